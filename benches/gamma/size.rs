//! Rows 6 and 7: time of a query, time of the tree's build and its memory, by the number of segments.

use std::time::Instant;

use tress::occlusion::{ClusterTree, Fineness, Scratch, Transmittance};

use crate::common::models::{Style, grow};
use crate::measure::{Query, median};
use crate::scene::{Bench, Case, Place};
use crate::table::{Bounds, Table};

const STRANDS: [u32; 4] = [500, 5_000, 50_000, 500_000];
const TIMED: u32 = 2048;

pub fn print(bench: &Bench, wanted: &dyn Fn(u32) -> bool) {
    let mut table = crate::table("By the number of segments: strands of 20, widths so that the optical depth stays");
    let cases: Vec<Case> = STRANDS.iter().map(|&strands| case(strands)).collect();
    if wanted(6) {
        growth(bench, &cases, &mut table);
    }
    if wanted(7) {
        build(&cases, &mut table);
    }
    table.print();
}

fn case(strands: u32) -> Case {
    let model = grow(Style::Ball, strands, 20, 0.003 * 50_000.0 / strands as f32, 0.5);
    Case::new(&format!("ball-{strands}"), model, -1.6)
}

fn growth(bench: &Bench, cases: &[Case], table: &mut Table) {
    let fineness: Fineness = bench.calibration(bench.ball(), Place::Hair, 0.004).fineness;
    let igloo = Place::Hair.igloo();
    let points: Vec<_> = cases.iter().map(|case| case.timed(Place::Hair, TIMED)).collect();
    let mut times = vec![Vec::new(); cases.len()];
    let mut scratch = Scratch::default();
    for _ in 0..5 {
        for ((case, points), times) in cases.iter().zip(&points).zip(&mut times) {
            let query = Query::new(case.tree(), &case.model, &igloo, fineness);
            times.push(query.time(points, &mut scratch));
        }
    }
    let times: Vec<f64> = times.into_iter().map(median).collect();
    let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] / pair[0]).collect();
    let list = |values: &[f64], digits: usize| {
        values.iter().map(|value| format!("{value:.digits$}")).collect::<Vec<_>>().join(", ")
    };
    let micro: Vec<f64> = times.iter().map(|time| time * 1e6).collect();
    let measured = format!("{} ({} µs)", list(&steps, 2), list(&micro, 1));
    let what = "growth of time for ten times the segments, 10⁴ to 10⁷ (the largest counts)";
    table.held(6, what, &measured, steps.iter().copied().fold(0.0, f64::max), Bounds::at_most(2.7, 2.0));
}

fn build(cases: &[Case], table: &mut Table) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("two threads");
    let case = &cases[2];
    let seconds = |_| {
        let start = Instant::now();
        let tree = pool.install(|| ClusterTree::build(&case.model, Transmittance::Crossing));
        let seconds = start.elapsed().as_secs_f64();
        std::hint::black_box(&tree);
        seconds
    };
    let seconds = median((0..5).map(seconds).collect());
    let what = "build of the tree, 10⁶ segments, two threads, seconds of the clock";
    table.held(7, what, &format!("{seconds:.3} s"), seconds, Bounds::at_most(0.5, 0.2));
    let each = case.tree().bytes() as f64 / case.model.segments() as f64;
    table.held(
        7,
        "memory of the tree, 10⁶ segments",
        &format!("{each:.1} B a segment"),
        each,
        Bounds::at_most(70.0, 70.0),
    );
    let large = &cases[3];
    let bytes = large.tree().bytes() as f64;
    let each = bytes / large.model.segments() as f64;
    table.said(7, "memory of the tree, 10⁷ segments", &format!("{:.0} MB, {each:.1} B a segment", bytes * 1e-6));
}
