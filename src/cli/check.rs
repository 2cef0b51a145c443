//! `tress check`: finds the faults of a scene without rendering it.

use std::path::PathBuf;

use super::{Failure, Overrides, Verbosity, exit, load};

/// Check a scene and list every fault with its line; render nothing
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The scene file (.toml or .json)
    scene: PathBuf,
    #[command(flatten)]
    overrides: Overrides,
}

pub(crate) fn run(arguments: Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let document = load(&arguments.scene, &arguments.overrides.set, verbosity)?;
    if verbosity.quiet {
        return Ok(());
    }
    let scene = &document.description;
    let lights = scene.light.point.len() + scene.light.directional.len() + scene.light.rect.len();
    let line = format!(
        "{}: sound: {}, {}, {}; {}\n",
        document.path.display(),
        count(scene.hair.len(), "hair object"),
        count(scene.surface.len(), "surface"),
        count(lights, "light"),
        count(document.warnings.len(), "warning"),
    );
    exit::print(line.as_bytes())
}

/// "1 light", "2 lights".
fn count(n: usize, thing: &str) -> String {
    format!("{n} {thing}{}", if n == 1 { "" } else { "s" })
}
