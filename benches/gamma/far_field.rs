//! Row 4: time a point where many are asked, in the order of space: what neighbours look at is still in the processor's caches.

use tress::occlusion::{Fineness, RaySettings, Receiver, Scratch};

use crate::measure::{Query, Traced, medians, multiplied};
use crate::scene::{Bench, Place};
use crate::table::{Bounds, Table};

const POINTS: u32 = 100_000;
const SPARSER: usize = 1_000;
const RAYS: u32 = 1_800;
const ROUNDS: usize = 9;

/// The settings of row 1.
const FINENESS: Fineness = Fineness { side: 12, opening: 1.2 };

pub fn print(bench: &Bench, _wanted: &dyn Fn(u32) -> bool) {
    let case = bench.ball();
    let place = Place::Hair;
    let igloo = place.igloo();
    let query = Query::new(case.tree(), &case.model, &igloo, FINENESS);
    let traced = Traced::new(case, &igloo);
    let timed = case.timed(place, POINTS);
    let sparser: Vec<Receiver> = timed.iter().step_by(SPARSER).copied().collect();
    let mut scratch = Scratch::default();
    let mut projected = || query.time(&timed, &mut scratch);
    let mut roulette = || traced.time(&sparser, &RaySettings::fastest(RAYS)) / f64::from(RAYS);
    let mut residual = || traced.time(&sparser, &multiplied(RAYS)) / f64::from(RAYS);
    let [time, roulette, residual] = medians(ROUNDS, [&mut projected, &mut roulette, &mut residual]);
    let mut table: Table =
        crate::table("Many points: 100,000 on hair, in the order of space; nothing is shared between them");
    for (name, ray) in [("roulette .25", roulette), ("residual .001", residual)] {
        let rays = time / ray;
        let measured = format!("{rays:.2} rays of {:.2} µs: {:.1} µs", ray * 1e6, time * 1e6);
        let what = format!("an igloo, in rays through the hair ({name})");
        table.held(4, &what, &measured, rays, Bounds::at_most(1.5, 0.7));
    }
    table.print();
}
