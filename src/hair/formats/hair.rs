//! Cem Yuksel's HAIR format, little-endian.
//!
//! | bytes | content |
//! |---|---|
//! | 0..4 | `HAIR` |
//! | 4..8 | u32 number of strands |
//! | 8..12 | u32 number of points over all strands |
//! | 12..16 | u32 flags: which arrays follow, bit 0 to 4 in the order below |
//! | 16..20 | u32 segments a strand where there is no array of them |
//! | 20..24 | f32 thickness where there is no array of it, in the units of the points |
//! | 24..28 | f32 transparency likewise, 0 opaque to 1 invisible |
//! | 28..40 | f32 x 3 colour likewise |
//! | 40..128 | text about the file |
//!
//! Then, as the flags say: segments (u16 a strand), points (f32 x 3), thickness (f32 a point), transparency (f32 a
//! point), colour (f32 x 3 a point). A strand has one point more than it has segments. The format does not say whether
//! a thickness is a diameter or a radius, nor in which space colours are; they are taken as linear.

use glam::Vec3;

use super::{Fault, Has, Options, Raw, even_layout, floats, triples, u32_at};
use crate::hair::strands::{Attribute, Strands};
use crate::scene::description::ThicknessIs;

pub(super) const MAGIC: &[u8] = b"HAIR";
pub(super) const HEADER_BYTES: usize = 128;
pub(super) const SEGMENTS: u32 = 1;
pub(super) const POINTS: u32 = 2;
pub(super) const THICKNESS: u32 = 4;
pub(super) const TRANSPARENCY: u32 = 8;
pub(super) const COLORS: u32 = 16;

/// The fields of the header that matter.
struct Header {
    strands: u32,
    points: u32,
    flags: u32,
    segments: u32,
    thickness: f32,
    transparency: f32,
    color: Vec3,
}

/// The arrays behind the header, as slices of the file; empty where the flag is not set.
#[derive(Default)]
struct Arrays<'a> {
    segments: &'a [u8],
    points: &'a [u8],
    thickness: &'a [u8],
    transparency: &'a [u8],
    colors: &'a [u8],
}

pub(super) fn parse(bytes: &[u8], options: &Options) -> Result<Raw, Fault> {
    let header = Header::parse(bytes)?;
    let mut notes = vec![];
    let arrays = split(&header, bytes, &mut notes)?;
    let first = layout(&header, arrays.segments)?;

    let factor = match options.thickness_is.unwrap_or(ThicknessIs::Diameter) {
        ThicknessIs::Diameter => 1.0,
        ThicknessIs::Radius => 2.0,
    };
    if options.thickness_is.is_none() && !options.replaced.width {
        notes.push("thickness is taken as a strand's diameter; `thickness_is` changes that".into());
    }

    let has_array = |flag| header.flags & flag != 0;
    let width = match has_array(THICKNESS) {
        true => Attribute::PerPoint(floats(arrays.thickness).map(|w| w * factor).collect()),
        false => Attribute::Uniform(header.thickness * factor),
    };
    let transparency = match has_array(TRANSPARENCY) {
        true => Attribute::PerPoint(floats(arrays.transparency).collect()),
        false => Attribute::Uniform(header.finite(header.transparency, 24, "transparency")?),
    };
    let color = match has_array(COLORS) {
        true => Attribute::PerPoint(triples(arrays.colors, 12).collect()),
        false => Attribute::Uniform(Vec3::new(
            header.finite(header.color.x, 28, "colour")?,
            header.finite(header.color.y, 32, "colour")?,
            header.finite(header.color.z, 36, "colour")?,
        )),
    };
    let points = triples(arrays.points, 12).collect();
    let has = Has { width: true, color: true, transparency: true };
    Ok(Raw { strands: Strands { points, first, width, color, transparency }, has, notes })
}

impl Header {
    fn parse(bytes: &[u8]) -> Result<Self, Fault> {
        if bytes.len() < HEADER_BYTES {
            let what = format!("a HAIR header has {HEADER_BYTES} bytes, but the file ends here");
            return Err(Fault::Byte { offset: bytes.len() as u64, what });
        }
        // Always there: the length was checked above.
        let word = |offset| u32_at(bytes, offset).unwrap_or_default();
        let float = |offset| f32::from_bits(word(offset));
        let header = Self {
            strands: word(4),
            points: word(8),
            flags: word(12),
            segments: word(16),
            thickness: float(20),
            transparency: float(24),
            color: Vec3::new(float(28), float(32), float(36)),
        };
        if header.flags & POINTS == 0 {
            let what = format!("the flags {:#x} say that the file holds no points", header.flags);
            return Err(Fault::Byte { offset: 12, what });
        }
        if header.flags >= 32 {
            let what = format!("the flags {:#x} ask for arrays that are not known; only bits 0 to 4 are", header.flags);
            return Err(Fault::Byte { offset: 12, what });
        }
        Ok(header)
    }

    /// A default of the header, which must be a number because no array replaces it.
    fn finite(&self, value: f32, offset: u64, what: &str) -> Result<f32, Fault> {
        if value.is_finite() {
            return Ok(value);
        }
        Err(Fault::Byte { offset, what: format!("the default {what} is {value}") })
    }
}

/// Cuts the file into its arrays. Sizes are compared with the file in u64, where no product of two u32 overflows.
fn split<'a>(header: &Header, bytes: &'a [u8], notes: &mut Vec<String>) -> Result<Arrays<'a>, Fault> {
    let (strands, points) = (u64::from(header.strands), u64::from(header.points));
    let mut arrays = Arrays::default();
    let mut at = HEADER_BYTES;
    let plan: [(u32, &str, u64, &mut &'a [u8]); 5] = [
        (SEGMENTS, "segments", 2 * strands, &mut arrays.segments),
        (POINTS, "points", 12 * points, &mut arrays.points),
        (THICKNESS, "thickness", 4 * points, &mut arrays.thickness),
        (TRANSPARENCY, "transparency", 4 * points, &mut arrays.transparency),
        (COLORS, "colours", 12 * points, &mut arrays.colors),
    ];
    for (flag, name, size, slot) in plan {
        if header.flags & flag == 0 {
            continue;
        }
        let left = bytes.len() - at;
        if size > left as u64 {
            let counts = format!("{strands} strands and {points} points, as the header says");
            let what = format!("the array of {name} needs {size} bytes ({counts}), but only {left} are left");
            return Err(Fault::Byte { offset: at as u64, what });
        }
        *slot = &bytes[at..at + size as usize];
        at += size as usize;
    }
    if at < bytes.len() {
        notes.push(format!("{} bytes behind the last array, from byte {at}, are ignored", bytes.len() - at));
    }
    Ok(arrays)
}

/// Where each strand begins; the counts of the header and of the array of segments must agree.
fn layout(header: &Header, segments: &[u8]) -> Result<Vec<u32>, Fault> {
    let (strands, points) = (header.strands, header.points);
    if header.flags & SEGMENTS == 0 {
        // Cannot overflow: (2^32 - 1) * 2^32 < 2^64.
        let total = u64::from(strands) * (u64::from(header.segments) + 1);
        if total != u64::from(points) {
            let each = header.segments;
            let what = format!("{strands} strands of {each} segments have {total} points, but byte 8 says {points}");
            return Err(Fault::Byte { offset: 4, what });
        }
        // An empty file of no strands may name any number of segments.
        return Ok(if strands == 0 { vec![0] } else { even_layout(strands, header.segments + 1) });
    }
    let mut first = Vec::with_capacity(strands as usize + 1);
    let mut end = 0u64;
    first.push(0);
    for (i, pair) in segments.chunks_exact(2).enumerate() {
        end += u64::from(u16::from_le_bytes([pair[0], pair[1]])) + 1;
        if end > u64::from(points) {
            let what = format!("strand {i} ends at point {end}, but byte 8 says that there are {points}");
            return Err(Fault::Byte { offset: (HEADER_BYTES + 2 * i) as u64, what });
        }
        first.push(end as u32);
    }
    if end != u64::from(points) {
        let what = format!("the segments of {strands} strands make {end} points, but byte 8 says {points}");
        return Err(Fault::Byte { offset: HEADER_BYTES as u64, what });
    }
    Ok(first)
}
