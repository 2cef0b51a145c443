//! `tress crosscheck` and `tress render --crosscheck` as a user runs them.

#[path = "common/program.rs"]
mod program;

use std::path::Path;

use program::{interrupt_at_work, start, tress};
use serde_json::Value;

const SCENE: &str = r#"
[camera]
position = [0, 1.2, 4]
fov = 45
resolution = [32, 32]
[[surface]]
name = "ball"
sphere = { radius = 0.8 }
[[surface]]
name = "floor"
plane = { center = [0, -1.2, 0], size = [4, 4] }
[[hair]]
name = "fur"
transparency = 0.5
grow = { on = "ball", count = 3000, segments = 5, length = 0.4, width_root = 0.01, width_tip = 0.005 }
[environment]
color = [1, 1, 1]
[occlusion]
mode = "none"
"#;

/// Small but enough: noise is taken out of what is judged.
const QUICK: [&str; 4] = ["--points", "60", "--rays", "2000"];

fn folder() -> tempfile::TempDir {
    program::folder(SCENE)
}

fn crosscheck(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    tress(folder, &[&["crosscheck", "scene.toml"], &QUICK[..], arguments].concat())
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

#[test]
fn a_small_scene_agrees_and_is_reported_in_three_forms() {
    let folder = folder();
    let (code, out, err) = crosscheck(folder.path(), &["--json", "a.json", "--plot", "a.svg"]);
    assert_eq!(code, Some(0), "{out}{err}");
    for part in [
        "2,000 rays each",
        "30 of ",
        "on hair",
        "on surfaces",
        "in scene units",
        "largest on hair: pixel",
        "fur, strand",
        "triangle",
    ] {
        assert!(out.contains(part), "{part} in {out}");
    }
    let report = json(&std::fs::read_to_string(folder.path().join("a.json")).expect("a report"));
    assert_ne!(report["verdict"], "exceeded", "{out}");
    assert_eq!(report["points"].as_array().map(Vec::len), Some(60));
    assert_eq!((report["hair"]["points"].as_u64(), report["surface"]["points"].as_u64()), (Some(30), Some(30)));
    let number = |pointer: &str| report.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer}"));
    let (low, rms, high) = (number("/all/rms/low"), number("/all/rms/value"), number("/all/rms/high"));
    assert!(low <= rms && rms <= high && high < 0.03, "{out}");
    assert!(number("/all/noise") > 0.0 && number("/all/noise") < 0.01, "{out}");
    for point in report["points"].as_array().expect("points") {
        let of = |key: &str| point[key].as_f64().expect(key);
        assert!((of("projection") - of("rays") - of("difference")).abs() < 1e-12, "{point}");
        assert!((0.0..=1.0).contains(&of("projection")) && (0.0..=1.0 + 1e-6).contains(&of("rays")), "{point}");
        // Fur on a ball of radius 0.8 above a floor of size 4: hair is nowhere farther.
        assert!(point["hair_distance"].as_f64().is_none_or(|distance| distance > 0.0 && distance < 6.0), "{point}");
    }
    // Points on hair sit in it, points on the floor see it from afar.
    let nearest = |kind: &str| number(&format!("/{kind}/by_distance/0/distance/0"));
    assert!(nearest("hair") < 0.5, "{out}");
    let svg = std::fs::read_to_string(folder.path().join("a.svg")).expect("a plot");
    let svg = roxmltree::Document::parse(&svg).expect("well-formed XML");
    assert_eq!(svg.root_element().tag_name().name(), "svg");
    // Each point stands in both panels, and each kind once in the legend.
    assert_eq!(svg.descendants().filter(|node| node.has_tag_name("circle")).count(), 2 * 60 + 2);
    let mut names: Vec<_> =
        std::fs::read_dir(folder.path()).expect("a folder").map(|entry| entry.expect("an entry").file_name()).collect();
    names.sort();
    assert_eq!(names, ["a.json", "a.svg", "scene.toml"]);
}

#[test]
fn deep_shadow_maps_are_held_against_rays_too() {
    let folder = folder();
    let lamp = |map| format!(r#"light.point=[{{position=[2,3,2],intensity=[20,20,20],shadows="{map}"}}]"#);
    let check = |lamp: &str| crosscheck(folder.path(), &["--set", lamp, "--json", "a.json"]);
    let (code, out, err) = check(&lamp("deep-map"));
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(out.contains("by deep shadow map") && out.contains("light.point[0] on hair"), "{out}");
    let report = json(&std::fs::read_to_string(folder.path().join("a.json")).expect("a report"));
    let shadow = &report["shadows"][0];
    assert_eq!(shadow["light"], "light.point[0]");
    for kind in ["hair", "surface"] {
        let number = |pointer: &str| shadow[kind].pointer(pointer).and_then(Value::as_f64).expect("a number");
        // Of points that the lamp's map knows; a filtered map and as many rays differ by little.
        assert!((20.0..=30.0).contains(&number("/points")), "{shadow}");
        assert!(number("/mean/value").abs() < 0.01 && number("/rms/value") < 0.03, "{shadow}");
    }
    // A map whose functions may be off by half is not what rays say.
    let coarse = lamp("deep-map").replace("shadows=", "map_error=0.5,shadows=");
    let (code, out, err) = check(&coarse);
    assert_eq!(code, Some(5), "{out}{err}");
    assert!(err.contains("light.point[0]") && err.contains("map_error"), "{err}");
    let (code, out, _) = check(&lamp("raytraced"));
    assert!(code == Some(0) && !out.contains("shadow map"), "{out}");
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let folder = folder();
    let run = |threads: &str| crosscheck(folder.path(), &["-q", "--json", "-", "--threads", threads]).1;
    let one = run("1");
    assert_eq!(json(&one)["points"].as_array().map(Vec::len), Some(60));
    assert!(one == run("2"));
    assert!(one == run("5"));
    // Another seed draws other points.
    assert!(one != crosscheck(folder.path(), &["--json", "-", "--seed", "1"]).1);
}

#[test]
fn an_accuracy_out_of_reach_is_exit_code_5() {
    let folder = folder();
    // With so many rays the noise hides no difference.
    let arguments =
        ["crosscheck", "scene.toml", "--points", "60", "--rays", "60000", "--accuracy", "1e-6", "--json", "a.json"];
    let (code, out, err) = tress(folder.path(), &arguments);
    assert_eq!(code, Some(5), "{out}{err}");
    assert!(out.contains("the accuracy of 0.000001 is not held"), "{out}");
    let fault =
        "error: scene.toml: the two estimators of hair occlusion differ by more than the accuracy of 0.000001: RMS 0.0";
    assert!(err.contains(fault) && err.contains("on hair (at least"), "{err}");
    let report = json(&std::fs::read_to_string(folder.path().join("a.json")).expect("a report"));
    assert_eq!(report["verdict"], "exceeded");
}

#[test]
fn points_come_from_the_crop_alone() {
    let folder = folder();
    let (code, out, err) =
        crosscheck(folder.path(), &["--json", "-", "--crop", "10,12,20,16", "--resolution", "40x40"]);
    assert_eq!(code, Some(0), "{err}");
    let report = json(&out);
    for point in report["points"].as_array().expect("points") {
        let [x, y] = [0, 1].map(|axis| point["pixel"][axis].as_u64().expect("a pixel"));
        assert!((10..20).contains(&x) && (12..16).contains(&y), "{point}");
    }
}

#[test]
fn without_hair_there_is_nothing_to_compare() {
    let folder = folder();
    let bare = "environment.color = [1, 1, 1]\n[[surface]]\nsphere = {}\n";
    std::fs::write(folder.path().join("bare.toml"), bare).expect("a scene");
    let (code, out, err) = tress(folder.path(), &["crosscheck", "bare.toml", "--plot", "a.svg"]);
    assert_eq!(code, Some(0), "{err}");
    assert!(out.contains("nothing to compare: the scene has no hair"), "{out}");
    assert!(err.contains("a.svg: not written") && !folder.path().join("a.svg").exists(), "{err}");
    let (code, out, _) = tress(folder.path(), &["crosscheck", "bare.toml", "--json", "-"]);
    assert_eq!((code, &json(&out)["verdict"], &json(&out)["all"]), (Some(0), &"nothing".into(), &Value::Null));
    // Hair that the camera does not see.
    let away = ["--set", "camera.position=[0,0,90]", "--set", "camera.target=[0,0,99]"];
    let (code, out, err) = crosscheck(folder.path(), &away);
    assert_eq!(code, Some(0), "{err}");
    assert!(out.contains("nothing to compare: no hair and no surface is in the picture"), "{out}");
}

#[test]
fn hair_that_only_a_lamp_lights_is_compared_all_the_same() {
    // The picture asks nothing about what is around there, and builds nothing for it.
    let lamp = "[[light.point]]\nposition = [2, 2, 2]\nintensity = [5, 5, 5]\n";
    let scene = format!("{}{lamp}", SCENE.replace("color = [1, 1, 1]", "color = [0, 0, 0]"));
    let folder = program::folder(&scene);
    let (code, out, err) = crosscheck(folder.path(), &["--json", "-", "--set", "indirect.mode=none"]);
    assert_eq!(code, Some(0), "{out}{err}");
    assert_ne!(json(&out)["verdict"], "exceeded", "{out}");
}

#[test]
fn faults_have_their_exit_codes() {
    let folder = folder();
    for (arguments, code, part) in [
        (&["--points", "3"][..], 2, "16"),
        (&["--rays", "1"], 2, "2.."),
        (&["--accuracy", "0"], 2, "above 0"),
        (&["--accuracy", "-0.1"], 2, "above 0"),
        (&["--threads", "0"], 2, "--threads"),
        (&["--crop", "0,0,100,10"], 2, "32x32"),
        (&["--plot", "a.png"], 2, "a.png: plots are drawn as SVG only; let the name end in .svg"),
        (&["--set", "camera.fov=500"], 3, "camera.fov is 500"),
        (&["--set", "occlusion.faces=none"], 3, "occlusion.faces"),
        (&["--json", "no/a.json"], 4, "no/a.json: the folder no does not exist"),
        (&["--plot", "no/a.svg"], 4, "no/a.svg: the folder no does not exist"),
    ] {
        let (found, out, err) = tress(folder.path(), &[&["crosscheck", "scene.toml"], arguments].concat());
        assert_eq!((found, out.as_str()), (Some(code), ""), "{arguments:?}: {err}");
        assert!(err.contains(part), "{arguments:?}: {err}");
    }
    let (code, _, err) = tress(folder.path(), &["crosscheck", "none.toml"]);
    assert_eq!(code, Some(3));
    assert!(err.contains("none.toml: cannot read the scene"), "{err}");
}

#[test]
fn a_render_checks_itself() {
    let folder = folder();
    let render = ["render", "scene.toml", "-o", "a.exr", "--crosscheck", "--stats", "a.json", "--occlusion", "igloo"];
    let (code, _, err) = tress(folder.path(), &render);
    assert_eq!(code, Some(0), "{err}");
    assert!(err.contains("cross-check: scene.toml: 32 of ") && err.contains("is held"), "{err}");
    let statistics = || json(&std::fs::read_to_string(folder.path().join("a.json")).expect("statistics"));
    let check = statistics()[0]["crosscheck"].clone();
    assert!(check["all"]["rms"]["value"].as_f64().is_some_and(|rms| rms < 0.02), "{check}");
    assert!(check.get("points").is_none() && check["verdict"].is_string(), "{check}");
    // The points were drawn from those that the render shaded.
    for (kind, shaded) in [("hair", "hair_points"), ("surface", "surface_points")] {
        assert_eq!(check["population"][kind], statistics()[0][shaded]);
    }
    let stages = statistics()[0]["stages"].as_array().expect("stages").clone();
    assert!(stages.iter().any(|stage| stage["name"] == "cross-check"), "{stages:?}");
    // Lumps as wide as half the sky: the check fails, the picture is there all the same.
    let coarse = ["-o", "b.exr", "--set", "occlusion.faces=2", "--set", "occlusion.opening=10"];
    let (code, _, err) = tress(folder.path(), &[&render[..], &coarse].concat());
    assert_eq!(code, Some(5), "{err}");
    assert!(err.contains("error: scene.toml: ") && folder.path().join("b.exr").exists(), "{err}");
    assert_eq!(statistics()[0]["crosscheck"]["verdict"], "exceeded");
}

#[test]
fn ctrl_c_stops_soon_and_leaves_no_file() {
    let folder = folder();
    let arguments = ["crosscheck", "scene.toml", "--threads", "2", "--rays", "100000000", "--json", "a.json"];
    let mut child = start(folder.path(), &[&arguments[..], &["--plot", "a.svg"]].concat());
    assert_eq!(interrupt_at_work(&mut child), Some(130));
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1);
}
