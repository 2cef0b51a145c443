//! The first hair along a ray: the nearest, by the rules of what counts.

mod common;

use common::models::model;
use glam::Vec3;
use tress::embree::Device;
use tress::occlusion::raytraced::Ray;
use tress::occlusion::{HairRays, Transmittance};

#[test]
fn the_nearest_strand_is_the_first_and_the_own_part_does_not_count() {
    // Walls of ten strands along y at z = 1, 2 ... 10, in an order of their own.
    let depths = [7, 3, 10, 1, 5, 2, 9, 4, 8, 6];
    let points = depths.iter().flat_map(|&z| [-1.0, 0.5, 1.0].map(|y| Vec3::new(0.0, y, z as f32))).collect();
    let model = model(points, (0..=10).map(|strand| 3 * strand).collect(), 0.02, 0.5);
    let rays = HairRays::build(&Device::new().expect("a device"), &model, Transmittance::Crossing).expect("hair");
    let ray = |z: f32, far: f32| Ray { origin: Vec3::new(0.0, 0.1, z), direction: Vec3::Z, far, on: None };
    let first = |ray: &Ray| rays.first_crossing(&model, ray);
    let near = |found: Option<f32>, wanted: f32| {
        assert!(found.is_some_and(|d| (d - wanted).abs() < 1e-5), "{found:?}, {wanted}")
    };
    near(first(&ray(0.0, f32::INFINITY)), 1.0);
    near(first(&ray(4.5, f32::INFINITY)), 0.5);
    // Nothing behind the end of the ray, and nothing behind all hair.
    assert_eq!(first(&ray(4.5, 0.4)), None);
    assert_eq!(first(&ray(10.5, f32::INFINITY)), None);
    // From a point on the strand at z = 1 (number 3), grazing along it: its own neighbourhood does not count.
    let on = model.sample(6, 0.7).on;
    assert_eq!(on.strand, 3);
    let own = |from: f32| {
        let slanted = Vec3::new(0.0, 0.02, from).normalize();
        Ray { origin: Vec3::new(0.0, 0.05, 1.0 - from), direction: slanted, far: f32::INFINITY, on: Some(on) }
    };
    near(first(&Ray { on: None, ..own(0.1) }), 0.1_f32.hypot(0.02));
    let beyond = first(&own(0.1)).expect("the next strand");
    assert!(beyond > 1.0, "{beyond}");
}
