//! `tress info`: what is in a hair file, mesh or image.

use std::path::{Path, PathBuf};

use super::{Failure, exit};

/// Say what is in a hair file, a mesh or an image
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The file
    file: PathBuf,
}

pub(crate) fn run(arguments: Arguments) -> Result<(), Failure> {
    let file = &arguments.file;
    let metadata =
        std::fs::metadata(file).map_err(|e| Failure::Input(format!("{}: cannot read it: {e}", file.display())))?;
    if metadata.is_dir() {
        return Err(Failure::Input(format!("{}: it is a folder; name a file", file.display())));
    }
    exit::print(describe(file)?.as_bytes())
}

/// The description of a file's contents, as lines.
fn describe(file: &Path) -> Result<String, Failure> {
    Err(Failure::Bug(format!("{}: this build cannot describe files yet", file.display())))
}
