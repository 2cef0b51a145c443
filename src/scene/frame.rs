//! Numbered frames: a run of `#` in a file's name stands for the frame.

use std::path::{Path, PathBuf};

use super::Document;

/// The path of one frame: the last run of `#` in the file's name becomes the number, padded with zeros to its length.
pub fn frame_path(pattern: &Path, frame: u32) -> PathBuf {
    let Some(name) = pattern.file_name().and_then(|name| name.to_str()) else { return pattern.to_owned() };
    let Some(last) = name.rfind('#') else { return pattern.to_owned() };
    let first =
        name[..last].rfind(|c| c != '#').map_or(0, |at| at + name[at..].chars().next().map_or(1, char::len_utf8));
    let width = last + 1 - first;
    pattern.with_file_name(format!("{}{frame:0width$}{}", &name[..first], &name[last + 1..]))
}

/// Whether a path depends on the frame.
pub fn is_numbered(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().contains('#'))
}

impl Document {
    /// The scene of one frame: the files that it names with a run of `#` are those of the frame.
    pub fn at_frame(&self, frame: u32) -> Self {
        let mut document = self.clone();
        let scene = &mut document.description;
        let hair = scene.hair.iter_mut().filter_map(|hair| hair.file.as_mut());
        let surfaces = scene.surface.iter_mut().filter_map(|surface| surface.file.as_mut());
        for file in hair.chain(surfaces).chain(scene.environment.file.as_mut()) {
            *file = frame_path(file, frame);
        }
        document
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_paths() {
        let path = |pattern: &str, frame| frame_path(Path::new(pattern), frame).to_str().unwrap().to_owned();
        assert_eq!(path("out/a.####.exr", 7), "out/a.0007.exr");
        assert_eq!(path("#.exr", 12345), "12345.exr");
        assert_eq!(path("##a##.exr", 7), "##a07.exr");
        assert_eq!(path("é##.exr", 7), "é07.exr");
        assert_eq!(path("##/a.exr", 7), "##/a.exr");
        assert_eq!(path("", 7), "");
    }
}
