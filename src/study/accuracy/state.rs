//! What a study has measured so far: a file of JSON lines, one a render, so that an interrupted study goes on where it was.
//!
//! A line is written when its picture is on disk. Lines that cannot be read (the last one of a machine that went down) are as if they were
//! not there. A key is a hash of all that a render depends on, so that a changed scene, setting or program finds nothing.

use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{Error, Read, Result, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::errors::Picture;
use crate::image::{self, ImageSpec, Limits, PixelFormat, RgbImage};
use crate::render::statistics::Stage;

/// The largest state file that is read, in bytes.
const MAX_BYTES: u64 = 64 << 20;

/// A finished render.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    pub key: String,
    /// What it was, for people who read the file.
    pub label: String,
    pub seed: u32,
    pub stages: Vec<Stage>,
    /// Largest resident memory, in bytes: of this render alone where `own_peak`, else of the process so far.
    pub peak_bytes: u64,
    pub own_peak: bool,
}

impl Measured {
    /// CPU and wall time of all stages, in seconds.
    #[must_use]
    pub fn seconds(&self) -> [f64; 2] {
        self.stages.iter().fold([0.0; 2], |[cpu, wall], stage| [cpu + stage.cpu_seconds, wall + stage.seconds])
    }
}

/// The state file of a folder, and the pictures beside it.
#[derive(Debug)]
pub struct State {
    folder: PathBuf,
    file: File,
    lines: HashMap<String, Measured>,
}

impl State {
    /// Opens or begins the state of a folder.
    ///
    /// # Errors
    /// The system's.
    pub fn open(folder: &Path) -> Result<Self> {
        std::fs::create_dir_all(folder.join("pictures"))?;
        let path = folder.join("state.jsonl");
        if path.exists() && !path.metadata()?.is_file() {
            return Err(Error::other("state.jsonl is no regular file"));
        }
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(&path)?;
        if file.metadata()?.len() > MAX_BYTES {
            return Err(Error::other("state.jsonl has more than 64 MiB; take another folder"));
        }
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(0))?;
        Read::by_ref(&mut file).take(MAX_BYTES).read_to_end(&mut bytes)?;
        let parsed = bytes.split(|&byte| byte == b'\n').filter_map(|line| serde_json::from_slice(line).ok());
        let lines = parsed.map(|measured: Measured| (measured.key.clone(), measured)).collect();
        if bytes.last().is_some_and(|&last| last != b'\n') {
            // Half a line must not spoil the next.
            file.write_all(b"\n")?;
        }
        Ok(Self { folder: folder.to_owned(), file, lines })
    }

    fn picture_path(&self, key: &str) -> PathBuf {
        self.folder.join("pictures").join(format!("{}.exr", &key[..key.len().min(24)]))
    }

    /// A render that was done before, with its picture; none where either is missing or unsound.
    #[must_use]
    pub fn find(&self, key: &str) -> Option<(Measured, Picture)> {
        let measured = self.lines.get(key)?;
        Some((measured.clone(), read_picture(&self.picture_path(key))?))
    }

    /// Keeps a render.
    ///
    /// # Errors
    /// The system's.
    pub fn keep(&mut self, measured: &Measured, picture: &Picture) -> Result<()> {
        write_picture(&self.picture_path(&measured.key), picture).map_err(|e| Error::other(e.to_string()))?;
        let mut line = serde_json::to_vec(measured).map_err(Error::other)?;
        line.push(b'\n');
        self.file.write_all(&line)?;
        self.file.sync_data()?;
        self.lines.insert(measured.key.clone(), measured.clone());
        Ok(())
    }
}

/// The hash of texts, each with its end.
#[must_use]
pub fn key(parts: &[&str]) -> String {
    let mut hasher = Sha256::new();
    for part in parts {
        hasher.update(part.as_bytes());
        hasher.update([0]);
    }
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The hash of a file's bytes; what the system says in its place where it cannot be read.
#[must_use]
pub fn file_hash(path: &Path) -> String {
    let hash = || -> Result<String> {
        let mut hasher = Sha256::new();
        let mut file = File::open(path)?;
        let mut buffer = vec![0; 1 << 16];
        loop {
            match file.read(&mut buffer)? {
                0 => break,
                n => hasher.update(&buffer[..n]),
            }
        }
        Ok(hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
    };
    hash().unwrap_or_else(|e| e.to_string())
}

fn write_picture(path: &Path, picture: &Picture) -> std::result::Result<(), image::Error> {
    let channels = ["R", "G", "B", "A"].map(|name| (name.to_owned(), PixelFormat::Float)).to_vec();
    let values: Vec<f32> =
        picture.rgb.pixels.iter().zip(&picture.alpha).flat_map(|(&[r, g, b], &a)| [r, g, b, a]).collect();
    image::write_atomic(path, &ImageSpec::new(picture.rgb.width, picture.rgb.height, channels), &values).map(|_| ())
}

fn read_picture(path: &Path) -> Option<Picture> {
    let image = image::read(path, &Limits::default()).ok()?;
    let alpha = image.channel("A")?;
    let alpha = image.pixels.chunks_exact(image.channels.len()).map(|pixel| pixel[alpha]).collect();
    let rgb: RgbImage = image.rgb().ok()?;
    Some(Picture { rgb, alpha })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(key: &str) -> Measured {
        let stage = Stage { name: "rendering".to_owned(), seconds: 1.5, cpu_seconds: 2.5, peak_bytes: 7 };
        Measured {
            key: key.to_owned(),
            label: "x".to_owned(),
            seed: 3,
            stages: vec![stage],
            peak_bytes: 7,
            own_peak: true,
        }
    }

    fn picture() -> Picture {
        let rgb = RgbImage { width: 2, height: 1, pixels: vec![[0.1, 0.2, 0.3], [4.0, 5.0, 6.0]] };
        Picture { rgb, alpha: vec![1.0, 0.5] }
    }

    #[test]
    fn a_state_is_found_again_though_its_last_line_is_half() {
        let folder = tempfile::tempdir().unwrap();
        State::open(folder.path()).unwrap().keep(&measured("aaaa"), &picture()).unwrap();
        let path = folder.path().join("state.jsonl");
        let mut bytes = std::fs::read(&path).unwrap();
        bytes.extend_from_slice(&bytes.clone()[..20]);
        std::fs::write(&path, &bytes).unwrap();
        let mut state = State::open(folder.path()).unwrap();
        assert_eq!(state.find("aaaa"), Some((measured("aaaa"), picture())));
        assert_eq!(state.find("bbbb"), None);
        state.keep(&measured("bbbb"), &picture()).unwrap();
        let state = State::open(folder.path()).unwrap();
        assert!(state.find("aaaa").is_some() && state.find("bbbb").is_some());
        // Without its picture a line is worth nothing.
        std::fs::remove_file(state.picture_path("aaaa")).unwrap();
        assert_eq!(state.find("aaaa"), None);
    }

    #[test]
    fn keys_tell_texts_apart() {
        assert_ne!(key(&["ab", "c"]), key(&["a", "bc"]));
        assert_eq!(key(&["a"]), key(&["a"]));
    }
}
