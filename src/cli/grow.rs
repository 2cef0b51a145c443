//! `tress grow`: grows a scene's hair and writes it to a file.

use std::path::PathBuf;

use super::{Failure, Overrides, Verbosity, load, values};
use crate::scene::Document;

/// Grow the hair of a scene and write it to a HAIR file
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The scene file (.toml or .json)
    scene: PathBuf,
    /// The file to write (.hair)
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    overrides: Overrides,
}

pub(crate) fn run(arguments: Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let document = load(&arguments.scene, &arguments.overrides.set, verbosity)?;
    if !document.description.hair.iter().any(|hair| hair.grow.is_some()) {
        let scene = arguments.scene.display();
        return Err(Failure::Input(format!("{scene}: no hair of this scene is grown; give a [[hair]] the key grow")));
    }
    values::folder_exists(&arguments.output)?;
    grow(&document, &arguments.output)
}

/// Grows the hair of a checked scene and writes it.
fn grow(_: &Document, _: &std::path::Path) -> Result<(), Failure> {
    Err(Failure::Bug("this build cannot grow hair yet".to_owned()))
}
