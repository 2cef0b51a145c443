//! `tress plan`: which effects a scene calls for and why, and what a render of it will take.

use std::path::PathBuf;

use serde::Serialize;

use super::check::notes;
use super::memory::thread_count;
use super::summary::grouped;
use super::values::{self, Resolution};
use super::{Failure, Overrides, Verbosity, exit, interrupt, load, progress::Reporter};
use crate::effects::{Effect, Effects};
use crate::render::memory::{Part, Work, amount, estimate};
use crate::render::progress::Progress;
use crate::render::{self, Options, Statistics};
use crate::scene::Scene;

/// Pixels of the probe.
const PROBE: f64 = 48.0 * 48.0;

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
}

/// What a render is expected to do and take.
#[derive(Serialize)]
struct Plan {
    scene: String,
    effects: Vec<Effect>,
    /// CPU seconds of each part; none without a probe.
    #[serde(skip_serializing_if = "Option::is_none")]
    cpu_seconds: Option<Vec<Cost>>,
    /// Bytes that are held at the same time at the most.
    memory: Vec<Part>,
}

#[derive(Serialize)]
struct Cost {
    part: String,
    seconds: f64,
}

pub(crate) fn run(arguments: Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let mut overrides = arguments.overrides.all();
    overrides.extend(arguments.resolution.map(Resolution::setting));
    let document = load(&arguments.scene, &overrides, verbosity)?.at_frame(arguments.frame);
    interrupt::install().map_err(|e| Failure::Bug(format!("cannot catch Ctrl-C: {e}")))?;
    let threads = arguments.threads.map(usize::from);
    let memory = estimate(&document, Work::Render { window: None, threads: thread_count(threads) }).parts;
    let mut scene = Scene::load(document)?;
    if !verbosity.quiet {
        notes(&scene.notes);
    }
    let effects = Effects::of(&scene).list(&scene.description().effects.without);
    let cpu_seconds = if arguments.no_probe {
        None
    } else {
        let reporter = Reporter::new(verbosity);
        Some(probe(&mut scene, threads, &reporter)?)
    };
    let plan = Plan { scene: scene.document.path.display().to_string(), effects, cpu_seconds, memory };
    let text = if arguments.json {
        serde_json::to_string_pretty(&plan).map_err(|e| Failure::Bug(e.to_string()))? + "\n"
    } else {
        lines(&plan).join("\n") + "\n"
    };
    exit::print(text.as_bytes())
}

/// Renders the scene small and scales the times.
fn probe(scene: &mut Scene, threads: Option<usize>, progress: &dyn Progress) -> Result<Vec<Cost>, Failure> {
    let [width, height] = scene.camera.resolution().map(f64::from);
    let shrink = (width * height / PROBE).sqrt().max(1.0);
    let small = [width, height].map(|side| (side / shrink).round().max(1.0) as u32);
    scene.camera = scene.camera.with_resolution(small);
    let (_, statistics) = render::render(scene, &Options { window: None, threads }, progress)?;
    let pixels = width * height / (f64::from(small[0]) * f64::from(small[1]));
    Ok(costs(&statistics, pixels))
}

/// The parts of a render of `pixels` times the probe's pixels. Structures take what they take.
fn costs(probe: &Statistics, pixels: f64) -> Vec<Cost> {
    let cost = |part: &str, seconds| Cost { part: part.to_owned(), seconds };
    let fixed = probe.stages.iter().filter(|stage| stage.name != "rendering");
    let parts = &probe.cpu_seconds;
    let scaled = [
        // Segments of hair cover more pixels as these shrink, in proportion to their length only.
        ("fragments", parts.fragments * pixels.sqrt()),
        ("hair occlusion", parts.gamma * pixels),
        ("arriving light", parts.lambda * pixels),
        ("point and directional lights", parts.direct * pixels),
    ];
    fixed
        .map(|stage| cost(&stage.name, stage.cpu_seconds))
        .chain(scaled.into_iter().map(|(part, seconds)| cost(part, seconds)))
        .collect()
}

fn lines(plan: &Plan) -> Vec<String> {
    let mut lines = vec![format!("{}: effects", plan.scene)];
    let widest = plan.effects.iter().map(|effect| effect.name.len()).max().unwrap_or(0);
    for Effect { name, on, reason } in &plan.effects {
        lines.push(format!("  {} {name:widest$}  {reason}", if *on { "on " } else { "off" }));
    }
    if let Some(costs) = &plan.cpu_seconds {
        let all: f64 = costs.iter().map(|cost| cost.seconds).sum();
        lines.push(format!("CPU time, from a small picture: some {all:.1} s"));
        lines.extend(costs.iter().map(|cost| format!("  {:>9.2} s  {}", cost.seconds, cost.part)));
    }
    let all: u64 = plan.memory.iter().map(|part| part.bytes).sum();
    lines.push(format!("memory, from counts: some {} ({} bytes)", amount(all), grouped(all)));
    lines.extend(plan.memory.iter().map(|part| format!("  {:>9}  {}", amount(part.bytes), part.what)));
    lines
}
