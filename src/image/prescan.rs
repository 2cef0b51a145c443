//! A look at a file's blocks before the libraries': they allocate whatever size a block claims, up to 2 GiB, and find the
//! end of the file afterwards.
//!
//! - EXR (OpenEXR File Layout, version 2): magic, version and flags, then for each part attributes of name, type, size and
//!   value, closed by an empty name; in a multi-part file one more empty name closes the list of parts. The library reads the
//!   values of types that it knows as these are made, whatever the size says, and goes on behind them: where the two differ it
//!   would take what follows for other attributes than are seen here. It makes room for a whole tile, also where the picture
//!   is smaller, and for as many lines as are compressed together.
//! - PNG (ISO/IEC 15948, 5.3): after eight bytes of signature chunks of length, type, data and checksum, up to `IEND`.

use std::ffi::CStr;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek};
use std::path::Path;

/// Set in the version field of a file with several parts.
const MULTI_PART: u32 = 0x1000;
/// Bytes of a tile, or of the lines that are compressed together, at the most: 4096x4096 pixels of four channels of 32 bits. Blocks are to be
/// small; what is larger is a damaged header.
pub(super) const LARGEST_BLOCK: u64 = 1 << 28;
/// Lines that are compressed together, by the number of the compression: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB.
const LINES: [u64; 10] = [1, 1, 1, 16, 32, 16, 32, 32, 32, 256];
/// Names and types have 31 characters, or 255 in files that say so.
const LONGEST_NAME: u64 = 255;

/// Why a file is refused.
#[derive(Debug, PartialEq)]
pub(super) enum Fault {
    Damaged(String),
    /// What would be read at once, and how many bytes of it there are; at most [`LARGEST_BLOCK`] may be.
    TooLarge(String, u64),
}

/// Checks that every EXR attribute, or every PNG chunk, lies inside the file of `file_bytes` bytes. An error says which
/// does not. Other formats pass.
pub(super) fn check(format: &CStr, path: &Path, file_bytes: u64) -> Result<(), Fault> {
    let walk = match format.to_bytes() {
        b"openexr" => check_attributes,
        b"png" => check_chunks,
        _ => return Ok(()),
    };
    let file = File::open(path).map_err(|error| Fault::Damaged(error.to_string()))?;
    walk(&mut BufReader::new(file), file_bytes).unwrap_or_else(|error| match error.kind() {
        io::ErrorKind::UnexpectedEof => Err(Fault::Damaged("the file is cut short".to_owned())),
        _ => Err(Fault::Damaged(error.to_string())),
    })
}

fn check_attributes<R: BufRead + Seek>(input: &mut R, file_bytes: u64) -> io::Result<Result<(), Fault>> {
    let mut start = [0; 8];
    input.read_exact(&mut start)?;
    let multi_part = u32::from_le_bytes([start[4], start[5], start[6], start[7]]) & MULTI_PART != 0;
    let mut position = start.len() as u64;
    let mut part_is_empty = true;
    let mut block = Block::default();
    loop {
        let name = read_name(input, &mut position)?;
        if name.is_empty() {
            if let Err(fault) = block.check() {
                return Ok(Err(fault));
            }
            if !multi_part || part_is_empty {
                return Ok(Ok(()));
            }
            (part_is_empty, block) = (true, Block::default());
            continue;
        }
        part_is_empty = false;
        let kind = read_name(input, &mut position)?;
        let mut size = [0; 4];
        input.read_exact(&mut size)?;
        position += 4;
        let (size, left) = (i64::from(i32::from_le_bytes(size)), file_bytes.saturating_sub(position));
        let Some(bytes) = u64::try_from(size).ok().filter(|&bytes| bytes <= left) else {
            let name = String::from_utf8_lossy(&name).into_owned();
            return Ok(Err(Fault::Damaged(format!(
                "the attribute {name:?} claims {size} bytes where the file has {left} left"
            ))));
        };
        let taken = match &kind[..] {
            b"chlist" => {
                let (taken, of_pixel) = channel_list_bytes(input, bytes)?;
                block.pixel_bytes = block.pixel_bytes.max(of_pixel);
                Some(taken)
            }
            b"preview" => {
                let [width, height] = read_size(input, bytes)?;
                Some((width * height).saturating_mul(4).saturating_add(8))
            }
            b"tiledesc" => {
                let [width, height] = read_size(input, bytes)?;
                block.tile = [block.tile[0].max(width), block.tile[1].max(height)];
                Some(9)
            }
            b"box2i" => {
                let width = window_width(input, bytes)?;
                block.width = block.width.max(if name == b"dataWindow" { width } else { 0 });
                Some(16)
            }
            b"compression" if bytes == 1 => {
                let mut number = [0];
                input.read_exact(&mut number)?;
                block.lines = block.lines.max(LINES.get(usize::from(number[0])).copied().unwrap_or(1));
                None
            }
            _ => {
                input.seek_relative(size)?;
                FIXED.iter().find(|(name, _)| *name == &kind[..]).map(|(_, size)| *size)
            }
        };
        if let Some(taken) = taken.filter(|&taken| taken != bytes) {
            let (name, kind) = (String::from_utf8_lossy(&name), String::from_utf8_lossy(&kind));
            return Ok(Err(Fault::Damaged(format!(
                "the attribute {name:?} of type {kind} claims {bytes} bytes but has {taken}"
            ))));
        }
        position += bytes;
    }
}

/// What of a part is read at once. Of what comes twice, the largest.
#[derive(Default)]
struct Block {
    pixel_bytes: u64,
    /// Width and height, in pixels; 0 where the part has no tiles.
    tile: [u64; 2],
    /// Of the data window, in pixels.
    width: u64,
    lines: u64,
}

impl Block {
    fn check(&self) -> Result<(), Fault> {
        let Self { pixel_bytes, tile, width, lines } = *self;
        let ([width, height], what) =
            if tile == [0; 2] { ([width, lines.max(1)], "a block of lines") } else { (tile, "a tile") };
        let bytes = u64::saturating_mul(width * height, pixel_bytes);
        if bytes <= LARGEST_BLOCK {
            return Ok(());
        }
        Err(Fault::TooLarge(format!("{what} of {width}x{height} pixels"), bytes))
    }
}

/// Types whose values all have one size, in bytes.
const FIXED: [(&[u8], u64); 22] = [
    (b"box2f", 16),
    (b"chromaticities", 32),
    (b"compression", 1),
    (b"deepImageState", 1),
    (b"double", 8),
    (b"envmap", 1),
    (b"float", 4),
    (b"int", 4),
    (b"keycode", 28),
    (b"lineOrder", 1),
    (b"m33d", 72),
    (b"m33f", 36),
    (b"m44d", 128),
    (b"m44f", 64),
    (b"rational", 8),
    (b"timecode", 8),
    (b"v2d", 16),
    (b"v2f", 8),
    (b"v2i", 8),
    (b"v3d", 24),
    (b"v3f", 12),
    (b"v3i", 12),
];

/// How many bytes a list of channels takes of the next `bytes`, all of which are passed, and how many its pixels have: channels of a name and
/// 16 bytes, which begin with the type, and an empty name.
fn channel_list_bytes(input: &mut impl BufRead, bytes: u64) -> io::Result<(u64, u64)> {
    /// The type of 16 bits; the others have 32.
    const HALF: [u8; 4] = 1_u32.to_le_bytes();
    let mut list = input.take(bytes);
    let (mut taken, mut of_pixel) = (0, 0);
    while !read_name(&mut list, &mut taken)?.is_empty() {
        let mut channel = [0; 16];
        list.read_exact(&mut channel)?;
        taken += 16;
        of_pixel += if channel[..4] == HALF { 2 } else { 4 };
    }
    io::copy(&mut list, &mut io::sink())?;
    Ok((taken, of_pixel))
}

/// The first words of 32 bits of the next `bytes`, all of which are passed.
fn read_words<const N: usize, R: BufRead + Seek>(input: &mut R, bytes: u64) -> io::Result<[[u8; 4]; N]> {
    let mut words = [[0; 4]; N];
    let read = words.as_flattened_mut();
    let Some(rest) = bytes.checked_sub(read.len() as u64) else { return Err(io::ErrorKind::UnexpectedEof.into()) };
    input.read_exact(read)?;
    input.seek_relative(rest as i64)?;
    Ok(words)
}

/// Width and height at the start of the next `bytes`, all of which are passed.
fn read_size<R: BufRead + Seek>(input: &mut R, bytes: u64) -> io::Result<[u64; 2]> {
    Ok(read_words(input, bytes)?.map(|word| u32::from_le_bytes(word).into()))
}

/// Width of a window in the next `bytes`, all of which are passed: the least x and y and the largest, both inside.
fn window_width<R: BufRead + Seek>(input: &mut R, bytes: u64) -> io::Result<u64> {
    let [low, _, high, _] = read_words(input, bytes)?.map(|word| i64::from(i32::from_le_bytes(word)));
    // A window without pixels is the library's to refuse.
    Ok(u64::try_from(high - low + 1).unwrap_or(0))
}

fn check_chunks<R: BufRead + Seek>(input: &mut R, file_bytes: u64) -> io::Result<Result<(), Fault>> {
    let mut position = 8;
    input.seek_relative(8)?;
    loop {
        let mut start = [0; 8];
        input.read_exact(&mut start)?;
        let [a, b, c, d, name @ ..] = start;
        let bytes = u32::from_be_bytes([a, b, c, d]);
        position += 8;
        let left = file_bytes.saturating_sub(position + 4);
        if u64::from(bytes) > left {
            let name = String::from_utf8_lossy(&name).into_owned();
            return Ok(Err(Fault::Damaged(format!(
                "the chunk {name:?} claims {bytes} bytes where the file has {left} left"
            ))));
        }
        if &name == b"IEND" {
            return Ok(Ok(()));
        }
        input.seek_relative(i64::from(bytes) + 4)?;
        position += u64::from(bytes) + 4;
    }
}

/// Bytes up to a zero, which is read but not returned.
fn read_name(input: &mut impl BufRead, position: &mut u64) -> io::Result<Vec<u8>> {
    let mut name = Vec::new();
    *position += input.take(LONGEST_NAME + 1).read_until(0, &mut name)? as u64;
    // Without its zero the name is too long, or the file has ended.
    if name.pop() == Some(0) { Ok(name) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn attribute(name: &str, size: i32, value: &[u8]) -> Vec<u8> {
        [name.as_bytes(), b"\0string\0", &size.to_le_bytes(), value].concat()
    }

    fn text(fault: Fault) -> String {
        match fault {
            Fault::Damaged(text) => text,
            Fault::TooLarge(what, bytes) => format!("{what}: {bytes}"),
        }
    }

    fn result(flags: u32, parts: &[Vec<u8>]) -> Result<(), String> {
        let bytes = [&b"\x76\x2f\x31\x01"[..], &(2 | flags).to_le_bytes(), &parts.concat()].concat();
        check_attributes(&mut Cursor::new(&bytes), bytes.len() as u64)
            .map_or_else(|error| Err(error.to_string()), |checked| checked.map_err(text))
    }

    #[test]
    fn attributes_must_lie_inside_the_file() {
        let good = attribute("owner", 3, b"abc");
        let end = b"\0".to_vec();
        assert_eq!(result(0, &[good.clone(), good.clone(), end.clone()]), Ok(()));
        assert!(result(0, std::slice::from_ref(&good)).is_err());
        for (size, part) in [(4, "claims 4 bytes where the file has 3 left"), (-1, "-1"), (i32::MAX, "2147483647")] {
            let text = result(0, &[good.clone(), attribute("note", size, b"abc")]).unwrap_err();
            assert!(text.contains("note") && text.contains(part), "{text}");
        }
        assert!(result(0, &[vec![b'x'; 300], end]).is_err());
    }

    /// The library would read on behind the value, and take its next bytes for an attribute of any size.
    #[test]
    fn values_must_have_the_size_of_their_type() {
        let typed =
            |kind: &str, size: i32, value: &[u8]| [b"x\0", kind.as_bytes(), b"\0", &size.to_le_bytes(), value].concat();
        let end = b"\0".to_vec();
        let channel = [&b"R\0"[..], &[0; 16], b"\0"].concat();
        let preview = [&2_u32.to_le_bytes()[..], &1_u32.to_le_bytes(), &[0; 8]].concat();
        for (kind, value) in [("chlist", &channel), ("preview", &preview), ("v2i", &vec![0; 8]), ("odd", &vec![0; 5])] {
            assert_eq!(result(0, &[typed(kind, value.len() as i32, value), end.clone()]), Ok(()), "{kind}");
        }
        let longer = [&channel[..], b"\0"].concat();
        for (kind, value) in [("chlist", &longer), ("preview", &[&preview[..], b"\0"].concat()), ("int", &vec![0; 5])] {
            let text = result(0, &[typed(kind, value.len() as i32, value), end.clone()]).unwrap_err();
            assert!(text.contains(kind) && text.contains("but has"), "{text}");
        }
        assert!(result(0, &[typed("chlist", 17, &channel), end.clone()]).is_err(), "a list without end");
        assert!(result(0, &[typed("preview", 4, &[0; 4]), end]).is_err());
    }

    /// The library makes room for a whole tile, 1.3 GB for one of 8x16777224 pixels of five channels in a picture of 20x16.
    #[test]
    fn what_is_read_at_once_must_be_small() {
        let channel = |name: &str, kind: u32| [name.as_bytes(), b"\0", &kind.to_le_bytes(), &[0; 12]].concat();
        let channels = [channel("G", 1), channel("R", 2), b"\0".to_vec()].concat();
        let list = [&b"channels\0chlist\0"[..], &(channels.len() as u32).to_le_bytes(), &channels].concat();
        let tiles = |width: u32, height: u32| {
            [&b"tiles\0tiledesc\0"[..], &9_u32.to_le_bytes(), &width.to_le_bytes(), &height.to_le_bytes(), &[0]]
                .concat()
        };
        let end = b"\0".to_vec();
        assert_eq!(result(0, &[list.clone(), tiles(64, 32), end.clone()]), Ok(()));
        assert_eq!(result(0, &[list.clone(), tiles(8192, 4096), end.clone()]), Ok(()), "six bytes a pixel");
        for tiles in [tiles(8, 0x0100_0008), tiles(u32::MAX, u32::MAX)] {
            for parts in [[list.clone(), tiles.clone(), end.clone()], [tiles.clone(), list.clone(), end.clone()]] {
                let text = result(0, &parts).unwrap_err();
                assert!(text.contains("a tile of"), "{text}");
            }
            let second = [list.clone(), end.clone(), list.clone(), tiles, end.clone(), end.clone()];
            assert!(result(MULTI_PART, &second).is_err());
        }
        // Lines of 7,631,721 pixels of three channels, 16 at a time, had room made for them too.
        let window = |high: i32| {
            let corners = [0, 0, high, 4].map(i32::to_le_bytes).concat();
            [&b"dataWindow\0box2i\0"[..], &16_u32.to_le_bytes(), &corners].concat()
        };
        let packed = |number: u8| [&b"compression\0compression\0"[..], &1_u32.to_le_bytes(), &[number]].concat();
        let wide = |high, number| result(0, &[list.clone(), packed(number), window(high), end.clone()]);
        assert_eq!((wide(7_631_720, 2), wide(100_000, 9), wide(-5, 9)), (Ok(()), Ok(()), Ok(())));
        assert_eq!(result(0, &[list.clone(), tiles(64, 32), window(7_631_720), end.clone()]), Ok(()), "it has tiles");
        for text in [wide(7_631_720, 3), wide(200_000, 9), wide(i32::MAX, 0)] {
            assert!(text.as_ref().is_err_and(|text| text.contains("a block of lines")), "{text:?}");
        }
    }

    #[test]
    fn every_part_is_checked() {
        let good = attribute("owner", 3, b"abc");
        let bad = attribute("note", 100, b"abc");
        let end = b"\0".to_vec();
        assert_eq!(result(MULTI_PART, &[good.clone(), end.clone(), good.clone(), end.clone(), end.clone()]), Ok(()));
        assert!(result(MULTI_PART, &[good.clone(), end.clone(), bad.clone()]).is_err());
        // What follows the header of a file with one part is not a header.
        assert_eq!(result(0, &[good, end, bad]), Ok(()));
    }

    #[test]
    fn chunks_must_lie_inside_the_file() {
        let chunk = |name: &str, size: u32, bytes: usize| {
            [&size.to_be_bytes()[..], name.as_bytes(), &vec![7; bytes + 4]].concat()
        };
        let result = |chunks: &[Vec<u8>]| {
            let bytes = [&b"\x89PNG\r\n\x1a\n"[..], &chunks.concat()].concat();
            check_chunks(&mut Cursor::new(&bytes), bytes.len() as u64)
                .map_or_else(|error| Err(error.to_string()), |checked| checked.map_err(text))
        };
        let (good, end) = (chunk("IDAT", 100, 100), chunk("IEND", 0, 0));
        assert_eq!(result(&[good.clone(), good.clone(), end.clone()]), Ok(()));
        assert_eq!(result(&[good.clone(), end.clone(), vec![0xff; 20]]), Ok(()));
        assert!(result(&[good.clone(), good.clone()]).is_err());
        let text = result(&[good.clone(), chunk("tEXt", 0x7fff_ffff, 100), end]).unwrap_err();
        assert!(
            text.contains("tEXt") && text.contains("claims 2147483647 bytes where the file has 112 left"),
            "{text}"
        );
    }
}
