//! `tress render`: turns the command line and a scene into a [`RenderRequest`].

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;

use super::values::{self, Crop, Frames, Resolution};
use super::{Failure, Overrides, Verbosity, interrupt, load, progress::Reporter};
use crate::render::progress::Progress;
use crate::scene::Document;

/// Render a scene to an image
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The scene file (.toml or .json)
    scene: PathBuf,
    /// The image to write; its ending says the format, a run of # stands for the frame number. Comes before output.file of the scene
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// How hair occlusion is found; the same as --set occlusion.mode=
    #[arg(long, value_name = "MODE", value_parser = PossibleValuesParser::new(MODES))]
    occlusion: Option<String>,
    /// Size of the picture in pixels; the same as --set camera.resolution=
    #[arg(long, value_name = "WxH", value_parser = values::resolution)]
    resolution: Option<Resolution>,
    /// Render only these pixels: columns x0 to before x1, rows y0 to before y1, from the top left
    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = values::crop, allow_hyphen_values = true)]
    crop: Option<Crop>,
    /// Frames to render: 5, 1-10, 1-10x2 (each second) or a list of these with commas; 1 unless given
    #[arg(long, value_name = "FRAMES", value_parser = values::frames, allow_hyphen_values = true)]
    frames: Option<Frames>,
    /// Number of threads; one a processor unless given. The picture does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    #[command(flatten)]
    overrides: Overrides,
    /// Seed of all random numbers; the same as --set sampling.seed=
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u32>,
    /// Fail with exit status 6 where a value that is not finite is met
    #[arg(long)]
    strict: bool,
    /// Write statistics of the run to this file
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

/// The words of `occlusion.mode`.
const MODES: [&str; 3] = ["igloo", "raytraced", "none"];

/// All that is asked of one run of the renderer.
#[derive(Clone, Debug)]
pub struct RenderRequest {
    /// The scene, the command line's settings included.
    pub document: Document,
    /// The image to write, relative to the working folder; a run of `#` in its name stands for the frame ([`values::frame_path`]).
    pub output: PathBuf,
    /// The frames, at least one.
    pub frames: Frames,
    /// The part of the picture to render, inside the picture; all of it where none.
    pub crop: Option<Crop>,
    /// Number of threads; one a processor where none.
    pub threads: Option<usize>,
    /// Whether values that are not finite are an error.
    pub strict: bool,
    /// Where statistics go.
    pub stats: Option<PathBuf>,
}

pub(crate) fn run(arguments: Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let request = request(arguments, verbosity)?;
    interrupt::install().map_err(|e| Failure::Bug(format!("cannot catch Ctrl-C: {e}")))?;
    let reporter = Reporter::new(verbosity);
    render(&request, &reporter)
}

/// Renders each frame of a request. Must return [`Failure::Interrupted`] when `progress` says that it is cancelled.
fn render(_: &RenderRequest, _: &dyn Progress) -> Result<(), Failure> {
    Err(Failure::Bug("this build cannot render yet".to_owned()))
}

fn request(arguments: Arguments, verbosity: Verbosity) -> Result<RenderRequest, Failure> {
    let document = load(&arguments.scene, &settings(&arguments), verbosity)?;
    let frames = arguments.frames.unwrap_or_default();
    let output = output(arguments.output, &document)?;
    if frames.numbers().len() > 1 && values::frame_path(&output, 1) == output {
        let message = format!(
            "{}: {} frames would overwrite each other; put #### where the frame number goes",
            output.display(),
            frames.numbers().len()
        );
        return Err(Failure::Usage(message));
    }
    values::folder_exists(&output)?;
    if let Some(stats) = &arguments.stats {
        values::folder_exists(stats)?;
    }
    let [width, height] = document.description.camera.resolution;
    if let Some(crop) = arguments.crop.filter(|crop| crop.x1 > width || crop.y1 > height) {
        return Err(Failure::Usage(format!("--crop {crop} reaches out of the picture of {width}x{height} pixels")));
    }
    let threads = arguments.threads.map(usize::from);
    let Arguments { crop, strict, stats, .. } = arguments;
    Ok(RenderRequest { document, output, frames, crop, threads, strict, stats })
}

/// What `--set` says, and after it the options that stand for a key.
fn settings(arguments: &Arguments) -> Vec<String> {
    let mut settings = arguments.overrides.set.clone();
    settings.extend(arguments.occlusion.as_ref().map(|mode| format!("occlusion.mode={mode}")));
    let size = |r: &Resolution| format!("camera.resolution=[{}, {}]", r.width, r.height);
    settings.extend(arguments.resolution.as_ref().map(size));
    settings.extend(arguments.seed.map(|seed| format!("sampling.seed={seed}")));
    settings
}

/// The file to write: `-o`, relative to the working folder, or the scene's, relative to the scene.
fn output(option: Option<PathBuf>, document: &Document) -> Result<PathBuf, Failure> {
    let output = option.or_else(|| document.description.output.file.as_deref().map(|file| document.resolve(file)));
    output.filter(|path| path.file_name().is_some()).ok_or_else(|| {
        let message = "no output: say where the image goes with -o FILE, or with output.file in the scene";
        Failure::Usage(message.to_owned())
    })
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
        let options = "--occlusion raytraced --resolution 64x32 --seed 7 --set camera.fov=40 --crop 0,0,64,32 --frames 1-3 -o a##.exr --threads 2 --strict";
        let options: Vec<&str> = options.split(' ').collect();
        let request = ask(folder.path(), "output.file = 'b.exr'", &options).unwrap();
        let scene = &request.document.description;
        assert_eq!(scene.occlusion.mode, crate::scene::description::OcclusionMode::Raytraced);
        assert_eq!((scene.camera.resolution, scene.camera.fov, scene.sampling.seed), ([64, 32], 40.0, 7));
        assert_eq!((request.output, request.frames.numbers()), (PathBuf::from("a##.exr"), &[1, 2, 3][..]));
        assert_eq!((request.threads, request.strict), (Some(2), true));
        // Without -o the scene's own file, beside the scene.
        let request = ask(folder.path(), "output.file = 'b.exr'", &[]).unwrap();
        assert_eq!((request.output, request.frames), (folder.path().join("b.exr"), Frames::default()));
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
