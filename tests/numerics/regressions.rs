//! Faults that the suite found, each by its cause.

use glam::Vec3;
use tress::hair::{Attribute, HairModel, Strands};
use tress::illumination::{DirectLight, Lamp, Radiance};
use tress::occlusion::Transmittance;
use tress::render::progress::Unwatched;
use tress::render::{self, Options};

#[test]
fn power_of_transparency_loses_short_lengths() {
    // 1 - t^x was 0 below x = 1e-7: hair cut finely let all light through.
    let rule = Transmittance::SegmentLength { unit: 1.0 };
    let whole = f64::from(rule.opacity(0.5, 1e-4));
    let parts: f64 = (0..1000).map(|_| f64::from(rule.opacity(0.5, 1e-7))).sum();
    assert!((parts / whole - 1.0).abs() < 1e-4, "{parts:e} of {whole:e}");
    // And 0^0 is a length of nothing, not a number that is none.
    assert_eq!((rule.opacity(0.0, 0.0), rule.opacity(0.0, 1e-30), rule.opacity(1.0, 5.0)), (0.0, 1.0, 0.0));
}

#[test]
fn underflow_of_a_square_bends_the_tangent() {
    // Lengths below 1e-19 have squares below the normal numbers: the tangent's length was off by up to all of it.
    for length in [1e-17_f32, 1e-19, 1e-20, 3e-22, 1e-30] {
        let strands = Strands {
            points: vec![Vec3::ZERO, Vec3::new(length, 0.3 * length, 0.0), Vec3::Y],
            first: vec![0, 3],
            width: Attribute::Uniform(0.01),
            color: Attribute::Uniform(Vec3::ONE),
            transparency: Attribute::Uniform(0.5),
        };
        let mut model = HairModel::default();
        model.add(&strands, 0);
        for segment in 0..model.segments() {
            let tangent = model.sample(segment, 0.5).tangent;
            assert!((tangent.length() - 1.0).abs() < 1e-6, "{length:e}: {tangent}");
        }
    }
}

#[test]
fn a_light_at_the_point_gives_no_infinity() {
    let light = DirectLight::Point { position: Vec3::ZERO, intensity: Vec3::splat(1e20) };
    for distance in [1e-19_f32, 1e-18, 1e-12, 1e-10, 1e-9] {
        if let Some(incident) = light.incident(Vec3::X * distance) {
            assert!(incident.irradiance.is_finite(), "{distance:e}: {:?}", incident);
            assert!((incident.toward.length() - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn a_sum_beyond_all_numbers_is_counted() {
    let text = "camera = { position = [0, 5, 0], up = [0, 0, -1], resolution = [8, 8] }\n\
                [[surface]]\nplane = { size = [40, 40] }\ncolor = [0.5, 0.5, 0.5]\n\
                [environment]\ncolor = [1, 1, 1]\n\
                [[light.directional]]\ndirection = [0, -1, 0]\nirradiance = [1, 1, 1]\n";
    let mut scene = crate::common::load(text, &[]);
    // Beyond what a scene file may say: six suns give the floor 2.4e38, the sky 1.4e38. Each is a number, their sum is none.
    let light = DirectLight::Directional { toward: Vec3::Y, irradiance: Vec3::splat(2.5e38) };
    scene.direct = vec![Lamp { light, blocked: true }; 6];
    scene.shadows = vec![scene.shadows[0].clone(); 6];
    scene.radiance = Radiance::Uniform(Vec3::splat(2.8e38));
    let (film, statistics) = render::render(&mut scene, &Options::default(), &Unwatched).expect("a picture");
    assert!(film.pixels.iter().all(|pixel| pixel.beauty.is_finite()));
    assert_eq!(statistics.non_finite, 64);
    println!("{:?}", statistics.non_finite_examples[0]);
}
