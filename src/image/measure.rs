//! The range of an image's values, found in one pass that holds a band of rows at a time.

use super::read::{Info, Limits, check_size, for_each_band, open, refuse_unsupported};
use super::{Error, PixelFormat};
use std::path::Path;

/// What the values of one channel are like, as stored: integers as 0 to 1, no curve undone.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ChannelRange {
    pub name: String,
    /// How it is stored: `u8`, `u16`, `u32`, `half`, `float` or `other`.
    pub format: &'static str,
    /// Lowest and highest finite value; none where no value is finite.
    pub min: Option<f32>,
    pub max: Option<f32>,
    /// Mean of the finite values.
    pub mean: Option<f64>,
    pub nan: u64,
    pub infinite: u64,
    /// Below zero and finite.
    pub negative: u64,
}

/// Reads the header and measures every channel, in the order of [`Info::channels`].
///
/// # Errors
/// As [`read`](super::read::read), for the same files.
pub fn measure(path: &Path, limits: &Limits) -> Result<(Info, Vec<ChannelRange>), Error> {
    let (mut input, info) = open(path)?;
    refuse_unsupported(path, &info, &input.header)?;
    check_size(path, &info, limits)?;
    let mut channels: Vec<Running> = info.channels.iter().map(|_| Running::default()).collect();
    let mut band = Vec::new();
    let header = input.header;
    for_each_band(&header, |rows, range| {
        band.resize(range.len(), 0.0);
        input.read_rows(rows, &mut band)?;
        for pixel in band.chunks_exact(channels.len()) {
            channels.iter_mut().zip(pixel).for_each(|(channel, value)| channel.add(*value));
        }
        Ok(())
    })
    .map_err(Error::library(path, path, "read the pixels"))?;
    let ranges = info.channels.iter().zip(channels).map(|((name, format), running)| running.finish(name, *format));
    let ranges = ranges.collect();
    Ok((info, ranges))
}

#[derive(Default)]
struct Running {
    range: Option<[f32; 2]>,
    sum: f64,
    finite: u64,
    nan: u64,
    infinite: u64,
    negative: u64,
}

impl Running {
    fn add(&mut self, value: f32) {
        if value.is_finite() {
            let [low, high] = self.range.unwrap_or([value; 2]);
            self.range = Some([low.min(value), high.max(value)]);
            self.sum += f64::from(value);
            self.finite += 1;
            self.negative += u64::from(value < 0.0);
        } else if value.is_nan() {
            self.nan += 1;
        } else {
            self.infinite += 1;
        }
    }

    fn finish(self, name: &str, format: PixelFormat) -> ChannelRange {
        let [min, max] = [0, 1].map(|end| self.range.map(|range| range[end]));
        let mean = (self.finite > 0).then(|| self.sum / self.finite as f64);
        let Self { nan, infinite, negative, .. } = self;
        ChannelRange { name: name.to_owned(), format: format_name(format), min, max, mean, nan, infinite, negative }
    }
}

fn format_name(format: PixelFormat) -> &'static str {
    match format {
        PixelFormat::U8 => "u8",
        PixelFormat::U16 => "u16",
        PixelFormat::U32 => "u32",
        PixelFormat::Half => "half",
        PixelFormat::Float => "float",
        PixelFormat::Other => "other",
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ImageSpec, write_atomic};
    use super::*;

    #[test]
    fn ranges_leave_out_what_is_not_finite_and_count_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let channels = ["R", "G", "B"].map(|name| (name.to_owned(), PixelFormat::Float)).to_vec();
        // More rows than one band.
        let rows = 600;
        let mut pixels: Vec<f32> = (0..rows * 3).map(|i| [i as f32, -0.5, 2.0][i % 3]).collect();
        pixels[1] = f32::NAN;
        pixels[4] = f32::NEG_INFINITY;
        pixels[3 * rows - 1] = 8.0;
        write_atomic(&path, &ImageSpec::new(1, rows as u32, channels), &pixels).unwrap();
        let (info, ranges) = measure(&path, &Limits::default()).unwrap();
        assert_eq!((info.width, info.height as usize), (1, rows));
        let find = |name: &str| ranges.iter().find(|range| range.name == name).unwrap();
        let (r, g, b) = (find("R"), find("G"), find("B"));
        assert_eq!((r.min, r.max, r.mean), (Some(0.0), Some(1797.0), Some(898.5)));
        assert_eq!((g.min, g.max, g.nan, g.infinite, g.negative), (Some(-0.5), Some(-0.5), 1, 1, 598));
        assert_eq!((b.max, b.mean, b.negative), (Some(8.0), Some(2.0 + 6.0 / 600.0), 0));
    }
}
