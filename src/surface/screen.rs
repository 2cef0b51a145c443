//! OBJ and MTL text is screened before it is parsed.
//!
//! The parser behind it gives errors without a line, panics on some malformed lines (a colour of fewer than three
//! numbers, an index near 2^63), cuts concave faces wrongly, splits vertices along the seams of texture coordinates, which nothing here uses, and
//! opens whatever file an OBJ names. So the statements that matter are checked here, with their line numbers, and only
//! they are passed on, in their plainest form; the rest is counted or ignored.

use std::fmt::Write;

use glam::{DVec3, Vec3};

use super::polygon;

/// Screened OBJ text, and what was met on the way.
#[derive(Debug, Default)]
pub(super) struct Screened {
    /// `v`, `vn`, `f` with absolute indices and without texture coordinates, `usemtl`, and one `mtllib` at the top.
    pub text: String,
    /// What the `mtllib` lines name, in order.
    pub libraries: Vec<String>,
    /// The material names in use, each once, in order of first use.
    pub used: Vec<String>,
    /// Triangles that are passed on.
    pub faces: usize,
    /// Faces that cross themselves, have no area, or have too many corners to be cut with care.
    pub rough: usize,
    /// Faces of one or two corners, lines and points, all left out.
    pub left_out: usize,
}

/// A line that cannot be used.
#[derive(Debug, PartialEq)]
pub(super) struct BadLine {
    pub line: usize,
    pub what: String,
}

/// The highest index of a kind so far, and the line it is on.
#[derive(Default)]
struct Highest {
    index: u64,
    line: usize,
}

/// Absolute indices of a corner's vertex and normal, from 1.
type Corner = [Option<u64>; 2];

impl Screened {
    /// Passes a face on as triangles. One that comes before its vertices cannot be looked at and becomes a fan.
    fn add_face(&mut self, face: &[Corner], positions: &[Vec3]) {
        if face.len() < 3 {
            self.left_out += 1;
            return;
        }
        let position = |corner: &Corner| positions.get(corner[0]?.checked_sub(1)? as usize).map(|p| p.as_dvec3());
        let corners: Option<Vec<DVec3>> = if face.len() > 3 { face.iter().map(position).collect() } else { None };
        let cut = corners.map(|corners| polygon::cut(&corners));
        self.rough += usize::from(cut.as_ref().is_some_and(|cut| !cut.clean));
        let triangles = cut.map_or_else(|| (2..face.len()).map(|k| [0, k - 1, k]).collect(), |cut| cut.triangles);
        for triangle in triangles {
            self.text.push('f');
            for [v, n] in triangle.map(|k| face[k]) {
                // Writing to a string cannot fail. A corner always has a vertex.
                let _ = match (v.unwrap_or(0), n) {
                    (v, Some(n)) => write!(self.text, " {v}//{n}"),
                    (v, None) => write!(self.text, " {v}"),
                };
            }
            self.text.push('\n');
            self.faces += 1;
        }
    }
}

/// Screens an OBJ file.
pub(super) fn obj(text: &str) -> Result<Screened, BadLine> {
    let mut out = Screened { text: String::with_capacity(text.len() + 16), ..Screened::default() };
    out.text.push_str("mtllib materials\n");
    let (mut positions, mut normals, mut face) = (vec![], 0u64, vec![]);
    let mut highest = [Highest::default(), Highest::default()];
    for (line, content) in logical_lines(text) {
        let mut words = content.split_whitespace();
        let Some(keyword) = words.next() else { continue };
        let rest = content.trim_start()[keyword.len()..].trim();
        match keyword {
            "v" => {
                positions.push(vertex(&mut out.text, rest).map_err(|what| BadLine { line, what })?);
            }
            "vn" => {
                normal(&mut out.text, rest).map_err(|what| BadLine { line, what })?;
                normals += 1;
            }
            "f" | "fo" => {
                face.clear();
                for word in words {
                    let counts = [positions.len() as u64, normals];
                    let indices = corner(word, counts).map_err(|what| BadLine { line, what })?;
                    for (high, index) in highest.iter_mut().zip(indices) {
                        if let Some(index) = index.filter(|i| *i > high.index) {
                            *high = Highest { index, line };
                        }
                    }
                    face.push(indices);
                }
                out.add_face(&face, &positions);
            }
            "l" | "p" => out.left_out += 1,
            "usemtl" if !rest.is_empty() => {
                let _ = writeln!(out.text, "usemtl {rest}");
                if !out.used.iter().any(|name| name == rest) {
                    out.used.push(rest.into());
                }
            }
            "mtllib" if !rest.is_empty() => out.libraries.push(rest.into()),
            _ => {}
        }
    }
    // A face may come before its vertices, so what it names can only be checked at the end.
    for (high, count, what) in [(&highest[0], positions.len() as u64, "vertex"), (&highest[1], normals, "normal")] {
        if high.index > count {
            let what = format!("the face uses {what} {}, but the file has only {count}", high.index);
            return Err(BadLine { line: high.line, what });
        }
    }
    Ok(out)
}

/// Screens an MTL file: names and diffuse colours remain. Oddities become notes that begin with a line number.
pub(super) fn mtl(text: &str, notes: &mut Vec<String>) -> String {
    let mut out = String::with_capacity(text.len());
    let mut textures = 0usize;
    for (line, content) in logical_lines(text) {
        let mut words = content.split_whitespace();
        let Some(keyword) = words.next() else { continue };
        let rest = content.trim_start()[keyword.len()..].trim();
        match keyword {
            "newmtl" if !rest.is_empty() => {
                let _ = writeln!(out, "newmtl {rest}");
            }
            "Kd" => match color(rest) {
                Some([r, g, b]) => {
                    let _ = writeln!(out, "Kd {r} {g} {b}");
                }
                None => notes.push(format!("line {line}: `{}` is no colour and is ignored", shorten(&content))),
            },
            _ if keyword.eq_ignore_ascii_case("map_kd") => textures += 1,
            _ => {}
        }
    }
    if textures > 0 {
        notes.push(format!("{textures} textures are ignored: surfaces have a plain diffuse colour"));
    }
    out
}

/// A colour of three numbers, or of one that stands for three.
fn color(rest: &str) -> Option<[f32; 3]> {
    let values: Option<Vec<f32>> = rest.split_whitespace().take(3).map(finite).collect();
    match values?[..] {
        [grey] => Some([grey; 3]),
        [r, g, b] => Some([r, g, b]),
        _ => None,
    }
}

fn finite(word: &str) -> Option<f32> {
    word.parse::<f32>().ok().filter(|v| v.is_finite())
}

/// `v x y z`, `v x y z w`, or `v x y z r g b`, whose colour is left out.
fn vertex(out: &mut String, rest: &str) -> Result<Vec3, String> {
    let words: Vec<&str> = rest.split_whitespace().collect();
    let position: Option<Vec<f32>> = words.iter().take(3).map(|w| finite(w)).collect();
    let (Some(position), true) = (position, words.len() >= 3) else {
        return Err(format!("`v {}` does not hold three finite numbers", shorten(rest)));
    };
    let w = match words.len() {
        4 => finite(words[3]).filter(|w| *w != 0.0 && position.iter().all(|x| (x / w).is_finite())),
        _ => Some(1.0),
    };
    let Some(w) = w else { return Err(format!("`v {}`: the weight must be a number but zero", shorten(rest))) };
    let position = Vec3::from_slice(&position) / w;
    let _ = writeln!(out, "v {} {} {}", position.x, position.y, position.z);
    Ok(position)
}

/// `vn x y z`; a normal of no direction is mended later.
fn normal(out: &mut String, rest: &str) -> Result<(), String> {
    let mut words = rest.split_whitespace();
    let mut next = || words.next().and_then(|w| w.parse::<f32>().ok());
    let (Some(x), Some(y), Some(z)) = (next(), next(), next()) else {
        return Err(format!("`vn {}` does not hold three numbers", shorten(rest)));
    };
    let _ = writeln!(out, "vn {x} {y} {z}");
    Ok(())
}

/// Absolute vertex and normal index of `v`, `v/t`, `v//n` or `v/t/n`; negative ones count back from the last so far.
fn corner(word: &str, [vertices, normals]: [u64; 2]) -> Result<Corner, String> {
    let mut parts = word.split('/');
    let v = parts.next().unwrap_or_default();
    let texture = parts.next().unwrap_or_default();
    let n = parts.next().unwrap_or_default();
    let is_number = |part: &str| part.is_empty() || part.parse::<i64>().is_ok();
    if parts.next().is_some() || v.is_empty() || ![v, texture, n].into_iter().all(is_number) {
        return Err(format!("`{}` is no corner of a face (`v`, `v/t`, `v//n` or `v/t/n`)", shorten(word)));
    }
    let absolute = |part: &str, count: u64, what: &str| match part.parse::<i64>() {
        Err(_) => Ok(None),
        Ok(0) => Err(format!("the face uses {what} 0, but they count from 1")),
        Ok(index) if index > 0 => Ok(Some(index.unsigned_abs())),
        Ok(back) if back.unsigned_abs() <= count => Ok(Some(count + 1 - back.unsigned_abs())),
        Ok(back) => Err(format!("the face uses {what} {back}, but only {count} come before it")),
    };
    Ok([absolute(v, vertices, "vertex")?, absolute(n, normals, "normal")?])
}

/// Lines with their numbers from 1; a line that ends in a backslash goes on in the next; comments are cut off.
fn logical_lines(text: &str) -> impl Iterator<Item = (usize, std::borrow::Cow<'_, str>)> {
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (index, line) = lines.next()?;
        let mut whole = std::borrow::Cow::Borrowed(line);
        while whole.trim_end().ends_with('\\') {
            let Some((_, next)) = lines.next() else { break };
            let kept = whole.trim_end().len() - 1;
            let whole = whole.to_mut();
            whole.truncate(kept);
            whole.push(' ');
            whole.push_str(next);
        }
        // A `#` inside a name is kept, as some programs write such names.
        if whole.trim_start().starts_with('#') {
            whole = std::borrow::Cow::Borrowed("");
        }
        Some((index + 1, whole))
    })
}

/// The beginning of a text, for messages.
fn shorten(text: &str) -> String {
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() {
        short.push_str("...");
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn faces_come_out_plain() {
        let text = "v 0 0 0\nv 1 0 0 2\nv 0 1 0 1 0 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2//-1 \\\n -1/1\nl 1 2\nf 1 2\n";
        let screened = obj(text).unwrap();
        assert_eq!(screened.text, "mtllib materials\nv 0 0 0\nv 0.5 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3\n");
        assert_eq!((screened.faces, screened.left_out, screened.rough), (1, 2, 0));
    }

    #[test]
    fn bad_lines_are_named() {
        let bad = |text: &str| obj(text).map(|_| ()).unwrap_err();
        assert_eq!(bad("v 0 0 0\nf 1 1 2").what, "the face uses vertex 2, but the file has only 1");
        assert_eq!(bad("\n\nv 0 x 0").line, 3);
        assert_eq!(bad("v 0 0 nan").line, 1);
        assert_eq!(bad("v 0 0 1e40").line, 1);
        assert_eq!(bad("v 0 0 0 0").line, 1);
        assert!(bad("v 1 1 1\nf 0 1 1").what.contains("count from 1"));
        assert!(bad("f -1 -2 -3").what.contains("only 0 come before it"));
        assert!(bad("v 1 1 1\nf 1/2/3/4 1 1").what.contains("no corner"));
        assert!(bad("v 1 1 1\nf 1/9999999999999999999/ 1 1").what.contains("no corner"));
        assert!(bad("v 1 1 1\nf 1//1 1 1").what.contains("normal 1"));
    }

    #[test]
    fn materials_keep_name_and_colour() {
        let mut notes = vec![];
        let text = "newmtl a b\nKd 0.5\nNs -1e\nKd spectral f.rfl\nmap_Kd x.png\nKa 1\n#Kd 1 1 1\n";
        assert_eq!(mtl(text, &mut notes), "newmtl a b\nKd 0.5 0.5 0.5\n");
        assert_eq!(notes.len(), 2, "{notes:?}");
        assert!(notes[0].starts_with("line 4: "));
    }

    proptest! {
        #[test]
        fn any_text_is_screened(text in "(v|f|vn|usemtl|mtllib|l|#|\\\\|\n| |/|-|1|2|\\.|e|é){0,120}") {
            let _ = obj(&text);
            let _ = mtl(&text, &mut vec![]);
        }
    }
}
