//! Hair files: one reader a format, and a writer for HAIR.
//!
//! Files are taken as hostile. A reader compares the counts in a header with the size of the file before it allocates
//! anything, so a file cannot make it hold more than a small multiple of its own size; it ends in strands or in an
//! [`enum@Error`] that names the file, the place and what was found there, never in a panic.

mod extent;
mod hair;
mod text;
mod tfx;
mod write;

use std::path::{Path, PathBuf};

use glam::Vec3;
use thiserror::Error;

use super::strands::{Attribute, Dropped, Strands, bounds};
use crate::file::read_regular;
use crate::scene::description::{HairFormat, ThicknessIs};

pub use extent::{Extent, extent};
pub use write::write_hair;

/// Files larger than this are refused, in bytes.
pub const MAX_FILE_BYTES: u64 = 64 << 30;

/// Width of strands where nothing gives one, as a share of the diagonal of the box around them.
pub const DEFAULT_WIDTH_SHARE: f32 = 1.0 / 2000.0;

/// How a file is to be understood where its format leaves that open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// Whether the thickness of a HAIR file is a diameter or a radius; a diameter unless given. Other formats ignore it.
    pub thickness_is: Option<ThicknessIs>,
    /// Attributes that the caller replaces: nothing is said about what stands for them.
    pub replaced: Has,
}

/// Which attributes the file gave; the others hold defaults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Has {
    pub width: bool,
    pub color: bool,
    pub transparency: bool,
}

/// What was read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// Sound strands: [`Strands::validate`] holds.
    pub strands: Strands,
    /// The format that the file turned out to have; never `Auto`.
    pub format: HairFormat,
    /// Which attributes the file gave.
    pub has: Has,
    /// Damaged strands that were left out; they are also in the notes.
    pub dropped: Dropped,
    /// What a user should be told: assumptions that were made, and oddities that were mended.
    pub notes: Vec<String>,
}

/// Why a hair file could not be read or written.
#[derive(Debug, Error)]
pub enum Error {
    #[error("cannot read hair file {path}: {source}", path = path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("cannot write hair file {path}: {source}", path = path.display())]
    Write { path: PathBuf, source: std::io::Error },
    #[error("cannot write hair file {path}: {reason}", path = path.display())]
    Unwritable { path: PathBuf, reason: String },
    #[error("hair file {path}: {fault}", path = path.display())]
    Content { path: PathBuf, fault: Fault },
}

/// What is wrong with the content of a file.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Fault {
    #[error("byte {offset}: {what}")]
    Byte { offset: u64, what: String },
    #[error("line {line}: {what}")]
    Line { line: usize, what: String },
    #[error("{0}")]
    Whole(String),
}

/// What a reader hands back before damaged strands are cut.
struct Raw {
    strands: Strands,
    has: Has,
    notes: Vec<String>,
}

/// Reads a hair file.
///
/// # Errors
/// A file that cannot be read, or whose content is not what its format asks for.
pub fn read(path: &Path, format: HairFormat, options: &Options) -> Result<Loaded, Error> {
    let bytes = read_regular(path, MAX_FILE_BYTES).map_err(|source| Error::Read { path: path.into(), source })?;
    let extension = path.extension().and_then(|e| e.to_str());
    parse(&bytes, format, extension, options).map_err(|fault| Error::Content { path: path.into(), fault })
}

/// Reads a hair file's content. `extension` is the ending of its name, which helps to tell the format.
///
/// # Errors
/// A content that is not what the format asks for.
pub fn parse(bytes: &[u8], format: HairFormat, extension: Option<&str>, options: &Options) -> Result<Loaded, Fault> {
    let format = resolve(bytes, format, extension)?;
    let mut raw = match format {
        HairFormat::Hair => hair::parse(bytes, options)?,
        HairFormat::Tfx => tfx::parse(bytes)?,
        HairFormat::Text | HairFormat::Auto => text::parse(bytes)?,
    };
    if options.thickness_is.is_some() && format != HairFormat::Hair {
        let why = match format {
            HairFormat::Text => "text files hold radii by definition",
            _ => "the file holds no widths",
        };
        raw.notes.push(format!("`thickness_is` is ignored: {why}"));
    }
    finish(raw, format, options.replaced)
}

/// The format that the first bytes show, if they show one.
fn sniff(bytes: &[u8]) -> Option<HairFormat> {
    if bytes.starts_with(hair::MAGIC) {
        return Some(HairFormat::Hair);
    }
    if tfx::version(bytes).is_some() {
        return Some(HairFormat::Tfx);
    }
    let head = &bytes[..bytes.len().min(512)];
    let printable = |b: &u8| b.is_ascii_graphic() || b.is_ascii_whitespace();
    let starts_a_line = |b: &u8| b"+-.#0123456789".contains(b);
    let first = head.iter().find(|b| !b.is_ascii_whitespace());
    (head.iter().all(printable) && first.is_some_and(starts_a_line)).then_some(HairFormat::Text)
}

/// Settles the format: what the user said, else the first bytes, else the ending; the bytes must agree.
fn resolve(bytes: &[u8], format: HairFormat, extension: Option<&str>) -> Result<HairFormat, Fault> {
    if bytes.is_empty() {
        return Err(Fault::Whole("the file is empty".into()));
    }
    let foreign: [(&[u8], &str); 3] = [(b"#usda", "USD"), (b"PXR-USDC", "USD"), (b"Ogawa", "Alembic")];
    if let Some((_, kind)) = foreign.iter().find(|(magic, _)| bytes.starts_with(magic)) {
        return Err(Fault::Whole(format!("{kind} files are not read; export the curves as HAIR, TressFX or text")));
    }
    let named = match extension.map(str::to_ascii_lowercase).as_deref() {
        Some("hair") => Some(HairFormat::Hair),
        Some("tfx") => Some(HairFormat::Tfx),
        Some("txt" | "text" | "curves" | "curve") => Some(HairFormat::Text),
        _ => None,
    };
    let (wanted, why) = match (format, named) {
        (HairFormat::Auto, Some(named)) => (named, "its ending says"),
        (HairFormat::Auto, None) => {
            return sniff(bytes).ok_or_else(|| {
                let what = "neither the ending nor the first bytes say what kind of hair file this is; ";
                Fault::Whole(format!("{what}set `format` to hair, tfx or text if it is one"))
            });
        }
        (given, _) => (given, "`format` says"),
    };
    match (sniff(bytes), wanted) {
        (Some(found), wanted) if found == wanted => Ok(wanted),
        (Some(found), _) => {
            let (wanted, found) = (name(wanted), name(found));
            Err(Fault::Whole(format!("{why} {wanted}, but its first bytes are those of {found}")))
        }
        // A text file may begin with a comment in any language; its reader says what it cannot take.
        (None, HairFormat::Text) => Ok(HairFormat::Text),
        (None, wanted) => {
            let shown: Vec<String> = bytes.iter().take(4).map(|b| format!("{b:02x}")).collect();
            let (wanted, shown) = (name(wanted), shown.join(" "));
            Err(Fault::Byte { offset: 0, what: format!("{why} {wanted}, but the file begins with {shown}") })
        }
    }
}

fn name(format: HairFormat) -> &'static str {
    match format {
        HairFormat::Auto => "any format",
        HairFormat::Hair => "HAIR",
        HairFormat::Tfx => "TressFX",
        HairFormat::Text => "text",
    }
}

/// Cuts damaged strands, brings attributes into their range and fills in what the file did not give.
fn finish(mut raw: Raw, format: HairFormat, replaced: Has) -> Result<Loaded, Fault> {
    let total = raw.strands.strand_count();
    if let Attribute::Uniform(width) = raw.strands.width
        && raw.has.width
        && !(width > 0.0 && width.is_finite())
    {
        raw.has.width = false;
        raw.notes.push(format!("the thickness in the header is {width}, which cannot be"));
    }
    if !raw.has.width {
        raw.strands.width = Attribute::Uniform(0.0);
    }
    let limited = limit(&mut raw.strands);
    raw.notes.extend(limited);
    let dropped = raw.strands.cut_damaged().map_err(|flaw| Fault::Whole(flaw.to_string()))?;
    raw.notes.extend(dropped.note());
    if raw.strands.strand_count() == 0 {
        let why = dropped.note().unwrap_or_else(|| "there are none".into());
        return Err(Fault::Whole(format!("no strand is left of {total}: {why}")));
    }
    if !raw.has.width {
        let width = default_width(&raw.strands);
        raw.strands.width = Attribute::Uniform(width);
        if !replaced.width {
            raw.notes.push(format!(
                "no width in the file: {width} is used, 1/2000 of the diagonal of the hair's bounds; set `width` to change it"
            ));
        }
    }
    if !raw.has.transparency && !replaced.transparency {
        raw.notes.push("no transparency in the file: strands are opaque; set `transparency` to change it".into());
    }
    Ok(Loaded { strands: raw.strands, format, has: raw.has, dropped, notes: raw.notes })
}

/// Clamps colours and transparencies to 0 to 1 and says how many values that changed. Those not finite stay as they are.
fn limit(strands: &mut Strands) -> Vec<String> {
    let mut notes = vec![];
    let mut count = 0;
    for color in strands.color.values_mut() {
        let clamped = color.clamp(Vec3::ZERO, Vec3::ONE);
        if color.is_finite() && clamped != *color {
            *color = clamped;
            count += 1;
        }
    }
    if count > 0 {
        notes.push(format!("{count} colours were outside 0 to 1 and were clamped"));
    }
    count = 0;
    for t in strands.transparency.values_mut() {
        if t.is_finite() && !(0.0..=1.0).contains(t) {
            *t = t.clamp(0.0, 1.0);
            count += 1;
        }
    }
    if count > 0 {
        notes.push(format!("{count} transparencies were outside 0 to 1 and were clamped"));
    }
    notes
}

/// Width where nothing gives one, in the units of the points. One where all points coincide.
fn default_width(strands: &Strands) -> f32 {
    let diagonal = bounds(&strands.points).map_or(0.0, |[low, high]| high.as_dvec3().distance(low.as_dvec3()));
    let width = (diagonal * f64::from(DEFAULT_WIDTH_SHARE)) as f32;
    if width > 0.0 && width.is_finite() { width } else { 1.0 }
}

/// A little-endian word at a byte offset, if the file reaches that far.
fn u32_at(bytes: &[u8], offset: usize) -> Option<u32> {
    let word = bytes.get(offset..offset.checked_add(4)?)?;
    Some(u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
}

/// Consecutive little-endian floats; a remainder of less than four bytes is left out.
fn floats(bytes: &[u8]) -> impl ExactSizeIterator<Item = f32> + '_ {
    bytes.chunks_exact(4).map(|w| f32::from_le_bytes([w[0], w[1], w[2], w[3]]))
}

/// Consecutive triples of little-endian floats, one every `stride` bytes (at least twelve).
fn triples(bytes: &[u8], stride: usize) -> impl ExactSizeIterator<Item = Vec3> + '_ {
    let word = |c: &[u8], i: usize| f32::from_le_bytes([c[i], c[i + 1], c[i + 2], c[i + 3]]);
    bytes.chunks_exact(stride).map(move |c| Vec3::new(word(c, 0), word(c, 4), word(c, 8)))
}

/// Where each strand begins, for strands of the same number of points.
fn even_layout(strands: u32, points_each: u32) -> Vec<u32> {
    (0..=strands).map(|i| i * points_each).collect()
}

#[cfg(test)]
mod tests;
