//! Hair segments in Embree against the same rule in double precision, ray by ray and segment by segment.

use std::ops::ControlFlow;
use std::path::Path;

use glam::{DVec3, Vec3, Vec4};
use rayon::prelude::*;
use tress::embree::{Crossing, CurveScene, Device};

const RAYS: u64 = 3000;
/// How near to a bound of the rule, relative to the radius or to the segment, single precision may decide either way.
const BORDERLINE: f64 = 5e-4;

/// A uniform number in [0, 1) from a seed and a purpose.
fn random(seed: u64, purpose: u64) -> f32 {
    let mut x = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ purpose.wrapping_mul(0xd1b5_4a32_d192_ed03);
    for multiplier in [0xbf58_476d_1ce4_e5b9_u64, 0x94d0_49bb_1331_11eb] {
        x = (x ^ (x >> 30)).wrapping_mul(multiplier);
    }
    ((x ^ (x >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

fn random_direction(seed: u64, purpose: u64) -> Vec3 {
    let z = 2.0 * random(seed, purpose) - 1.0;
    let (sin, cos) = (std::f32::consts::TAU * random(seed, purpose + 1)).sin_cos();
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(radius * cos, radius * sin, z)
}

struct Hair {
    vertices: Vec<Vec4>,
    segments: Vec<u32>,
}

impl Hair {
    /// Strands on a sphere, bent by gravity and noise, thinner towards the tip; about unit size.
    fn grown(strands: u64, points: u64) -> Self {
        let mut hair = Self { vertices: Vec::new(), segments: Vec::new() };
        for strand in 0..strands {
            let mut direction = random_direction(strand, 10);
            let mut position = 0.5 * direction;
            let radius = 0.004 + 0.008 * random(strand, 20);
            for point in 0..points {
                if point + 1 < points {
                    hair.segments.push(hair.vertices.len() as u32);
                }
                hair.vertices.push(position.extend(radius * (1.0 - 0.9 * point as f32 / points as f32)));
                let noise = random_direction(strand * 1000 + point, 30);
                direction = (direction + 0.3 * noise - 0.15 * Vec3::Y).normalize();
                position += 0.03 * direction;
            }
        }
        hair
    }

    /// A `.hair` file with points only taken from it, moved to the origin and scaled to unit size. None where there is no such file.
    fn read(path: &Path, radius: f32) -> Option<Self> {
        let Ok(bytes) = std::fs::read(path) else {
            eprintln!("skipped: {} is not there", path.display());
            return None;
        };
        let word = |offset: usize| u32::from_le_bytes(bytes[offset..offset + 4].try_into().unwrap());
        assert_eq!(&bytes[..4], b"HAIR");
        let (strands, points, flags, default_segments) = (word(4) as usize, word(8) as usize, word(12), word(16));
        let has_counts = flags & 1 != 0;
        let counts = |strand: usize| match has_counts {
            true => u32::from(u16::from_le_bytes(bytes[128 + 2 * strand..][..2].try_into().unwrap())),
            false => default_segments,
        };
        let start = 128 + if has_counts { 2 * strands } else { 0 };
        let position = |i: usize| Vec3::from_array([0, 4, 8].map(|o| f32::from_bits(word(start + 12 * i + o))));
        let all: Vec<Vec3> = (0..points).map(position).collect();
        let (low, high) = all.iter().fold((all[0], all[0]), |(l, h), &p| (l.min(p), h.max(p)));
        let scale = 1.0 / (high - low).max_element();
        let centre = 0.5 * (low + high);
        let vertices = all.iter().map(|&p| (scale * (p - centre)).extend(scale * radius)).collect();
        let mut segments = Vec::new();
        let mut first = 0;
        for strand in 0..strands {
            segments.extend(first..first + counts(strand));
            first += counts(strand) + 1;
        }
        Some(Self { vertices, segments })
    }

    /// A sphere around a segment with room to spare: what passes it needs no closer look.
    fn sphere(&self, first: usize) -> (DVec3, f64) {
        let [from, to] = [self.vertices[first], self.vertices[first + 1]].map(Vec4::as_dvec4);
        let half = 0.5 * (to - from).truncate();
        (from.truncate() + half, 1.01 * (half.length() + from.w.max(to.w)))
    }

    /// Half the rays start on strands, where shading points are, half at a distance.
    fn ray(&self, seed: u64) -> (Vec3, Vec3) {
        if seed.is_multiple_of(2) {
            let first = self.segments[(random(seed, 40) * self.segments.len() as f32) as usize] as usize;
            let (a, b) = (self.vertices[first].truncate(), self.vertices[first + 1].truncate());
            (a.lerp(b, 0.1 + 0.8 * random(seed, 41)), random_direction(seed, 42))
        } else {
            let origin = 2.0 * random_direction(seed, 43);
            (origin, (0.5 * random_direction(seed, 45) * random(seed, 47) - origin).normalize())
        }
    }
}

/// The flat-linear-curve rule. With a crossing comes how far it is from not being one, and the other way round, relative to what decides.
fn brute_force(from: Vec4, to: Vec4, origin: Vec3, direction: Vec3) -> (bool, f64, f64) {
    let (origin, direction) = (origin.as_dvec3(), direction.as_dvec3().normalize());
    let split = |vertex: Vec4| -> (DVec3, f64) {
        let p = vertex.truncate().as_dvec3() - origin;
        (p - p.dot(direction) * direction, p.dot(direction))
    };
    let ((p0, t0), (p1, t1)) = (split(from), split(to));
    let axis = p1 - p0;
    let u = -p0.dot(axis) / axis.length_squared();
    let inside = u.clamp(0.0, 1.0);
    let radius = f64::from(from.w) + inside * f64::from(to.w - from.w);
    let distance = t0 + inside * (t1 - t0);
    let off = (p0 + inside * axis).length();
    let margins = [u, 1.0 - u, 1.0 - off / radius, (distance - 2.0 * radius) / radius];
    let smallest = margins.into_iter().fold(f64::INFINITY, f64::min);
    (smallest > 0.0, smallest.abs(), distance)
}

fn visited(scene: &CurveScene, origin: Vec3, direction: Vec3) -> Vec<Crossing> {
    let mut crossings = Vec::new();
    let broke = scene.crossings(origin, direction, 0.0, f32::INFINITY, |crossing| {
        crossings.push(crossing);
        ControlFlow::Continue(())
    });
    assert!(!broke);
    crossings.sort_by_key(|c| c.segment);
    crossings
}

/// Compares every ray with every segment; returns (crossings, those that single precision decided differently).
fn compare(hair: &Hair) -> (usize, usize) {
    let scene = CurveScene::build(&Device::new().unwrap(), hair.vertices.clone(), hair.segments.clone()).unwrap();
    let spheres: Vec<(DVec3, f64)> = hair.segments.iter().map(|&first| hair.sphere(first as usize)).collect();
    let one = |seed: u64| {
        let (origin, direction) = hair.ray(seed);
        let (axis_origin, axis) = (origin.as_dvec3(), direction.as_dvec3().normalize());
        let found = visited(&scene, origin, direction);
        assert!(found.windows(2).all(|w| w[0].segment < w[1].segment), "ray {seed}: a segment was reported twice");
        let mut differing = 0;
        for (segment, &first) in hair.segments.iter().enumerate() {
            let got = found.binary_search_by_key(&(segment as u32), |c| c.segment);
            let (centre, reach) = spheres[segment];
            if (centre - axis_origin).cross(axis).length_squared() > reach * reach {
                assert!(got.is_err(), "ray {seed} passes segment {segment} at a distance");
                continue;
            }
            let (from, to) = (hair.vertices[first as usize], hair.vertices[first as usize + 1]);
            let (expected, margin, distance) = brute_force(from, to, origin, direction);
            if expected != got.is_ok() {
                assert!(margin < BORDERLINE, "ray {seed}, segment {segment}: expected {expected}, margin {margin:e}");
                differing += 1;
            } else if let Ok(i) = got {
                let error = (f64::from(found[i].distance) - distance).abs();
                assert!(error < 1e-4, "ray {seed}, segment {segment}: distance {} not {distance}", found[i].distance);
            }
        }
        (found.len(), differing)
    };
    (0..RAYS).into_par_iter().map(one).reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
}

#[test]
fn crossings_are_those_of_brute_force() {
    let (crossings, differing) = compare(&Hair::grown(2000, 11));
    eprintln!("grown: {crossings} crossings, {differing} decided differently at a bound");
    assert!(crossings > 4000);
    assert!(differing * 2000 <= crossings, "{differing} of {crossings}");
}

#[test]
fn crossings_of_a_real_model_are_those_of_brute_force() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/hair/yuksel_straight.hair"));
    let Some(hair) = Hair::read(path, 0.05) else { return };
    assert_eq!(hair.segments.len(), 150_000);
    let (crossings, differing) = compare(&hair);
    eprintln!("real: {crossings} crossings, {differing} decided differently at a bound");
    assert!(crossings > 10_000);
    assert!(differing * 2000 <= crossings, "{differing} of {crossings}");
}

/// The bound is on the distance along the ray, and the radius that counts is the one at the crossing, not at an end.
#[test]
fn crossings_nearer_than_two_radii_are_dropped() {
    let vertices = vec![Vec4::new(-1.0, 0.0, 0.0, 0.01), Vec4::new(1.0, 0.0, 0.0, 0.21)];
    let scene = CurveScene::build(&Device::new().unwrap(), vertices, vec![0]).unwrap();
    for x in [-0.9, -0.5, 0.0, 0.3, 0.8_f32] {
        let radius = 0.01 + 0.2 * 0.5 * (x + 1.0);
        for scale in [1.0, 3.0, 0.25_f32] {
            let crosses = |distance: f32, y: f32| {
                !visited(&scene, Vec3::new(x, y, distance), Vec3::new(0.0, 0.0, -scale)).is_empty()
            };
            for y in [0.0, 0.7 * radius] {
                assert!(!crosses(2.0 * radius * 0.999, y), "x {x}, y {y}, scale {scale}");
                assert!(crosses(2.0 * radius * 1.001, y), "x {x}, y {y}, scale {scale}");
            }
        }
    }
}

/// Two segments of a strand count once where they meet, up to what a bend opens or overlaps.
#[test]
fn joints_are_not_counted_twice() {
    let vertices: Vec<Vec4> = (0..11).map(|i| Vec4::new(0.1 * i as f32, 0.0, 0.0, 0.02)).collect();
    let scene = CurveScene::build(&Device::new().unwrap(), vertices, (0..10).collect()).unwrap();
    for i in 0..1000 {
        // Never exactly through a joint, which neither side would claim.
        let x = 0.0505 + 0.000_913_7 * i as f32;
        let found = visited(&scene, Vec3::new(x, 0.3, 1.0), Vec3::new(0.0, -0.3, -1.0));
        assert_eq!(found.len(), 1, "x = {x}: {found:?}");
    }
    // Beyond the ends, where a round cap would reach.
    for x in [-0.01, 1.01] {
        assert!(visited(&scene, Vec3::new(x, 0.0, 1.0), Vec3::NEG_Z).is_empty());
    }
}
