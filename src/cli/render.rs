//! `tress render`: turns the command line and a scene into a [`RenderRequest`].

use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;

use super::exit::{print, write_text};
use super::memory::{Memory, thread_count};
use super::values::{self, Crop, Frames, Resolution};
use super::{Failure, Overrides, Verbosity, crosscheck, interrupt, load, pixel, progress::Reporter, summary};
use crate::embree;
use crate::fragment::PixelRect;
use crate::render::memory::Work;
use crate::render::{self, Options, RenderError, Statistics, output, plan, progress::Progress, statistics::Watch};
use crate::scene::frame::frame_path;
use crate::scene::{Document, Scene};
use crate::study;
use crate::study::controlled::{Goal, render_to};

/// Render a scene to an image
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The scene file (.toml or .json)
    scene: PathBuf,
    /// The image to write; its ending says the format, a run of # stands for the frame number. Comes before output.file of the scene; may be given several times
    #[arg(long, short, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// How hair occlusion is found; the same as --set occlusion.mode=
    #[arg(long, value_name = "MODE", value_parser = PossibleValuesParser::new(MODES))]
    occlusion: Option<String>,
    /// Size of the picture in pixels; the same as --set camera.resolution=
    #[arg(long, value_name = "WxH", value_parser = values::resolution)]
    resolution: Option<Resolution>,
    /// Render only these pixels: columns x0 to before x1, rows y0 to before y1, from the top left
    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = values::crop, allow_hyphen_values = true)]
    crop: Option<Crop>,
    /// Render this pixel alone and print what makes it up: its fragments, layers and shading points with their Γ and light. Nothing is written; with -v as JSON
    #[arg(long, value_name = "x,y", value_parser = values::pixel, conflicts_with_all = ["crop", "output", "stats", "crosscheck", "strict"])]
    pixel: Option<[u32; 2]>,
    /// Frames to render: 5, 1-10, 1-10x2 (each second) or a list of these with commas; 1 unless given
    #[arg(long, value_name = "FRAMES", value_parser = values::frames, allow_hyphen_values = true)]
    frames: Option<Frames>,
    /// Render to this relative RMS error of the picture, as in 0.01: settings and passes are found on the scene itself, and the summary says with a 95 % interval what error came of it
    #[arg(long, value_name = "X", value_parser = values::accuracy, allow_negative_numbers = true, conflicts_with = "max_time")]
    max_error: Option<f64>,
    /// Render as accurately as this time allows, as in 60s or 5m: a picture that differs from run to run
    #[arg(long, value_name = "TIME", value_parser = values::duration)]
    max_time: Option<f64>,
    /// Number of threads; one a processor unless given. The picture does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    memory: Memory,
    /// Seed of all random numbers; the same as --set sampling.seed=
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u32>,
    /// Fail with exit status 6 where a value that is not finite is met
    #[arg(long)]
    strict: bool,
    /// Check hair occlusion after the render: compare the igloo with rays at a few of the points that were shaded, as tress crosscheck does. Fail with exit status 5 where they differ by more than the accuracy
    #[arg(long)]
    crosscheck: bool,
    /// Make a plan first, from a small picture as tress plan does, and hold what the render took against it, effect by effect
    #[arg(long, conflicts_with_all = ["max_error", "max_time", "pixel"])]
    plan: bool,
    /// Write statistics of the run to this file
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

/// Points of `--crosscheck`: a small part of a render's time.
const CROSSCHECK_POINTS: usize = 64;

/// The words of `occlusion.mode`.
const MODES: [&str; 4] = ["igloo", "raytraced", "auto", "none"];

/// All that is asked of one run of the renderer.
#[derive(Clone, Debug)]
pub struct RenderRequest {
    /// The scene, the command line's settings included.
    pub document: Document,
    /// The images to write, relative to the working folder; a run of `#` in a name stands for the frame ([`frame_path`]).
    pub outputs: Vec<PathBuf>,
    /// The frames, at least one.
    pub frames: Frames,
    /// The part of the picture to render, inside the picture; all of it where none.
    pub crop: Option<Crop>,
    /// Number of threads; one a processor where none.
    pub threads: Option<usize>,
    /// Whether values that are not finite are an error.
    pub strict: bool,
    /// Whether the estimators of hair occlusion are compared after the render.
    pub crosscheck: bool,
    /// An error or a time to render to, with settings of its own.
    pub goal: Option<Goal>,
    /// Whether what it takes is planned first.
    pub plan: bool,
    /// Where statistics go.
    pub stats: Option<PathBuf>,
}

pub(crate) fn run(arguments: Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    if let Some(pixel) = arguments.pixel {
        return one_pixel(&arguments, pixel, verbosity);
    }
    let memory = arguments.memory;
    let request = request(arguments, verbosity)?;
    interrupt::install().map_err(|e| Failure::Bug(format!("cannot catch Ctrl-C: {e}")))?;
    let reporter = Reporter::new(verbosity);
    let mut reports = Vec::new();
    let frames = request.frames.numbers();
    for &frame in frames {
        let numbered = frames.len() > 1;
        let document = request.document.at_frame(frame);
        let (window, threads) = (window(request.crop, &document)?, thread_count(request.threads));
        let work = match request.goal {
            Some(goal) => Work::RenderTo { window, threads, photon_sets: goal.photon_sets() },
            None => Work::Render { window, threads },
        };
        memory.check(&document, work)?;
        reports.push(render_frame(&request, frame, document, &reporter, verbosity, numbered)?);
        if let Some(path) = &request.stats {
            // After each frame: what was measured is kept when a later frame fails.
            write_statistics(path, &reports)?;
        }
    }
    strict(&request, &reports)?;
    reports.iter().filter_map(|report| report.crosscheck.as_ref()).try_for_each(crosscheck::verdict)
}

/// `--pixel`: of the first of the frames.
fn one_pixel(arguments: &Arguments, pixel: [u32; 2], verbosity: Verbosity) -> Result<(), Failure> {
    let document = load(&arguments.scene, &settings(arguments), verbosity)?;
    let [width, height] = document.description.camera.resolution;
    let [x, y] = pixel;
    if x >= width || y >= height {
        return Err(Failure::Usage(format!("--pixel {x},{y} lies outside the picture of {width}x{height} pixels")));
    }
    interrupt::install().map_err(|e| Failure::Bug(format!("cannot catch Ctrl-C: {e}")))?;
    let frame = arguments.frames.as_ref().and_then(|frames| frames.numbers().first().copied()).unwrap_or(1);
    let mut scene = Scene::load(document.at_frame(frame)).map_err(|e| Failure::Input(e.to_string()))?;
    // Progress goes to the terminal's other stream; the pixel alone is the output.
    let reporter = Reporter::new(Verbosity { verbose: 0, ..verbosity });
    let threads = arguments.threads.map(usize::from);
    let inspected = render::inspect(&mut scene, pixel, threads, &reporter)?;
    if verbosity.verbose > 0 {
        let text = serde_json::to_string_pretty(&inspected).map_err(|e| Failure::Bug(e.to_string()))?;
        return print(format!("{text}\n").as_bytes());
    }
    print(pixel::text(&inspected).as_bytes())
}

/// What `--stats` writes of one frame.
#[derive(serde::Serialize)]
struct FrameReport {
    frame: u32,
    #[serde(flatten)]
    statistics: Statistics,
    #[serde(skip_serializing_if = "Option::is_none")]
    crosscheck: Option<study::Report>,
}

/// Loads, renders and writes one frame.
fn render_frame(
    request: &RenderRequest,
    frame: u32,
    document: Document,
    progress: &dyn Progress,
    verbosity: Verbosity,
    numbered: bool,
) -> Result<FrameReport, Failure> {
    let outputs: Vec<PathBuf> = request.outputs.iter().map(|path| frame_path(path, frame)).collect();
    for path in &outputs {
        output::check(path).map_err(|e| Failure::Output(e.to_string()))?;
    }
    let loading = Watch::start();
    progress.stage(&if numbered { format!("frame {frame}: loading") } else { "loading".to_owned() }, 0);
    let mut scene = Scene::load(document).map_err(|e| Failure::Input(e.to_string()))?;
    let loading = loading.stage("loading");
    if !verbosity.quiet {
        scene.notes.iter().for_each(|note| progress.message(&format!("note: {note}")));
    }
    let window = window(request.crop, &request.document)?;
    let options = Options { window, threads: request.threads };
    // The render takes them out of the scene.
    let surfaces = request.crosscheck.then(|| scene.surfaces.clone());
    let plan = request.plan.then(|| plan::probe(&mut scene, &options, progress)).transpose()?;
    let (film, mut statistics) = match request.goal {
        Some(goal) => render_to(&mut scene, goal, &options, progress)?,
        None => render::render(&mut scene, &options, progress)?,
    };
    plan.iter().for_each(|plan| plan.note_in(&mut statistics));
    statistics.stages.insert(0, loading);
    let watch = Watch::start();
    for path in &outputs {
        if progress.cancelled() {
            return Err(Failure::Interrupted);
        }
        let written = output::write(path, &film, &scene, &statistics).map_err(|e| Failure::Output(e.to_string()))?;
        if written.saturated > 0 && path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
            let name = path.display();
            progress.message(&format!(
                "warning: {name}: {} values beyond 65504 were stored as that; output.pixel_type = \"float\" keeps them",
                written.saturated
            ));
        }
    }
    statistics.stage("writing", &watch);
    if !verbosity.quiet {
        summary::lines(&statistics, &outputs, verbosity.verbose > 0).iter().for_each(|line| progress.message(line));
    }
    let Some(surfaces) = surfaces else { return Ok(FrameReport { frame, statistics, crosscheck: None }) };
    scene.surfaces = surfaces;
    let settings =
        study::Settings { points: CROSSCHECK_POINTS, rays: None, accuracy: None, window, threads: request.threads };
    let watch = Watch::start();
    let mut report = study::crosscheck(&mut scene, &settings, progress)?;
    statistics.stage("cross-check", &watch);
    if !verbosity.quiet {
        crosscheck::lines(&report, verbosity.verbose > 0).iter().for_each(|line| progress.message(line));
    }
    // Statistics are of the frame, not of single points.
    report.points.clear();
    Ok(FrameReport { frame, statistics, crosscheck: Some(report) })
}

fn write_statistics(path: &Path, reports: &[FrameReport]) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(reports).map_err(|e| Failure::Bug(e.to_string()))?;
    write_text(path, &text, "statistics")
}

/// With `--strict`, values that are not finite are a failure; the picture is there all the same.
fn strict(request: &RenderRequest, reports: &[FrameReport]) -> Result<(), Failure> {
    let count: u64 = reports.iter().map(|report| report.statistics.non_finite).sum();
    if count == 0 || !request.strict {
        return Ok(());
    }
    Err(Failure::NonFinite(format!("{count} shading points gave values that are not finite; the summary says where")))
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Cancelled => Failure::Interrupted,
            // Memory that is not to be had for what the scene asks.
            RenderError::Bins(_) | RenderError::ShadowMap { .. } | RenderError::Threads { .. } => {
                Failure::Input(error.to_string())
            }
            RenderError::Embree(embree::Error::Vertex { .. } | embree::Error::Radius { .. }) => {
                Failure::Input(format!(
                    "in units of half the hair's extent (of the surfaces', where there is no hair), {error}; \
                 is one of the objects in other units? transform.scale brings them together"
                ))
            }
            RenderError::Embree(embree::Error::TooMany { .. }) => Failure::Input(error.to_string()),
            RenderError::Embree(_) => Failure::Bug(error.to_string()),
        }
    }
}

fn request(arguments: Arguments, verbosity: Verbosity) -> Result<RenderRequest, Failure> {
    let document = load(&arguments.scene, &settings(&arguments), verbosity)?;
    let frames = arguments.frames.unwrap_or_default();
    let outputs = outputs(arguments.output, &document)?;
    for output in &outputs {
        if frames.numbers().len() > 1 && frame_path(output, 1) == *output {
            let message = format!(
                "{}: {} frames would overwrite each other; put #### where the frame number goes",
                output.display(),
                frames.numbers().len()
            );
            return Err(Failure::Usage(message));
        }
        values::folder_exists(output)?;
    }
    if let Some(stats) = &arguments.stats {
        values::folder_exists(stats)?;
    }
    window(arguments.crop, &document)?;
    let threads = arguments.threads.map(usize::from);
    let goal = arguments.max_error.map(Goal::Error).or(arguments.max_time.map(Goal::Time));
    let Arguments { crop, strict, crosscheck, plan, stats, .. } = arguments;
    Ok(RenderRequest { document, outputs, frames, crop, threads, strict, crosscheck, goal, plan, stats })
}

/// The pixels of `--crop`; none where it is not given.
pub(super) fn window(crop: Option<Crop>, document: &Document) -> Result<Option<PixelRect>, Failure> {
    let [width, height] = document.description.camera.resolution;
    if let Some(crop) = crop.filter(|crop| crop.x1 > width || crop.y1 > height) {
        return Err(Failure::Usage(format!("--crop {crop} reaches out of the picture of {width}x{height} pixels")));
    }
    Ok(crop.map(|crop| PixelRect { min: [crop.x0, crop.y0], max: [crop.x1, crop.y1] }))
}

/// What `--set` says, and after it the options that stand for a key.
fn settings(arguments: &Arguments) -> Vec<String> {
    let mut settings = arguments.overrides.all();
    settings.extend(arguments.occlusion.as_ref().map(|mode| format!("occlusion.mode={mode}")));
    settings.extend(arguments.resolution.map(Resolution::setting));
    settings.extend(arguments.seed.map(|seed| format!("sampling.seed={seed}")));
    settings
}

/// The files to write: those of `-o`, relative to the working folder, or the scene's, relative to the scene.
fn outputs(options: Vec<PathBuf>, document: &Document) -> Result<Vec<PathBuf>, Failure> {
    let given = if options.is_empty() {
        document.description.output.file.as_deref().map(|file| document.resolve(file)).into_iter().collect()
    } else {
        options
    };
    if given.is_empty() || given.iter().any(|path| path.file_name().is_none()) {
        let message = "no output: say where the image goes with -o FILE, or with output.file in the scene";
        return Err(Failure::Usage(message.to_owned()));
    }
    Ok(given)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Wrapper {
        #[command(flatten)]
        arguments: Arguments,
    }

    fn ask(folder: &std::path::Path, scene: &str, options: &[&str]) -> Result<RenderRequest, Failure> {
        let file = folder.join("scene.toml");
        std::fs::write(&file, scene).unwrap();
        let arguments = ["render", file.to_str().unwrap()].into_iter().chain(options.iter().copied());
        request(Wrapper::try_parse_from(arguments).unwrap().arguments, Verbosity { quiet: true, verbose: 0 })
    }

    #[test]
    fn options_stand_for_keys() {
        let folder = tempfile::tempdir().unwrap();
        let options = "--occlusion raytraced --resolution 64x32 --seed 7 --set camera.fov=40 --crop 0,0,64,32 --frames 1-3 -o a##.exr --threads 2 --strict --crosscheck";
        let options: Vec<&str> = options.split(' ').collect();
        let request = ask(folder.path(), "output.file = 'b.exr'", &options).unwrap();
        let scene = &request.document.description;
        assert_eq!(scene.occlusion.mode, crate::scene::description::OcclusionMode::Raytraced);
        assert_eq!((scene.camera.resolution, scene.camera.fov, scene.sampling.seed), ([64, 32], 40.0, 7));
        assert_eq!((request.outputs, request.frames.numbers()), (vec![PathBuf::from("a##.exr")], &[1, 2, 3][..]));
        assert_eq!((request.threads, request.strict, request.crosscheck), (Some(2), true, true));
        // Without -o the scene's own file, beside the scene.
        let request = ask(folder.path(), "output.file = 'b.exr'", &[]).unwrap();
        assert_eq!((request.outputs, request.frames), (vec![folder.path().join("b.exr")], Frames::default()));
    }

    #[test]
    fn requests_that_cannot_be_met_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let refuse = |options: &[&str]| ask(folder.path(), "", options).unwrap_err();
        assert!(matches!(refuse(&[]), Failure::Usage(text) if text.contains("-o FILE")));
        assert!(matches!(refuse(&["-o", "a.exr", "--frames", "1-2"]), Failure::Usage(text) if text.contains("####")));
        assert!(
            matches!(refuse(&["-o", "a.exr", "--crop", "0,0,513,1"]), Failure::Usage(text) if text.contains("512x512"))
        );
        assert!(matches!(refuse(&["-o", "no/such/a.exr"]), Failure::Output(text) if text.contains("does not exist")));
        assert!(matches!(refuse(&["-o", "src"]), Failure::Output(text) if text.contains("folder")));
        assert!(matches!(refuse(&["-o", "a.exr", "--stats", "no/s.json"]), Failure::Output(_)));
        let failure = refuse(&["-o", "a.exr", "--resolution", "40000x1"]);
        assert!(matches!(failure, Failure::Input(text) if text.contains("camera.resolution[0] is 40000")));
    }

    #[test]
    fn the_modes_are_those_of_the_schema() {
        let modes = &crate::scene::schema()["$defs"]["OcclusionMode"]["oneOf"];
        let modes: Vec<&str> = modes.as_array().unwrap().iter().map(|mode| mode["const"].as_str().unwrap()).collect();
        assert_eq!(modes, MODES);
    }
}
