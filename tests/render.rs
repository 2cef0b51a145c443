//! Whole renders of small scenes, against closed forms, against each other, and bit by bit.

mod common;

use std::sync::atomic::{AtomicU64, Ordering};

use common::{block_difference, film, load, mean, whole};
use tress::fragment::PixelRect;
use tress::render::progress::Progress;
use tress::render::{self, Film, Options, RenderError};

/// White hair on a sphere that is not seen, under a uniform sky of radiance 1.
const FURNACE: &str = r#"
[camera]
position = [0, 0, 6]
fov = 40
resolution = [48, 48]
background = false
[[surface]]
name = "ball"
sphere = { radius = 1.0 }
visible = false
[[hair]]
color = [1, 1, 1]
specular = [0, 0, 0]
grow = { on = "ball", count = 3000, length = 0.6, width_root = 0.02, width_tip = 0.02, curl_radius = 0.05 }
[environment]
color = [1, 1, 1]
[occlusion]
mode = "none"
"#;

/// Hair, surfaces, and a light of each kind.
const EVERYTHING: &str = r#"
[camera]
position = [0.5, 1.5, 4.5]
target = [0, 0.1, 0]
fov = 38
resolution = [64, 56]
[[surface]]
name = "ball"
sphere = { radius = 0.7 }
color = [0.6, 0.4, 0.3]
[[surface]]
plane = { center = [0, -0.9, 0], size = [8, 8] }
[[hair]]
color = [0.5, 0.3, 0.15]
transparency = 0.4
grow = { on = "ball", count = 4000, length = 0.5, width_root = 0.012, width_tip = 0.006, gravity = 0.6, clumping = 0.5 }
[environment]
gradient = { zenith = [0.5, 0.7, 1.0], horizon = [0.8, 0.8, 0.8], nadir = [0.2, 0.2, 0.2] }
[[light.point]]
position = [2, 2, 2]
intensity = [6, 5, 4]
[[light.directional]]
direction = [-1, -2, -0.5]
irradiance = [1, 1, 1.2]
[[light.rect]]
center = [-2, 1.5, 1]
edge_u = [0, 0, -1]
edge_v = [0.6, 0.8, 0]
radiance = [3, 2, 2]
[sampling]
layers = 4
"#;

/// Beauty over alpha where the pixel is mostly covered.
fn covered(film: &Film) -> Vec<f32> {
    let pixels = film.pixels.iter().filter(|pixel| pixel.alpha > 0.5);
    pixels.map(|pixel| pixel.beauty.y / pixel.alpha).collect()
}

#[test]
fn white_hair_in_a_furnace_is_as_bright_as_the_sky() {
    let (film, statistics) = whole(FURNACE, &[]);
    let values = covered(&film);
    assert!(values.len() > 200, "{} pixels", values.len());
    assert!(values.iter().all(|value| (value - 1.0).abs() < 0.01), "{values:?}");
    assert_eq!(statistics.non_finite, 0);
}

#[test]
fn without_occlusion_hair_does_not_dim_what_surfaces_reflect() {
    // A white ball under its hair: each face's ray meets sky or a surface that is as bright as the sky.
    let (film, _) = whole(FURNACE, &["surface[0].visible=true", "surface[0].color=[1, 1, 1]"]);
    assert!(covered(&film).iter().all(|value| (value - 1.0).abs() < 0.01), "{:?}", covered(&film));
}

#[test]
fn a_highlight_in_a_furnace_takes_its_share() {
    let (film, _) = whole(FURNACE, &["hair[0].color=[0.6, 0.6, 0.6]", "hair[0].specular=[0.4, 0.4, 0.4]"]);
    let values = covered(&film);
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    assert!((mean - 1.0).abs() < 0.01, "{mean}");
}

#[test]
fn a_white_sphere_in_a_furnace_vanishes() {
    let scene = r#"
[camera]
position = [0, 0, 5]
resolution = [32, 32]
[[surface]]
sphere = { radius = 1.0 }
color = [1, 1, 1]
[environment]
color = [1, 1, 1]
"#;
    let (film, _) = whole(scene, &[]);
    assert!(film.pixels.iter().any(|pixel| pixel.alpha == 1.0) && film.pixels.iter().any(|pixel| pixel.alpha == 0.0));
    for pixel in &film.pixels {
        assert!((pixel.beauty.y - 1.0).abs() < 0.01, "{pixel:?}");
    }
}

#[test]
fn the_picture_does_not_depend_on_threads_or_crop() {
    let by_hand = ["occlusion.faces=40", "occlusion.rays=80"];
    let by_accuracy = ["occlusion.accuracy=0.02"];
    for (mode, more) in [
        ("igloo", &by_hand[..1]),
        ("raytraced", &by_hand),
        ("none", &by_hand[..1]),
        ("raytraced", &by_accuracy),
        ("auto", &by_accuracy),
    ] {
        let mode = format!("occlusion.mode={mode}");
        let settings = [&[mode.as_str()], more].concat();
        let render = |window, threads| film(EVERYTHING, &settings, Options { window, threads: Some(threads) }).0;
        let one = render(None, 1);
        assert_eq!(one, render(None, 2), "{mode}: two threads");
        let window = PixelRect { min: [13, 9], max: [50, 42] };
        let mut patched = Film { pixels: one.pixels.clone(), ..one };
        for pixel in patched.pixels.iter_mut().enumerate().filter(|(i, _)| {
            let [x, y] = [*i as u32 % 64, *i as u32 / 64];
            (13..50).contains(&x) && (9..42).contains(&y)
        }) {
            *pixel.1 = Default::default();
        }
        patched.place(&window, &render(Some(window), 2).pixels);
        assert_eq!(one, patched, "{mode}: a crop put back");
    }
}

#[test]
fn the_accuracy_decides_how_finely_and_auto_by_what() {
    let settled = |settings: &[&str]| {
        let small = ["camera.resolution=[32, 28]", "sampling.layers=1"];
        whole(EVERYTHING, &[&small[..], settings].concat()).1.occlusion
    };
    let igloo = |accuracy: &str| settled(&[accuracy]).expect("settings found");
    let (coarse, fine) = (igloo("occlusion.accuracy=0.03"), igloo("occlusion.accuracy=0.006"));
    for (coarse, fine) in [(coarse.hair, fine.hair), (coarse.surface, fine.surface)] {
        let [coarse, fine] = [coarse, fine].map(|found| found.expect("points of both kinds"));
        let [a, b] = [coarse, fine].map(|found| found.projection.expect("a projection"));
        assert!(a.reached && a.error <= 0.03 && b.error <= 0.006 || !b.reached, "{coarse:?}, {fine:?}");
        assert!(b.work > a.work && fine.rays > coarse.rays, "{coarse:?}, {fine:?}");
    }
    // What is said by hand is not looked for.
    assert_eq!(settled(&["occlusion.opening=1"]), None);
    assert_eq!(settled(&["occlusion.mode=raytraced", "occlusion.rays=50"]), None);
    assert_eq!(settled(&["occlusion.thinning.fraction=0.5"]), None);
    let traced = settled(&["occlusion.mode=raytraced"]).expect("rays found");
    assert!(traced.estimator == "raytraced" && traced.hair.is_some_and(|found| found.projection.is_none()));
    let auto = settled(&["occlusion.mode=auto", "occlusion.accuracy=0.01"]).expect("a choice");
    assert!(auto.estimator == "igloo" && auto.reason.contains("times as fast as tracing rays"), "{auto:?}");
    let lengths = ["occlusion.mode=auto", "occlusion.transmittance=segment-length"];
    assert_eq!(settled(&lengths).map(|settled| settled.estimator), Some("raytraced"));
}

#[test]
fn both_estimators_make_the_same_picture() {
    let settings = |mode: &'static str| [mode, "occlusion.faces=200", "occlusion.accuracy=0.005"];
    let (igloo, statistics) = whole(EVERYTHING, &settings("occlusion.mode=igloo"));
    let (rays, _) = whole(EVERYTHING, &settings("occlusion.mode=raytraced"));
    let (none, _) = whole(EVERYTHING, &settings("occlusion.mode=none"));
    assert_eq!(statistics.non_finite, 0);
    let difference = mean(&igloo) / mean(&rays) - 1.0;
    assert!(difference.abs() < 0.01, "means differ by {difference}");
    let blocks = block_difference(&igloo, &rays);
    assert!(blocks < 0.03, "8x8 blocks differ by {blocks}");
    assert!(mean(&none) > 1.05 * mean(&rays), "without occlusion the picture is brighter");
}

#[test]
fn the_papers_own_ways_make_nearly_the_same_picture() {
    let settings = |own: &[&'static str]| {
        let small =
            ["camera.resolution=[24, 21]", "sampling.layers=1", "hair[0].grow.count=1500", "occlusion.faces=60"];
        [&small, own].concat()
    };
    let (usual, _) = whole(EVERYTHING, &settings(&[]));
    let mut films = vec![usual];
    for (own, bound) in [
        (&["occlusion.thinning.fraction=1"][..], 0.01),
        (&["occlusion.thinning.distance_unit=0.5"], 0.01),
        (&["occlusion.thinning.fraction=0.3"], 0.05),
        (&["occlusion.projection=tangent-plane"], 0.03),
        (&["occlusion.projection=tangent-plane", "occlusion.thinning.distance_unit=0.5"], 0.03),
        (&["occlusion.projection=tangent-plane", "occlusion.transmittance=segment-length"], 0.3),
    ] {
        let (film, statistics) = whole(EVERYTHING, &settings(own));
        assert_eq!(statistics.non_finite, 0);
        let difference = mean(&film) / mean(&films[0]) - 1.0;
        println!("{own:?}: {difference:+.4}");
        assert!(difference.abs() < bound, "{own:?}: means differ by {difference}");
        assert!(films.iter().all(|other| *other != film), "{own:?} changes nothing");
        films.push(film);
    }
}

#[test]
fn alpha_is_the_same_for_any_number_of_shaded_layers() {
    let alpha = |layers: &str| {
        let (film, statistics) = whole(FURNACE, &[layers, "hair[0].transparency=0.6"]);
        (film.pixels.iter().map(|pixel| pixel.alpha).collect::<Vec<_>>(), statistics.hair_points)
    };
    let (one, few_points) = alpha("sampling.layers=1");
    let (all, many_points) = alpha("sampling.layers=1000");
    assert_eq!(one, all);
    assert!(many_points > 3 * few_points);
    let (gamma, _) = whole(FURNACE, &["sampling.layers=2", "sampling.layer_choice=gamma"]);
    assert!(covered(&gamma).iter().all(|value| (value - 1.0).abs() < 0.01));
}

/// A floor of albedo 0.5 seen from straight above, black sky.
const FLOOR: &str = r#"
[camera]
position = [0, 10, 0]
up = [0, 0, -1]
fov = 20
resolution = [33, 33]
background = false
[[surface]]
plane = { size = [20, 20] }
color = [0.5, 0.5, 0.5]
"#;

fn center(film: &Film) -> glam::Vec3 {
    film.pixels[film.pixels.len() / 2].beauty
}

#[test]
fn lights_on_a_floor_have_their_closed_forms() {
    // A point light of intensity 8 at height 2: E = 8 / 4 = 2, L = 0.5 * 2 / pi.
    let (film, _) = whole(FLOOR, &["light.point[0]={position=[0,2,0], intensity=[8,8,8]}"]);
    let want = 0.5 * 2.0 / std::f32::consts::PI;
    assert!((center(&film).y / want - 1.0).abs() < 1e-3, "{}", center(&film));
    // Parallel light at 60 degrees from the normal: E = 3 cos 60.
    let (film, _) = whole(FLOOR, &["light.directional[0]={direction=[0.8660254, -0.5, 0], irradiance=[3,3,3]}"]);
    let want = 0.5 * 1.5 / std::f32::consts::PI;
    assert!((center(&film).y / want - 1.0).abs() < 1e-4, "{}", center(&film));
    // A square of half side 0.5 at height 0.8 (Siegel and Howell, C-11), 64 samples.
    let light = "light.rect[0]={center=[0,0.8,0], edge_u=[1,0,0], edge_v=[0,0,1], radiance=[1,1,1]}";
    let (film, _) = whole(FLOOR, &[light, "sampling.area_light_samples=1024", "camera.position=[8,6,0]"]);
    let root = (0.25_f32 + 0.64).sqrt();
    let form = 4.0 * 0.5 / root * (0.5 / root).atan();
    let want = 0.5 * form / std::f32::consts::PI;
    assert!((center(&film).y / want - 1.0).abs() < 0.01, "{} against {want}", center(&film));
}

#[test]
fn a_crossing_of_hair_dims_a_light_by_its_transparency() {
    // One hair 0.4 wide lies across the axis between a sun and the floor.
    let hair = |transparency: f32| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("one.txt");
        std::fs::write(&path, "-3 1 0 0.2\n3 1 0 0.2\n").expect("a hair file");
        let settings = [
            "light.directional[0]={direction=[0,-1,0], irradiance=[1,1,1]}".to_owned(),
            format!("hair[0]={{file=\"{}\", transparency={transparency}}}", path.display()),
            // From the side, so that the hair does not hide the point that it shadows.
            "camera.position=[0,10,6]".to_owned(),
        ];
        let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
        center(&whole(FLOOR, &settings).0).y
    };
    let free = 0.5 / std::f32::consts::PI;
    for transparency in [0.0, 0.3, 0.7, 1.0] {
        let got = hair(transparency);
        assert!((got - free * transparency).abs() < 1e-4, "t = {transparency}: {got} of {free}");
    }
}

#[test]
fn hair_behind_a_surface_is_not_seen() {
    let wall = "surface[1]={plane={center=[0,0,3], normal=[0,0,1], size=[20,20]}, color=[0,0,0]}";
    let (film, statistics) = whole(FURNACE, &[wall]);
    assert!(film.pixels.iter().all(|pixel| pixel.beauty.y == 0.0 && pixel.alpha == 1.0));
    assert_eq!(statistics.hair_points, 0);
}

#[test]
fn place_and_size_of_the_scene_do_not_change_the_picture() {
    let text = |k: f64, at: f64| {
        format!(
            r#"
[camera]
position = [{0}, {0}, {1}]
target = [{0}, {0}, {0}]
fov = 40
resolution = [32, 32]
[[surface]]
name = "ball"
sphere = {{ center = [{0}, {0}, {0}], radius = {k} }}
[[hair]]
grow = {{ on = "ball", count = 800, length = {2}, width_root = {3}, width_tip = {3} }}
[[light.point]]
position = [{0}, {1}, {1}]
intensity = [{4}, {4}, {4}]
[environment]
color = [0.5, 0.5, 0.5]
[occlusion]
faces = 30
"#,
            at,
            at + 5.0 * k,
            0.5 * k,
            0.02 * k,
            20.0 * k * k
        )
    };
    let reference = whole(&text(1.0, 0.0), &[]).0;
    for (k, at) in [(1e-4, 0.0), (1e4, 0.0), (1.0, 1e6), (1e4, -1e7)] {
        let other = whole(&text(k, at), &[]).0;
        // Grown points are rounded to f32 in the scene's units moved to the origin: a few parts in 1e7 move a few fragments.
        let difference = block_difference(&reference, &other);
        assert!(difference < 2e-3, "scale {k}, at {at}: {difference}");
        assert!((mean(&other) / mean(&reference) - 1.0).abs() < 1e-3, "scale {k}, at {at}");
    }
}

/// Cancels after a number of looks.
struct Impatient(AtomicU64);

impl Progress for Impatient {
    fn stage(&self, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn message(&self, _: &str) {}
    fn cancelled(&self) -> bool {
        self.0.fetch_add(1, Ordering::Relaxed) > 20
    }
}

#[test]
fn a_cancelled_render_stops_within_a_few_points() {
    let mut scene = load(EVERYTHING, &[]);
    let progress = Impatient(AtomicU64::new(0));
    let result = render::render(&mut scene, &Options::default(), &progress);
    assert!(matches!(result, Err(RenderError::Cancelled)));
    assert!(progress.0.load(Ordering::Relaxed) < 100);
}

#[test]
fn hair_that_does_not_gather_is_lit_by_point_lights_alone() {
    let lamp =
        ["light.point=[{position=[2,2,3],intensity=[8,8,8]}]", "occlusion.mode=igloo", "camera.resolution=[24,24]"];
    let (all, _) = whole(FURNACE, &lamp);
    let (direct, _) = whole(FURNACE, &[&lamp[..], &["hair[0].gather=false"]].concat());
    assert!(all.pixels.iter().any(|pixel| pixel.environment.y > 0.1));
    for (all, direct) in all.pixels.iter().zip(&direct.pixels) {
        assert_eq!(direct.environment, glam::Vec3::ZERO);
        assert_eq!((direct.direct, direct.alpha), (all.direct, all.alpha));
    }
}
