//! Rows 1, 2, 3 and 5: time of the projection against rays at an equal error, and against projecting every segment.

use tress::occlusion::{Fineness, Igloo, Projection, RaySettings, Receiver, Scratch, ThinnedSegments, Thinning};
use tress::occlusion::{Transmittance, layer};

use crate::common::models::{Difference, mean};
use crate::measure::{Query, Traced, median, medians, multiplied, thread_time};
use crate::scene::{Bench, Case, PLACES, Place};
use crate::table::{Bounds, Table};
use rayon::prelude::*;

const ACCURACY: f64 = 0.004;
const ROUNDS: usize = 15;
/// Points over which the projection is timed, as near to each other as those of a small picture; rays are timed at some of them.
const TIMED: u32 = 16_384;
const SPARSER: usize = 128;

pub fn print(bench: &Bench, wanted: &dyn Fn(u32) -> bool) {
    let mut table = crate::table("Against rays: 50,000 strands of 20 segments");
    for (row, place) in [1, 2].into_iter().zip(PLACES) {
        // Row 3 is of the query of row 1.
        if wanted(row) || (row == 1 && wanted(3)) {
            against_rays(bench, place, row, wanted, &mut table);
        }
    }
    table.print();
}

fn against_rays(bench: &Bench, place: Place, row: u32, wanted: &dyn Fn(u32) -> bool, table: &mut Table) {
    let case = bench.ball();
    let igloo = place.igloo();
    let (receivers, truth) = bench.exact(case, place);
    let timed = case.timed(place, TIMED);
    let found = cheapest(case, place, &receivers, &truth, &timed[..TIMED as usize / 8]);
    let query = Query::new(case.tree(), &case.model, &igloo, found);
    let error = Difference::between(&query.values(&receivers), &truth);
    let calibrated = bench.calibration(case, place, ACCURACY).fineness;
    let by_calibration = Query::new(case.tree(), &case.model, &igloo, calibrated);
    let traced = Traced::new(case, &igloo);
    let (count, traced_error) = traced.fewest(&receivers, &truth, ACCURACY);

    let sparser: Vec<Receiver> = timed.iter().step_by(SPARSER).copied().collect();
    let [mut scratch, mut other] = [Scratch::default(), Scratch::default()];
    let mut projected = || query.time(&timed, &mut scratch);
    let mut safe = || by_calibration.time(&timed, &mut other);
    let mut roulette = || traced.time(&sparser, &RaySettings::fastest(count));
    let mut residual = || traced.time(&sparser, &multiplied(count)) / f64::from(count);
    let [igloo_time, safe_time, rays_time, residual_ray] =
        medians(ROUNDS, [&mut projected, &mut safe, &mut roulette, &mut residual]);
    let ray = rays_time / f64::from(count);

    let Fineness { side, opening } = found;
    if wanted(row) {
        let ratio = rays_time / igloo_time;
        let within = error.rms <= ACCURACY;
        let measured = format!(
            "{ratio:.0} times: {count} rays, {:.2} ms (RMS {traced_error:.5}), against {:.1} µs (RMS {:.5}, mean {:+.5}{}); {side} cells a side, opening {opening}",
            rays_time * 1e3,
            igloo_time * 1e6,
            error.rms,
            error.mean,
            if within { "" } else { ": beyond the accuracy" },
        );
        let bounds = if place == Place::Hair { Bounds::at_least(400.0, 800.0) } else { Bounds::at_least(300.0, 600.0) };
        let what = format!("time to an RMS error of {ACCURACY}, {}: rays / projected", place.name());
        table.held(row, &what, &measured, if within { ratio } else { f64::NAN }, bounds);
        let error = Difference::between(&by_calibration.values(&receivers), &truth);
        let Fineness { side, opening } = calibrated;
        let measured = format!(
            "{:.0} times: {:.1} µs (RMS {:.5}); {side} cells a side, opening {opening}",
            rays_time / safe_time,
            safe_time * 1e6,
            error.rms
        );
        table.said(
            row,
            &format!("the same by settings that a calibration found at other points, {}", place.name()),
            &measured,
        );
    }
    if place == Place::Hair && wanted(3) {
        for (name, ray) in [("roulette .25", ray), ("residual .001", residual_ray)] {
            let rays = igloo_time / ray;
            let measured = format!("{rays:.2} rays of {:.2} µs: {:.1} µs", ray * 1e6, igloo_time * 1e6);
            let what = format!("an igloo of row 1, in rays through the hair ({name})");
            table.held(3, &what, &measured, rays, Bounds::at_most(4.0, 2.0));
        }
    }
}

/// The settings of least time whose error at the points is within the accuracy: chosen on the points themselves, as the number of rays is.
fn cheapest(case: &Case, place: Place, receivers: &[Receiver], truth: &[f64], timed: &[Receiver]) -> Fineness {
    let igloo = place.igloo();
    let mut scratch = Scratch::default();
    let mut best = (f64::INFINITY, finest());
    for side in (8..=28).step_by(2) {
        for opening in [0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.65] {
            let fineness = Fineness { side, opening };
            let query = Query::new(case.tree(), &case.model, &igloo, fineness);
            if Difference::between(&query.values(receivers), truth).rms > ACCURACY {
                continue;
            }
            let time = median((0..3).map(|_| query.time(timed, &mut scratch)).collect());
            if time < best.0 {
                best = (time, fineness);
            }
        }
    }
    best.1
}

/// What is measured where none of the settings is fine enough; the table then says so.
fn finest() -> Fineness {
    Fineness { side: 64, opening: 1.0 }
}

/// Openings and sides of maps that are tried against every segment by itself.
const SIDES: [u32; 8] = [4, 6, 8, 10, 12, 14, 16, 20];
const OPENINGS: [f32; 7] = [0.7, 1.0, 1.3, 1.6, 2.0, 2.5, 3.0];

pub fn print_every_segment(bench: &Bench, _wanted: &dyn Fn(u32) -> bool) {
    let case = bench.ball();
    let place = Place::Hair;
    let igloo = place.igloo();
    let receivers = case.receivers(place, 0, place.points());
    let segments = ThinnedSegments::build(&case.model, Transmittance::Crossing);
    let one_by_one = |receiver: &Receiver| every_segment(&segments, &case.model, &igloo, receiver);
    let all: Vec<f64> = receivers.par_iter().map(|receiver| mean(&one_by_one(receiver))).collect();

    let timed = case.timed(place, TIMED);
    let mut scratch = Scratch::default();
    let mut best: Option<(f64, Fineness, f64, f64)> = None;
    for side in SIDES {
        for opening in OPENINGS {
            let fineness = Fineness { side, opening };
            let query = Query::new(case.tree(), &case.model, &igloo, fineness);
            let values = query.values(&receivers);
            let distance = |(a, b): (&f64, &f64)| (a - b).abs();
            let average = values.iter().zip(&all).map(distance).sum::<f64>() / all.len() as f64;
            let largest = values.iter().zip(&all).map(distance).fold(0.0, f64::max);
            if average > 2.0 / 256.0 || largest > 5.0 / 256.0 {
                continue;
            }
            let time = median((0..3).map(|_| query.time(&timed[..512], &mut scratch)).collect());
            if best.is_none_or(|(least, ..)| time < least) {
                best = Some((time, fineness, average, largest));
            }
        }
    }
    let mut table = crate::table("Against every segment by itself: 1,000,000 segments, on hair");
    let what = "time of every segment / projected, mean difference ≤ 2/256, largest ≤ 5/256";
    let bounds = Bounds::at_least(3000.0, 6000.0);
    let Some((_, fineness, average, largest)) = best else {
        table.held(5, what, "no settings do it", f64::NAN, bounds);
        return table.print();
    };
    let query = Query::new(case.tree(), &case.model, &igloo, fineness);
    let sparse: Vec<Receiver> = timed.iter().step_by(TIMED as usize / 8).copied().collect();
    let mut slow = || {
        let start = thread_time();
        for receiver in &sparse {
            std::hint::black_box(one_by_one(receiver));
        }
        (thread_time() - start) / sparse.len() as f64
    };
    let mut fast = || query.time(&timed, &mut scratch);
    let [slow, fast] = medians(ROUNDS, [&mut slow, &mut fast]);
    let measured = format!(
        "{:.0} times: {:.0} ms against {:.1} µs; mean {:.2}/256, largest {:.2}/256; {} cells a side, opening {}",
        slow / fast,
        slow * 1e3,
        fast * 1e6,
        average * 256.0,
        largest * 256.0,
        fineness.side,
        fineness.opening,
    );
    table.held(5, what, &measured, slow / fast, bounds);
    table.print();
}

fn every_segment(
    segments: &ThinnedSegments,
    model: &tress::hair::HairModel,
    igloo: &Igloo,
    receiver: &Receiver,
) -> Vec<f32> {
    let far = vec![f32::INFINITY; igloo.len()];
    let mut depth = vec![0.0; igloo.len()];
    let mut pieces = Vec::new();
    let sphere = Projection::Sphere;
    segments.optical_depths(receiver, igloo, &Thinning::NONE, sphere, &far, &mut depth, model, &mut pieces);
    layer::transmittances(&mut depth);
    depth
}
