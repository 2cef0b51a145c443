//! Writing images. A file appears under its name only when it is complete, read back and on the disk; until then
//! whatever had that name stays as it was.

use super::format::FileFormat;
use super::library::{Header, OutputSpec};
use super::{Error, MetaValue, PixelFormat, REC709, verify};
use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

use crate::file::{self, Temporary};

/// An image to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageSpec {
    /// The data window's width and height: the pixels that are handed over.
    pub width: u32,
    pub height: u32,
    /// Where the data window starts, counted from the display window's upper left corner. Only EXR keeps it.
    pub origin: [i32; 2],
    /// The display window's width and height. Only EXR keeps it.
    pub full_size: [u32; 2],
    /// Names (`R`, `A`, `direct.R`, `depth.Z`) and stored formats, in the order of the pixels' values. EXR takes
    /// [`PixelFormat::Half`] and [`PixelFormat::Float`], mixed at will; the others one format for all channels: PNG `U8`
    /// or `U16`, JPEG `U8`, TIFF `U8`, `U16` or `Float`.
    pub channels: Vec<(String, PixelFormat)>,
    /// A name the format knows, such as `zip` or `dwaa:45`, `jpeg:90`; `None` for a lossless default (JPEG: quality 95).
    pub compression: Option<String>,
    /// `DateTime` (`YYYY:MM:DD hh:mm:ss`) is fixed unless it is given, so that equal images make equal files. An empty
    /// text is left out.
    pub metadata: Vec<(String, MetaValue)>,
}

impl ImageSpec {
    /// An image whose data window is its display window.
    #[must_use]
    pub fn new(width: u32, height: u32, channels: Vec<(String, PixelFormat)>) -> Self {
        Self {
            width,
            height,
            origin: [0; 2],
            full_size: [width, height],
            channels,
            compression: None,
            metadata: Vec::new(),
        }
    }
}

/// What happened to the values on their way into the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Written {
    pub bytes: u64,
    /// Finite values beyond what their format holds, stored as the nearest it does: half ends at 65504, integers hold 0 to 1.
    pub saturated: usize,
    /// NaN and infinities. Half and float store them; integers get 0 for NaN and the nearest bound for infinities.
    pub non_finite: usize,
}

/// The largest finite half.
const HALF_MAX: f32 = 65_504.0;
/// OpenImageIO's EXR writer puts the present in where nothing is given.
const FIXED_DATE: &str = "2000:01:01 00:00:00";

/// Writes `pixels` (row by row from the top, channels interleaved) to `path`, in the format of its extension.
///
/// The file is made beside its target under a temporary name, read back and compared, flushed to the disk and renamed.
/// Values are stored as they are: for PNG, JPEG and TIFF encode colour for the display first (see
/// [`display`](super::display)), and do not multiply it by alpha.
///
/// # Errors
/// If `spec` and `pixels` do not fit each other or the format, if anything fails on the way, or if the file does not hold
/// what was written to it. A file that was there before is untouched then and no temporary file remains.
pub fn write_atomic(path: &Path, spec: &ImageSpec, pixels: &[f32]) -> Result<Written, Error> {
    let format = FileFormat::from_path(path)?;
    check_spec(path, spec, format, pixels.len())?;
    let (pixels, mut written) = fit(&spec.channels, pixels);
    let target = resolve(path)?;
    let temporary = temporary_beside(path, &target, format)?;
    let output = output_spec(spec, format).map_err(Error::library(path, path, "describe the image"))?;
    output.write(format.library_name(), temporary.path(), &pixels).map_err(Error::library(
        path,
        temporary.path(),
        "write the image",
    ))?;
    written.bytes = verify::verify(temporary.path(), path, format, spec, &pixels)?;
    temporary.persist(&target).map_err(Error::io(path, "move the finished image into place"))?;
    Ok(written)
}

/// Checks, before any work is spent on an image, that [`write_atomic`] could put a file there.
///
/// # Errors
/// For an unknown extension, a missing directory, one that cannot be written to, or a target that is no regular file or read-only.
pub fn check_target(path: &Path) -> Result<(), Error> {
    let format = FileFormat::from_path(path)?;
    temporary_beside(path, &resolve(path)?, format).map(drop)
}

/// The file that `path` leads to: a symbolic link keeps its place and its target is replaced.
fn resolve(path: &Path) -> Result<PathBuf, Error> {
    if path.file_name().is_none() || path.metadata().is_ok_and(|data| !data.is_file()) {
        return Err(Error::NotAFile { path: path.to_owned() });
    }
    file::replaceable(path).map_err(Error::io(path, "replace it"))
}

fn temporary_beside(path: &Path, target: &Path, format: FileFormat) -> Result<Temporary, Error> {
    let folder = file::folder_of(target);
    Temporary::in_folder(folder, format.extension()).map_err(Error::io(path, "create a file in its directory"))
}

fn check_spec(path: &Path, spec: &ImageSpec, format: FileFormat, values: usize) -> Result<(), Error> {
    let bad = |what: String| Err(Error::BadSpec { path: path.to_owned(), what });
    let [full_width, full_height] = spec.full_size;
    // A quarter of the range leaves room for the sums and differences that readers form.
    let most = 1 << 29;
    if [spec.width, spec.height, full_width, full_height].iter().any(|&size| size == 0 || size > most) {
        return bad(format!("{}x{} pixels in {full_width}x{full_height}", spec.width, spec.height));
    }
    if spec.origin.iter().any(|offset| offset.unsigned_abs() > most) {
        return bad(format!("an offset of {:?} pixels", spec.origin));
    }
    let expected = u128::from(spec.width) * u128::from(spec.height) * spec.channels.len() as u128;
    if expected != values as u128 {
        return bad(format!("{values} values where size and channels need {expected}"));
    }
    let mut names = HashSet::new();
    if let Some((name, _)) = spec.channels.iter().find(|(name, _)| name.is_empty() || !names.insert(name)) {
        return bad(format!("the channel name {name:?} is empty or used twice"));
    }
    format.check(spec).or_else(bad)
}

/// Brings values into the range of their formats. Left to the library, 1e5 becomes infinite in a half.
fn fit<'a>(channels: &[(String, PixelFormat)], pixels: &'a [f32]) -> (Cow<'a, [f32]>, Written) {
    let mut fitted = Cow::Borrowed(pixels);
    let mut written = Written::default();
    let formats = channels.iter().map(|(_, format)| *format).cycle();
    for (index, (&value, format)) in pixels.iter().zip(formats).enumerate() {
        let stored = match format {
            PixelFormat::Half if value.is_finite() => value.clamp(-HALF_MAX, HALF_MAX),
            PixelFormat::U8 | PixelFormat::U16 if value.is_nan() => 0.0,
            PixelFormat::U8 | PixelFormat::U16 => value.clamp(0.0, 1.0),
            _ => value,
        };
        written.non_finite += usize::from(!value.is_finite());
        if stored.to_bits() != value.to_bits() {
            written.saturated += usize::from(value.is_finite() && stored != value);
            fitted.to_mut()[index] = stored;
        }
    }
    (fitted, written)
}

fn output_spec(spec: &ImageSpec, format: FileFormat) -> Result<OutputSpec, String> {
    let int = |value: u32| i32::try_from(value).map_err(|error| error.to_string());
    let header = Header {
        x: spec.origin[0],
        y: spec.origin[1],
        width: int(spec.width)?,
        height: int(spec.height)?,
        depth: 1,
        full_width: int(spec.full_size[0])?,
        full_height: int(spec.full_size[1])?,
        full_depth: 1,
        channels: i32::try_from(spec.channels.len()).map_err(|error| error.to_string())?,
        ..Header::default()
    };
    let mut output = OutputSpec::new(&header, &spec.channels)?;
    let given = |name: &str| spec.metadata.iter().any(|(key, _)| key.eq_ignore_ascii_case(name));
    let mut default = |name: &str, value: MetaValue| if given(name) { Ok(()) } else { output.set(name, &value) };
    default("DateTime", MetaValue::Str(FIXED_DATE.to_owned()))?;
    if format == FileFormat::Exr {
        // A colour space's name is not stored in EXR; this is the format's own way to say it.
        default("chromaticities", MetaValue::Floats(REC709.to_vec()))?;
    } else {
        default("oiio:ColorSpace", MetaValue::Str("sRGB".to_owned()))?;
        // Our colour is not multiplied by alpha: the writer shall not divide by it.
        default("oiio:UnassociatedAlpha", MetaValue::Int(1))?;
    }
    // On an empty caption OpenImageIO's JPEG and TIFF writers abort.
    let empty = |value: &MetaValue| matches!(value, MetaValue::Str(text) if text.is_empty());
    for (name, value) in spec.metadata.iter().filter(|(_, value)| !empty(value)) {
        output.set(name, value)?;
    }
    if let Some(compression) = spec.compression.as_deref().or(format.default_compression()) {
        output.set("compression", &MetaValue::Str(compression.to_owned()))?;
    }
    Ok(output)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Values that fit are handed on without a copy; no value leaves its format's range.
        #[test]
        fn fitted_values_are_in_range(bits in proptest::collection::vec(any::<u32>(), 2..40)) {
            let pixels: Vec<f32> = bits[..bits.len() / 2 * 2].iter().map(|&bits| f32::from_bits(bits)).collect();
            let channels = [("R".to_owned(), PixelFormat::Half), ("G".to_owned(), PixelFormat::U8)];
            let (fitted, written) = fit(&channels, &pixels);
            for pair in fitted.chunks_exact(2) {
                prop_assert!(!pair[0].is_finite() || pair[0].abs() <= HALF_MAX);
                prop_assert!((0.0..=1.0).contains(&pair[1]));
            }
            prop_assert_eq!(written.non_finite, pixels.iter().filter(|value| !value.is_finite()).count());
            let floats = [("R".to_owned(), PixelFormat::Float)];
            prop_assert!(matches!(fit(&floats, &pixels).0, Cow::Borrowed(_)));
        }
    }
}
