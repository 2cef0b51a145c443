//! `tress figure` as a user runs it.

#[path = "common/program.rs"]
mod program;

use std::path::Path;

use tress::image::{self, Limits};

const SCENE: &str = r#"
[camera]
position = [0, 0, 4]
resolution = [24, 16]
[[surface]]
sphere = { radius = 1.0 }
[environment]
color = [0.5, 0.5, 0.5]
"#;

const FIGURE: &str = r#"
title = "Three"
note = "nothing much"
scene = "scene.toml"
columns = 2
gap = 2

[[panel]]
label = "grey"

[[panel]]
label = "a little brighter"
set = ["environment.scale=1.1"]

[[panel]]
label = "difference"
difference = [0, 1]
factor = 8

[[panel]]
label = "a part, enlarged"
crop = [8, 4, 12, 8]
enlarge = 3
"#;

/// Exit code and standard error.
fn tress(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let (code, _, said) = program::tress(folder, arguments);
    (code, said)
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("scenes/paper")).unwrap();
    std::fs::create_dir(folder.path().join("panels")).unwrap();
    std::fs::write(folder.path().join("scenes/paper/scene.toml"), SCENE).unwrap();
    std::fs::write(folder.path().join("scenes/paper/figure03.toml"), FIGURE).unwrap();
    folder
}

fn read(path: &Path) -> image::Image {
    image::read(path, &Limits { max_bytes: 1 << 24 }).unwrap()
}

#[test]
fn panels_stand_side_by_side_and_are_told_apart() {
    let folder = folder();
    let arguments = ["figure", "3", "-o", "f.png", "--panels", "panels", "--stats", "f.json"];
    let (code, said) = tress(folder.path(), &arguments);
    assert_eq!(code, Some(0), "{said}");
    for part in ["0: grey", "2: difference: mean", "look at: nothing much", "wrote f.png"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let picture = read(&folder.path().join("f.png")).rgb().unwrap();
    assert_eq!((picture.width, picture.height), (24 + 2 + 24, 16 + 2 + 16));
    // The gap is white; so is what a smaller panel leaves of its cell.
    assert_eq!(picture.pixels[24], [1.0; 3]);
    let panel = |n: usize| read(&folder.path().join(format!("panels/panel{n}.exr"))).rgb().unwrap();
    assert_eq!((panel(3).width, panel(3).height), (4, 4));
    let (a, b) = (panel(0), panel(1));
    let ratio = b.pixels[0][0] / a.pixels[0][0];
    assert!((ratio - 1.1).abs() < 1e-3, "{ratio}");
    let reports: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("f.json")).unwrap()).unwrap();
    assert!(reports[0]["statistics"]["surface_points"].as_u64().unwrap() > 0);
    assert!(reports[2]["difference"]["max"].as_u64().unwrap() > 0);
}

#[test]
fn wrong_figures_are_refused_with_their_exit_codes() {
    let folder = folder();
    let (code, said) = tress(folder.path(), &["figure", "4", "-o", "f.png"]);
    assert!(code == Some(3) && said.contains("scenes/paper/figure04.toml"), "{code:?} {said}");
    let (code, said) = tress(folder.path(), &["figure", "3", "-o", "no/f.png"]);
    assert!(code == Some(4) && said.contains("no"), "{code:?} {said}");
    let (code, said) = tress(folder.path(), &["figure", "3", "-o", "f.png", "--panels", "none"]);
    assert!(code == Some(4) && said.contains("make it first"), "{code:?} {said}");
    let (code, said) = tress(folder.path(), &["figure", "3", "-o", "f.png", "--set", "camera.fov=0"]);
    assert!(code == Some(3) && said.contains("camera.fov"), "{code:?} {said}");
    let broken = FIGURE.replace("crop = [8, 4, 12, 8]", "crop = [80, 4, 90, 8]");
    std::fs::write(folder.path().join("scenes/paper/figure03.toml"), broken).unwrap();
    let (code, said) = tress(folder.path(), &["figure", "3", "-o", "f.png"]);
    assert!(code == Some(3) && said.contains("outside the picture of 24x16"), "{code:?} {said}");
    assert!(!folder.path().join("f.png").exists());
}
