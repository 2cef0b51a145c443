//! Reading a scene file: from its bytes to a checked [`Description`], with the place of every key for messages.

use std::fmt;
use std::path::{Path, PathBuf};

use serde_json::Value;
use sha2::{Digest, Sha256};

use super::check::{self, Finding, MAX_FINDINGS};
use super::description::Description;
use super::keypath::KeyPath;
use super::parse as syntax;
use super::spans::{Node, Origin, Place, Spans};
use super::{overrides, validate};

/// A scene file that was read and found sound, as far as that can be told without reading the files it names.
#[derive(Clone, Debug)]
pub struct Document {
    /// What it says, the command line's overrides included.
    pub description: Description,
    /// The file.
    pub path: PathBuf,
    /// The folder that paths in the file are relative to.
    pub base_dir: PathBuf,
    /// SHA-256 of the file's bytes, in hexadecimal. Overrides are not in it.
    pub source_hash: String,
    /// The overrides that were applied, as `key.path=value`.
    pub overrides: Vec<String>,
    /// Where each key was written.
    pub spans: Spans,
    /// What is allowed but hardly meant.
    pub warnings: Vec<Problem>,
}

/// A fault or an oddity of a scene file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Problem {
    /// Where it was written.
    pub place: Place,
    /// What is wrong and what to do.
    pub message: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.message)
    }
}

/// The faults of one scene file, in the order of the file: at most [`MAX_PROBLEMS`], and how many more there are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problems {
    /// The faults.
    pub list: Vec<Problem>,
    /// How many more were found.
    pub more: usize,
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, problem) in self.list.iter().enumerate() {
            write!(f, "{}{problem}", if n > 0 { "\n" } else { "" })?;
        }
        match self.more {
            0 => Ok(()),
            // The search ends there, so that the number is not the whole number.
            more if more + self.list.len() >= MAX_FINDINGS => write!(f, "\nand many more"),
            more => write!(f, "\nand {more} more"),
        }
    }
}

/// Why a scene file is no scene.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file cannot be read.
    #[error("{}: cannot read the scene: {source}", path.display())]
    Read {
        /// The scene file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is too large to be a scene.
    #[error("{}: the scene file has more than {} MiB; hair and meshes belong in files of their own", path.display(), MAX_BYTES >> 20)]
    TooLarge {
        /// The scene file.
        path: PathBuf,
    },
    /// The file's ending names no format.
    #[error("{}: the ending of a scene file must be .toml or .json", path.display())]
    Ending {
        /// The scene file.
        path: PathBuf,
    },
    /// The file's text or values are wrong.
    #[error("{0}")]
    Invalid(Problems),
}

/// The largest scene file, in bytes.
pub const MAX_BYTES: u64 = 16 << 20;

/// The most faults that one error lists.
pub const MAX_PROBLEMS: usize = 20;

/// Reads a scene file (TOML or strict JSON, by its ending), applies the overrides (`key.path=value`, as after `--set`) and checks it.
///
/// # Errors
/// All faults of the file at once, each with its place; see [`SceneError`].
pub fn load(path: &Path, overrides: &[String]) -> Result<Document, SceneError> {
    // A name that cannot be a scene's is refused before anything is opened.
    Format::of(path)?;
    parse(&read(path)?, path, overrides)
}

/// [`load`] of a content that was read already; `path` says the format, what other paths are relative to, and serves for messages.
///
/// # Errors
/// As [`load`].
pub fn parse(bytes: &[u8], path: &Path, overrides: &[String]) -> Result<Document, SceneError> {
    let base_dir = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    };
    from_bytes(bytes, Format::of(path)?, path, base_dir, overrides)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Toml,
    Json,
}

impl Format {
    fn of(path: &Path) -> Result<Self, SceneError> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match ending.as_deref() {
            Some("toml") => Ok(Format::Toml),
            Some("json") => Ok(Format::Json),
            _ => Err(SceneError::Ending { path: path.to_owned() }),
        }
    }
}

fn read(path: &Path) -> Result<Vec<u8>, SceneError> {
    use std::io::Read;
    let failed = |source| SceneError::Read { path: path.to_owned(), source };
    let file = std::fs::File::open(path).map_err(failed)?;
    if file.metadata().map_err(failed)?.is_dir() {
        return Err(failed(std::io::Error::new(std::io::ErrorKind::IsADirectory, "it is a folder")));
    }
    // The size is not taken from the metadata: a pipe or a growing file has another.
    let mut bytes = Vec::new();
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(SceneError::TooLarge { path: path.to_owned() });
    }
    Ok(bytes)
}

/// [`parse`] with what the path says given apart.
pub(crate) fn from_bytes(
    bytes: &[u8],
    format: Format,
    path: &Path,
    base_dir: PathBuf,
    overrides: &[String],
) -> Result<Document, SceneError> {
    let source_hash = Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect();
    let text = text_of(bytes, path)?;
    let parsed = match format {
        Format::Toml => syntax::toml(&text),
        Format::Json => syntax::json(&text),
    };
    let (mut value, root) = parsed.map_err(|errors| {
        let spans = Spans::new(path, text.clone(), Node::leaf(Origin::Text { key: 0, value: 0 }), &[]);
        invalid(errors.into_iter().map(|e| Problem { place: spans.at(e.byte), message: e.message }).collect())
    })?;
    let mut spans = Spans::new(path, text, root, overrides);

    let faults = overrides::apply(&mut value, &mut spans.root, overrides);
    let (mut list, more) = place(check::check(&mut value), &spans);
    let fault = |(n, message): (usize, String)| Problem { place: Place::Override(overrides[n].clone()), message };
    list.extend(faults.into_iter().map(fault));
    refuse(list, more)?;
    let description = describe(value, &spans)?;

    let found = validate::validate(&description, &spans, &base_dir);
    let (errors, more) = place(found.errors, &spans);
    refuse(errors, more)?;
    let (mut warnings, more) = place(found.warnings, &spans);
    if more > 0 {
        warnings.push(Problem { place: spans.value(&KeyPath::root()), message: format!("and {more} more warnings") });
    }
    let (path, overrides) = (path.to_owned(), overrides.to_owned());
    Ok(Document { description, path, base_dir, source_hash, overrides, spans, warnings })
}

fn describe(value: Value, spans: &Spans) -> Result<Description, SceneError> {
    serde_json::from_value(value).map_err(|e| {
        // The schema accepted it, so this is a disagreement between schema and types: still an error, not a panic.
        invalid(vec![Problem { place: spans.value(&KeyPath::root()), message: e.to_string() }])
    })
}

fn text_of(bytes: &[u8], path: &Path) -> Result<String, SceneError> {
    // A byte order mark is no part of the text, nor of the first line's columns.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    String::from_utf8(bytes.to_owned()).map_err(|e| {
        let sound = e.utf8_error().valid_up_to();
        let text = String::from_utf8_lossy(&bytes[..sound]).into_owned();
        let spans = Spans::new(path, text, Node::leaf(Origin::Text { key: 0, value: 0 }), &[]);
        let message = "the text is not UTF-8 from here on; save the file as UTF-8".to_owned();
        invalid(vec![Problem { place: spans.at(sound), message }])
    })
}

/// The first findings in the order of the file, with their places, and the number of the others. Only these, because
/// a column costs the length of its line.
fn place(mut findings: Vec<Finding>, spans: &Spans) -> (Vec<Problem>, usize) {
    findings.sort_by_cached_key(|f| spans.order(&f.path, f.about_key));
    let more = findings.len().saturating_sub(MAX_PROBLEMS);
    findings.truncate(MAX_PROBLEMS);
    let place = |f: &Finding| if f.about_key { spans.key(&f.path) } else { spans.value(&f.path) };
    (findings.into_iter().map(|f| Problem { place: place(&f), message: f.message }).collect(), more)
}

/// An error if there are problems; `more` were found but not placed.
fn refuse(list: Vec<Problem>, more: usize) -> Result<(), SceneError> {
    if list.is_empty() { Ok(()) } else { Err(SceneError::Invalid(Problems { list, more })) }
}

fn invalid(list: Vec<Problem>) -> SceneError {
    SceneError::Invalid(Problems { list, more: 0 })
}

impl Document {
    /// Where the value at a key path such as `hair[0].file` was written, or the nearest thing around it: for messages about what a key leads to.
    pub fn locate(&self, key_path: &str) -> Place {
        self.spans.value(&KeyPath::parse(key_path).unwrap_or_default())
    }

    /// A path of the scene file, made relative to the file's folder.
    pub fn resolve(&self, path: &Path) -> PathBuf {
        self.base_dir.join(path)
    }
}
