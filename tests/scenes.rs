//! The scenes of the project: each is sound and renders in both occlusion modes, and each shows what it says it shows.

use std::path::{Path, PathBuf};
use std::process::Command;

use tress::image;

const TRESS: &str = env!("CARGO_BIN_EXE_tress");
const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn scenes() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(Path::new(ROOT).join("scenes")).expect("the folder scenes");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let mut scenes: Vec<PathBuf> = paths.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    scenes.sort();
    assert!(scenes.len() >= 5, "{scenes:?}");
    scenes
}

fn tress(arguments: &[&str]) {
    let output = Command::new(TRESS).args(arguments).output().expect("tress runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "tress {arguments:?}: {said}");
    assert!(!said.contains("warning"), "tress {arguments:?}: {said}");
}

#[test]
fn every_scene_is_sound() {
    let scenes = scenes();
    let names = scenes.iter().map(|scene| scene.to_str().expect("a name"));
    tress(&std::iter::once("check").chain(names).collect::<Vec<_>>());
}

#[test]
fn every_scene_renders_in_both_modes() {
    let folder = tempfile::tempdir().expect("a folder");
    for scene in scenes() {
        let (name, scene) = (scene.file_stem().expect("a name").to_string_lossy(), scene.to_string_lossy());
        let means: Vec<f64> = ["igloo", "raytraced"]
            .into_iter()
            .map(|mode| {
                let file = folder.path().join(format!("{name}-{mode}.exr"));
                let path = file.to_string_lossy();
                tress(&["render", &scene, "--strict", "--occlusion", mode, "--resolution", "32x32", "-o", &path]);
                mean(&file)
            })
            .collect();
        assert!((means[0] / means[1] - 1.0).abs() < 0.02, "{name}: {means:?}");
    }
}

/// Mean of the red, green and blue channels of the beauty.
fn mean(file: &Path) -> f64 {
    let picture = image::read(file, &image::Limits::default()).and_then(|image| image.rgb()).expect("a picture");
    let values = picture.pixels.iter().flatten();
    values.clone().map(|&v| f64::from(v)).sum::<f64>() / values.count() as f64
}

#[test]
fn the_furnace_is_white() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("furnace.exr");
    let scene = Path::new(ROOT).join("scenes/furnace.toml");
    tress(&["render", &scene.to_string_lossy(), "-o", &file.to_string_lossy()]);
    let picture = image::read(&file, &image::Limits::default()).and_then(|image| image.rgb()).expect("a picture");
    for value in picture.pixels.iter().flatten() {
        assert!((value - 1.0).abs() < 0.01, "{value}");
    }
}

#[test]
fn the_reference_is_what_the_program_prints() {
    let output = Command::new(TRESS).args(["schema", "--markdown"]).output().expect("tress runs");
    let file = std::fs::read(Path::new(ROOT).join("docs/scene.md")).expect("docs/scene.md");
    assert!(output.stdout == file, "docs/scene.md is old: tress schema --markdown > docs/scene.md");
}
