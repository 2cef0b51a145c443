//! Environment maps, their small bright sources, and area lights, as whole scenes see them.

mod common;

use std::path::Path;

use common::{block_difference, data, load, mean, whole};
use glam::{Mat3, Vec3};
use tress::illumination::Environment;
use tress::occlusion::{Igloo, Span};
use tress::render::Film;
use tress::scene::Scene;

fn lit_by(file: &str, more: &str) -> String {
    format!("[environment]\nfile = \"{file}\"\n{more}\n[[surface]]\nsphere = {{}}\n")
}

fn averages(scene: &Scene, faces: u32) -> Vec<Vec3> {
    let environment = Environment::new(scene.radiance.clone(), scene.sources.clone(), Mat3::IDENTITY, faces);
    environment.averages(&Igloo::new(Span::Sphere, faces))
}

#[test]
fn a_light_probe_is_the_environment_of_its_lat_long_conversion() {
    let Some(data) = data() else { return };
    let file = |name: &str| data.join("env").join(name).display().to_string();
    let probe = load(&lit_by(&file("uffizi_probe-128.exr"), "sources = \"none\""), &[]);
    let map = load(&lit_by(&file("uffizi_latlong_env-128.exr"), "sources = \"none\""), &[]);
    let (probe, map) = (averages(&probe, 36), averages(&map, 36));
    let sum = |faces: &[Vec3]| faces.iter().map(|mean| mean.y).sum::<f32>();
    let squares = |faces: &[Vec3]| faces.iter().map(|mean| mean.y * mean.y).sum::<f32>();
    // As a share of the faces' own root mean square: the picture has a tenth of its solid angle at ten times its mean.
    let difference = |other: &[Vec3]| {
        let differences: Vec<Vec3> = map.iter().zip(other).map(|(a, b)| a - b).collect();
        (squares(&differences) / squares(&map)).sqrt()
    };
    // Left and right exchanged: what another convention would give.
    let igloo = Igloo::new(Span::Sphere, 36);
    let mirrored: Vec<Vec3> =
        (0..igloo.len()).map(|face| probe[igloo.face_of(igloo.center(face) * Vec3::new(-1.0, 1.0, 1.0))]).collect();
    let (total, rms) = (sum(&probe) / sum(&map) - 1.0, difference(&probe));
    println!("RMS difference {rms:.4}, mirrored {:.4}, of the whole {total:+.4}", difference(&mirrored));
    // The conversion was resampled at 128 pixels a turn: what is left lies at the edges of the sky.
    assert!(total.abs() < 0.01 && rms < 0.05, "{total}, {rms}");
    assert!(difference(&mirrored) > 5.0 * rms);
}

#[test]
fn what_was_wrong_in_a_map_is_noted_with_its_place_and_goes_into_the_statistics() {
    let Some(data) = data() else { return };
    let file = data.join("env/uffizi_probe-128.exr").display().to_string();
    let (_, statistics) = whole(&lit_by(&file, ""), &["camera.resolution=[4, 4]"]);
    let note = statistics.notes.iter().find(|note| note.contains("values are negative; taken as 0; first in pixel"));
    assert!(note.is_some_and(|note| note.starts_with(&file)), "{:?}", statistics.notes);
}

/// Σ L cos θ dω over the upper half of a lat-long map, green, in f64.
fn irradiance_from_above(path: &Path) -> f64 {
    let rgb =
        tress::image::read(path, &tress::image::Limits::default()).and_then(|image| image.rgb()).expect("a picture");
    let (width, height) = (rgb.width as usize, rgb.height as usize);
    let sin2 = |row: usize| (std::f64::consts::PI * row as f64 / height as f64).sin().powi(2);
    let row = |y: usize| -> f64 {
        let sum: f64 = rgb.pixels[y * width..][..width].iter().map(|pixel| f64::from(pixel[1])).sum();
        // The integral of cos θ sin θ over the row.
        sum * std::f64::consts::TAU / width as f64 * 0.5 * (sin2(y + 1) - sin2(y))
    };
    (0..height / 2).map(row).sum()
}

#[test]
fn sources_change_how_a_map_is_lit_by_and_not_what_is_seen_of_it() {
    let Some(data) = data() else { return };
    let file = data.join("env/pmndrs_studio.hdr").display().to_string();
    // A floor without hair: sources as lights or in the faces, the irradiance is the same.
    let scene = format!(
        "[environment]\nfile = \"{file}\"\n[[surface]]\nplane = {{ size = [1, 1] }}\n[camera]\nposition = [0, 4, 4]\n\
         resolution = [32, 32]\n[occlusion]\nfaces = 100\n"
    );
    let picture = |settings: &[&str]| whole(&scene, settings);
    let (found, statistics) = picture(&[]);
    let (left, without) = picture(&["environment.sources=none"]);
    let on = |s: &tress::render::Statistics| s.effects.iter().any(|e| e.name == "small bright sources" && e.on);
    assert!(on(&statistics) && !on(&without));
    assert!(statistics.notes.iter().any(|note| note.contains("2 small bright sources with 94.5 % of its light")));
    let floor = |film: &Film| {
        let seen: Vec<f32> = film.pixels.iter().filter(|p| p.alpha == 1.0).map(|p| p.beauty.y).collect();
        assert!(seen.len() > 20);
        f64::from(seen.iter().sum::<f32>()) / seen.len() as f64
    };
    let want = 0.5 / std::f64::consts::PI * irradiance_from_above(Path::new(&file));
    let error = |film: &Film| floor(film) / want - 1.0;
    println!("floor: {:+.4} with sources, {:+.4} without", error(&found), error(&left));
    // A face knows no more than the mean of a lamp's cosine.
    assert!(error(&found).abs() < 0.01 && error(&left).abs() > 2.0 * error(&found).abs());
    for (a, b) in found.pixels.iter().zip(&left.pixels).filter(|(a, _)| a.alpha == 0.0) {
        assert_eq!(a.beauty, b.beauty);
    }
}

#[test]
fn a_sun_in_a_map_throws_the_shadow_of_a_directional_light() {
    // A pixel of 1 in 256 columns: 1.4 degrees. The same light by hand: radiance times solid angle.
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("sun.exr");
    let (width, height) = (256_usize, 128_usize);
    let mut pixels = vec![0.2_f32; width * height * 3];
    let (x, y) = (150, 40);
    pixels[(y * width + x) * 3..][..3].fill(10_000.0);
    let channels = ["R", "G", "B"].map(|name| (name.to_owned(), tress::image::PixelFormat::Float)).to_vec();
    tress::image::write_atomic(&path, &tress::image::ImageSpec::new(256, 128, channels), &pixels).expect("a picture");
    let pi = std::f64::consts::PI;
    let theta = |k: f64| pi * k / height as f64;
    let solid_angle = 2.0 * pi / width as f64 * (theta(y as f64).cos() - theta(y as f64 + 1.0).cos());
    let (elevation, turn) = (theta(y as f64 + 0.5), 2.0 * pi * (x as f64 + 0.5) / width as f64);
    let toward = [elevation.sin() * turn.sin(), elevation.cos(), -elevation.sin() * turn.cos()];
    let scene = r#"
[camera]
position = [0, 3, 6]
fov = 40
resolution = [64, 64]
background = false
[[surface]]
name = "ball"
sphere = { radius = 0.7 }
[[surface]]
plane = { center = [0, -0.9, 0], size = [8, 8] }
[[hair]]
transparency = 0.4
grow = { on = "ball", count = 3000, length = 0.5, width_root = 0.012, width_tip = 0.006 }
[sampling]
layers = 2
[occlusion]
accuracy = 0.02
"#;
    let (map, statistics) = whole(scene, &[&format!("environment.file={}", path.display())]);
    let light = format!(
        "light.directional[0]={{direction=[{}, {}, {}], irradiance=[{e}, {e}, {e}]}}",
        -toward[0],
        -toward[1],
        -toward[2],
        e = solid_angle * (10_000.0 - 0.2)
    );
    let (hand, _) = whole(scene, &["environment.color=[0.2, 0.2, 0.2]", &light]);
    assert!(statistics.notes.iter().any(|note| note.contains("1 small bright source with")), "{:?}", statistics.notes);
    let (difference, blocks) = (mean(&map) / mean(&hand) - 1.0, block_difference(&hand, &map));
    println!("sun: means differ by {difference:+.4}, blocks by {blocks:.4}");
    assert!(difference.abs() < 0.01 && blocks < 0.03, "{difference}, {blocks}");
}

/// A fur ball close under a small bright panel.
const UNDER_A_PANEL: &str = r#"
[camera]
position = [0, 1.5, 5]
fov = 35
resolution = [64, 64]
background = false
[[surface]]
name = "ball"
sphere = { radius = 0.8 }
color = [0.5, 0.4, 0.3]
[[surface]]
plane = { center = [0, -1.1, 0], size = [8, 8] }
[[hair]]
color = [0.6, 0.4, 0.2]
transparency = 0.3
grow = { on = "ball", count = 6000, length = 0.5, width_root = 0.012, width_tip = 0.006, gravity = 0.4 }
[[light.rect]]
center = [0.8, 2.2, 0.6]
edge_u = [0.4, 0, 0]
edge_v = [0, 0, 0.4]
radiance = [60, 60, 60]
[sampling]
layers = 2
"#;

#[test]
fn an_area_light_does_not_show_the_faces_of_the_igloo() {
    let picture = |settings: &[&str]| whole(UNDER_A_PANEL, settings).0;
    let coarse = picture(&["occlusion.faces=36"]);
    let fine = picture(&["occlusion.faces=400"]);
    let rays = picture(&["occlusion.faces=36", "occlusion.mode=raytraced", "sampling.seed=7"]);
    let free = picture(&["occlusion.faces=36", "occlusion.mode=none"]);
    for (what, other, bound) in [("400 faces", &fine, 0.02), ("rays", &rays, 0.03)] {
        let (difference, blocks) = (mean(other) / mean(&coarse) - 1.0, block_difference(&coarse, other));
        println!("36 faces against {what}: means {difference:+.4}, blocks {blocks:.4}");
        assert!(difference.abs() < 0.01 && blocks < bound, "{what}: {difference}, {blocks}");
    }
    assert!(mean(&free) > 1.1 * mean(&coarse), "without hair occlusion the light comes through whole");
}
