//! Reading images. The header is checked before anything of the image's size is allocated.

use super::library::{Header, Input};
use super::pixels::{Encoding, Image};
use super::prescan::{self, Fault};
use super::{Error, MetaValue, PixelFormat};
use std::ffi::CStr;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

/// What reading a file may cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of `f32` in memory: width x height x channels x 4. The display window, as RGB, is held to it too.
    pub max_bytes: u64,
}

impl Default for Limits {
    /// 1 GiB: a map of 8192 x 4096 pixels with eight channels.
    fn default() -> Self {
        Self { max_bytes: 1 << 30 }
    }
}

/// Uncompressed bytes for each byte of a file, at most. Deflate cannot exceed 1032, LZW about 1,400; JPEG's progressive
/// mode and EXR's DWA reach far more on a constant picture, so those have their own bound.
const PLAUSIBLE_RATIO: u128 = 2_000;
const PLAUSIBLE_RATIO_LOSSY: u128 = 50_000;
/// Below this size a claim is not worth a doubt.
const HARMLESS_BYTES: u128 = 16 << 20;
/// Enough rows for the library to decompress in parallel.
const ROWS_AT_ONCE: i32 = 256;

/// What the header of an image says.
#[derive(Debug, Clone, PartialEq)]
pub struct Info {
    /// OpenImageIO's name of the format: `openexr`, `hdr`, `png`, `jpeg`, `tiff`.
    pub format: String,
    /// The data window: the pixels that are stored.
    pub width: u32,
    pub height: u32,
    /// Where the data window starts, counted from the display window's upper left corner.
    pub origin: [i32; 2],
    /// The display window's width and height.
    pub full_size: [u32; 2],
    /// Names and stored formats, in the order in which [`Image::pixels`] holds them.
    pub channels: Vec<(String, PixelFormat)>,
    /// Width and height of a tile, where the file has tiles.
    pub tile: Option<[u32; 2]>,
    /// Each pixel holds a list of samples; [`read`] refuses such files.
    pub deep: bool,
    pub metadata: Vec<(String, MetaValue)>,
    pub file_bytes: u64,
}

impl Info {
    /// The value of the first attribute called `name`, in any case.
    #[must_use]
    pub fn meta(&self, name: &str) -> Option<&MetaValue> {
        self.metadata.iter().find(|(key, _)| key.eq_ignore_ascii_case(name)).map(|(_, value)| value)
    }

    /// The format's own name of its compression, where it names one.
    #[must_use]
    pub fn compression(&self) -> Option<&str> {
        match self.meta("compression") {
            Some(MetaValue::Str(name)) => Some(name),
            _ => None,
        }
    }
}

/// Reads a header only.
///
/// # Errors
/// If the file cannot be opened, is no image in a supported format, or its header makes no sense.
pub fn info(path: &Path) -> Result<Info, Error> {
    Ok(open(path)?.1)
}

/// Reads the first image of a file at full resolution, all channels, as `f32`.
///
/// # Errors
/// As [`info`]; also where the image exceeds `limits`, claims more than its file can hold, is deep, or where any
/// scanline or tile is missing or damaged: an image is whole or an error.
pub fn read(path: &Path, limits: &Limits) -> Result<Image, Error> {
    let (mut input, info) = open(path)?;
    refuse_unsupported(path, &info, &input.header)?;
    let count = check_size(path, &info, limits)?;
    let mut pixels = Vec::new();
    pixels.try_reserve_exact(count).map_err(|_| Error::TooLarge {
        path: path.to_owned(),
        what: "an image".to_owned(),
        bytes: count as u128 * 4,
        limit: limits.max_bytes,
    })?;
    pixels.resize(count, 0.0);
    let header = input.header;
    for_each_band(&header, |rows, range| input.read_rows(rows, &mut pixels[range])).map_err(Error::library(
        path,
        path,
        "read the pixels",
    ))?;
    let integer = info.channels.iter().all(|(_, format)| format.is_display());
    Ok(Image {
        path: path.to_owned(),
        width: info.width,
        height: info.height,
        channels: info.channels.into_iter().map(|(name, _)| name).collect(),
        pixels,
        origin: info.origin,
        full_size: info.full_size,
        encoding: if integer && info.format != "openexr" { Encoding::Srgb } else { Encoding::Linear },
        metadata: info.metadata,
    })
}

/// Calls `read` for one band of rows after the other, with the floats the band covers in an interleaved image. In a tiled
/// file a band is a number of whole tile rows.
pub(super) fn for_each_band<E>(
    header: &Header,
    mut read: impl FnMut(std::ops::Range<i32>, std::ops::Range<usize>) -> Result<(), E>,
) -> Result<(), E> {
    let stride = header.width as usize * header.channels as usize;
    let step = if header.tile_height > 0 {
        (ROWS_AT_ONCE / header.tile_height).max(1).saturating_mul(header.tile_height)
    } else {
        ROWS_AT_ONCE
    };
    let end = header.y + header.height;
    let mut y = header.y;
    while y < end {
        let next = y.saturating_add(step).min(end);
        let (from, to) = ((y - header.y) as usize, (next - header.y) as usize);
        read(y..next, from * stride..to * stride)?;
        y = next;
    }
    Ok(())
}

/// Opens a file and checks that its header is consistent: positive sizes, windows that fit in `i32`, a name per channel.
pub(super) fn open(path: &Path) -> Result<(Input, Info), Error> {
    let file_bytes = file_size(path)?;
    let format = sniff(path)?.ok_or_else(|| Error::UnknownFormat { path: path.to_owned() })?;
    prescan::check(format, path, file_bytes).map_err(|fault| match fault {
        Fault::Damaged(message) => Error::library(path, path, "open the image")(message),
        Fault::TooLarge(what, bytes) => {
            Error::TooLarge { path: path.to_owned(), what, bytes: bytes.into(), limit: prescan::LARGEST_BLOCK }
        }
    })?;
    let mut input = Input::open(format, path).map_err(Error::library(path, path, "open the image"))?;
    let header = input.header;
    let nonsense = || Error::Library {
        path: path.to_owned(),
        action: "open the image",
        message: format!("its header makes no sense: {header:?}"),
    };
    let size = |value: i32| u32::try_from(value).ok().filter(|&value| value > 0).ok_or_else(nonsense);
    let ends = [(header.x, header.width), (header.y, header.height)];
    if header.channels <= 0 || ends.iter().any(|(start, length)| start.checked_add(*length).is_none()) {
        return Err(nonsense());
    }
    let offset = |start: i32, full: i32| start.checked_sub(full).ok_or_else(nonsense);
    let info = Info {
        format: format.to_string_lossy().into_owned(),
        width: size(header.width)?,
        height: size(header.height)?,
        origin: [offset(header.x, header.full_x)?, offset(header.y, header.full_y)?],
        full_size: [size(header.full_width)?, size(header.full_height)?],
        channels: input.channels(),
        tile: if header.tile_width > 0 { Some([size(header.tile_width)?, size(header.tile_height)?]) } else { None },
        deep: header.deep != 0,
        metadata: input.metadata(),
        file_bytes,
    };
    Ok((input, info))
}

/// The size of a regular file. Anything else could block for ever or never end.
fn file_size(path: &Path) -> Result<u64, Error> {
    let data = fs::metadata(path).map_err(Error::io(path, "open the image"))?;
    if data.is_file() { Ok(data.len()) } else { Err(Error::NotAFile { path: path.to_owned() }) }
}

/// OpenImageIO's name for the format that the file's first bytes announce. Left to itself the library would try every
/// reader it has on an unknown file, down to films and medical scans.
fn sniff(path: &Path) -> Result<Option<&'static CStr>, Error> {
    let mut start = Vec::new();
    let file = File::open(path).map_err(Error::io(path, "open the image"))?;
    file.take(16).read_to_end(&mut start).map_err(Error::io(path, "read the image"))?;
    let formats: [(&[u8], &CStr); 8] = [
        (b"\x76\x2f\x31\x01", c"openexr"),
        (b"#?", c"hdr"),
        (b"\x89PNG\r\n\x1a\n", c"png"),
        (b"\xff\xd8\xff", c"jpeg"),
        (b"II*\0", c"tiff"),
        (b"MM\0*", c"tiff"),
        (b"II+\0", c"tiff"),
        (b"MM\0+", c"tiff"),
    ];
    Ok(formats.iter().find(|(magic, _)| start.starts_with(magic)).map(|(_, name)| *name))
}

pub(super) fn refuse_unsupported(path: &Path, info: &Info, header: &Header) -> Result<(), Error> {
    let unsupported =
        |what: &str, remedy| Err(Error::Unsupported { path: path.to_owned(), what: what.to_owned(), remedy });
    if info.deep {
        return unsupported("a deep image", "flatten it first (oiiotool --flatten)");
    }
    if header.depth > 1 {
        return unsupported("a volume, not a picture", "extract one slice of it");
    }
    Ok(())
}

/// Checks every claim of the header that costs memory, and returns the number of floats in the image.
pub(super) fn check_size(path: &Path, info: &Info, limits: &Limits) -> Result<usize, Error> {
    let area = |size: [u32; 2]| u128::from(size[0]) * u128::from(size[1]);
    let data = area([info.width, info.height]);
    let values = data * info.channels.len() as u128;
    let floats = |values: u128| values * 4;
    let stored_pixel: u64 = info.channels.iter().map(|(_, format)| format.bytes()).sum();
    let tile = info.tile.map_or(0, area) * u128::from(stored_pixel);
    for (what, bytes) in
        [("an image", floats(values)), ("a display window", floats(area(info.full_size) * 3)), ("a tile", tile)]
    {
        if bytes > u128::from(limits.max_bytes) {
            return Err(Error::TooLarge {
                path: path.to_owned(),
                what: what.to_owned(),
                bytes,
                limit: limits.max_bytes,
            });
        }
    }
    let stored = data * u128::from(stored_pixel);
    let lossy = info.format == "jpeg" || info.compression().is_some_and(|name| name.starts_with("dwa"));
    let ratio = if lossy { PLAUSIBLE_RATIO_LOSSY } else { PLAUSIBLE_RATIO };
    if stored > HARMLESS_BYTES + ratio * u128::from(info.file_bytes) {
        return Err(Error::Implausible {
            path: path.to_owned(),
            width: info.width.into(),
            height: info.height.into(),
            bytes: stored,
            file_bytes: info.file_bytes,
        });
    }
    usize::try_from(values).map_err(|_| Error::TooLarge {
        path: path.to_owned(),
        what: "an image".to_owned(),
        bytes: floats(values),
        limit: limits.max_bytes,
    })
}
