//! `tress check`: finds the faults of scenes and of the files that they name, without rendering them.

use std::path::{Path, PathBuf};

use super::memory::Memory;
use super::{Failure, Overrides, Verbosity, exit, load, log};
use crate::illumination::{Mapping, Radiance};
use crate::render::memory::Work;
use crate::scene::{AssetError, Scene};

/// Check scenes and all files they name, and list every fault with its line; render nothing
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The scene files (.toml or .json)
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    memory: Memory,
    /// The frame whose files are read, where names hold a run of #
    #[arg(long, value_name = "N", default_value_t = 1)]
    frame: u32,
}

pub(crate) fn run(arguments: Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let mut faults = Vec::new();
    for scene in &arguments.scenes {
        match examine(scene, &arguments, verbosity) {
            // The next scene is looked at all the same.
            Err(Failure::Input(fault)) if arguments.scenes.len() > 1 => {
                faults.extend(fault.lines().map(|line| naming(scene, line)));
            }
            Err(Failure::Input(fault)) => faults.push(fault),
            ended => ended?,
        }
    }
    exit::unless_faulty(&faults)
}

/// A fault with its scene's name: what is wrong with `--set` may be so for one of several.
fn naming(scene: &Path, fault: &str) -> String {
    let name = scene.display().to_string();
    if fault.contains(&name) { fault.to_owned() } else { format!("{name}: {fault}") }
}

fn examine(scene: &Path, arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let document = load(scene, &arguments.overrides.all(), verbosity)?;
    let document = document.at_frame(arguments.frame);
    arguments.memory.check(&document, Work::Check)?;
    let scene = Scene::load(document)?;
    if verbosity.quiet {
        return Ok(());
    }
    notes(&scene.notes);
    exit::print(summary(&scene).as_bytes())
}

/// Prints what loading found worth telling.
pub(super) fn notes(notes: &[String]) {
    notes.iter().for_each(|note| log::say(&format!("note: {note}")));
}

impl From<AssetError> for Failure {
    fn from(error: AssetError) -> Self {
        Failure::Input(error.to_string())
    }
}

fn summary(scene: &Scene) -> String {
    let document = &scene.document;
    let lights = scene.direct.len() + scene.area.len();
    let triangles = scene.surfaces.mesh_triangles();
    let [width, height] = document.description.camera.resolution;
    [
        format!("{}: sound, {}", document.path.display(), count(document.warnings.len(), "warning")),
        format!("  picture      {width}x{height} pixels"),
        format!(
            "  hair         {}: {}, {}",
            count(scene.hair_objects.len(), "object"),
            count(scene.hair.object.len(), "strand"),
            count(scene.hair.segments(), "segment")
        ),
        format!(
            "  surfaces     {}: {}",
            count(document.description.surface.len(), "object"),
            count(triangles, "triangle")
        ),
        format!("  environment  {}", environment(&scene.radiance)),
        format!("  lights       {lights}\n"),
    ]
    .join("\n")
}

fn environment(radiance: &Radiance) -> String {
    match radiance {
        Radiance::Uniform(color) if color.max_element() <= 0.0 => "black".to_owned(),
        Radiance::Uniform(color) => format!("radiance {} {} {} everywhere", color.x, color.y, color.z),
        Radiance::Gradient { .. } => "gradient sky".to_owned(),
        Radiance::Map(map) => {
            let kind = match map.mapping {
                Mapping::LatLong => "lat-long",
                Mapping::Angular => "angular",
            };
            format!("{kind} map of {}x{} pixels", map.width, map.height)
        }
    }
}

/// "1 light", "2 lights".
pub(super) fn count(n: usize, thing: &str) -> String {
    format!("{n} {thing}{}", if n == 1 { "" } else { "s" })
}
