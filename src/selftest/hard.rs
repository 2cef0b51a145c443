//! Small models that are hard on an estimator of Γ, each with points that look at it. The places of precision's loss, one by one.

use glam::{DVec3, Mat3, Vec3};

use crate::hair::{Attribute, HairModel, Strands};
use crate::hash::unit;
use crate::occlusion::{Receiver, frame_around};

/// A model and who looks at it.
pub struct Hard {
    pub name: &'static str,
    pub model: HairModel,
    pub receivers: Vec<Receiver>,
}

/// Strands of one width and transparency; what has no length is left out as in any scene.
pub fn model(strands: &[Vec<Vec3>], width: impl Fn(usize) -> f32, transparency: f32) -> HairModel {
    let mut first = vec![0];
    let mut widths = Vec::new();
    for (index, strand) in strands.iter().enumerate() {
        first.push(first[index] + strand.len() as u32);
        widths.extend(strand.iter().map(|_| width(index)));
    }
    let strands = Strands {
        points: strands.concat(),
        first,
        width: Attribute::PerPoint(widths),
        color: Attribute::Uniform(Vec3::ONE),
        transparency: Attribute::Uniform(transparency),
    };
    let mut model = HairModel::default();
    model.add(&strands, 0);
    model
}

fn free(position: Vec3) -> Receiver {
    Receiver { position, on: None, frame: Mat3::IDENTITY }
}

fn around(normal: Vec3) -> Receiver {
    Receiver { position: Vec3::ZERO, on: None, frame: frame_around(normal) }
}

/// A direction of an even lattice.
fn spread(index: u32, count: u32) -> Vec3 {
    super::truth::lattice(index, count).as_vec3()
}

/// Straight strands of `pieces` segments.
fn straight(ends: &[[Vec3; 2]], pieces: u32) -> Vec<Vec<Vec3>> {
    ends.iter().map(|[a, b]| (0..=pieces).map(|i| a.lerp(*b, i as f32 / pieces as f32)).collect()).collect()
}

/// Strands through a ball around the origin that leave its middle free.
fn tangle(count: u32, key: u32) -> Vec<[Vec3; 2]> {
    let one = |i| {
        let middle = spread(i, count) * (0.35 + 0.5 * unit(&[key, i]) as f32);
        let along = spread((i * 7 + 3) % count, count).cross(middle).normalize_or(Vec3::X);
        [middle - 0.4 * along, middle + 0.4 * along]
    };
    (0..count).map(one).collect()
}

/// Points on strands: the middle of a segment, and the two ends of one.
fn on_strands(model: &HairModel) -> Vec<Receiver> {
    let place = |segment: usize, u| {
        let sample = model.sample(segment.min(model.segments() - 1), u);
        Receiver { position: sample.position, on: Some(sample.on), frame: Mat3::IDENTITY }
    };
    vec![place(3, 0.5), place(model.segments() / 2, 0.0), place(model.segments() - 2, 1.0)]
}

/// All of them.
pub fn all() -> Vec<Hard> {
    let mut all = vec![axes(), end_on(), touching(), wide(), sub_ulp(), layers()];
    for (name, transparency) in [("t of 0", 0.0), ("t of 1", 1.0), ("t of 1e-38", 1e-38)] {
        let model = model(&straight(&tangle(120, 1), 6), |_| 0.02, transparency);
        let receivers = [vec![free(Vec3::ZERO)], on_strands(&model)].concat();
        all.push(Hard { name, model, receivers });
    }
    all.push(mixed());
    all
}

/// Along the axes, in the planes between them and through the poles of the igloo, a millionth off and exactly.
fn axes() -> Hard {
    let mut ends = Vec::new();
    for (i, lift) in [0.0, 1e-7, -1e-7, 1e-3, -0.2, 0.2, 0.5].into_iter().enumerate() {
        let far = 0.3 + 0.1 * i as f32;
        ends.push([Vec3::new(far, -0.6, lift), Vec3::new(far, 0.6, lift)]);
        ends.push([Vec3::new(-0.6, -far, lift), Vec3::new(0.6, -far, lift)]);
        ends.push([Vec3::new(lift, -0.6, far), Vec3::new(lift, 0.6, far)]);
        ends.push([Vec3::new(-0.6, lift, -far), Vec3::new(0.6, lift, -far)]);
        ends.push([Vec3::new(-far, lift, -0.5), Vec3::new(-far, lift, 0.5)]);
    }
    let model = model(&straight(&ends, 4), |_| 0.03, 0.2);
    let receivers = vec![free(Vec3::ZERO), around(Vec3::Z), around(Vec3::X), around(-Vec3::Z)];
    Hard { name: "pole, horizon, meridians", model, receivers }
}

/// Strands that point at the receiver, or past it by a millionth.
fn end_on() -> Hard {
    let one = |i: u32| {
        let toward = spread(i, 150);
        let off = toward.any_orthonormal_vector() * [0.0, 1e-6, 1e-4, 1e-2][i as usize % 4];
        [off + 0.2 * toward, off + 0.9 * toward]
    };
    let ends: Vec<_> = (0..150).map(one).collect();
    let model = model(&straight(&ends, 5), |_| 0.02, 0.3);
    Hard { name: "end-on", model, receivers: vec![free(Vec3::ZERO), around(Vec3::Y)] }
}

/// Points in, at the end of, and a millionth beside strands that are not their own.
fn touching() -> Hard {
    let ends = tangle(100, 2);
    let model = model(&straight(&ends, 4), |_| 0.015, 0.4);
    let mut receivers = on_strands(&model);
    for segment in [5, 101, 202] {
        let [a, b] = model.ends(segment);
        let beside = (b - a).any_orthonormal_vector() * 1e-6;
        receivers.extend([free(a.midpoint(b)), free(b), free(a.midpoint(b) + beside)]);
    }
    Hard { name: "points on hair, at its ends, beside it", model, receivers }
}

/// Ribbons as wide as their distance and wider.
fn wide() -> Hard {
    let ends = tangle(24, 3);
    let model = model(&straight(&ends, 3), |i| [0.05, 0.2, 0.6, 1.2][i % 4], 0.5);
    Hard { name: "ribbons wider than faces", model, receivers: vec![free(Vec3::ZERO), around(Vec3::X)] }
}

/// Strands of segments from a few digits to one in a million of the scene, and of points that lie upon each other.
fn sub_ulp() -> Hard {
    let one = |[a, b]: [Vec3; 2]| {
        let mut points = Vec::new();
        for i in 0..=8 {
            let here = a.lerp(b, i as f32 / 8.0);
            let along = (b - a).normalize();
            // Two digits further, the same once more, a millionth, a ten-thousandth.
            points.extend([
                here,
                here + along * 1.2e-7,
                here + along * 1.2e-7,
                here + along * 1e-6,
                here + along * 1e-4,
            ]);
        }
        points
    };
    let strands: Vec<_> = tangle(60, 4).into_iter().map(one).collect();
    let model = model(&strands, |_| 0.03, 0.3);
    let receivers = vec![free(Vec3::ZERO), around(Vec3::Z)];
    Hard { name: "segments below a digit", model, receivers }
}

/// Three thousand layers of hardly any opacity behind each other, and a curtain of 40 layers that hides everything.
fn layers() -> Hard {
    let mut ends = Vec::new();
    for i in 0..3000 {
        let height = 0.3 + 0.6 * (i as f32 / 3000.0);
        let across = 0.3 * (2.0 * unit(&[5, i]) as f32 - 1.0) * height;
        ends.push([Vec3::new(-0.5, across, height), Vec3::new(0.5, across, height)]);
    }
    let model = model(&straight(&ends, 1), |_| 0.01, 0.995);
    Hard { name: "thousands of layers", model, receivers: vec![free(Vec3::ZERO), around(Vec3::Z)] }
}

/// Widths from 1e-7 to 1 beside each other.
fn mixed() -> Hard {
    let ends = tangle(100, 6);
    let model = model(&straight(&ends, 4), |i| 10f32.powi(-(i as i32 % 8)), 0.5);
    Hard { name: "widths from 1e-7 to 1", model, receivers: vec![free(Vec3::ZERO), around(Vec3::Y)] }
}

/// One more strand, somewhere, for what adding hair may do.
pub fn with_another(hard: &Hard, key: u32) -> HairModel {
    let mut model = hard.model.clone();
    let a = DVec3::new(unit(&[7, key]), unit(&[8, key]), unit(&[9, key])).as_vec3() - 0.5;
    let b = DVec3::new(unit(&[10, key]), unit(&[11, key]), unit(&[12, key])).as_vec3() - 0.5;
    let strands = Strands {
        points: vec![a, a.midpoint(b), b],
        first: vec![0, 3],
        width: Attribute::Uniform(0.02),
        color: Attribute::Uniform(Vec3::ONE),
        transparency: Attribute::Uniform(0.3),
    };
    model.add(&strands, 0);
    model
}
