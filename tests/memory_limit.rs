//! `--memory-limit`: work that would take more is refused before it takes any, and the estimate is near what is taken.

use std::fs;
use std::path::Path;
use std::process::Command;

use glam::Vec3;
use tress::hair::{Attribute, Strands, formats::write_hair};
use tress::render::memory::{Work, estimate};
use tress::scene;
use tress::study::controlled::Goal;

const TRESS: &str = env!("CARGO_BIN_EXE_tress");

/// Runs the program with no more than this much address space, in GiB: what it would take beyond ends it.
fn tress(folder: &Path, gib: u64, arguments: &str) -> (Option<i32>, String) {
    let script = format!("ulimit -v {}; exec $TRESS {arguments}", gib << 20);
    let output =
        Command::new("sh").current_dir(folder).args(["-c", &script]).env("TRESS", TRESS).output().expect("a shell");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

fn with_hair(hair: &str) -> String {
    format!(
        "environment.color = [1, 1, 1]\ncamera = {{ position = [0, 0, 4], resolution = [64, 64] }}\n\
         [[surface]]\nname = 'ball'\nsphere = {{}}\n[[hair]]\n{hair}\n"
    )
}

#[test]
fn too_much_is_refused_before_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| fs::write(folder.path().join(name), text).unwrap();
    write("grown.toml", with_hair("grow = { on = 'ball', count = 8_000_000, segments = 64 }"));
    write(
        "wide.toml",
        "environment.color = [1, 1, 1]\ncamera.resolution = [32768, 32768]\nsurface = [{ sphere = {} }]".into(),
    );
    let figure = "title = 't'\nnote = 'n'\nscene = 'grown.toml'\n[[panel]]\nlabel = 'a'\nset = ['hair=[]']\n\
                  [[panel]]\nlabel = 'b'\n[[panel]]\nlabel = 'c'\ndifference = [0, 1]\n";
    write("figure.toml", figure.into());
    for (arguments, what) in [
        ("plan grown.toml --no-probe", "Embree's tree over 520000000 segments"),
        ("plan wide.toml", "the picture of 1073741824 pixels"),
        ("figure figure.toml -o f.png", "Embree's tree over 520000000 segments"),
        ("study grown.toml -o folder", "Embree's tree over 520000000 segments"),
        ("render grown.toml -o a.exr", "Embree's tree over 520000000 segments"),
        ("check grown.toml", "hair[0].grow (8000000 strands of 65 points)"),
        ("grow grown.toml -o a.hair", "hair[0].grow"),
        ("crosscheck grown.toml", "Embree's tree"),
        ("render wide.toml -o a.exr", "the picture of 1073741824 pixels"),
    ] {
        for (option, named) in
            [("--memory-limit 300MiB", "300 MiB (--memory-limit)"), ("--memory-limit 1.5GiB", "1.50 GiB")]
        {
            let (code, text) = tress(folder.path(), 2, &format!("{arguments} {option}"));
            assert_eq!(code, Some(3), "{arguments} {option}: {text}");
            let line = text.lines().find(|line| line.starts_with("error: ")).unwrap_or_default();
            for part in ["of memory are needed", named, "most of it by", what, "raise the limit"] {
                assert!(line.contains(part), "{part} in {text}");
            }
        }
    }
    // Nothing was begun.
    assert!(!folder.path().join("f.png").exists() && !folder.path().join("folder").exists());
    // A part of the picture takes a part of the memory.
    let (code, text) = tress(folder.path(), 2, "render wide.toml -o a.exr --crop 0,0,16,16 --memory-limit 300MiB");
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn limits_are_read_strictly_and_may_be_lifted() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.toml"), with_hair("grow = { on = 'ball', count = 100 }")).unwrap();
    for (limit, code) in [("none", 0), ("1GiB", 0), ("1MB", 3), ("-1", 2), ("lots", 2), ("0GiB", 2)] {
        let (found, text) = tress(folder.path(), 4, &format!("check a.toml --memory-limit={limit}"));
        assert_eq!(found, Some(code), "{limit}: {text}");
    }
}

#[test]
fn renders_to_a_small_error_hold_more_photons() {
    let folder = tempfile::tempdir().unwrap();
    let lit = with_hair("grow = { on = 'ball', count = 100 }")
        + "[[light.point]]\nposition = [2, 2, 2]\nintensity = [5, 5, 5]\n[indirect]\nphotons = 2000000\n";
    fs::write(folder.path().join("a.toml"), lit).unwrap();
    let document = scene::load(&folder.path().join("a.toml"), &[]).unwrap();
    let sets = [Goal::Error(0.005), Goal::Error(0.05), Goal::Time(60.0)].map(Goal::photon_sets);
    assert_eq!(sets, [12, 3, 3], "three pictures, in four streams for errors below .01");
    let of = |photon_sets| estimate(&document, Work::RenderTo { window: None, threads: 2, photon_sets }).bytes();
    assert_eq!(of(1), estimate(&document, Work::Render { window: None, threads: 2 }).bytes());
    // Six million arrivals of 60 bytes each are kept of a set.
    assert_eq!(of(12) - of(3), 9 * 6_000_000 * 60);
    let (code, text) = tress(folder.path(), 16, "render a.toml -o a.exr --max-error 0.005 --memory-limit 3GiB");
    assert_eq!(code, Some(3), "{text}");
    assert!(text.contains("most of it by the map of 2000000 photons"), "{text}");
}

/// References of renders to an error trace shadows that the picture has from maps.
#[test]
fn renders_to_an_error_hold_what_rays_of_their_references_take() {
    let folder = tempfile::tempdir().unwrap();
    let lit = with_hair("grow = { on = 'ball', count = 100 }")
        + "[[light.point]]\nposition = [2, 2, 2]\nintensity = [5, 5, 5]\nshadows = 'deep-map'\n[occlusion]\nmode = 'none'\n";
    fs::write(folder.path().join("a.toml"), lit).unwrap();
    let document = scene::load(&folder.path().join("a.toml"), &[]).unwrap();
    let traces = |work| estimate(&document, work).parts.iter().any(|part| part.what.contains("Embree's tree over"));
    assert!(!traces(Work::Render { window: None, threads: 2 }));
    assert!(traces(Work::RenderTo { window: None, threads: 2, photon_sets: Goal::Error(0.05).photon_sets() }));
}

/// However few passes the scene asks for, there may be many.
#[test]
fn renders_to_an_error_hold_the_mean_of_their_passes() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.toml"), with_hair("grow = { on = 'ball', count = 100 }")).unwrap();
    let document = scene::load(&folder.path().join("a.toml"), &["camera.resolution=[1000, 1000]".to_owned()]).unwrap();
    let of =
        |work| estimate(&document, work).parts.iter().find(|part| part.what.contains("the mean of")).map(|p| p.bytes);
    assert_eq!(of(Work::Render { window: None, threads: 2 }), None);
    let bytes = of(Work::RenderTo { window: None, threads: 2, photon_sets: Goal::Time(60.0).photon_sets() }).unwrap();
    // Sums, the means of four streams, the first pass, and what pixels are drawn by: 264 + 84 + 32 bytes a pixel.
    assert_eq!(bytes, 380_000_000);
}

/// Straight hair on a disc.
fn hair_file(path: &Path, strands: u32, points: u32) {
    let at = |strand: u32, point: u32| {
        let (sin, cos) = (strand as f32 * 2.399_963).sin_cos();
        let radius = (strand as f32 / strands as f32).sqrt();
        Vec3::new(radius * cos, point as f32 * 0.02, radius * sin)
    };
    let strands = Strands {
        points: (0..strands).flat_map(|s| (0..points).map(move |p| at(s, p))).collect(),
        first: (0..=strands).map(|s| s * points).collect(),
        width: Attribute::Uniform(0.001),
        color: Attribute::Uniform(Vec3::splat(0.5)),
        transparency: Attribute::Uniform(0.5),
    };
    write_hair(&strands, path).unwrap();
}

/// A grid as OBJ text.
fn mesh_file(path: &Path, side: u32) {
    let mut text = String::new();
    for i in 0..side * side {
        text += &format!("v {} {} {}\n", i % side, i / side, (i % 97) as f32 * 0.01);
    }
    for (x, y) in (0..side - 1).flat_map(|y| (0..side - 1).map(move |x| (x, y))) {
        let corner = y * side + x + 1;
        text += &format!("f {corner} {} {} {}\n", corner + 1, corner + side + 1, corner + side);
    }
    fs::write(path, text).unwrap();
}

/// Peak memory of a render, and what it was said to be.
fn compare(folder: &Path, name: &str, more: &str) -> (f64, f64) {
    let document = scene::load(&folder.join(name), &[]).unwrap();
    let said = estimate(&document, Work::Render { window: None, threads: 2 }).bytes() as f64;
    let (code, text) = tress(folder, 16, &format!("render {name} -o a.exr --threads 2 --stats s.json {more}"));
    assert_eq!(code, Some(0), "{text}");
    let statistics: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("s.json")).unwrap()).unwrap();
    let stages = statistics[0]["stages"].as_array().unwrap();
    let taken = stages.iter().map(|stage| stage["peak_bytes"].as_f64().unwrap()).fold(0.0, f64::max);
    eprintln!(
        "{name}: {:.0} MiB said, {:.0} MiB taken, ratio {:.2}",
        said / 1048576.0,
        taken / 1048576.0,
        said / taken
    );
    (said, taken)
}

#[test]
fn shadow_maps_are_counted_as_large_as_they_may_become() {
    let folder = tempfile::tempdir().unwrap();
    hair_file(&folder.path().join("h.hair"), 20_000, 11);
    let lights = |resolution: &str| {
        let lamp = |kind: &str, place: &str, shadows: &str| {
            format!("[[light.{kind}]]\n{place}\nshadows = '{shadows}'\n{resolution}\n")
        };
        with_hair("file = 'h.hair'")
            + &lamp("point", "position = [0, 3, 0]\nintensity = [9, 9, 9]", "deep-map")
            + &lamp("point", "position = [0, 0.1, 0.2]\nintensity = [9, 9, 9]", "deep-map")
            + &lamp("directional", "direction = [0, -1, 0.5]\nirradiance = [1, 1, 1]", "map")
    };
    fs::write(folder.path().join("chosen.toml"), lights("")).unwrap();
    fs::write(folder.path().join("small.toml"), lights("map_resolution = 32\n")).unwrap();
    // What does not fit is refused, though the maps might turn out smaller.
    let (code, text) = tress(folder.path(), 4, "render chosen.toml -o a.exr --memory-limit 1GiB");
    assert_eq!(code, Some(3), "{text}");
    assert!(text.contains("most of it by the deep shadow map of light.point[1]: 512 MiB"), "{text}");
    // A given resolution bounds a map by itself.
    let (code, text) = tress(folder.path(), 4, "render small.toml -o a.exr --memory-limit 1GiB --threads 2");
    assert_eq!(code, Some(0), "{text}");
    for name in ["chosen.toml", "small.toml"] {
        let document = scene::load(&folder.path().join(name), &[]).unwrap();
        let parts = estimate(&document, Work::Render { window: None, threads: 2 }).parts;
        let said = |what: &str| parts.iter().find(|part| part.what == what).map_or(0, |part| part.bytes);
        let (said_bytes, taken) = compare(folder.path(), name, "--memory-limit none");
        assert!(said_bytes > taken, "{name}: {said_bytes} said, {taken} taken");
        let statistics: serde_json::Value =
            serde_json::from_slice(&fs::read(folder.path().join("s.json")).unwrap()).unwrap();
        let maps = statistics[0]["shadow_maps"].as_array().expect("maps");
        assert_eq!(maps.len(), 3);
        for map in maps {
            let (light, bytes) = (map["light"].as_str().unwrap(), map["bytes"].as_u64().unwrap());
            let most =
                said(&format!("the deep shadow map of {light}")).max(said(&format!("the shadow map of {light}")));
            eprintln!("{name}, {light}: {bytes} bytes of {most}");
            assert!(0 < bytes && bytes <= most, "{name}, {light}: {bytes} of {most}");
        }
    }
}

#[test]
fn the_estimate_is_near_what_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| fs::write(folder.path().join(name), text).unwrap();
    hair_file(&folder.path().join("h.hair"), 60_000, 11);
    mesh_file(&folder.path().join("m.obj"), 400);
    write("file.toml", with_hair("file = 'h.hair'"));
    write(
        "opening.toml",
        with_hair("file = 'h.hair'\n[occlusion]\nopening = 1.0")
            .replace("[[surface]]\nname = 'ball'\nsphere = {}\n", ""),
    );
    write("grown.toml", with_hair("grow = { on = 'ball', count = 60000, segments = 10 }"));
    write("mesh.toml", "environment.color = [1, 1, 1]\ncamera = { position = [200, 200, 500], target = [200, 200, 0], resolution = [64, 64] }\nsurface = [{ file = 'm.obj' }]".into());
    write("film.toml", "environment.color = [1, 1, 1]\ncamera = { position = [0, 0, 40], resolution = [1500, 1500] }\nsurface = [{ sphere = {} }]\noutput.layers = ['beauty', 'alpha', 'normal', 'depth']".into());
    for name in ["file.toml", "opening.toml", "grown.toml", "mesh.toml", "film.toml"] {
        let (said, taken) = compare(folder.path(), name, "");
        assert!((0.9..2.5).contains(&(said / taken)), "{name}: {said} said, {taken} taken");
    }
}
