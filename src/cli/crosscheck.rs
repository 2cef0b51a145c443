//! `tress crosscheck`: holds the projection of hair against rays through it, at points of the picture.

use std::path::{Path, PathBuf};

use super::check::notes;
use super::memory::{Memory, thread_count};
use super::render::window;
use super::summary::grouped;
use super::values::{self, Crop, Resolution};
use super::{Failure, Overrides, Verbosity, exit, interrupt, load, log, progress::Reporter};
use crate::render::memory::Work;
use crate::render::progress::Progress;
use crate::scene::Scene;
use crate::study::report::{Compared, Part, Site};
use crate::study::shadow_check::Shadow;
use crate::study::statistics::{Estimate, Summary};
use crate::study::{Report, Settings, Verdict, crosscheck, plot};

/// Compare the two ways to find hair occlusion, igloo and rays, at points that a render of the scene shades
///
/// Sky visibility (the mean of hair occlusion over all directions) is found at each point by projection with the scene's settings and by many rays, in two halves so that their noise is known. It says by how much they differ, on hair and on surfaces, and by the distance of the hair. Deep shadow maps are held against rays at the same points, spread over the pixels that the map weights. Exit status 5 means that the RMS difference of sky visibility, without the noise, exceeds the accuracy, or the mean difference of a deep shadow map does, or its RMS five times that.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The scene file (.toml or .json)
    scene: PathBuf,
    /// Points to compare at: half on hair, half on surfaces
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(16..=1_000_000))]
    points: u32,
    /// Rays a point; by the accuracy unless given: 10000 for 0.01
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000_000))]
    rays: Option<u32>,
    /// RMS difference of sky visibility that is allowed, above 0 to 1; the scene's unless given
    #[arg(long, value_name = "X", value_parser = values::accuracy, allow_negative_numbers = true)]
    accuracy: Option<f64>,
    /// Write the result with all points to this file as JSON; - is standard output, in place of the text
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the points to this file (.svg): projection against rays, and their difference
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Size of the picture in pixels; the same as --set camera.resolution=
    #[arg(long, value_name = "WxH", value_parser = values::resolution)]
    resolution: Option<Resolution>,
    /// Take points of these pixels only: columns x0 to before x1, rows y0 to before y1, from the top left
    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = values::crop, allow_hyphen_values = true)]
    crop: Option<Crop>,
    /// The frame whose files are read, where names hold a run of #
    #[arg(long, value_name = "N", default_value_t = 1)]
    frame: u32,
    /// Number of threads; one a processor unless given. The result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    memory: Memory,
    /// Seed of all random numbers, also of those that choose the points; the same as --set sampling.seed=
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u32>,
}

pub(crate) fn run(arguments: Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let mut overrides = arguments.overrides.all();
    overrides.extend(arguments.resolution.map(Resolution::setting));
    overrides.extend(arguments.seed.map(|seed| format!("sampling.seed={seed}")));
    let document = load(&arguments.scene, &overrides, verbosity)?.at_frame(arguments.frame);
    let settings = Settings {
        points: arguments.points as usize,
        rays: arguments.rays,
        accuracy: arguments.accuracy,
        window: window(arguments.crop, &document)?,
        threads: arguments.threads.map(usize::from),
    };
    let json = arguments.json.as_deref().filter(|path| path.as_os_str() != "-");
    for path in json.into_iter().chain(arguments.plot.as_deref()) {
        values::folder_exists(path)?;
    }
    if let Some(path) = arguments.plot.as_deref().filter(|path| !is_svg(path)) {
        let message = format!("{}: plots are drawn as SVG only; let the name end in .svg", path.display());
        return Err(Failure::Usage(message));
    }
    let threads = thread_count(settings.threads);
    arguments.memory.check(&document, Work::Crosscheck { window: settings.window, threads })?;
    interrupt::install().map_err(|e| Failure::Bug(format!("cannot catch Ctrl-C: {e}")))?;
    let reporter = Reporter::new(verbosity);
    reporter.stage("loading", 0);
    let mut scene = Scene::load(document)?;
    if !verbosity.quiet {
        notes(&scene.notes);
    }
    let report = crosscheck(&mut scene, &settings, &reporter)?;
    // Its bar goes before the result comes.
    drop(reporter);
    if arguments.json.is_some() && json.is_none() {
        exit::print(json_of(&report)?.as_bytes())?;
    } else if !verbosity.quiet {
        exit::print((lines(&report, true).join("\n") + "\n").as_bytes())?;
    }
    if let Some(path) = json {
        exit::write_text(path, &json_of(&report)?, "it")?;
    }
    match &arguments.plot {
        Some(path) if report.points.is_empty() => {
            log::say(&format!("note: {}: not written, there are no points to plot", path.display()));
        }
        Some(path) => {
            exit::write_text(path, &plot::svg(&report).map_err(|e| Failure::Bug(e.to_string()))?, "it")?;
        }
        None => {}
    }
    verdict(&report)
}

fn is_svg(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg"))
}

fn json_of(report: &Report) -> Result<String, Failure> {
    serde_json::to_string_pretty(report).map(|text| text + "\n").map_err(|e| Failure::Bug(e.to_string()))
}

/// An error where the estimators differ by more than the accuracy, or deep shadow maps from rays.
pub(super) fn verdict(report: &Report) -> Result<(), Failure> {
    if report.verdict != Verdict::Exceeded {
        return Ok(());
    }
    let Report { scene, accuracy, .. } = report;
    let faults = [
        (
            occlusion_faults(report),
            "the two estimators of hair occlusion differ by more than the accuracy of",
            ": RMS",
            "ask for a finer occlusion.accuracy in place of occlusion.opening, or set occlusion.mode = \"raytraced\"",
        ),
        (
            shadow_faults(report),
            "deep shadow maps differ from rays by more than the accuracy of",
            " in the mean, or five times that RMS:",
            "give these lights a smaller map_error, or shadows = \"raytraced\"",
        ),
    ];
    let said = faults.into_iter().filter(|(faults, ..)| !faults.is_empty());
    let said = said
        .map(|(faults, what, how, advice)| format!("{scene}: {what} {accuracy}{how} {}\n{advice}", faults.join(", ")));
    Err(Failure::Disagreement(said.collect::<Vec<_>>().join("\n")))
}

/// The sets of points over which the estimators of Γ differ by too much.
fn occlusion_faults(report: &Report) -> Vec<String> {
    let beyond = |part: &&Part| part.summary.rms.low.is_some_and(|low| low > report.accuracy);
    let fault = |(name, part): (&str, &Part)| {
        let rms = &part.summary.rms;
        format!("{:.4} {name} (at least {:.4})", rms.value, rms.low.unwrap_or_default())
    };
    report.judged().filter(|(_, part)| beyond(part)).map(fault).collect()
}

/// The lights whose deep shadow maps are too far from rays.
fn shadow_faults(report: &Report) -> Vec<String> {
    let figures = |name: &str, part: &Option<Summary>| {
        part.as_ref().map(|s| format!("{:+.4} on {name} (RMS {:.4})", s.mean.value, s.rms.value))
    };
    let beyond = report.shadows.iter().filter(|shadow| shadow.verdict(report.accuracy) == Verdict::Exceeded);
    let fault = |shadow: &Shadow| {
        let kinds = [figures("hair", &shadow.hair), figures("surfaces", &shadow.surface)];
        format!("{} {}", shadow.light, kinds.into_iter().flatten().collect::<Vec<_>>().join(" and "))
    };
    beyond.map(fault).collect()
}

/// The result in words and a table; with `details` also by distance of the hair.
pub(super) fn lines(report: &Report, details: bool) -> Vec<String> {
    if report.points.is_empty() {
        let reason = if report.has_hair { "no hair and no surface is in the picture" } else { "the scene has no hair" };
        return vec![format!("cross-check: {}: nothing to compare: {reason}", report.scene)];
    }
    let count = |part: &Option<Part>| grouped(part.as_ref().map_or(0, |part| part.summary.points as u64));
    let mut lines = vec![
        format!(
            "cross-check: {}: {} of {} points on hair, {} of {} on surfaces, {} rays each",
            report.scene,
            count(&report.hair),
            grouped(report.population.hair),
            count(&report.surface),
            grouped(report.population.surface),
            grouped(u64::from(report.rays)),
        ),
        "sky visibility (0 to 1) by projection, less that by rays; RMS without the noise of the rays, with its 95 % interval:".to_owned(),
        format!("  {:<22}{:>7}  {:<18}  {:<26}  {:<6}  {:>7}", "", "points", "mean", "RMS", "noise", "largest"),
    ];
    let rows = [("all", &report.all), ("hair", &report.hair), ("surfaces", &report.surface)];
    for (name, part) in rows {
        lines.extend(part.as_ref().map(|part| row(name, part)));
    }
    for (name, part) in [("hair", &report.hair), ("surfaces", &report.surface)] {
        let Some(part) = part.as_ref().filter(|_| details) else { continue };
        lines.push(format!("on {name}, by the mean distance of the hair that rays meet first, in scene units:"));
        lines.extend(part.by_distance.iter().map(|bin| {
            let name =
                bin.distance.map_or("none met".to_owned(), |[from, to]| format!("{} to {}", short(from), short(to)));
            row(&name, &bin.part)
        }));
    }
    for part in [&report.hair, &report.surface].into_iter().flatten() {
        lines.push(format!("largest {}", place(&part.largest)));
    }
    lines.extend(shadows(report));
    lines.push(match report.verdict {
        Verdict::Held => format!("the accuracy of {} is held", report.accuracy),
        Verdict::Exceeded => format!("the accuracy of {} is not held", report.accuracy),
        Verdict::Undecided | Verdict::Nothing => format!(
            "whether the accuracy of {} is held cannot be told from so few points: tress crosscheck with more --points narrows the interval",
            report.accuracy
        ),
    });
    lines
}

/// Deep shadow maps; nothing where there are none.
fn shadows(report: &Report) -> Vec<String> {
    let Some(first) = report.shadows.first() else { return Vec::new() };
    let mut lines = vec![format!(
        "light left by hair (0 to 1) by deep shadow map, less that by rays over the map's pixels, {} a pixel:",
        first.rays
    )];
    for shadow in &report.shadows {
        for (name, summary) in [("hair", &shadow.hair), ("surfaces", &shadow.surface)] {
            let named = |summary| figures(&format!("{} on {name}", shadow.light), summary);
            lines.extend(summary.as_ref().map(named));
        }
    }
    lines
}

fn row(name: &str, part: &Part) -> String {
    format!("{}  {:>+7.4}", figures(name, &part.summary), part.largest.difference)
}

fn figures(name: &str, summary: &Summary) -> String {
    let Summary { points, mean, standard_error, rms, noise, .. } = summary;
    let error = standard_error.map_or(String::new(), |error| format!(" ± {error:.5}"));
    let mean = format!("{:+.5}{error}", mean.value);
    // A longer name takes room from the number.
    let room = 29_usize.saturating_sub(name.chars().count().max(22));
    format!(
        "  {name:<22} {:>room$}  {mean:<18}  {:<26}  {noise:<6.4}",
        grouped(*points as u64),
        interval(rms),
        room = room.saturating_sub(1)
    )
}

fn interval(estimate: &Estimate) -> String {
    match (estimate.low, estimate.high) {
        (Some(low), Some(high)) => format!("{:.5} ({low:.5} to {high:.5})", estimate.value),
        _ => format!("{:.5}", estimate.value),
    }
}

fn place(point: &Compared) -> String {
    let [x, y] = point.pixel;
    let site = match &point.site {
        Site::Hair { object, strand, segment } => {
            format!("on hair: pixel {x},{y}, {object}, strand {strand}, segment {segment}")
        }
        Site::Surface { triangle } => format!("on surfaces: pixel {x},{y}, triangle {triangle}"),
    };
    format!("{site}: projection {:.4}, rays {:.4}", point.projection, point.rays)
}

/// A length to three digits.
fn short(length: f64) -> String {
    if length == 0.0 || (1e-3..1e6).contains(&length) {
        let digits = (2.0 - length.max(1e-3).log10().floor()).clamp(0.0, 5.0) as usize;
        format!("{length:.digits$}")
    } else {
        format!("{length:.2e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_short() {
        assert_eq!(
            [0.0, 0.012345, 1.5, 123.4, 99_999.0, 3e-7].map(short),
            ["0.00000", "0.0123", "1.50", "123", "99999", "3.00e-7"]
        );
    }
}
