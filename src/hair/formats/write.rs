//! Writing HAIR files. The layout is that of the reader.

use std::io::Write;
use std::path::Path;

use glam::Vec3;

use super::Error;
use super::hair::{COLORS, HEADER_BYTES, MAGIC, POINTS, SEGMENTS, THICKNESS, TRANSPARENCY};
use crate::file::write_whole;
use crate::hair::strands::{Attribute, Strands};

/// Writes strands as a HAIR file whose thickness is the diameter.
///
/// The file appears under its name only when it is whole and on disk: it is written under another name in the same
/// folder, flushed to the disk and renamed. Values given per strand are written per point, as the format wants.
///
/// # Errors
/// Strands that are not sound or have more than 65,535 segments, which the format cannot hold; a failed write.
pub fn write_hair(strands: &Strands, path: &Path) -> Result<(), Error> {
    let unwritable = |reason: String| Error::Unwritable { path: path.into(), reason };
    strands.validate().map_err(|flaw| unwritable(flaw.to_string()))?;
    let longest = strands.iter().enumerate().find(|(_, points)| points.len() - 1 > usize::from(u16::MAX));
    if let Some((index, points)) = longest {
        let count = points.len() - 1;
        return Err(unwritable(format!("strand {index} has {count} segments; the HAIR format holds up to 65535")));
    }
    write_whole(path, |out| write_content(strands, out)).map_err(|source| Error::Write { path: path.into(), source })
}

/// The content of the file, for strands that were checked.
pub(super) fn write_content(strands: &Strands, out: &mut impl Write) -> std::io::Result<()> {
    let is_array = |uniform: bool, flag: u32| if uniform { 0 } else { flag };
    let segments = even_segments(strands);
    let flags = POINTS
        | is_array(segments.is_some(), SEGMENTS)
        | is_array(matches!(strands.width, Attribute::Uniform(_)), THICKNESS)
        | is_array(matches!(strands.transparency, Attribute::Uniform(_)), TRANSPARENCY)
        | is_array(matches!(strands.color, Attribute::Uniform(_)), COLORS);

    let mut header = Vec::with_capacity(HEADER_BYTES);
    header.extend_from_slice(MAGIC);
    for word in [strands.strand_count() as u32, strands.point_count() as u32, flags, segments.unwrap_or(0)] {
        header.extend_from_slice(&word.to_le_bytes());
    }
    let color = strands.color.values().first().copied().unwrap_or(Vec3::ONE);
    let width = strands.width.values().first().copied().unwrap_or(1.0);
    let transparency = strands.transparency.values().first().copied().unwrap_or(0.0);
    for value in [width, transparency, color.x, color.y, color.z] {
        header.extend_from_slice(&value.to_le_bytes());
    }
    header.extend_from_slice(b"Written by Tress; thickness is the diameter of a strand");
    header.resize(HEADER_BYTES, 0);
    out.write_all(&header)?;

    if segments.is_none() {
        for strand in strands.iter() {
            out.write_all(&((strand.len() - 1) as u16).to_le_bytes())?;
        }
    }
    for point in &strands.points {
        write_triple(*point, out)?;
    }
    if flags & THICKNESS != 0 {
        per_point(strands, &strands.width, |w| out.write_all(&w.to_le_bytes()))?;
    }
    if flags & TRANSPARENCY != 0 {
        per_point(strands, &strands.transparency, |t| out.write_all(&t.to_le_bytes()))?;
    }
    if flags & COLORS != 0 {
        per_point(strands, &strands.color, |c| write_triple(c, out))?;
    }
    Ok(())
}

/// The number of segments of every strand, if it is the same for all.
fn even_segments(strands: &Strands) -> Option<u32> {
    let mut counts = strands.iter().map(<[Vec3]>::len);
    let count = counts.next()?;
    counts.all(|c| c == count).then_some(count as u32 - 1)
}

fn write_triple(v: Vec3, out: &mut impl Write) -> std::io::Result<()> {
    for value in v.to_array() {
        out.write_all(&value.to_le_bytes())?;
    }
    Ok(())
}

fn per_point<T: Copy>(
    strands: &Strands,
    attribute: &Attribute<T>,
    mut write: impl FnMut(T) -> std::io::Result<()>,
) -> std::io::Result<()> {
    for strand in 0..strands.strand_count() {
        for point in strands.range(strand) {
            write(attribute.at(strand, point))?;
        }
    }
    Ok(())
}
