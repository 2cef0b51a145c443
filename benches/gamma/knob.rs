//! Row 11: whether the accuracy asked for is what comes, and what it costs, for many kinds of hair.

use tress::occlusion::{Calibration, RaySettings, Receiver, Scratch};

use crate::common::models::{Difference, Style, calibrated, grow, yuksel_straight};
use crate::measure::{Query, Traced, medians};
use crate::scene::{Bench, Case, PLACES, Place, sintel, styled};
use crate::table::{Bounds, Table};

const ASKED: [f64; 3] = [0.02, 0.01, 0.005];
const TRUTH_RAYS: u32 = 50_000;

/// Makes a model; none where its file is not there.
type Make = fn() -> Option<Case>;

/// The last three had no part in the choice of what is tried.
const CASES: [Make; 11] = [
    || Some(styled(Style::Ball, 0.5)),
    || Some(styled(Style::Ball, 0.0)),
    || Some(styled(Style::Clumps, 0.5)),
    || Some(styled(Style::Clumps, 0.0)),
    || Some(styled(Style::Curly, 0.5)),
    || Some(styled(Style::Curly, 0.0)),
    || Some(Case::new("yuksel-straight-0.356", yuksel_straight(0.356)?, -1.1)),
    || Some(Case::new("yuksel-straight-0", yuksel_straight(0.0)?, -1.1)),
    || Some(Case::new("lock-0.5", grow(Style::Lock, 30_000, 24, 0.004, 0.5), -1.6)),
    || Some(Case::new("sintel-0.5", sintel(0.5)?, -1.1)),
    || Some(Case::new("sintel-0", sintel(0.0)?, -1.1)),
];

pub fn print(bench: &Bench, _wanted: &dyn Fn(u32) -> bool) {
    println!("\n### The accuracy asked for, and what comes\n");
    println!(
        "Claimed: by the calibration, on other points than those of the error. Rays: the fewest with that accuracy.\n"
    );
    println!("| hair | where | asked | settings | claimed | error | held | µs a point | rays | µs a point | ratio |");
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let (mut held, mut within, mut all) = (0, 0, 0);
    for case in CASES.iter().filter_map(|make| make()) {
        for place in PLACES {
            for asked in ASKED {
                let (claim, error) = line(bench, &case, place, asked);
                held += u32::from(claim);
                within += u32::from(error <= asked);
                all += 1;
            }
        }
    }
    let mut table = crate::table("The accuracy asked for, in short");
    summary(&mut table, held, within, all);
    table.print();
}

fn summary(table: &mut Table, held: u32, within: u32, all: u32) {
    let share = f64::from(held) / f64::from(all);
    table.held(
        11,
        "claims that hold",
        &format!("{held} of {all}; the error is within what was asked in {within}"),
        share,
        Bounds::at_least(1.0, 1.0),
    );
}

/// Half the points of the other rows.
fn points(place: Place) -> u32 {
    match place {
        Place::Hair => 64,
        Place::Floor => 32,
    }
}

/// Whether the claim held, and the error.
fn line(bench: &Bench, case: &Case, place: Place, asked: f64) -> (bool, f64) {
    let count = points(place);
    let igloo = place.igloo();
    let receivers = case.receivers(place, 0, count);
    let truth = bench.truth(case, place, &receivers, &RaySettings::fastest(TRUTH_RAYS));
    let others = case.receivers(place, count, count);
    let Calibration { fineness, error: claimed, reached, .. } =
        calibrated(case.tree(), case.rays(), &case.model, &others, &igloo, asked);
    let query = Query::new(case.tree(), &case.model, &igloo, fineness);
    let error = Difference::between(&query.values(&receivers), &truth);
    // Where it says itself that it did not get there, its claim is its own error.
    let held = error.rms <= if reached { asked } else { claimed.max(asked) };

    let traced = Traced::new(case, &igloo);
    let (rays, _) = traced.fewest(&receivers, &truth, asked);
    let timed = case.timed(place, 512);
    let sparser: Vec<Receiver> = timed.iter().step_by(16).copied().collect();
    let mut scratch = Scratch::default();
    let mut projected = || query.time(&timed, &mut scratch);
    let mut by_rays = || traced.time(&sparser, &RaySettings::fastest(rays));
    let [projected, by_rays] = medians(3, [&mut projected, &mut by_rays]);
    println!(
        "| {} | {} | {asked} | {} cells, {} | {claimed:.4}{} | {:.4} (mean {:+.4}) | {} | {:.1} | {rays} | {:.0} | {:.0} |",
        case.name,
        place.name(),
        fineness.side,
        fineness.opening,
        if reached { "" } else { ", not reached" },
        error.rms,
        error.mean,
        if held { "yes" } else { "**no**" },
        projected * 1e6,
        by_rays * 1e6,
        by_rays / projected,
    );
    (held, error.rms)
}
