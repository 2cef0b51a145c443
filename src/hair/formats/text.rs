//! Text: a line `x y z radius` for each point, root first, and blank lines between strands.
//!
//! Any number of blank lines parts two strands; blank lines at the ends, spaces around numbers, Windows line ends and
//! what follows a `#` are ignored. A line with nothing but a comment is no blank line.

use glam::Vec3;

use super::{Fault, Has, Raw};
use crate::hair::strands::{Attribute, DEFAULT_COLOR, DEFAULT_TRANSPARENCY, Strands};

pub(super) fn parse(bytes: &[u8]) -> Result<Raw, Fault> {
    let mut points: Vec<Vec3> = vec![];
    let mut widths: Vec<f32> = vec![];
    let mut first = vec![0u32];
    let mut repeated = (0usize, 0usize);
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    for (index, line) in bytes.split(|&b| b == b'\n').enumerate() {
        let line_number = index + 1;
        let begun = points.len() > *first.last().unwrap_or(&0) as usize;
        let content = line.split(|&b| b == b'#').next().unwrap_or_default().trim_ascii();
        if content.is_empty() {
            let blank = line.trim_ascii().is_empty();
            if blank && begun {
                first.push(points.len() as u32);
            }
            continue;
        }
        let [x, y, z, radius] = numbers(content, line_number)?;
        if radius < 0.0 {
            return Err(Fault::Line { line: line_number, what: format!("the radius {radius} is negative") });
        }
        let point = Vec3::new(x, y, z);
        if begun && points.last() == Some(&point) {
            repeated.0 += 1;
            repeated.1 = if repeated.1 == 0 { line_number } else { repeated.1 };
        }
        if points.len() >= u32::MAX as usize {
            return Err(Fault::Line { line: line_number, what: format!("more than {} points", u32::MAX) });
        }
        points.push(point);
        widths.push(2.0 * radius);
    }
    if points.len() > *first.last().unwrap_or(&0) as usize {
        first.push(points.len() as u32);
    }
    if points.is_empty() {
        return Err(Fault::Whole("no line holds a point (`x y z radius`)".into()));
    }
    let mut notes = vec![];
    if repeated.0 > 0 {
        let (count, line) = repeated;
        notes.push(format!(
            "{count} points repeat the one before them (first on line {line}); such segments have no length"
        ));
    }
    let strands = Strands {
        points,
        first,
        width: Attribute::PerPoint(widths),
        color: Attribute::Uniform(DEFAULT_COLOR),
        transparency: Attribute::Uniform(DEFAULT_TRANSPARENCY),
    };
    Ok(Raw { strands, has: Has { width: true, ..Has::default() }, notes })
}

/// The four numbers of a line.
fn numbers(content: &[u8], line: usize) -> Result<[f32; 4], Fault> {
    let mut values = [0.0; 4];
    let mut count = 0;
    for word in content.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()) {
        let number = std::str::from_utf8(word).ok().and_then(|w| w.parse::<f32>().ok());
        let Some(number) = number.filter(|n| n.is_finite()) else {
            let shown: String = String::from_utf8_lossy(word).chars().take(40).collect();
            return Err(Fault::Line { line, what: format!("{shown:?} is not a finite number") });
        };
        if let Some(value) = values.get_mut(count) {
            *value = number;
        }
        count += 1;
    }
    if count != 4 {
        let what = format!("{count} numbers instead of the four of `x y z radius`");
        return Err(Fault::Line { line, what });
    }
    Ok(values)
}
