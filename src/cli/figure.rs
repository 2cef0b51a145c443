//! `tress figure`: several pictures side by side.

use std::path::{Path, PathBuf};

use super::memory::{Memory, thread_count};
use super::values::{self, Resolution};
use super::{Failure, Overrides, Verbosity, exit, interrupt, log, progress::Reporter};
use crate::image::{self, ImageSpec, PixelFormat, RgbImage, display};
use crate::render::memory::Work;
use crate::study::figure::{Drawn, Figure, FigureError, PanelReport};

/// Render the pictures of a figure and put them side by side
///
/// A figure file is TOML: a title, a note of what to look at, and panels, each a scene with settings of its own or the difference of two panels. A number stands for scenes/paper/figureNN.toml below the working folder.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The figure file (.toml), or the number of a figure of the paper
    figure: PathBuf,
    /// The image to write (.png, .jpg, .tif, .exr)
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Also write each panel to this folder, as OpenEXR files in linear colour
    #[arg(long, value_name = "FOLDER")]
    panels: Option<PathBuf>,
    /// Write times and statistics of the panels to this file
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// Size of the pictures in pixels; the same as --set camera.resolution=
    #[arg(long, value_name = "WxH", value_parser = values::resolution)]
    resolution: Option<Resolution>,
    /// Number of threads; one a processor unless given. The pictures do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    memory: Memory,
}

pub(crate) fn run(arguments: Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let path = file_of(&arguments.figure)?;
    let figure = Figure::read(&path)?;
    image::check_target(&arguments.output).map_err(|e| Failure::Output(e.to_string()))?;
    if let Some(stats) = &arguments.stats {
        values::folder_exists(stats)?;
    }
    if let Some(folder) = arguments.panels.as_deref().filter(|folder| !folder.is_dir()) {
        let message = format!("{}: the folder does not exist; make it first", folder.display());
        return Err(Failure::Output(message));
    }
    let mut overrides = arguments.overrides.all();
    overrides.extend(arguments.resolution.map(Resolution::setting));
    interrupt::install().map_err(|e| Failure::Bug(format!("cannot catch Ctrl-C: {e}")))?;
    let threads = arguments.threads.map(usize::from);
    for (document, window) in figure.documents(&path, &overrides)? {
        arguments.memory.check(&document, Work::Render { window, threads: thread_count(threads) })?;
    }
    let reporter = Reporter::new(verbosity);
    let drawn = figure.draw(&path, &overrides, threads, &reporter)?;
    drop(reporter);
    write_all(&arguments, &drawn)?;
    if !verbosity.quiet {
        lines(&figure, &drawn.reports).iter().for_each(|line| log::say(line));
        log::say(&format!("wrote {}", arguments.output.display()));
    }
    Ok(())
}

/// A number names one of the paper's figures.
fn file_of(figure: &Path) -> Result<PathBuf, Failure> {
    let Some(number) = figure.to_str().and_then(|text| text.parse::<u8>().ok()) else { return Ok(figure.to_owned()) };
    let path = PathBuf::from(format!("scenes/paper/figure{number:02}.toml"));
    if path.is_file() {
        return Ok(path);
    }
    Err(Failure::Input(format!(
        "there is no figure {number}: {} is not below the working folder; name a figure file, or one of the paper's figures from tress's own folder",
        path.display()
    )))
}

fn write_all(arguments: &Arguments, drawn: &Drawn) -> Result<(), Failure> {
    let failed = |e: image::Error| Failure::Output(e.to_string());
    for (index, panel) in drawn.panels.iter().enumerate() {
        if let Some(folder) = &arguments.panels {
            write_linear(&folder.join(format!("panel{index}.exr")), panel).map_err(failed)?;
        }
    }
    if let Some(path) = &arguments.stats {
        let text = serde_json::to_string_pretty(&drawn.reports).map_err(|e| Failure::Bug(e.to_string()))?;
        exit::write_text(path, &text, "statistics")?;
    }
    let openexr = arguments.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"));
    if openexr {
        write_linear(&arguments.output, &drawn.picture).map_err(failed)
    } else {
        display::write_srgb8(&arguments.output, &drawn.picture, 0.0).map(|_| ()).map_err(failed)
    }
}

fn write_linear(path: &Path, picture: &RgbImage) -> Result<(), image::Error> {
    let channels = ["R", "G", "B"].map(|name| (name.to_owned(), PixelFormat::Float)).to_vec();
    image::write_atomic(path, &ImageSpec::new(picture.width, picture.height, channels), picture.pixels.as_flattened())
        .map(|_| ())
}

/// The figure in words: what each panel took, or how two differ.
fn lines(figure: &Figure, reports: &[PanelReport]) -> Vec<String> {
    let mut lines = vec![figure.title.clone()];
    for (index, report) in reports.iter().enumerate() {
        let label = &report.label;
        if let Some(statistics) = &report.statistics {
            let points = statistics.hair_points + statistics.surface_points;
            lines.push(format!("  {index}: {label}: {:.1} s, {points} points shaded", statistics.seconds()));
        } else if let Some(levels) = &report.difference {
            let [r, g, b] = levels.mean;
            let max = levels.max;
            lines.push(format!(
                "  {index}: {label}: mean {r:.2} red, {g:.2} green, {b:.2} blue, largest {max}, of 256 levels"
            ));
        }
    }
    lines.push(format!("look at: {}", figure.note));
    lines
}

impl From<FigureError> for Failure {
    fn from(error: FigureError) -> Self {
        match error {
            FigureError::Render(error) => error.into(),
            _ => Failure::Input(error.to_string()),
        }
    }
}
