//! An image in memory, and its colour: channels by name, the data window inside the display window, linear light.

use super::{Error, MetaValue, REC709, display};
use std::path::PathBuf;

/// What the numbers of an image mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Proportional to light.
    Linear,
    /// Encoded for a display (IEC 61966-2-1): by convention, every image of 8- or 16-bit integers.
    Srgb,
}

/// The pixels of a file as they are stored there, converted to `f32`.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Where it came from, for messages.
    pub path: PathBuf,
    /// Width and height of the data window, in pixels.
    pub width: u32,
    pub height: u32,
    pub channels: Vec<String>,
    /// Row by row from the top, channels interleaved: `width * height * channels.len()` values, NaN and infinities as in
    /// the file.
    pub pixels: Vec<f32>,
    /// Where the data window starts, counted from the display window's upper left corner.
    pub origin: [i32; 2],
    /// The display window's width and height.
    pub full_size: [u32; 2],
    pub encoding: Encoding,
    pub metadata: Vec<(String, MetaValue)>,
}

/// Linear Rec.709 colour over a whole display window, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct RgbImage {
    pub width: u32,
    pub height: u32,
    pub pixels: Vec<[f32; 3]>,
}

/// Names of one-channel images.
const GREY: [&str; 4] = ["Y", "L", "I", "luminance"];

impl Image {
    /// The position of the channel called `name`; in any case if there is none in this one.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<usize> {
        let exact = self.channels.iter().position(|channel| channel == name);
        exact.or_else(|| self.channels.iter().position(|channel| channel.eq_ignore_ascii_case(name)))
    }

    /// Linear colour over the display window, turned upright where the file says how it lies; black where the file stores nothing. Values are as stored, also where
    /// they are negative or not finite.
    ///
    /// The colour is that of R, G and B; else of the first layer with these (`name.R`); else a grey channel (Y), else the
    /// only channel there is.
    ///
    /// # Errors
    /// [`Error::MissingChannel`] where none of these is present.
    pub fn rgb(&self) -> Result<RgbImage, Error> {
        let channels = self.colour("").or_else(|| self.layers().find_map(|layer| self.colour(&layer)));
        let channels = channels.or_else(|| (self.channels.len() == 1).then_some([0; 3]));
        channels.map(|channels| self.compose(channels)).ok_or_else(|| self.missing("R, G, B or Y"))
    }

    /// As [`Image::rgb`], of one layer: `layer.R`, `layer.G`, `layer.B` or `layer.Y`.
    ///
    /// # Errors
    /// [`Error::MissingChannel`] where the layer is not present.
    pub fn rgb_layer(&self, layer: &str) -> Result<RgbImage, Error> {
        let channels = self.colour(&format!("{layer}."));
        channels.map(|channels| self.compose(channels)).ok_or_else(|| self.missing(&format!("{layer}.R, .G and .B")))
    }

    fn missing(&self, wanted: &str) -> Error {
        Error::MissingChannel { path: self.path.clone(), wanted: wanted.to_owned(), present: self.channels.clone() }
    }

    /// Prefixes up to and including the last dot, in the order of the channels.
    fn layers(&self) -> impl Iterator<Item = String> {
        self.channels.iter().filter_map(|name| name.rfind('.').map(|dot| name[..=dot].to_owned()))
    }

    /// The channels that hold red, green and blue below `prefix`.
    fn colour(&self, prefix: &str) -> Option<[usize; 3]> {
        let find = |name: &str| self.channel(&format!("{prefix}{name}"));
        for [red, green, blue] in [["R", "G", "B"], ["red", "green", "blue"]] {
            if let (Some(red), Some(green), Some(blue)) = (find(red), find(green), find(blue)) {
                return Some([red, green, blue]);
            }
        }
        GREY.iter().find_map(|name| find(name)).map(|grey| [grey; 3])
    }

    fn compose(&self, channels: [usize; 3]) -> RgbImage {
        self.warn_of_primaries();
        let [full_width, full_height] = self.full_size;
        let mut pixels = vec![[0.0; 3]; full_width as usize * full_height as usize];
        let count = self.channels.len();
        let columns = overlap(self.origin[0], self.width, full_width);
        for y in overlap(self.origin[1], self.height, full_height) {
            let source_y = (y - i64::from(self.origin[1])) as usize;
            for x in columns.clone() {
                let source_x = (x - i64::from(self.origin[0])) as usize;
                let source = &self.pixels[(source_y * self.width as usize + source_x) * count..][..count];
                let target = &mut pixels[y as usize * full_width as usize + x as usize];
                *target = channels.map(|channel| match self.encoding {
                    Encoding::Linear => source[channel],
                    Encoding::Srgb => display::srgb_to_linear(source[channel]),
                });
            }
        }
        RgbImage { width: full_width, height: full_height, pixels }.oriented(self.orientation())
    }

    /// The EXIF and TIFF number that says how the stored rows lie in the picture; 1 where there is none.
    fn orientation(&self) -> i32 {
        let value = self.metadata.iter().find(|(name, _)| name == "Orientation").map(|(_, value)| value);
        if let Some(MetaValue::Int(number)) = value { *number } else { 1 }
    }

    /// Says so where the file names primaries other than ours: its numbers are not converted.
    fn warn_of_primaries(&self) {
        let value = self.metadata.iter().find(|(name, _)| name == "chromaticities").map(|(_, value)| value);
        if let Some(MetaValue::Floats(found)) = value
            && found.iter().zip(REC709).any(|(found, ours)| (found - ours).abs() > 0.005)
        {
            tracing::warn!(
                path = %self.path.display(), chromaticities = ?found,
                "the image has other primaries than Rec.709; its colours are used as if it had these"
            );
        }
    }
}

impl RgbImage {
    /// Turned upright: `orientation` is that of EXIF and TIFF 6.0 (1 upright, 3 upside down, 6 and 8 on the side, the
    /// other four mirrored); any other number leaves the picture as it is.
    fn oriented(self, orientation: i32) -> Self {
        let (last_x, last_y) = (self.width as usize - 1, self.height as usize - 1);
        let source = |x: usize, y: usize| match orientation {
            2 => (last_x - x, y),
            3 => (last_x - x, last_y - y),
            4 => (x, last_y - y),
            5 => (y, x),
            6 => (y, last_y - x),
            7 => (last_x - y, last_y - x),
            _ => (last_x - y, x),
        };
        let (width, height) = match orientation {
            2..=4 => (self.width, self.height),
            5..=8 => (self.height, self.width),
            _ => return self,
        };
        let rows = (0..height as usize).flat_map(|y| (0..width as usize).map(move |x| source(x, y)));
        let pixels = rows.map(|(x, y)| self.pixels[y * self.width as usize + x]).collect();
        Self { width, height, pixels }
    }
}

/// The part of a display window's extent 0 .. `full` that the data `origin .. origin + length` covers.
fn overlap(origin: i32, length: u32, full: u32) -> std::ops::Range<i64> {
    let end = (i64::from(origin) + i64::from(length)).min(full.into());
    i64::from(origin).max(0)..end
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, channels: &[&str], pixels: &[f32]) -> Image {
        Image {
            path: "test.exr".into(),
            width,
            height,
            channels: channels.iter().map(|name| (*name).to_owned()).collect(),
            pixels: pixels.to_vec(),
            origin: [0; 2],
            full_size: [width, height],
            encoding: Encoding::Linear,
            metadata: Vec::new(),
        }
    }

    fn first(channels: &[&str]) -> Option<[f32; 3]> {
        let values: Vec<f32> = (0..channels.len()).map(|index| index as f32).collect();
        image(1, 1, channels, &values).rgb().ok().map(|rgb| rgb.pixels[0])
    }

    #[test]
    fn colour_is_found_by_name() {
        assert_eq!(first(&["A", "B", "G", "R"]), Some([3.0, 2.0, 1.0]));
        assert_eq!(first(&["b", "r", "g"]), Some([1.0, 2.0, 0.0]));
        assert_eq!(first(&["red", "green", "blue"]), Some([0.0, 1.0, 2.0]));
        assert_eq!(first(&["x.R", "x.G", "x.B", "R", "G", "B"]), Some([3.0, 4.0, 5.0]));
        assert_eq!(first(&["z.Z", "x.y.R", "x.y.B", "x.y.G"]), Some([1.0, 3.0, 2.0]));
        assert_eq!(first(&["A", "Y"]), Some([1.0; 3]));
        assert_eq!(first(&["depth"]), Some([0.0; 3]));
        assert_eq!(first(&["x.R", "y.G", "z.B"]), None);
        let error = image(1, 1, &["U", "V"], &[0.0; 2]).rgb().unwrap_err().to_string();
        assert_eq!(error, "test.exr: no R, G, B or Y among its channels (U, V)");
    }

    #[test]
    fn a_layer_is_found_by_its_name() {
        let image = image(1, 1, &["R", "G", "B", "d.B", "d.G", "d.R"], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(image.rgb_layer("d").unwrap().pixels, [[5.0, 4.0, 3.0]]);
        assert!(image.rgb_layer("e").is_err());
    }

    #[test]
    fn data_outside_the_display_window_is_cut_and_missing_data_is_black() {
        let mut image = image(3, 1, &["Y"], &[1.0, 2.0, 3.0]);
        for (origin, expected) in
            [(-1, [2.0, 3.0]), (1, [0.0, 1.0]), (2, [0.0; 2]), (-3, [0.0; 2]), (i32::MAX, [0.0; 2])]
        {
            image.origin = [origin, 0];
            image.full_size = [2, 1];
            assert_eq!(image.rgb().unwrap().pixels, expected.map(|value| [value; 3]), "{origin}");
        }
        image.origin = [0, i32::MIN];
        assert_eq!(image.rgb().unwrap().pixels, [[0.0; 3]; 2]);
    }

    /// TIFF 6.0 defines an orientation by the sides of the picture where the first stored row and column lie.
    #[test]
    fn orientations_put_the_first_row_and_column_where_tiff_says() {
        let stored = [0, 1, 2, 10, 11, 12].map(|value| value as f32);
        for (orientation, expected) in [
            (1, [[0, 1, 2], [10, 11, 12]].concat()),   // top, left
            (2, [[2, 1, 0], [12, 11, 10]].concat()),   // top, right
            (3, [[12, 11, 10], [2, 1, 0]].concat()),   // bottom, right
            (4, [[10, 11, 12], [0, 1, 2]].concat()),   // bottom, left
            (5, [[0, 10], [1, 11], [2, 12]].concat()), // left, top
            (6, [[10, 0], [11, 1], [12, 2]].concat()), // right, top
            (7, [[12, 2], [11, 1], [10, 0]].concat()), // right, bottom
            (8, [[2, 12], [1, 11], [0, 10]].concat()), // left, bottom
            (99, [[0, 1, 2], [10, 11, 12]].concat()),
        ] {
            let mut image = image(3, 2, &["Y"], &stored);
            image.metadata = vec![("Orientation".to_owned(), MetaValue::Int(orientation))];
            let upright = image.rgb().unwrap();
            assert_eq!([upright.width, upright.height], if (5..9).contains(&orientation) { [2, 3] } else { [3, 2] });
            let found: Vec<i32> = upright.pixels.iter().map(|pixel| pixel[0] as i32).collect();
            assert_eq!(found, expected, "{orientation}");
        }
    }
}
