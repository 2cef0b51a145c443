//! TressFX files, version 3 and 4, little-endian.
//!
//! Both begin with a float version, a u32 number of strands and a u32 number of points a strand. Then:
//!
//! | version | offset of the points | a point |
//! |---|---|---|
//! | 4 | u32 at byte 12; the header ends at byte 160 | four floats; the fourth is an inverse mass and is ignored |
//! | 3 | u64 at byte 144; the header ends at byte 296 | three floats |
//!
//! Strands are stored one after the other, root first. The files hold neither width nor colour nor transparency that
//! could be used here.

use super::{Fault, Has, Raw, even_layout, triples, u32_at};
use crate::hair::strands::{Attribute, DEFAULT_COLOR, DEFAULT_TRANSPARENCY, Strands};

/// Where the two versions differ.
struct Version {
    major: u32,
    header_bytes: u64,
    point_bytes: u64,
    /// Where the header says where the points begin.
    offset_at: usize,
}

const V3: Version = Version { major: 3, header_bytes: 296, point_bytes: 12, offset_at: 144 };
const V4: Version = Version { major: 4, header_bytes: 160, point_bytes: 16, offset_at: 12 };

/// The major version, if the first bytes are those of a TressFX file. Versions 3 and 4 with any minor digit count.
pub(super) fn version(bytes: &[u8]) -> Option<u32> {
    let version = f32::from_bits(u32_at(bytes, 0)?);
    // Text never passes: its bytes as a float would have to begin with two control characters, or hold "@@" or "\u{80}@".
    let tenths = version * 10.0;
    let is_version = (3.0..5.0).contains(&version) && (tenths - tenths.round()).abs() < 1e-4;
    is_version.then_some(version as u32)
}

pub(super) fn parse(bytes: &[u8]) -> Result<Raw, Fault> {
    let version = match version(bytes) {
        Some(3) => &V3,
        Some(4) => &V4,
        _ => {
            return Err(Fault::Byte { offset: 0, what: "a TressFX file begins with version 3 or 4 as a float".into() });
        }
    };
    let size = bytes.len() as u64;
    if size < version.header_bytes {
        let (major, header) = (version.major, version.header_bytes);
        let what = format!("the header of TressFX {major} has {header} bytes, but the file ends here");
        return Err(Fault::Byte { offset: size, what });
    }
    let word = |offset| u32_at(bytes, offset).unwrap_or_default();
    let (strands, points_each) = (word(4), word(8));
    let offset = match version.major {
        3 => u64::from(word(version.offset_at)) | u64::from(word(version.offset_at + 4)) << 32,
        _ => u64::from(word(version.offset_at)),
    };
    if !(version.header_bytes..=size).contains(&offset) {
        let header = version.header_bytes;
        let what = format!("points are said to begin at byte {offset}, outside {header} (header) to {size} (file)");
        return Err(Fault::Byte { offset: version.offset_at as u64, what });
    }

    // The product of two u32 fits u64; with the bytes of a point it may not.
    let points = u64::from(strands) * u64::from(points_each);
    let needed = points.checked_mul(version.point_bytes).filter(|&needed| needed <= size - offset);
    let (Some(needed), Ok(_)) = (needed, u32::try_from(points)) else {
        let each = version.point_bytes;
        let what = format!(
            "{strands} strands of {points_each} points at {each} bytes do not fit into the {} bytes from byte {offset}",
            size - offset
        );
        return Err(Fault::Byte { offset: 4, what });
    };
    // One strand takes at least four bytes in memory even where it has no points and takes none in the file.
    if points_each < 2 {
        let what = format!("strands of {points_each} points: at least 2 are needed");
        return Err(Fault::Byte { offset: 8, what });
    }

    let mut notes = vec![];
    let (begin, end) = (offset as usize, (offset + needed) as usize);
    if end < bytes.len() {
        notes.push(format!("{} bytes behind the points, from byte {end}, are ignored", bytes.len() - end));
    }
    let strands = Strands {
        points: triples(&bytes[begin..end], version.point_bytes as usize).collect(),
        first: even_layout(strands, points_each),
        width: Attribute::Uniform(0.0),
        color: Attribute::Uniform(DEFAULT_COLOR),
        transparency: Attribute::Uniform(DEFAULT_TRANSPARENCY),
    };
    Ok(Raw { strands, has: Has::default(), notes })
}
