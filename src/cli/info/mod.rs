//! `tress info`: what is in hair files, meshes, images and scene files.

mod facts;
mod text;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::{Failure, exit};

/// Say what is in hair files, meshes, images and scene files, and what is suspicious about it
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The files; of what kind they are is told from their first bytes and their endings
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Print JSON: an array of one object a file
    #[arg(long)]
    json: bool,
}

/// What a file is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Image,
    Hair,
    Mesh,
    Scene,
}

pub(crate) fn run(arguments: Arguments) -> Result<(), Failure> {
    let (mut found, mut failures) = (Vec::new(), Vec::new());
    for file in &arguments.files {
        match examine(file) {
            // At once: the next file may take long.
            Ok(facts) if !arguments.json => exit::print(text::lines(&facts).as_bytes())?,
            Ok(facts) => found.push(facts),
            Err(failure) => failures.push(failure),
        }
    }
    if arguments.json {
        let json = serde_json::to_string_pretty(&found).map_err(|e| Failure::Bug(format!("JSON: {e}")))?;
        exit::print(format!("{json}\n").as_bytes())?;
    }
    exit::unless_faulty(&failures)
}

/// Everything that is known of a file, or a message that names it.
fn examine(file: &Path) -> Result<facts::Facts, String> {
    let cannot_read = |e: std::io::Error| format!("{}: cannot read it: {e}", file.display());
    let metadata = std::fs::metadata(file).map_err(cannot_read)?;
    if metadata.is_dir() {
        return Err(format!("{}: it is a folder; name a file", file.display()));
    }
    if !metadata.is_file() {
        return Err(format!("{}: it is not a regular file", file.display()));
    }
    let mut head = Vec::new();
    File::open(file).and_then(|f| f.take(HEAD_BYTES).read_to_end(&mut head)).map_err(cannot_read)?;
    match kind(file, &head) {
        Some(Kind::Image) => facts::image(file),
        Some(Kind::Hair) => facts::hair(file),
        Some(Kind::Mesh) => facts::mesh(file),
        Some(Kind::Scene) => facts::scene(file),
        None => Err(format!(
            "{}: no kind of file that tress knows, by its ending and its first bytes; it reads hair (.hair, .tfx, .txt), meshes (.obj), images (.exr, .hdr, .png, .jpg, .tif) and scenes (.toml, .json)",
            file.display()
        )),
    }
}

/// How much of a file its kind is told from.
const HEAD_BYTES: u64 = 4096;

/// First bytes that leave no doubt.
const MAGIC: [(&[u8], Kind); 9] = [
    (b"HAIR", Kind::Hair),
    (b"\x76\x2f\x31\x01", Kind::Image),
    (b"#?RADIANCE", Kind::Image),
    (b"#?RGBE", Kind::Image),
    (b"\x89PNG\r\n\x1a\n", Kind::Image),
    (b"\xff\xd8\xff", Kind::Image),
    (b"II*\0", Kind::Image),
    (b"MM\0*", Kind::Image),
    (b"\0\0\x80\x40", Kind::Hair),
];

/// What the first bytes say without doubt, else the ending, else what the first lines look like.
fn kind(file: &Path, head: &[u8]) -> Option<Kind> {
    if let Some((_, kind)) = MAGIC.iter().find(|(magic, _)| head.starts_with(magic)) {
        return Some(*kind);
    }
    let ending = file.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    match ending.as_deref() {
        Some("hair" | "tfx" | "txt" | "text" | "curve" | "curves") => Some(Kind::Hair),
        Some("obj") => Some(Kind::Mesh),
        Some("exr" | "hdr" | "pic" | "png" | "jpg" | "jpeg" | "tif" | "tiff") => Some(Kind::Image),
        Some("toml" | "json") => Some(Kind::Scene),
        Some("mtl" | "rst" | "md") => None,
        _ => first_lines(head),
    }
}

/// A file without a known ending: four numbers a line are hair, `v` and three numbers a mesh.
fn first_lines(head: &[u8]) -> Option<Kind> {
    let text = String::from_utf8_lossy(head);
    let line = text.lines().map(str::trim).find(|line| {
        let first = line.split_whitespace().next();
        first.is_some_and(|word| !word.starts_with('#') && !matches!(word, "mtllib" | "o" | "g" | "s"))
    })?;
    let numbers = |words: &str| words.split_whitespace().filter(|word| word.parse::<f32>().is_ok()).count();
    match line.strip_prefix("v ") {
        Some(rest) if numbers(rest) >= 3 => Some(Kind::Mesh),
        None if numbers(line) == 4 && line.split_whitespace().count() == 4 => Some(Kind::Hair),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_comes_before_the_ending() {
        for (name, head, expected) in [
            ("a.obj", &b"HAIR\x01"[..], Some(Kind::Hair)),
            ("a.hair", b"\x76\x2f\x31\x01\x02", Some(Kind::Image)),
            ("a.hdr", b"nothing", Some(Kind::Image)),
            ("a.TFX", b"", Some(Kind::Hair)),
            ("a.Toml", b"", Some(Kind::Scene)),
            ("a", b"# a mesh\nmtllib a.mtl\n\nv 0 1e3 -.5\n", Some(Kind::Mesh)),
            ("a.dat", b"\n 0 1 2 0.5\n0 1 3 0.5\n", Some(Kind::Hair)),
            ("a.dat", b"0 1 2\n", None),
            ("a.mtl", b"v 0 0 0\n", None),
            ("a", b"v a b c", None),
            ("a", b"\xff\xfe\x00", None),
            ("a", b"", None),
        ] {
            assert_eq!(kind(Path::new(name), head), expected, "{name} {head:?}");
        }
    }
}
