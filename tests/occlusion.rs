//! The two estimators of Γ against each other and against brute force in double precision.

mod common;

use common::models::*;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use tress::embree::Device;
use tress::hair::{Attribute, HairModel, Strands};
use tress::occlusion::raytraced::Ray;
use tress::occlusion::{
    ClusterTree, DepthMap, Fineness, HairRays, Igloo, Instructions, Receiver, Scratch, Span, Thinning, Transmittance,
};
use tress::surface::{SurfaceModel, Surfaces, primitives};

const FACES: u32 = 100;
const CLUSTERS: Way = Way::Clusters(None);
const ALL: Way = Way::Segments(Thinning::NONE);

/// The models that both estimators must agree on, by name; each opaque and half-transparent.
fn models(strands: u32, segments: u32, width: f32) -> Vec<(String, HairModel)> {
    let mut models = Vec::new();
    for transparency in [0.0, 0.5] {
        for style in [Style::Ball, Style::Clumps, Style::Curly] {
            models.push((format!("{style:?} t {transparency}"), grow(style, strands, segments, width, transparency)));
        }
    }
    models
}

/// The bound of the mean difference in the small models. A clump is narrower than a part of a face, so light between clumps is lost,
/// the more the fewer and thicker the clumps are: measured -.031 here, within .01 with the full number of strands.
fn bound(name: &str) -> f64 {
    if name.starts_with("Clumps") { 0.035 } else { 0.01 }
}

fn cross_check(name: &str, model: &HairModel, places: &[(&str, Vec<Receiver>)], rays: u32, bound: f64) {
    let hair_rays = HairRays::build(&Device::new().unwrap(), model, Transmittance::Crossing).unwrap();
    let mut beyond = Vec::new();
    for (place, receivers) in places {
        let truth = traced(&hair_rays, model, receivers, rays);
        let value = projected(model, receivers, FACES, CLUSTERS);
        let difference = Difference::between(&value, &truth);
        let level = truth.iter().sum::<f64>() / truth.len() as f64;
        println!("{name}, {place}: Γ̄ {level:.4}, {difference}");
        if difference.mean.abs() >= bound {
            beyond.push(format!("{name}, {place}: {difference}"));
        }
    }
    assert!(beyond.is_empty(), "beyond {bound}: {beyond:?}");
}

#[test]
fn projection_and_rays_agree_on_small_models() {
    for (name, model) in models(10_000, 10, 0.006) {
        let places = [("hair", on_hair(&model, 32)), ("scalp", on_scalp(16)), ("floor", on_floor(-1.6, 16))];
        cross_check(&name, &model, &places, 1024, bound(&name));
    }
}

#[test]
#[ignore = "slow: nine models of up to a million segments, 4,096 rays a point"]
fn projection_and_rays_agree() {
    for (name, model) in models(50_000, 20, 0.003) {
        let places = [("hair", on_hair(&model, 64)), ("scalp", on_scalp(32)), ("floor", on_floor(-1.6, 32))];
        cross_check(&name, &model, &places, 4096, 0.01);
    }
    for transparency in [0.0, 0.356, 0.5] {
        if let Some(model) = yuksel_straight(transparency) {
            let places = [("hair", on_hair(&model, 64)), ("floor", on_floor(-1.1, 32))];
            cross_check(&format!("yuksel_straight t {transparency}"), &model, &places, 4096, 0.01);
        }
    }
}

/// The unit sphere under the hair.
fn scalp(device: &Device) -> Surfaces {
    let mut surfaces = SurfaceModel::default();
    surfaces.add(&primitives::sphere(DVec3::ZERO, 1.0), false);
    surfaces.into_traceable(device).unwrap()
}

/// Σ over faces of [the face's ray misses the surface] Γ, over the number of faces.
fn projected_sky(model: &HairModel, receivers: &[Receiver], surfaces: &Surfaces) -> Vec<f64> {
    let igloo = igloo_for(&receivers[0], FACES);
    let projector = Projector::new(model, Transmittance::Crossing, &igloo, CLUSTERS);
    let value = |scratch: &mut Scratch, (key, receiver): (usize, &Receiver)| {
        let distance = |face| {
            let [across, down] = [0, 1].map(|axis| random(&[20, key as u32, face as u32, axis]));
            let direction = receiver.frame * igloo.direction(face, across, down);
            surfaces
                .closest(receiver.position, direction, 1e-4, f32::INFINITY)
                .map_or(f32::INFINITY, |hit| hit.distance)
        };
        let far: Vec<f32> = (0..igloo.len()).map(distance).collect();
        let gamma = projector.faces(receiver, Some(&far), scratch);
        let open = gamma.iter().zip(&far).filter(|(_, far)| far.is_infinite());
        open.map(|(&gamma, _)| f64::from(gamma)).sum::<f64>() / igloo.len() as f64
    };
    receivers.par_iter().enumerate().map_init(Scratch::default, value).collect()
}

/// The same by rays over the igloo, each of which looks for the surface itself.
fn traced_sky(
    rays: &HairRays,
    model: &HairModel,
    receivers: &[Receiver],
    surfaces: &Surfaces,
    per_face: u32,
) -> Vec<f64> {
    let igloo = igloo_for(&receivers[0], FACES);
    let value = |(key, receiver): (usize, &Receiver)| {
        let mut sum = 0.0;
        for (face, ray) in (0..igloo.len()).flat_map(|face| (0..per_face).map(move |ray| (face, ray))) {
            let [across, down] = [0, 1].map(|axis| random(&[21, key as u32, face as u32, ray, axis]));
            let direction = receiver.frame * igloo.direction(face, across, down);
            if surfaces.blocks(receiver.position, direction, 1e-4, f32::INFINITY) {
                continue;
            }
            let ray = Ray { origin: receiver.position, direction, far: f32::INFINITY, on: receiver.on };
            sum += f64::from(rays.transmittance(model, &ray, 0.0));
        }
        sum / f64::from(per_face) / igloo.len() as f64
    };
    receivers.par_iter().enumerate().map(value).collect()
}

fn cross_check_over_scalp(models: Vec<(String, HairModel)>, points: u32, per_face: u32, bound: f64) {
    let device = Device::new().unwrap();
    let scalp = scalp(&device);
    for (name, model) in models {
        let hair_rays = HairRays::build(&device, &model, Transmittance::Crossing).unwrap();
        for (place, receivers) in [("hair", on_hair(&model, points)), ("floor", on_floor(-1.6, points / 2))] {
            let truth = traced_sky(&hair_rays, &model, &receivers, &scalp, per_face);
            let value = projected_sky(&model, &receivers, &scalp);
            let difference = Difference::between(&value, &truth);
            let level = truth.iter().sum::<f64>() / truth.len() as f64;
            println!("{name} over a scalp, {place}: sky {level:.4}, {difference}");
            assert!(difference.mean.abs() < bound, "{name}, {place}: {difference}");
        }
    }
}

#[test]
fn sky_visibility_over_an_opaque_scalp_agrees_on_small_models() {
    cross_check_over_scalp(models(10_000, 10, 0.006), 64, 5, 0.02);
}

#[test]
#[ignore = "slow: six models of a million segments, 4,000 rays a point"]
fn sky_visibility_over_an_opaque_scalp_agrees() {
    // Opaque clumps from the floor: measured -.0112, of which .009 is light lost between clumps.
    cross_check_over_scalp(models(50_000, 20, 0.003), 128, 20, 0.0125);
}

/// Strands of different transparencies and tapering widths.
fn motley_model() -> HairModel {
    let mut points = Vec::new();
    let mut first = vec![0];
    for strand in 0..60 {
        let mut here = 0.3 * direction(&[30, strand]);
        for point in 0..12 {
            points.push(here);
            here += 0.06 * (direction(&[31, strand]) + 0.5 * direction(&[32, strand, point])).normalize();
        }
        first.push(points.len() as u32);
    }
    let width = (0..points.len() as u32).map(|point| 0.01 + 0.01 * random(&[33, point])).collect();
    let strands = Strands {
        width: Attribute::PerPoint(width),
        color: Attribute::Uniform(Vec3::ONE),
        transparency: Attribute::PerStrand((0..60).map(|strand| 0.3 + 0.6 * random(&[34, strand])).collect()),
        points,
        first,
    };
    let mut model = HairModel::default();
    model.add(&strands, 0);
    model
}

/// Transmittance along a ray by the stated rules, in double precision, and how near any decision is, relative to what decides.
fn brute_force(model: &HairModel, ray: &Ray) -> (f64, f64) {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let (mut transmittance, mut nearest_decision) = (1.0, f64::INFINITY);
    for segment in 0..model.segments() {
        let [a, b] = model.ends(segment).map(|end| end.as_dvec3() - origin);
        let flat = |p: DVec3| p - p.dot(direction) * direction;
        let axis = flat(b) - flat(a);
        let u = -flat(a).dot(axis) / axis.length_squared();
        let at = u.clamp(0.0, 1.0);
        let [w0, w1] = model.widths(segment).map(f64::from);
        let width = w0 + at * (w1 - w0);
        let distance = a.lerp(b, at).dot(direction);
        let off = flat(a.lerp(b, at)).length();
        let mut margins = vec![
            u,
            1.0 - u,
            1.0 - off / (0.5 * width),
            (distance - width) / width,
            (f64::from(ray.far) - distance) / width,
        ];
        if let Some(on) = ray.on.filter(|on| on.strand == model.strand[segment]) {
            let p = model.segment_point[segment] as usize;
            let [from, to] = [model.arc[p], model.arc[p + 1]].map(f64::from);
            margins.push(((from + at * (to - from) - f64::from(on.arc)).abs() / f64::from(on.width)) - 4.0);
        }
        let counts = margins.iter().copied().fold(f64::INFINITY, f64::min);
        nearest_decision = counts.abs().min(nearest_decision);
        if counts > 0.0 {
            transmittance *= f64::from(model.transparency[segment]);
        }
    }
    (transmittance, nearest_decision)
}

#[test]
fn transmittance_of_rays_is_that_of_brute_force() {
    let model = motley_model();
    let hair_rays = HairRays::build(&Device::new().unwrap(), &model, Transmittance::Crossing).unwrap();
    let (mut compared, mut cut_short, mut own_strand) = (0, 0, 0);
    for (index, receiver) in on_hair(&model, 3000).into_iter().enumerate() {
        let key = index as u32;
        // A third of the rays run along their own strand's neighbourhood, where the exclusion decides.
        let along = model.sample(0, 0.5).tangent;
        let towards = if key.is_multiple_of(3) { along } else { direction(&[35, key]) };
        let direction = (towards + 0.2 * direction(&[36, key])).normalize();
        let far = if key.is_multiple_of(2) { f32::INFINITY } else { 0.4 * random(&[37, key]) };
        let ray = Ray { origin: receiver.position, direction, far, on: receiver.on };
        let (want, decision) = brute_force(&model, &ray);
        if decision < 1e-3 {
            continue;
        }
        let got = f64::from(hair_rays.transmittance(&model, &ray, 0.0));
        assert!((got - want).abs() < 1e-5, "ray {index}, {ray:?}: {got} against {want}");
        compared += 1;
        let (endless, _) = brute_force(&model, &Ray { far: f32::INFINITY, ..ray });
        cut_short += u32::from(endless != want);
        let (seeing_itself, _) = brute_force(&model, &Ray { on: None, ..ray });
        own_strand += u32::from(seeing_itself != want);
    }
    assert!(compared > 2000, "only {compared} rays had no borderline decision");
    assert!(cut_short > 50, "`far` decided for {cut_short} rays only");
    assert!(own_strand > 20, "the own strand's exclusion decided for {own_strand} rays only");
    println!("{compared} rays, {cut_short} cut short, {own_strand} would have met their own strand");
}

/// Every kind of receiver, for the tests of what must hold anywhere.
fn everywhere(model: &HairModel) -> Vec<Receiver> {
    [on_hair(model, 12), on_scalp(6), on_floor(-1.6, 6)].concat()
}

/// Γ of each face for each receiver.
fn values(model: &HairModel, receivers: &[Receiver], way: Way) -> Vec<Vec<f32>> {
    let igloos = [Igloo::new(Span::Sphere, FACES), Igloo::new(Span::Hemisphere, FACES)];
    let projectors = igloos.each_ref().map(|igloo| Projector::new(model, Transmittance::Crossing, igloo, way));
    let mut scratch = Scratch::default();
    let mut value = |r: &Receiver| projectors[usize::from(r.on.is_none())].faces(r, None, &mut scratch);
    receivers.iter().map(&mut value).collect()
}

/// Γ̄ of each receiver.
fn means(model: &HairModel, receivers: &[Receiver], way: Way) -> Vec<f64> {
    values(model, receivers, way).iter().map(|faces| mean(faces)).collect()
}

fn thinned(fraction: f32, distance_unit: f32) -> Way {
    Way::Segments(Thinning { fraction, distance_unit })
}

#[test]
fn a_thinner_way_lies_inside_a_denser_one() {
    let model = grow(Style::Ball, 300, 10, 0.004, 0.5);
    let receivers = everywhere(&model);
    for distance_unit in [0.3, 1e9] {
        let mut inside: Option<Vec<Vec<f32>>> = None;
        for fraction in [0.03, 0.1, 0.3, 1.0] {
            let denser = values(&model, &receivers, thinned(fraction, distance_unit));
            for (thin, dense) in inside.iter().flatten().flatten().zip(denser.iter().flatten()) {
                assert!(*thin == 1.0 || *dense < 1.0, "hair is seen at less than {fraction} that is not seen there");
            }
            inside = Some(denser);
        }
    }
}

#[test]
fn thinning_converges_to_all_hair() {
    let model = grow(Style::Ball, 2_000, 12, 0.01, 0.5);
    let receivers = [on_hair(&model, 24), on_floor(-1.6, 8)].concat();
    let all = means(&model, &receivers, ALL);
    // 5.1, by fraction: measured rms .080, .040, .017.
    let mut last = f64::INFINITY;
    for fraction in [0.1, 0.3, 0.7] {
        let error = Difference::between(&means(&model, &receivers, thinned(fraction, 1e9)), &all);
        println!("5.1, {fraction}: {error}");
        assert!(error.rms < last, "{fraction}: {error}");
        last = error.rms;
    }
    let whole = Difference::between(&means(&model, &receivers, thinned(1.0, 1e9)), &all);
    assert!(whole.largest < 1e-6, "{whole}");
    // 5.2, by the distance up to which all hair is taken.
    let mut last = f64::INFINITY;
    for distance_unit in [0.1, 0.5, 1.5] {
        let error = Difference::between(&means(&model, &receivers, thinned(1.0, distance_unit)), &all);
        println!("5.2, unit {distance_unit}: {error}");
        assert!(error.rms < last, "{distance_unit}: {error}");
        last = error.rms;
    }
}

/// With more cells, and lumps in proportion to them, the error against rays falls to the noise of the rays.
#[test]
fn finer_maps_and_lumps_come_nearer_to_the_rays() {
    for (style, transparency) in [(Style::Ball, 0.5), (Style::Clumps, 0.5), (Style::Curly, 0.0)] {
        let model = grow(style, 4_000, 12, 0.006, transparency);
        let rays = HairRays::build(&Device::new().unwrap(), &model, Transmittance::Crossing).unwrap();
        for (receivers, opening) in [(on_hair(&model, 32), 1.15), (on_floor(-1.6, 24), 1.5)] {
            let truth = traced(&rays, &model, &receivers, 20_000);
            let mut last = f64::INFINITY;
            for side in [6, 12, 24, 48] {
                let way = Way::Clusters(Some(Fineness { side, opening }));
                let error = Difference::between(&projected(&model, &receivers, FACES, way), &truth);
                println!("{style:?} t {transparency}, {side} cells a side: {error}");
                // Where the error is small already it is noise.
                assert!(error.rms < last.max(4e-3), "{style:?}, {side} cells a side: {error}");
                last = error.rms;
            }
            assert!(last < 0.0125, "{style:?}: {last}");
        }
    }
}

#[test]
fn cutting_segments_in_four_changes_nothing() {
    for (style, transparency) in [(Style::Ball, 0.0), (Style::Ball, 0.5), (Style::Clumps, 0.5), (Style::Curly, 0.5)] {
        let model = grow(style, 4_000, 12, 0.005, transparency);
        let receivers = everywhere(&model);
        let finer = cut(&model, 4);
        for way in [CLUSTERS, ALL] {
            let change = Difference::between(&means(&finer, &receivers, way), &means(&model, &receivers, way));
            println!("{style:?} t {transparency}, {way:?}: {change}");
            assert!(change.mean.abs() < 0.0035, "{style:?} t {transparency}, {way:?}: {change}");
        }
    }
}

#[test]
fn order_and_direction_of_strands_do_not_matter() {
    let model = grow(Style::Ball, 1_000, 10, 0.005, 0.5);
    let receivers = [on_scalp(12), on_floor(-1.6, 12)].concat();
    let other = reversed(&model);
    for way in [CLUSTERS, ALL] {
        let (a, b) = (values(&model, &receivers, way), values(&other, &receivers, way));
        for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
            assert!((a - b).abs() < 1e-5, "{way:?}: {a} against {b}");
        }
    }
}

#[test]
fn more_hair_is_never_brighter() {
    let model = grow(Style::Curly, 500, 10, 0.005, 0.3);
    let receivers = everywhere(&model);
    let more = grow(Style::Curly, 600, 10, 0.005, 0.3);
    for way in [CLUSTERS, ALL, thinned(1.0, 0.5)] {
        let (less, more) = (values(&model, &receivers, way), values(&more, &receivers, way));
        assert!(less.iter().chain(&more).flatten().all(|gamma| (0.0..=1.0).contains(gamma)));
        if way == CLUSTERS {
            // Lumps move between faces when the tree changes; their sum does not.
            let mean = |values: &[Vec<f32>]| values.iter().flatten().map(|&g| f64::from(g)).sum::<f64>();
            assert!(mean(&more) < mean(&less));
            continue;
        }
        for (less, more) in less.iter().flatten().zip(more.iter().flatten()) {
            assert!(more <= &(less + 1e-5), "{way:?}: {more} after adding hair, {less} before");
        }
    }
}

#[test]
fn the_segment_length_rule_agrees_with_rays_where_segments_are_smaller_than_faces() {
    let rule = Transmittance::SegmentLength { unit: 0.02 };
    let model = grow(Style::Ball, 1_000, 40, 0.006, 0.5);
    let hair_rays = HairRays::build(&Device::new().unwrap(), &model, rule).unwrap();
    let receivers = on_floor(-2.5, 24);
    let truth = traced(&hair_rays, &model, &receivers, 4096);
    let igloo = igloo_for(&receivers[0], FACES);
    let error = Difference::between(&Projector::new(&model, rule, &igloo, ALL).means(&receivers), &truth);
    println!("{error}");
    assert!(truth.iter().all(|gamma| *gamma < 0.995) && error.mean.abs() < 0.01, "{error}");
}

/// Whatever the processor can do, and whatever was asked before with the same buffers, a point has the same bits.
#[test]
fn all_instructions_give_the_same_bits() {
    for style in [Style::Ball, Style::Clumps, Style::Curly] {
        let model = grow(style, 4_000, 12, 0.006, 0.5);
        let tree = ClusterTree::build(&model, Transmittance::Crossing);
        for (receivers, span) in [(on_hair(&model, 24), Span::Sphere), (on_floor(-1.6, 12), Span::Hemisphere)] {
            let igloo = Igloo::new(span, FACES);
            let map = DepthMap::new(&igloo, 14);
            let surfaces: Vec<f32> = (0..igloo.len()).map(|face| 0.2 + 0.1 * (face % 7) as f32).collect();
            for far in [None, Some(&surfaces[..])] {
                let value = |receiver: &Receiver, scratch: &mut Scratch| -> Vec<u32> {
                    let mut gamma = vec![0.0; igloo.len()];
                    tree.transmittances(&model, receiver, &map, 1.2 * map.cell_width(), far, &mut gamma, scratch);
                    gamma.iter().map(|g| g.to_bits()).collect()
                };
                let fresh: Vec<_> = receivers.iter().map(|r| value(r, &mut Scratch::default())).collect();
                for instructions in Instructions::available() {
                    let mut scratch = Scratch::with_instructions(instructions);
                    for (receiver, fresh) in receivers.iter().zip(&fresh).rev() {
                        assert!(value(receiver, &mut scratch) == *fresh, "{style:?}, {instructions:?}");
                    }
                }
            }
        }
    }
}
