//! Images in files, through OpenImageIO.
//!
//! - [`read`] and [`info`]: EXR, Radiance HDR, PNG, JPEG and TIFF into `f32`, with limits on what a file may make us
//!   allocate;
//! - [`measure`](fn@measure): the range of each channel, without holding the image;
//! - [`write_atomic`]: one call that either leaves a complete, verified file in place or leaves what was there before;
//! - [`display`]: linear colour to sRGB bytes, for looking at.
//!
//! Channels are found by name, never by position: OpenImageIO hands them over in an order of its own.
//!
//! `unsafe` is confined to `library.rs`, the wrapper of the C interface.

pub mod display;
mod error;
mod format;
mod library;
mod measure;
mod pixels;
mod prescan;
mod read;
mod verify;
mod write;

pub use error::Error;
pub use measure::{ChannelRange, measure};
pub use pixels::{Encoding, Image, RgbImage};
pub use read::{Info, Limits, info, read};
pub use write::{ImageSpec, Written, check_target, write_atomic};

/// How one channel is stored in a file. In memory every channel is `f32`; integers are 0 to 1 over their full range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PixelFormat {
    U8,
    U16,
    U32,
    Half,
    Float,
    /// Whatever else a file may hold (signed, 64 bits); can be read, not written.
    Other,
}

impl PixelFormat {
    /// Bytes of one stored value.
    fn bytes(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::Half => 2,
            Self::U32 | Self::Float => 4,
            Self::Other => 8,
        }
    }

    /// Stored as an integer, and so by convention encoded for a display rather than linear.
    fn is_display(self) -> bool {
        matches!(self, Self::U8 | Self::U16)
    }
}

/// A named value in a file's header.
#[derive(Debug, Clone, PartialEq)]
pub enum MetaValue {
    Str(String),
    Int(i32),
    Float(f32),
    Floats(Vec<f32>),
    /// 4x4, in the order in which OpenImageIO stores it: row vectors, translation in elements 12 to 14.
    Matrix([f32; 16]),
}

/// The primaries of Rec. ITU-R BT.709 and their white, D65: x and y of red, green, blue, white.
const REC709: [f32; 8] = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];

/// Sets how many threads OpenImageIO uses to compress and decompress; 0 means one for each core. Files do not depend on it.
pub fn set_threads(count: usize) {
    library::set_threads(i32::try_from(count).unwrap_or(i32::MAX));
}

/// The version of the OpenImageIO that is loaded, such as `2.5.18`.
#[must_use]
pub fn library_version() -> String {
    let version = library::version();
    format!("{}.{}.{}", version / 10_000, version / 100 % 100, version % 100)
}
