//! Rows 8 and 10: error on clumped hair, and what cutting segments changes.

use tress::occlusion::{ClusterTree, RaySettings, Transmittance};

use crate::common::models::{Difference, Style, cut};
use crate::measure::Query;
use crate::scene::{Bench, Case, PLACES, styled};
use crate::table::{Bounds, Table};

const ACCURACY: f64 = 0.004;

pub fn print(bench: &Bench, wanted: &dyn Fn(u32) -> bool) {
    let mut table = crate::table("Other hair: settings calibrated for .004");
    if wanted(8) {
        for transparency in [0.5, 0.0] {
            clumped(bench, &styled(Style::Clumps, transparency), &mut table);
        }
    }
    if wanted(10) {
        cut_in_four(bench, &mut table);
    }
    table.print();
}

fn clumped(bench: &Bench, case: &Case, table: &mut Table) {
    for place in PLACES {
        let igloo = place.igloo();
        let receivers = case.receivers(place, 0, place.points());
        let truth = bench.truth(case, place, &receivers, &RaySettings::exact(100_000));
        let found = bench.calibration(case, place, ACCURACY);
        let query = Query::new(case.tree(), &case.model, &igloo, found.fineness);
        let error = Difference::between(&query.values(&receivers), &truth);
        let time = query.median_time(&case.timed(place, 512));
        let measured = format!(
            "{error}; claimed {:.5}{}; {} cells a side, opening {}; {:.0} µs",
            found.error,
            if found.reached { "" } else { " (not reached)" },
            found.fineness.side,
            found.fineness.opening,
            time * 1e6
        );
        let what = format!("RMS error of {}, {}", case.name, place.name());
        table.held(8, &what, &measured, error.rms, Bounds::at_most(0.005, 0.003));
    }
}

fn cut_in_four(bench: &Bench, table: &mut Table) {
    let case = bench.ball();
    let finer = cut(&case.model, 4);
    let tree = ClusterTree::build(&finer, Transmittance::Crossing);
    for place in PLACES {
        let igloo = place.igloo();
        let receivers = case.receivers(place, 0, place.points());
        let fineness = bench.calibration(case, place, ACCURACY).fineness;
        let whole = Query::new(case.tree(), &case.model, &igloo, fineness).values(&receivers);
        let parts = Query::new(&tree, &finer, &igloo, fineness).values(&receivers);
        let change = Difference::between(&parts, &whole);
        let what = |which: &str| format!("change of Γ̄ with segments cut in four, {}, {which}", place.name());
        let bounds = Bounds::at_most(0.003, 0.001);
        table.held(10, &what("mean"), &format!("{:+.5}", change.mean), change.mean.abs(), bounds);
        let measured = format!("{:.5} (largest {:.4})", change.rms, change.largest);
        table.held(10, &what("RMS"), &measured, change.rms, bounds);
    }
}
