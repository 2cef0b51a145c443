//! `tress study`: what accuracy costs on a scene.

use std::path::PathBuf;

use super::memory::{Memory, thread_count};
use super::render::window;
use super::values::{self, Crop, Resolution};
use super::{Failure, Overrides, Verbosity, exit, interrupt, log, progress::Reporter};
use crate::render::RenderError;
use crate::render::memory::Work;
use crate::scene;
use crate::study::accuracy::{Options, Study, StudyError, results, study};

/// Measure what accuracy costs on a scene: error against time of the settings that trade one for the other
///
/// A converged reference is rendered, then pictures with many settings, one changed at a time and all together; FOLDER gets a page to look at (study.html), the numbers (study.csv, study.json) and the pictures. Times are CPU times. Stopped by Ctrl-C or a crash, the same command goes on where it was.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The scene file (.toml or .json)
    scene: PathBuf,
    /// The folder for the results; made if it is not there
    #[arg(long, short, value_name = "FOLDER")]
    output: PathBuf,
    /// Time that it may take, as in 90s, 5m or 1h: pictures become smaller and settings are left out until it fits. All of it at the scene's size unless given
    #[arg(long, value_name = "TIME", value_parser = values::duration)]
    budget: Option<f64>,
    /// Renders of each setting with different seeds; 2 or more tell noise from bias
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=100))]
    repeats: u32,
    /// Size of the pictures in pixels; the same as --set camera.resolution=
    #[arg(long, value_name = "WxH", value_parser = values::resolution)]
    resolution: Option<Resolution>,
    /// Study this part of the picture only, corners in pixels with x1, y1 outside; a budget makes it smaller around its middle, and its pixels stay as they are
    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = values::crop, allow_hyphen_values = true)]
    crop: Option<Crop>,
    /// Number of threads; one a processor unless given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    memory: Memory,
}

pub(crate) fn run(arguments: Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let folder = &arguments.output;
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::Output(format!("{}: it is a file; name a folder", folder.display())));
    }
    interrupt::install().map_err(|e| Failure::Bug(format!("cannot catch Ctrl-C: {e}")))?;
    let mut overrides = arguments.overrides.all();
    overrides.extend(arguments.resolution.map(Resolution::setting));
    // As large as the scene says, though a budget may ask for smaller pictures.
    let threads = arguments.threads.map(usize::from);
    let document = scene::load(&arguments.scene, &overrides)?;
    let crop = window(arguments.crop, &document)?;
    arguments.memory.check(&document, Work::Render { window: crop, threads: thread_count(threads) })?;
    let options = Options {
        overrides,
        crop,
        folder: folder.clone(),
        budget: arguments.budget,
        repeats: arguments.repeats,
        threads,
        command: std::env::args().collect::<Vec<_>>().join(" "),
    };
    let reporter = Reporter::new(verbosity);
    let found = study(&arguments.scene, &options, &reporter);
    drop(reporter);
    let found = match found {
        Err(StudyError::Render(RenderError::Cancelled)) => {
            if !verbosity.quiet {
                log::say("what was measured is kept: the same command goes on from here");
            }
            return Err(Failure::Interrupted);
        }
        found => found?,
    };
    if verbosity.quiet {
        return Ok(());
    }
    exit::print(text(&found, &folder.join("study.html").display().to_string()).as_bytes())
}

/// What was found, in a few lines.
fn text(study: &Study, page: &str) -> String {
    let [width, height] = study.size;
    let mut lines = vec![format!(
        "{}: {} settings at {width}x{height} pixels, {} renders each; reference known to {}",
        study.scene,
        study.points.len(),
        study.repeats,
        results::percent(study.reference.standard_error)
    )];
    lines.extend(study.cut.iter().map(|cut| format!("cut: {cut}")));
    for advice in &study.advice {
        lines.push(advice.text.clone());
        lines.push(format!("  {}", advice.command));
    }
    lines.push(format!("look at {page}\n"));
    lines.join("\n")
}

impl From<StudyError> for Failure {
    fn from(error: StudyError) -> Self {
        match error {
            StudyError::Render(error) => error.into(),
            StudyError::Output { .. } => Failure::Output(error.to_string()),
            _ => Failure::Input(error.to_string()),
        }
    }
}
