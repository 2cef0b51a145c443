//! `tress render` as a user runs it: files, metadata, exit codes, Ctrl-C.

#[path = "common/program.rs"]
mod program;

use std::path::Path;

use program::{interrupt_at_work, start};
use tress::image;

const SCENE: &str = r#"
[camera]
position = [0, 1, 4]
fov = 35
resolution = [48, 40]
[[surface]]
name = "ball"
sphere = { radius = 0.8 }
[[hair]]
grow = { on = "ball", count = 1500, length = 0.4, width_root = 0.02 }
[environment]
color = [0.8, 0.9, 1.0]
[[light.point]]
position = [2, 2, 2]
intensity = [5, 5, 5]
[occlusion]
faces = 30
[output]
layers = ["beauty", "alpha", "direct", "environment", "environment-unoccluded", "occlusion", "depth", "normal", "tangent"]
"#;

fn folder() -> tempfile::TempDir {
    program::folder(SCENE)
}

/// Exit code and standard error.
fn tress(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let (code, _, said) = program::tress(folder, arguments);
    (code, said)
}

#[test]
fn an_openexr_file_holds_the_layers_and_says_where_it_is_from() {
    let folder = folder();
    let (code, said) = tress(folder.path(), &["render", "scene.toml", "-o", "a.exr", "-o", "a.png", "--strict"]);
    assert_eq!(code, Some(0), "{said}");
    let info = image::info(&folder.path().join("a.exr")).expect("an EXR file");
    let names: Vec<&str> = info.channels.iter().map(|(name, _)| name.as_str()).collect();
    for name in [
        "R",
        "G",
        "B",
        "A",
        "direct.R",
        "environment.G",
        "environment-unoccluded.B",
        "occlusion.Y",
        "depth.Z",
        "normal.X",
        "tangent.Z",
    ] {
        assert!(names.contains(&name), "{name} in {names:?}");
    }
    for key in ["Software", "tress:scene", "tress:sceneHash", "tress:occlusion", "tress:renderSeconds", "worldToCamera"]
    {
        assert!(info.meta(key).is_some(), "{key}");
    }
    let exr = image::read(&folder.path().join("a.exr"), &image::Limits::default()).expect("an EXR file");
    let at = |name: &str, pixel: usize| {
        exr.pixels[pixel * exr.channels.len() + exr.channel(name).unwrap_or_else(|| panic!("{name}"))]
    };
    let middle = 48 * 20 + 24;
    assert_eq!(at("A", middle), 1.0);
    let sum = at("direct.R", middle) + at("environment.R", middle);
    assert!((at("R", middle) / sum - 1.0).abs() < 2e-3, "beauty is the sum of its parts");
    assert!(at("environment-unoccluded.R", middle) >= at("environment.R", middle));
    assert!((2.5..4.2).contains(&at("depth.Z", middle)), "{}", at("depth.Z", middle));
    assert_eq!((at("A", 0), at("depth.Z", 0), at("occlusion.Y", 0)), (0.0, 1e30, 1.0));
    let png = image::info(&folder.path().join("a.png")).expect("a PNG file");
    assert_eq!((png.width, png.height, png.channels.len()), (48, 40, 3));
}

#[test]
fn what_is_left_out_and_forced_on_is_in_the_file_and_in_the_summary() {
    let folder = folder();
    let arguments = ["--without", "point-lights", "--with", "area-lights", "--with", "marschner"];
    let (code, said) = tress(folder.path(), &[&["render", "scene.toml", "-o", "a.exr"], &arguments[..]].concat());
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("effects left out: point lights\n"), "{said}");
    assert!(said.contains("effects forced on: area lights, scattering by Marschner\n"), "{said}");
    let meta = |name: &str, key: &str| {
        let info = image::info(&folder.path().join(name)).expect("an EXR file");
        info.meta(key).map(|value| format!("{value:?}"))
    };
    assert!(meta("a.exr", "tress:effects.without").is_some_and(|value| value.contains("point-lights")));
    assert!(meta("a.exr", "tress:effects.with").is_some_and(|value| value.contains("area-lights marschner")));
    // Not in a file that needs neither.
    let (code, said) = tress(folder.path(), &["render", "scene.toml", "-o", "b.exr", "--plan"]);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!([meta("b.exr", "tress:effects.without"), meta("b.exr", "tress:effects.with")], [None, None]);
    assert!(!said.contains("left out") && said.contains("CPU time   planned"), "{said}");
    assert!(said.lines().any(|line| line.trim_end().ends_with("  hair occlusion by projection")), "{said}");
}

#[test]
fn reproducible_files_are_equal_byte_by_byte_for_any_threads() {
    let folder = folder();
    let read = |name: &str| std::fs::read(folder.path().join(name)).expect("a file");
    for (threads, name) in [("1", "one.exr"), ("2", "two.exr")] {
        let arguments = ["render", "scene.toml", "-q", "--threads", threads, "--set", "output.reproducible=true"];
        let (code, said) = tress(folder.path(), &[&arguments[..], &["-o", name]].concat());
        assert_eq!(code, Some(0), "{said}");
    }
    assert!(read("one.exr") == read("two.exr"));
}

#[test]
fn a_crop_is_a_data_window_of_the_same_pixels() {
    let folder = folder();
    for arguments in [&["-o", "whole.exr"][..], &["-o", "part.exr", "--crop", "10,5,30,25"]] {
        let (code, said) = tress(folder.path(), &[&["render", "scene.toml", "-q"], arguments].concat());
        assert_eq!(code, Some(0), "{said}");
    }
    let read = |name: &str| image::read(&folder.path().join(name), &image::Limits::default()).expect("a picture");
    let (whole, part) = (read("whole.exr"), read("part.exr"));
    assert_eq!((part.origin, part.full_size, part.width, part.height), ([10, 5], [48, 40], 20, 20));
    let row = |image: &image::Image, x: usize, y: usize| {
        let count = image.channels.len();
        let start = (y * image.width as usize + x) * count;
        image.pixels[start..start + 20 * count].to_vec()
    };
    for y in 0..20 {
        assert_eq!(row(&whole, 10, y + 5), row(&part, 0, y), "row {y}");
    }
}

#[test]
fn frames_take_numbered_assets_and_names() {
    let folder = folder();
    for frame in [3, 5] {
        let hair = format!("0 -1 0 0.{frame}\n0 1 0 0.{frame}\n");
        std::fs::write(folder.path().join(format!("one.{frame:04}.txt")), hair).expect("a hair file");
    }
    let scene = "environment.color = [1, 1, 1]\ncamera.resolution = [16, 16]\n[[hair]]\nfile = 'one.####.txt'\n";
    std::fs::write(folder.path().join("move.toml"), scene).expect("a scene");
    let arguments = ["render", "move.toml", "-o", "out.###.exr", "--stats", "stats.json"];
    let (code, said) = tress(folder.path(), &[&arguments[..], &["--frames", "3-5x2"]].concat());
    assert_eq!(code, Some(0), "{said}");
    let alpha = |name: &str| {
        let image = image::read(&folder.path().join(name), &image::Limits::default()).expect("a picture");
        let a = image.channel("A").expect("alpha");
        image.pixels.iter().skip(a).step_by(image.channels.len()).sum::<f32>()
    };
    assert!((alpha("out.005.exr") / alpha("out.003.exr") - 5.0 / 3.0).abs() < 0.05);
    let stats = std::fs::read_to_string(folder.path().join("stats.json")).expect("statistics");
    let stats: serde_json::Value = serde_json::from_str(&stats).expect("JSON");
    assert_eq!((stats[1]["frame"].as_u64(), stats[1]["non_finite"].as_u64()), (Some(5), Some(0)));
    // A frame without its file stops the run after the frames before it.
    let (code, said) = tress(folder.path(), &[&arguments[..], &["--frames", "5,4"]].concat());
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("one.0004.txt") && said.contains("move.toml:4"), "{said}");
}

#[test]
fn faults_have_their_exit_codes_and_leave_files_alone() {
    let folder = folder();
    std::fs::write(folder.path().join("good.exr"), "precious").expect("a file");
    let cases: [(&[&str], i32, &str); 6] = [
        (&["render", "scene.toml"], 2, "-o"),
        (&["render", "scene.toml", "-o", "good.exr", "--crop", "0,0,100,10"], 2, "48x40"),
        (&["render", "none.toml", "-o", "good.exr"], 3, "none.toml"),
        (&["render", "scene.toml", "-o", "good.exr", "--set", "camera.fov=500"], 3, "179"),
        (&["render", "scene.toml", "-o", "picture.xyz"], 4, "exr"),
        (&["render", "scene.toml", "-o", "nowhere/a.exr"], 4, "nowhere"),
    ];
    for (arguments, want, word) in cases {
        let (code, said) = tress(folder.path(), arguments);
        assert_eq!(code, Some(want), "{arguments:?}: {said}");
        assert!(said.contains(word), "{arguments:?}: {said}");
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("good.exr")).expect("still there"), "precious");
}

#[test]
fn ctrl_c_stops_soon_and_leaves_no_file() {
    let folder = folder();
    // Far more work than the test waits for.
    let scene = ["render", "scene.toml", "-o", "long.exr", "--threads", "2"];
    let work = ["--resolution", "2000x2000", "--set", "occlusion.faces=2000"];
    let mut child = start(folder.path(), &[&scene[..], &work].concat());
    assert_eq!(interrupt_at_work(&mut child), Some(130));
    let left: Vec<_> =
        std::fs::read_dir(folder.path()).expect("a folder").map(|e| e.expect("an entry").file_name()).collect();
    assert_eq!(left, ["scene.toml"]);
}
