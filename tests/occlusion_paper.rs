//! The paper's own ways to Γ: every segment by itself, thinned sets (5.1, 5.2), the tangent plane (A.2), Eq. 7 with its L_n.

mod common;

use common::models::*;
use glam::Vec3;
use tress::hair::HairModel;
use tress::occlusion::{Igloo, Projection, Receiver, Span, ThinnedSegments, Thinning, Transmittance};

const FACES: u32 = 100;

fn thinned(fraction: f32, distance_unit: f32) -> Thinning {
    Thinning { fraction, distance_unit }
}

/// Faces without parts.
fn igloo(receiver: &Receiver, faces: u32) -> Igloo {
    Igloo::new(if receiver.on.is_some() { Span::Sphere } else { Span::Hemisphere }, faces)
}

fn everywhere(model: &HairModel) -> Vec<Receiver> {
    [on_hair(model, 12), on_scalp(6), on_floor(-1.6, 6)].concat()
}

/// Optical depth of each face.
fn depths(
    segments: &ThinnedSegments,
    model: &HairModel,
    receiver: &Receiver,
    igloo: &Igloo,
    thinning: Thinning,
    projection: Projection,
) -> Vec<f32> {
    let far = vec![f32::INFINITY; igloo.len()];
    let mut depth = vec![0.0; igloo.len()];
    segments.optical_depths(receiver, igloo, &thinning, projection, &far, &mut depth, model, &mut Vec::new());
    depth
}

fn gamma(depths: &[f32]) -> f64 {
    depths.iter().map(|&depth| f64::from(-depth).exp()).sum::<f64>() / depths.len() as f64
}

fn total(depths: &[f32]) -> f64 {
    depths.iter().map(|&depth| f64::from(depth)).sum()
}

/// The segments that are used for a point, and their factors.
fn selected(segments: &ThinnedSegments, model: &HairModel, position: Vec3, thinning: Thinning) -> Vec<(usize, f32)> {
    let mut selected = Vec::new();
    segments.selected(model, position, &thinning, |segment, weight| selected.push((segment, weight)));
    selected.sort_by_key(|&(segment, _)| segment);
    selected
}

#[test]
fn view_dependent_sets_are_those_of_the_share_at_each_distance() {
    let model = grow(Style::Curly, 3_000, 21, 0.004, 0.5);
    let segments = ThinnedSegments::build(&model, Transmittance::Crossing);
    for receiver in everywhere(&model) {
        for thinning in [thinned(1.0, 0.05), thinned(0.4, 0.3)] {
            // Segments of the set of each share that occurs, which the everywhere-thinned sets tell.
            let share_of = |segment: usize| {
                let [a, b] = model.ends(segment);
                thinning.share(receiver.position.distance(a + 0.5 * (b - a)))
            };
            let mut shares: Vec<f32> = (0..model.segments()).map(share_of).collect();
            shares.sort_by(f32::total_cmp);
            shares.dedup();
            let mut want = Vec::new();
            for share in shares {
                let all = selected(&segments, &model, receiver.position, thinned(share, f32::INFINITY));
                want.extend(all.into_iter().filter(|&(segment, _)| share_of(segment) == share));
            }
            want.sort_by_key(|&(segment, _)| segment);
            let got = selected(&segments, &model, receiver.position, thinning);
            assert!(got == want, "{thinning:?}: {} segments, not {}", got.len(), want.len());
        }
    }
}

#[test]
fn thinner_sets_lie_inside_denser_ones_and_have_the_share_that_is_asked_for() {
    let model = grow(Style::Ball, 20_000, 20, 0.003, 0.5);
    let segments = ThinnedSegments::build(&model, Transmittance::Crossing);
    for distance_unit in [f32::INFINITY, 0.5, 0.1] {
        for position in [Vec3::ZERO, Vec3::new(0.0, 1.2, 0.0), Vec3::new(3.0, -2.0, 1.0)] {
            let mut denser: Option<Vec<usize>> = None;
            for fraction in [1.0, 0.3, 0.1, 0.03] {
                let thinning = thinned(fraction, distance_unit);
                let selected = selected(&segments, &model, position, thinning);
                let mut expected = 0.0;
                for segment in 0..model.segments() {
                    let [a, b] = model.ends(segment);
                    let z = f64::from(position.distance(0.5 * (a + b)));
                    let n = if distance_unit.is_finite() {
                        (z / f64::from(distance_unit) + 0.5).floor().max(1.0)
                    } else {
                        1.0
                    };
                    expected += f64::from(fraction) / n;
                }
                let share = selected.len() as f64 / expected;
                // One in n strands is there or not: 20,000 at 3 % leave a deviation of 4 %, of those 1 in 30 more.
                let strands = expected / 20.0;
                assert!((share - 1.0).abs() < 5.0 / strands.sqrt(), "{thinning:?} at {position}: {share} of the share");
                assert!(selected.iter().all(|&(_, weight)| weight >= 0.999 / fraction));
                if distance_unit.is_infinite() {
                    assert!(selected.iter().all(|&(_, weight)| weight == 1.0 / fraction));
                }
                let here: Vec<usize> = selected.iter().map(|&(segment, _)| segment).collect();
                if let Some(denser) = &denser {
                    assert!(here.iter().all(|segment| denser.binary_search(segment).is_ok()), "{thinning:?}");
                }
                denser = Some(here);
            }
        }
    }
    assert_eq!(selected(&segments, &model, Vec3::ZERO, Thinning::NONE).len(), model.segments());
}

#[test]
fn thinned_sets_are_right_in_the_mean_over_strands() {
    // A strand's optical depth τ_i is kept with probability p and then counts τ_i / p: the sum deviates by √(Σ τ_i² (1 - p) / p), the
    // mean of n sums by that over √n. Each draw gives the strands other numbers.
    const STRANDS: u32 = 2_000;
    const POINTS: u32 = 11;
    const DRAWS: u32 = 40;
    let of_points = |points: Vec<Vec3>| {
        let first = (0..=points.len() as u32 / POINTS).map(|strand| POINTS * strand).collect();
        model(points, first, 0.004, 0.5)
    };
    let whole = grow(Style::Ball, STRANDS, POINTS - 1, 0.004, 0.5);
    let alone: Vec<HairModel> = whole.points.chunks(POINTS as usize).map(|strand| of_points(strand.to_vec())).collect();
    let draw = |draw: u32| {
        let mut model = whole.clone();
        model.strand.iter_mut().for_each(|strand| *strand += STRANDS * draw);
        model
    };
    let draws: Vec<HairModel> = (0..DRAWS).map(draw).collect();
    let built = |model| ThinnedSegments::build(model, Transmittance::Crossing);
    let (of_whole, of_draws) = (built(&whole), draws.iter().map(built).collect::<Vec<_>>());
    let of_alone: Vec<ThinnedSegments> = alone.iter().map(built).collect();
    let mut scores = Vec::new();
    for receiver in [on_scalp(2), on_floor(-1.6, 2)].concat() {
        let igloo = igloo(&receiver, FACES);
        for projection in [Projection::Sphere, Projection::TangentPlane] {
            let sum = |segments: &ThinnedSegments, model: &HairModel, thinning| {
                total(&depths(segments, model, &receiver, &igloo, thinning, projection))
            };
            let want = sum(&of_whole, &whole, Thinning::NONE);
            let strands = alone.iter().zip(&of_alone);
            let squares: f64 = strands.map(|(model, segments)| sum(segments, model, Thinning::NONE).powi(2)).sum();
            for thinning in
                [thinned(0.1, f32::INFINITY), thinned(0.3, f32::INFINITY), thinned(1.0, 0.5), thinned(0.5, 0.3)]
            {
                let sums = draws.iter().zip(&of_draws).map(|(model, segments)| sum(segments, model, thinning));
                let got = sums.sum::<f64>() / f64::from(DRAWS);
                // With distance the share differs along a strand; the smallest, that of the farthest hair, bounds the deviation.
                let least = f64::from(thinning.share(4.5));
                scores.push((got - want) / (squares * (1.0 - least) / least / f64::from(DRAWS)).sqrt());
            }
        }
    }
    println!("in standard deviations: {scores:.1?}");
    assert!(scores.iter().all(|score| score.abs() < 4.0), "{scores:.1?}");
}

#[test]
fn the_tangent_plane_agrees_with_the_sphere_where_little_crosses_the_horizon() {
    // From a floor all hair is above the horizon, and narrow: the average distance is all that differs.
    let model = grow(Style::Ball, 2_000, 12, 0.004, 0.5);
    let segments = ThinnedSegments::build(&model, Transmittance::Crossing);
    let difference = |receivers: &[Receiver]| {
        let gammas = [Projection::Sphere, Projection::TangentPlane].map(|projection| {
            let value = |receiver: &Receiver| {
                let igloo = igloo(receiver, FACES);
                gamma(&depths(&segments, &model, receiver, &igloo, Thinning::NONE, projection))
            };
            receivers.iter().map(value).collect::<Vec<f64>>()
        });
        Difference::between(&gammas[1], &gammas[0])
    };
    let floor = difference(&on_floor(-1.8, 16));
    println!("floor: {floor}");
    assert!(floor.largest < 2e-3, "{floor}");
    // Among hair some of it crosses the horizon: Γ is too great, never too small by more than the layers' form accounts for.
    let hair = difference(&on_hair(&model, 24));
    println!("hair: {hair}");
    assert!(hair.mean > 0.0 && hair.rms < 0.05, "{hair}");
}

#[test]
fn hair_turns_transparent_with_more_faces_where_opacity_goes_by_length() {
    // Eq. 7's L_n: a face sees less of a segment the smaller it is. What does not depend on faces is the rule of the crossing.
    let model = grow(Style::Ball, 3_000, 6, 0.01, 0.5);
    let receivers = on_hair(&model, 8);
    let sweep = |rule: Transmittance, projection: Projection, model: &HairModel| {
        let segments = ThinnedSegments::build(model, rule);
        [50, 400, 3_200].map(|faces| {
            let igloo = igloo(&receivers[0], faces);
            let value = |receiver| gamma(&depths(&segments, model, receiver, &igloo, Thinning::NONE, projection));
            receivers.iter().map(value).sum::<f64>() / receivers.len() as f64
        })
    };
    for projection in [Projection::Sphere, Projection::TangentPlane] {
        let by_length = sweep(Transmittance::SegmentLength { unit: 0.1 }, projection, &model);
        println!("{projection:?}, by length: {by_length:.3?}");
        assert!(by_length[1] > by_length[0] + 0.02 && by_length[2] > by_length[1] + 0.02, "{by_length:?}");
    }
    let by_crossing = sweep(Transmittance::Crossing, Projection::Sphere, &model);
    println!("by crossing: {by_crossing:.3?}");
    assert!(by_crossing.iter().all(|gamma| (gamma - by_crossing[0]).abs() < 0.02), "{by_crossing:?}");
    // And with finer segments, where a crossing is a crossing still.
    let finer = cut(&model, 4);
    let by_length = Transmittance::SegmentLength { unit: 0.1 };
    let [coarse, fine] = [&model, &finer].map(|model| sweep(by_length, Projection::Sphere, model)[0]);
    println!("by length, segments cut in four: {coarse:.3} to {fine:.3}");
    assert!(fine > coarse + 0.02, "{coarse} to {fine}");
}

#[test]
fn a_strand_does_not_shadow_itself_on_the_tangent_plane() {
    // The strand runs above the point, clear of the horizon.
    let points: Vec<Vec3> = (0..=10).map(|i| 0.1 * i as f32 * Vec3::new(1.0, 0.2, 0.0)).collect();
    let model = model(points, vec![0, 11], 0.01, 0.5);
    let segments = ThinnedSegments::build(&model, Transmittance::Crossing);
    let sample = model.sample(5, 0.5);
    let below = sample.position - 0.015 * Vec3::Z;
    let seen = |on| {
        let receiver = Receiver { position: below, on, frame: glam::Mat3::IDENTITY };
        let igloo = Igloo::new(Span::Sphere, FACES);
        total(&depths(&segments, &model, &receiver, &igloo, Thinning::NONE, Projection::TangentPlane))
    };
    let (itself, another) = (seen(Some(sample.on)), seen(None));
    assert!(itself > 0.0 && itself < 0.2 * another, "{itself} of {another}");
}
