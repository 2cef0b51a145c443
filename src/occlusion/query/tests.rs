use glam::{DVec3, Mat3, Vec3};

use super::*;
use crate::occlusion::testing::{ball, direction, model, random, receiver};
use crate::occlusion::{Igloo, Span, Transmittance};

/// Solid angle of the part `range` of a thin ribbon that faces the origin, its width linear along it: ∫ w h / r³ ds.
fn ribbon(a: DVec3, b: DVec3, widths: [f64; 2], range: [f64; 2]) -> f64 {
    let length = a.distance(b);
    let axis = (b - a) / length;
    let start = a.dot(axis);
    let h = (a - start * axis).length();
    if h < 1e-6 {
        return 0.0;
    }
    let [from, to] = range.map(|t| start + t * length);
    let [r0, r1] = [from, to].map(|s| h.hypot(s));
    let taper = (widths[1] - widths[0]) / length;
    let foot = widths[0] - taper * start;
    // Next to the axis the silhouette of the cylinder is wider than a ribbon: exact where the width is even.
    2.0 * (0.5 * foot / h).min(1.0).asin() * (to / r1 - from / r0) - taper * h * (1.0 / r1 - 1.0 / r0)
}

/// Σ solid angle · opacity of all hair that counts, each segment by itself.
fn total(model: &HairModel, receiver: &Receiver) -> f64 {
    let position = receiver.position.as_dvec3();
    let mut sum = 0.0;
    for segment in 0..model.segments() {
        let [a, b] = model.ends(segment).map(|end| end.as_dvec3() - position);
        let widths = model.widths(segment).map(f64::from);
        let opacity = 1.0 - f64::from(model.transparency[segment]);
        let ranges = match receiver.on.filter(|on| on.strand == model.strand[segment]) {
            None => vec![[0.0, 1.0]],
            Some(on) => {
                let [from, to] = model.arcs(segment).map(f64::from);
                let [low, high] = on.excluded().map(|arc| (f64::from(arc) - from) / (to - from));
                vec![[0.0, low.clamp(0.0, 1.0)], [high.clamp(0.0, 1.0), 1.0]]
            }
        };
        sum += ranges.iter().map(|&range| opacity * ribbon(a, b, widths, range)).sum::<f64>();
    }
    sum
}

/// What a query gathers, all cells together.
fn gathered(tree: &ClusterTree, model: &HairModel, receiver: &Receiver, side: u32, opening: f32) -> f64 {
    let igloo = Igloo::new(Span::Sphere, 50);
    let map = DepthMap::new(&igloo, side);
    let (mut scratch, mut gamma) = (Scratch::default(), vec![0.0; igloo.len()]);
    tree.transmittances(model, receiver, &map, opening, None, &mut gamma, &mut scratch);
    assert!(gamma.iter().all(|gamma| (0.0..=1.0).contains(gamma)));
    scratch.depth.iter().flatten().map(|&x| f64::from(x)).sum()
}

#[test]
fn what_is_gathered_is_all_hair_whatever_the_cells_and_lumps() {
    // Thin and hardly opaque, so that nothing is saturated: Σ solid angle · opacity, segment by segment in f64.
    let model = ball(3_000, 8, 0.0004, 0.999);
    let tree = ClusterTree::build(&model, Transmittance::Crossing);
    let between = (0..12).map(|key| direction(&[1, key]) * (0.3 + 1.5 * random(&[2, key])));
    let receivers: Vec<Receiver> = between.enumerate().map(|(key, position)| receiver(position, key as u32)).collect();
    // By the opening: 1e-6 takes each segment by itself, where only the midpoint rule is off, within a few cells of the point. A
    // lump's hair is seen from one direction, so what is end-on from each part of it is not from its middle: among hair that points at
    // the point, lumps of .2 radians are too dark, measured by .088.
    for (opening, bound, mean_bound) in [(1e-6, 0.01, 0.003), (0.05, 0.01, 0.003), (0.2, 0.12, 0.04)] {
        for side in [8, 16, 40] {
            let errors = receivers.iter().map(|r| gathered(&tree, &model, r, side, opening) / total(&model, r) - 1.0);
            let errors: Vec<f64> = errors.collect();
            let worst = errors.iter().copied().map(f64::abs).fold(0.0, f64::max);
            let mean = errors.iter().sum::<f64>() / errors.len() as f64;
            println!("opening {opening}, {side} cells: mean {mean:+.5}, worst {worst:.5}");
            assert!(worst < bound && mean.abs() < mean_bound, "opening {opening}, {side} cells: {errors:.5?}");
        }
    }
}

/// A strand bent along a circle of radius 1, `segments` of them in most of a turn.
fn ring(segments: u32, width: f32) -> HairModel {
    let point = |i: u32| {
        let (sin, cos) = (5.5 * i as f32 / segments as f32).sin_cos();
        Vec3::new(cos, sin, 0.1 * i as f32 / segments as f32)
    };
    let count = segments as usize + 1;
    model((0..=segments).map(point).collect(), vec![0, segments + 1], vec![width; count], 0.999)
}

#[test]
fn a_strand_counts_outside_of_the_excluded_arc_only() {
    for (segments, width) in [(60, 0.003), (60, 0.02), (400, 0.02), (400, 0.003), (7, 0.01)] {
        let model = ring(segments, width);
        let tree = ClusterTree::build(&model, Transmittance::Crossing);
        let (mut worst, mut beside) = (0.0_f64, 0.0_f64);
        for key in 0..60 {
            let sample = model.sample((random(&[3, key]) * segments as f32) as usize, random(&[4, key]));
            // On the strand, and some widths beside it.
            let off = if key & 1 == 0 { 0.0 } else { width * (3.0 + 3.0 * random(&[5, key])) };
            let position = sample.position + off * Vec3::Z;
            let own = Receiver { position, on: Some(sample.on), frame: Mat3::IDENTITY };
            let got = gathered(&tree, &model, &own, 8, 0.1);
            let want = total(&model, &own);
            worst = worst.max((got / want - 1.0).abs());
            if off > 0.0 {
                beside = beside.max(want / total(&model, &Receiver { on: None, ..own }));
            }
        }
        println!("{segments} segments {width} wide: worst {worst:.4}; beside it {beside:.3} of what another would see");
        // Segments on the far side of the ring are one or two lumps each, by the midpoint rule: measured .0361.
        assert!(worst < 0.04, "{segments} segments {width} wide: {worst}");
        assert!(beside < 0.6, "the exclusion hardly matters: {beside}");
    }
}

#[test]
fn a_far_surface_hides_what_is_behind_it_and_nothing_before() {
    let model = ball(300, 8, 0.02, 0.5);
    let tree = ClusterTree::build(&model, Transmittance::Crossing);
    let igloo = Igloo::new(Span::Sphere, 50);
    let map = DepthMap::new(&igloo, 16);
    let mut scratch = Scratch::default();
    let mut seen = |receiver: &Receiver, far: Option<f32>| {
        let (far, mut gamma) = (far.map(|far| vec![far; igloo.len()]), vec![0.0; igloo.len()]);
        tree.transmittances(&model, receiver, &map, 0.2, far.as_deref(), &mut gamma, &mut scratch);
        gamma
    };
    for key in 0..8 {
        // Hair lies between 1 and 1.5 from the middle.
        let outside = receiver(3.0 * direction(&[6, key]), key);
        let all = seen(&outside, None);
        assert!(all.iter().any(|&gamma| gamma < 0.95));
        // With surfaces a face's mean is over the cells of its kind, divided by their shares' sum: that is 1 to rounding only.
        for far in [f32::INFINITY, 5.0] {
            let off = seen(&outside, Some(far)).iter().zip(&all).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 1e-6, "{far}: off by {off:e}");
        }
        assert!(seen(&outside, Some(1.4)).iter().all(|&gamma| gamma > 1.0 - 1e-6));
        let mut last = f64::INFINITY;
        for far in [1.4, 2.0, 2.5, 3.5, 5.0] {
            let sum: f64 = seen(&outside, Some(far)).iter().map(|&gamma| f64::from(gamma)).sum();
            assert!(sum <= last + 1e-6, "{far}: {sum} after {last}");
            last = sum;
        }
        // One query leaves nothing to the next.
        assert_eq!(seen(&outside, None), all);
    }
}

#[test]
fn scales_do_not_matter() {
    // Everything is a ratio of lengths, and powers of 2 round nothing: the same bits.
    let (width, points) = (0.01, 6_usize);
    let base = ball(200, 8, width, 0.3);
    let igloo = Igloo::new(Span::Sphere, 50);
    let map = DepthMap::new(&igloo, 16);
    let value = |scale: f32| {
        let mut scaled = base.clone();
        scaled.points.iter_mut().for_each(|point| *point *= scale);
        scaled.width.iter_mut().chain(&mut scaled.arc).for_each(|x| *x *= scale);
        let tree = ClusterTree::build(&scaled, Transmittance::Crossing);
        let mut scratch = Scratch::default();
        let one = |key: usize| {
            let sample = scaled.sample(key * 37, 0.3);
            let receiver = Receiver { position: sample.position, on: Some(sample.on), frame: Mat3::IDENTITY };
            let mut gamma = vec![0.0; igloo.len()];
            tree.transmittances(&scaled, &receiver, &map, 0.2, None, &mut gamma, &mut scratch);
            gamma
        };
        (0..points).flat_map(one).collect::<Vec<f32>>()
    };
    let want = value(1.0);
    for exponent in [-13, -7, 5, 13] {
        assert_eq!(value(2.0_f32.powi(exponent)), want, "2^{exponent}");
    }
}

#[test]
fn no_hair_lets_all_light_through() {
    let model = HairModel::default();
    let tree = ClusterTree::build(&model, Transmittance::Crossing);
    for span in [Span::Sphere, Span::Hemisphere] {
        let igloo = Igloo::new(span, 50);
        let map = DepthMap::new(&igloo, 16);
        let mut gamma = vec![0.0; igloo.len()];
        let here = receiver(Vec3::ZERO, 1);
        tree.transmittances(&model, &here, &map, 0.2, None, &mut gamma, &mut Scratch::default());
        assert!(gamma.iter().all(|&gamma| (1.0 - 1e-6..=1.0).contains(&gamma)), "{gamma:?}");
    }
}

/// An opening whose square is 0 in single precision takes every segment by itself; nodes that are not full have lanes without a child,
/// which the walk must not go down.
#[test]
fn an_opening_of_nothing_does_not_go_down_lanes_without_child() {
    for strands in [1, 3, 40] {
        let model = ball(strands, 8, 0.01, 0.5);
        let tree = ClusterTree::build(&model, Transmittance::Crossing);
        for key in 0..8 {
            let receiver = receiver(2.5 * direction(&[92, key]), key);
            let [nothing, tiny] = [1e-30, 0.0].map(|opening| gathered(&tree, &model, &receiver, 16, opening));
            assert_eq!(nothing, tiny);
            let all = total(&model, &receiver);
            // Layers saturate where strands lie over each other in a cell; the sum of what is gathered does so by little here.
            assert!((nothing - all).abs() < 0.05 * all, "{strands} strands: {nothing} against {all}");
        }
    }
}
