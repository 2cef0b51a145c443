//! `tress render --pixel` and `tress selftest` as their users see them.

use std::path::Path;
use std::process::Command;

use tress::render::progress::Unwatched;
use tress::render::{self, Options};
use tress::scene::{self, Scene};

fn tress(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tress")).args(arguments).output().expect("tress runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

fn scene_file(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).to_string_lossy().into_owned()
}

#[test]
fn a_pixel_alone_has_the_values_of_the_whole_picture() {
    // With light from lamps and sky, and with photons in a closed room.
    ["lights.toml", "cornell.toml"].into_iter().for_each(a_pixel_is_that_of_the_picture);
}

fn a_pixel_is_that_of_the_picture(name: &str) {
    let settings = ["camera.resolution=[48,48]".to_owned(), "output.pixel_type=float".to_owned()];
    let path = scene_file(name);
    let load = || Scene::load(scene::load(Path::new(&path), &settings).expect("a scene")).expect("a scene");
    let (film, _) = render::render(&mut load(), &Options::default(), &Unwatched).expect("a picture");
    for [x, y] in [[24, 24], [13, 30], [0, 0], [47, 47]] {
        let inspected = render::inspect(&mut load(), [x, y], None, &Unwatched).expect("a pixel");
        let whole = &film.pixels[(y * 48 + x) as usize];
        assert_eq!(
            (inspected.beauty, inspected.alpha),
            (whole.beauty.to_array(), whole.alpha),
            "{name}: pixel {x},{y}"
        );
        // The points' sum is the pixel.
        let sum: f32 =
            inspected.points.iter().map(|p| p.weight * (p.environment[1] + p.direct[1] + p.emission[1])).sum();
        assert!(sum <= whole.beauty.y * (1.0 + 1e-5), "{sum} of {}", whole.beauty.y);
        assert!(inspected.non_finite.is_empty() && inspected.points.iter().all(|p| p.finite));
    }
}

#[test]
fn the_command_line_prints_a_pixel_as_text_and_as_json() {
    let path = scene_file("fur_ball.toml");
    let options = ["render", &path, "-q", "--pixel", "16,16", "--resolution", "32x32"];
    let (code, text, said) = tress(&options);
    assert_eq!(code, Some(0), "{said}");
    for part in ["pixel 16,16", "strand", "point 0", "Σ F Γ Λ", "alpha", "Γ "] {
        assert!(text.contains(part), "no {part} in {text}");
    }
    let (code, json, said) = tress(&["render", &path, "-v", "--pixel", "16,16", "--resolution", "32x32"]);
    assert_eq!(code, Some(0), "{said}");
    let value: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(value["pixel"], serde_json::json!([16, 16]));
    assert!(!value["fragments"].as_array().expect("a list").is_empty());
    let (code, _, said) = tress(&["render", &path, "--pixel", "32,0", "--resolution", "32x32"]);
    assert_eq!((code, said.contains("32x32")), (Some(2), true), "{said}");
    let (code, _, said) = tress(&["render", &path, "--pixel", "3"]);
    assert_eq!((code, said.contains("120,80")), (Some(2), true), "{said}");
}

#[test]
#[ignore = "slow: the whole self-test"]
fn the_self_test_passes_and_says_so() {
    let (code, text, said) = tress(&["selftest"]);
    assert_eq!(code, Some(0), "{text}{said}");
    assert!(text.contains("keep their bounds"), "{text}");
    let (code, json, _) = tress(&["selftest", "--json"]);
    let outcomes: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(code, Some(0));
    assert!(outcomes.as_array().expect("a list").iter().all(|outcome| outcome["ok"] == true));
}
