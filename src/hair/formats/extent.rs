//! How much hair is in a file, told without holding it: what its header says, or its lines.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Result};
use std::path::Path;

use super::hair::{COLORS, HEADER_BYTES, MAGIC, POINTS, SEGMENTS, THICKNESS, TRANSPARENCY};
use super::{tfx, u32_at};

/// What a hair file would take in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extent {
    pub strands: u64,
    pub points: u64,
    /// Bytes of [`Strands`](crate::hair::Strands) read from it.
    pub bytes: u64,
    /// Bytes of the file, which is held while it is read.
    pub file_bytes: u64,
}

/// The extent of a hair file: of a binary one as its header says, but no more than fits into the file; of any other as many points as lines.
/// Nothing where there is no regular file: whoever reads it will say so.
///
/// # Errors
/// The system's.
pub fn extent(path: &Path) -> Result<Extent> {
    let data = path.metadata()?;
    if !data.is_file() {
        return Ok(Extent::default());
    }
    let file_bytes = data.len();
    let mut head = Vec::new();
    let mut file = File::open(path)?;
    file.by_ref().take(HEADER_BYTES as u64).read_to_end(&mut head)?;
    let word = |offset| u64::from(u32_at(&head, offset).unwrap_or_default());
    let (strands, points, point_bytes, attributes) = if head.starts_with(MAGIC) {
        let flags = word(12) as u32;
        let size = |flag, bytes: u64| if flags & flag != 0 { bytes } else { 0 };
        let attributes = size(THICKNESS, 4) + size(TRANSPARENCY, 4) + size(COLORS, 12);
        (word(4), word(8), size(POINTS, 12) + attributes, attributes)
    } else if let Some(version) = tfx::version(&head) {
        (word(4), word(4) * word(8), if version == 3 { 12 } else { 16 }, 0)
    } else {
        let lines = lines(BufReader::with_capacity(1 << 16, head.chain(file)))?;
        // A strand has a blank line behind it, so it cannot have fewer lines than two points and one.
        return Ok(Extent { strands: lines / 3, points: lines, bytes: 16 * lines + 4 * (lines / 3), file_bytes });
    };
    // A header that says more is refused when it is read. A strand takes two bytes of the file where there is an array of segments.
    let points = points.min(file_bytes / point_bytes.max(1));
    let strands = if word(12) as u32 & SEGMENTS != 0 { strands.min(file_bytes / 2) } else { strands.min(points) };
    Ok(Extent { strands, points, bytes: points * (12 + attributes) + 4 * strands, file_bytes })
}

/// Lines of a text, the last one with or without its end.
fn lines(mut text: impl BufRead) -> Result<u64> {
    let (mut lines, mut begun) = (0, false);
    loop {
        let buffer = text.fill_buf()?;
        let Some(&last) = buffer.last() else { return Ok(lines + u64::from(begun)) };
        lines += buffer.iter().filter(|&&byte| byte == b'\n').count() as u64;
        begun = last != b'\n';
        let length = buffer.len();
        text.consume(length);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hair::formats::{Options, read, write_hair};
    use crate::hair::{Attribute, Strands};
    use crate::scene::description::HairFormat;
    use glam::Vec3;

    #[test]
    fn what_a_header_says_is_what_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let strands = Strands {
            points: (0..30).map(|i| Vec3::splat(i as f32)).collect(),
            first: vec![0, 10, 30],
            width: Attribute::PerPoint(vec![0.1; 30]),
            color: Attribute::Uniform(Vec3::ONE),
            transparency: Attribute::PerPoint(vec![0.5; 30]),
        };
        let path = folder.path().join("a.hair");
        write_hair(&strands, &path).unwrap();
        let found = extent(&path).unwrap();
        assert_eq!((found.strands, found.points, found.bytes), (2, 30, 30 * 20 + 8));
        let text = folder.path().join("a.txt");
        std::fs::write(&text, "0 0 0 1\n1 0 0 1\n\n2 0 0 1\n3 0 0 1").unwrap();
        let found = extent(&text).unwrap();
        let held = read(&text, HairFormat::Auto, &Options::default()).unwrap().strands;
        assert!(found.points >= held.points.len() as u64 && found.points == 5);
    }

    #[test]
    fn promises_are_held_against_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hair");
        let mut bytes = b"HAIR".to_vec();
        for word in [u32::MAX, u32::MAX, 31, 0] {
            bytes.extend(word.to_le_bytes());
        }
        bytes.resize(128, 0);
        std::fs::write(&path, &bytes).unwrap();
        assert!(extent(&path).unwrap().bytes < 1000);
        let mut bytes = 4.0_f32.to_le_bytes().to_vec();
        bytes.extend([0xff; 12]);
        bytes.resize(160, 0);
        std::fs::write(&path, &bytes).unwrap();
        assert!(extent(&path).unwrap().bytes < 1000);
        assert_eq!(extent(folder.path()).unwrap(), Extent::default());
        assert!(extent(Path::new("/no/such.hair")).is_err());
    }
}
