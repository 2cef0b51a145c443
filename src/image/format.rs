//! The formats that images are written in, and what each can hold.

use super::{Error, ImageSpec, MetaValue, PixelFormat};
use std::ffi::CStr;
use std::path::Path;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FileFormat {
    Exr,
    Png,
    Jpeg,
    Tiff,
}

impl FileFormat {
    pub fn from_path(path: &Path) -> Result<Self, Error> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().into_owned());
        match extension.as_deref().map(str::to_ascii_lowercase).as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            Some("jpg" | "jpeg") => Ok(Self::Jpeg),
            Some("tif" | "tiff") => Ok(Self::Tiff),
            _ => Err(Error::UnknownExtension { path: path.to_owned(), extension }),
        }
    }

    /// OpenImageIO's name.
    pub fn library_name(self) -> &'static CStr {
        match self {
            Self::Exr => c"openexr",
            Self::Png => c"png",
            Self::Jpeg => c"jpeg",
            Self::Tiff => c"tiff",
        }
    }

    pub fn extension(self) -> &'static str {
        match self {
            Self::Exr => ".exr",
            Self::Png => ".png",
            Self::Jpeg => ".jpg",
            Self::Tiff => ".tif",
        }
    }

    pub fn default_compression(self) -> Option<&'static str> {
        match self {
            Self::Exr | Self::Tiff => Some("zip"),
            Self::Png => None,
            Self::Jpeg => Some("jpeg:95"),
        }
    }

    /// Says what is wrong where an image of these channels cannot be stored. The library itself would drop channels or
    /// choose another format or compression in silence.
    pub fn check(self, spec: &ImageSpec) -> Result<(), String> {
        self.check_channels(&spec.channels)?;
        if self == Self::Jpeg {
            check_jpeg(spec)?;
        }
        spec.compression.as_deref().map_or(Ok(()), |name| self.check_compression(name))
    }

    fn check_channels(self, channels: &[(String, PixelFormat)]) -> Result<(), String> {
        let formats: &[PixelFormat] = match self {
            Self::Exr => &[PixelFormat::Half, PixelFormat::Float],
            Self::Png => &[PixelFormat::U8, PixelFormat::U16],
            Self::Jpeg => &[PixelFormat::U8],
            Self::Tiff => &[PixelFormat::U8, PixelFormat::U16, PixelFormat::Float],
        };
        if let Some((name, format)) = channels.iter().find(|(_, format)| !formats.contains(format)) {
            return Err(format!("channel {name} is {format:?}, {self:?} holds {formats:?}"));
        }
        if self != Self::Exr && channels.iter().any(|(_, format)| *format != channels[0].1) {
            return Err(format!("{self:?} stores all channels in one format"));
        }
        let counts = match self {
            Self::Exr | Self::Tiff => 1..=1024,
            Self::Png => 1..=4,
            Self::Jpeg => 1..=3,
        };
        if !counts.contains(&channels.len()) || self == Self::Jpeg && channels.len() == 2 {
            return Err(format!("{self:?} does not hold {} channels", channels.len()));
        }
        Ok(())
    }

    fn check_compression(self, name: &str) -> Result<(), String> {
        let (base, level) = name.split_once(':').map_or((name, None), |(base, level)| (base, Some(level)));
        let known: &[&str] = match self {
            Self::Exr => &["none", "rle", "zip", "zips", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab"],
            Self::Png => &[],
            Self::Jpeg => &["jpeg"],
            Self::Tiff => &["none", "zip", "lzw", "packbits"],
        };
        if !known.contains(&base) {
            return Err(format!("{self:?} has no compression '{name}' (known: {})", known.join(", ")));
        }
        match level {
            Some(level) if level.parse::<f32>().is_ok_and(|level| level.is_finite() && level >= 0.0) => Ok(()),
            None => Ok(()),
            Some(level) => Err(format!("the compression level '{level}' is not a number")),
        }
    }

    /// Whether each value comes back as it was, to the rounding of its pixel format.
    pub fn is_lossless(self, compression: Option<&str>) -> bool {
        let base = compression.and_then(|name| name.split(':').next());
        self != Self::Jpeg && !matches!(base, Some("pxr24" | "b44" | "b44a" | "dwaa" | "dwab"))
    }
}

/// The bounds of libjpeg that OpenImageIO does not check: to exceed one would end the process.
fn check_jpeg(spec: &ImageSpec) -> Result<(), String> {
    const SIDE: u32 = 65_500;
    if spec.width > SIDE || spec.height > SIDE {
        return Err(format!("{}x{} pixels; JPEG ends at {SIDE}", spec.width, spec.height));
    }
    // All metadata of a kind shares one marker of 64 kB, written as text in one of the forms.
    let size = |(name, value): &(String, MetaValue)| {
        name.len()
            + match value {
                MetaValue::Str(text) => text.len(),
                MetaValue::Int(_) | MetaValue::Float(_) => 16,
                MetaValue::Floats(numbers) => 16 * numbers.len(),
                MetaValue::Matrix(_) => 256,
            }
    };
    let bytes: usize = spec.metadata.iter().map(size).sum();
    if bytes > 16_384 {
        return Err(format!("{bytes} bytes of metadata; a JPEG file takes 16384"));
    }
    Ok(())
}
