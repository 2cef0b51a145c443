//! Small models and random numbers for the unit tests.

use glam::{Mat3, Vec3};

use super::Receiver;
use crate::hair::{Attribute, HairModel, Strands};
use crate::hash::unit;

/// A uniform number in [0, 1).
pub fn random(key: &[u32]) -> f32 {
    unit(key) as f32
}

/// A uniform number in [-1, 1).
pub fn signed(key: &[u32]) -> f32 {
    2.0 * random(key) - 1.0
}

/// A uniform direction.
pub fn direction(key: &[u32]) -> Vec3 {
    let two = |axis: u32| random(&[key, &[axis]].concat());
    let z = 2.0 * two(0) - 1.0;
    let (sin, cos) = (std::f32::consts::TAU * two(1)).sin_cos();
    Vec3::new(cos, sin, 0.0) * (1.0 - z * z).max(0.0).sqrt() + Vec3::Z * z
}

/// A uniform rotation: a direction as z, turned about itself.
pub fn rotation(key: &[u32]) -> Mat3 {
    crate::igloo::frame_around(direction(key)) * Mat3::from_rotation_z(6.0 * random(&[key, &[9]].concat()))
}

/// A point off hair, looking along a random frame.
pub fn receiver(position: Vec3, key: u32) -> Receiver {
    Receiver { position, on: None, frame: rotation(&[70, key]) }
}

pub fn model(points: Vec<Vec3>, first: Vec<u32>, width: Vec<f32>, transparency: f32) -> HairModel {
    let strands = Strands {
        points,
        first,
        width: Attribute::PerPoint(width),
        color: Attribute::Uniform(Vec3::ONE),
        transparency: Attribute::Uniform(transparency),
    };
    let mut model = HairModel::default();
    assert_eq!(model.add(&strands, 0), 0, "segments of no length");
    model
}

/// Strands of half a unit that grow from the unit sphere outwards with a random walk and taper to half of `width`.
pub fn ball(strands: u32, segments: u32, width: f32, transparency: f32) -> HairModel {
    let (mut points, mut widths, mut first) = (Vec::new(), Vec::new(), vec![0]);
    for strand in 0..strands {
        let mut here = direction(&[71, strand]);
        let mut toward = here;
        for point in 0..=segments {
            points.push(here);
            widths.push(width * (1.0 - 0.5 * point as f32 / segments as f32));
            toward = (toward + 0.25 * direction(&[72, strand, point])).normalize();
            here += toward * (0.5 / segments as f32);
        }
        first.push(points.len() as u32);
    }
    model(points, first, widths, transparency)
}
