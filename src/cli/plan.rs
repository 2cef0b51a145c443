//! `tress plan`: which effects a scene calls for and why, and what a render of it will take.

use std::path::PathBuf;

use serde::Serialize;

use super::check::notes;
use super::memory::{Memory, thread_count};
use super::summary::grouped;
use super::values::{self, Resolution};
use super::{Failure, Overrides, Verbosity, exit, interrupt, load, progress::Reporter};
use crate::effects::{Effect, Effects};
use crate::render::Options;
use crate::render::memory::{Part, Work, amount, estimate};
use crate::render::plan::{self, Plan as Expected};
use crate::scene::Scene;

/// Say which effects a scene calls for, and estimate what its render takes
///
/// Each effect is on or off for a reason. Times come from a probe: the scene rendered small; what grows with the picture is scaled by the number of pixels. Memory comes from counts.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The scene file (.toml or .json)
    scene: PathBuf,
    /// Leave out the probe: effects and memory only
    #[arg(long)]
    no_probe: bool,
    /// Print JSON in place of the tables
    #[arg(long)]
    json: bool,
    /// Size of the picture in pixels; the same as --set camera.resolution=
    #[arg(long, value_name = "WxH", value_parser = values::resolution)]
    resolution: Option<Resolution>,
    /// The frame whose files are read, where names hold a run of #
    #[arg(long, value_name = "N", default_value_t = 1)]
    frame: u32,
    /// Number of threads; one a processor unless given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    memory: Memory,
}

/// What a render is expected to do and take.
#[derive(Serialize)]
struct Plan {
    scene: String,
    effects: Vec<Effect>,
    /// CPU seconds of each part; none without a probe.
    #[serde(skip_serializing_if = "Option::is_none")]
    cpu_seconds: Option<Vec<Seconds>>,
    /// Bytes that the structures of each effect hold; none without a probe.
    #[serde(skip_serializing_if = "Option::is_none")]
    structures: Option<Vec<Part>>,
    /// Bytes that are held at the same time at the most.
    memory: Vec<Part>,
}

#[derive(Serialize)]
struct Seconds {
    part: String,
    seconds: f64,
}

pub(crate) fn run(arguments: Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let mut overrides = arguments.overrides.all();
    overrides.extend(arguments.resolution.map(Resolution::setting));
    let document = load(&arguments.scene, &overrides, verbosity)?.at_frame(arguments.frame);
    interrupt::install().map_err(|e| Failure::Bug(format!("cannot catch Ctrl-C: {e}")))?;
    let threads = arguments.threads.map(usize::from);
    let work = Work::Render { window: None, threads: thread_count(threads) };
    arguments.memory.check(&document, work)?;
    let memory = estimate(&document, work).parts;
    let mut scene = Scene::load(document)?;
    if !verbosity.quiet {
        notes(&scene.notes);
    }
    let effects = Effects::of(&scene).list(&scene.description().effects);
    let expected = if arguments.no_probe {
        None
    } else {
        let reporter = Reporter::new(verbosity);
        Some(plan::probe(&mut scene, &Options { window: None, threads }, &reporter)?)
    };
    let scene = scene.document.path.display().to_string();
    let (cpu_seconds, structures) = (expected.as_ref().map(seconds), expected.as_ref().map(structures));
    let plan = Plan { scene, effects, cpu_seconds, structures, memory };
    let text = if arguments.json {
        serde_json::to_string_pretty(&plan).map_err(|e| Failure::Bug(e.to_string()))? + "\n"
    } else {
        lines(&plan).join("\n") + "\n"
    };
    exit::print(text.as_bytes())
}

/// What takes any time, each effect by its name.
fn seconds(expected: &Expected) -> Vec<Seconds> {
    let effects = expected.costs.iter().filter_map(|cost| Some((cost.name, cost.planned?.cpu_seconds)));
    effects
        .chain([("all else", expected.rest)])
        .filter(|(_, seconds)| *seconds > 0.0)
        .map(|(part, seconds)| Seconds { part: part.to_owned(), seconds })
        .collect()
}

/// What holds any memory.
fn structures(expected: &Expected) -> Vec<Part> {
    let part = |cost: &crate::render::costs::Cost| Part { what: cost.name.to_owned(), bytes: cost.bytes };
    expected.costs.iter().map(part).filter(|part| part.bytes > 0).collect()
}

fn lines(plan: &Plan) -> Vec<String> {
    let mut lines = vec![format!("{}: effects", plan.scene)];
    let widest = plan.effects.iter().map(|effect| effect.name.len()).max().unwrap_or(0);
    for Effect { name, on, reason, .. } in &plan.effects {
        lines.push(format!("  {} {name:widest$}  {reason}", if *on { "on: " } else { "off:" }));
    }
    if let Some(costs) = &plan.cpu_seconds {
        let all: f64 = costs.iter().map(|cost| cost.seconds).sum();
        lines.push(format!("CPU time, from a small picture: some {all:.1} s"));
        lines.extend(costs.iter().map(|cost| format!("  {:>9.2} s  {}", cost.seconds, cost.part)));
    }
    if let Some(structures) = &plan.structures {
        lines.push("memory of structures, from the same picture".to_owned());
        lines.extend(structures.iter().map(|part| format!("  {:>13}  {}", amount(part.bytes), part.what)));
    }
    let all: u64 = plan.memory.iter().map(|part| part.bytes).sum();
    lines.push(format!("memory, from counts: some {} ({} bytes)", amount(all), grouped(all)));
    lines.extend(plan.memory.iter().map(|part| format!("  {:>9}  {}", amount(part.bytes), part.what)));
    lines
}
