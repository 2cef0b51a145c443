//! Whole pictures: what must not change them, and that no value in them is not finite.

use std::path::Path;

use tress::render::progress::Unwatched;
use tress::render::{self, Options};
use tress::scene::{self, Scene};
use tress::selftest::pictures::{self, Light, Place};
use tress::selftest::rooms;

use crate::all_hold;

#[test]
fn pictures_with_direct_light_stay_the_same() {
    all_hold(&pictures::invariances(Light::Direct, &[]).expect("a picture"));
}

#[test]
fn the_order_of_strands_changes_no_bit() {
    all_hold(&[pictures::permutation().expect("a picture")]);
}

#[test]
fn a_mirrored_picture_differs_by_its_random_places_alone() {
    all_hold(&pictures::mirrored().expect("a picture"));
}

#[test]
fn nothing_shines_into_a_closed_box() {
    all_hold(&rooms::dark(&rooms::PLACES).expect("a picture"));
}

#[test]
fn rounded_bodies_have_no_black_facets_at_the_terminator() {
    all_hold(&rooms::terminator().expect("a picture"));
}

#[test]
fn pictures_under_a_sky_stay_the_same() {
    all_hold(&pictures::invariances(Light::Sky, &[]).expect("a picture"));
}

#[test]
#[ignore = "slow: pictures by clusters and by rays, too"]
fn pictures_stay_the_same_by_every_estimator() {
    // Within the bounds of all segments, though the tree's lumps and the rays' random directions change with the order of strands.
    for settings in [&["occlusion.opening=0.5"][..], &["occlusion.mode=raytraced", "occlusion.rays=2000"]] {
        all_hold(&pictures::invariances(Light::Sky, settings).expect("a picture"));
    }
}

#[test]
fn the_furnace_is_never_brighter_than_its_sky() {
    all_hold(&[pictures::furnace().expect("a picture")]);
}

#[test]
fn light_scales_from_1e_minus_20_to_1e20() {
    // By powers of two, so that every product scales exactly; 2^-66 is 1.4e-20; nine times 2^63 is 8e19, scenes go to 1e20.
    let lamp = |factor: f64| format!("light.point[0].intensity=[{0:e},{0:e},{0:e}]", 9.0 * factor);
    let sun = |factor: f64| format!("light.directional[0].irradiance=[{factor:e},{factor:e},{factor:e}]");
    let picture = |factor: f64| {
        let settings = [lamp(factor), sun(factor)];
        let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
        pictures::render(&pictures::strands(), Place::HERE, Light::Direct, &settings).expect("a picture")
    };
    let (one, _) = picture(1.0);
    for exponent in [-66, 63] {
        let factor = 2f64.powi(exponent);
        let (film, statistics) = picture(factor);
        assert_eq!(statistics.non_finite, 0);
        for (a, b) in one.pixels.iter().zip(&film.pixels) {
            let want = a.beauty.as_dvec3() * factor;
            // A pixel's darkest point may be 1e-6 of its brightest: 1e-26, far above the denormals.
            assert!(
                (b.beauty.as_dvec3() - want).abs().max_element() <= 2e-7 * want.max_element(),
                "{want} {:?}",
                b.beauty
            );
        }
    }
}

/// The projects' scenes, small, by both estimators.
#[test]
fn no_scene_has_a_value_that_is_not_finite() {
    let mut seen = 0;
    for entry in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")).expect("scenes") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        for mode in ["igloo", "raytraced"] {
            let settings = [format!("occlusion.mode={mode}"), "camera.resolution=[24,24]".to_owned()];
            let mut scene = Scene::load(scene::load(&path, &settings).expect("a scene")).expect("a scene");
            let (film, statistics) = render::render(&mut scene, &Options::default(), &Unwatched).expect("a picture");
            assert_eq!(statistics.non_finite, 0, "{}: {:?}", path.display(), statistics.non_finite_examples);
            assert!(film.pixels.iter().all(|p| p.beauty.is_finite() && (0.0..=1.0).contains(&p.alpha)));
            seen += 1;
        }
    }
    assert!(seen >= 10);
}

/// Cameras in hair, lights in hair and on surfaces, hair through the near plane, widths and sizes out of all proportion.
#[test]
fn no_hard_scene_has_a_value_that_is_not_finite() {
    let strands = pictures::strands();
    let root = strands[10][0];
    let at = |p: glam::DVec3| format!("[{:?},{:?},{:?}]", p.x, p.y, p.z);
    let cases: Vec<Vec<String>> = vec![
        vec![format!("camera.position={}", at(strands[10][3]))],
        vec![format!("camera.position={}", at(root)), "camera.near=1e-6".to_owned()],
        vec!["camera.near=3.5".to_owned()],
        vec![format!("light.point[0].position={}", at(strands[10][2]))],
        vec!["light.point[0].position=[0,-0.52,0]".to_owned(), "light.point[0].intensity=[1e20,1e20,1e20]".to_owned()],
        vec!["light.directional[0].direction=[1,0,0]".to_owned()],
        vec!["hair[0].width=1e-7".to_owned()],
        vec!["hair[0].width=10".to_owned()],
        vec!["hair[0].transparency=0".to_owned()],
        vec!["hair[0].transparency=1".to_owned()],
        vec!["hair[0].transparency=1e-38".to_owned()],
        vec!["hair[0].transform={scale=[-3, 0.01, 1]}".to_owned()],
        vec!["surface[0].transform={scale=[1e-3, -1, 1e3], rotate=[180,0,0]}".to_owned()],
        vec![
            "light.rect[0]={center=[0,-0.52,0], edge_u=[1,0,0], edge_v=[0,0,-1], radiance=[1e20,1e20,1e20]}".to_owned(),
        ],
    ];
    for light in [Light::Direct, Light::Sky] {
        for case in &cases {
            if light == Light::Sky && case.iter().any(|s| s.starts_with("light.point") || s.starts_with("light.dir")) {
                continue;
            }
            let settings: Vec<&str> = case.iter().map(String::as_str).collect();
            let (film, statistics) = pictures::render(&strands, Place::HERE, light, &settings).expect("a picture");
            assert_eq!(statistics.non_finite, 0, "{light:?} {case:?}: {:?}", statistics.non_finite_examples);
            let sane = |p: &tress::render::film::Pixel| {
                (0.0..=1.0).contains(&p.alpha)
                    && (0.0..=1.0 + 1e-6).contains(&p.occlusion)
                    && p.beauty.min_element() >= 0.0
            };
            assert!(film.pixels.iter().all(sane), "{light:?} {case:?}");
        }
    }
}
