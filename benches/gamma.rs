//! Γ by projection: time a point on one thread and error against every segment by itself and against rays.
//!
//! `cargo bench --bench gamma [-- STRANDS...]`; times are medians of five runs over the same points.

#[path = "../tests/common/mod.rs"]
mod common;

use std::time::Instant;

use common::models::*;
use tress::embree::Device;
use tress::hair::HairModel;
use tress::occlusion::clusters::Scratch;
use tress::occlusion::{ClusterTree, HairRays, Igloo, Receiver, Selection, Transmittance};

const POINTS: u32 = 2048;
/// Points of which the error is taken, spread over the timed ones.
const CHECKED: usize = 64;

fn main() {
    let given: Vec<u32> = std::env::args().skip(1).filter_map(|argument| argument.parse().ok()).collect();
    let strands = if given.is_empty() { vec![500, 5_000, 50_000] } else { given };
    for strands in strands {
        // The same optical depth at every count.
        let width = 0.003 * (50_000.0 / strands as f32).min(10.0);
        let model = grow(Style::Ball, strands, 20, width, 0.5);
        let start = Instant::now();
        let tree = ClusterTree::build(&model, Transmittance::Crossing);
        let (seconds, bytes) = (start.elapsed().as_secs_f64(), tree.bytes() as f64 / model.segments() as f64);
        println!("{} segments: tree in {seconds:.3} s, {bytes:.1} bytes a segment", model.segments());
        let rays = HairRays::build(&Device::new().unwrap(), &model, Transmittance::Crossing).unwrap();
        for (place, mut receivers) in [("hair", on_hair(&model, POINTS)), ("floor", on_floor(-1.6, POINTS))] {
            receivers.sort_by_key(|receiver| morton(receiver.position));
            measure(place, &tree, &rays, &model, &receivers);
        }
    }
}

fn measure(place: &str, tree: &ClusterTree, rays: &HairRays, model: &HairModel, receivers: &[Receiver]) {
    let checked: Vec<Receiver> = receivers.iter().step_by(receivers.len() / CHECKED).copied().collect();
    let truth = traced(rays, model, &checked, 20_000);
    for faces in [25, 50, 100, 200, 400] {
        let all = (faces == 100).then(|| projected(tree, model, &checked, faces, Selection::All));
        for opening in [0.3, 0.45, 0.6, 0.8] {
            let selection = Selection::Clusters { opening };
            let value = projected(tree, model, &checked, faces, selection);
            let time = time(tree, model, receivers, faces, selection);
            let against =
                all.as_ref().map(|all| format!("; against all segments {}", Difference::between(&value, all)));
            let against = against.unwrap_or_default();
            let error = Difference::between(&value, &truth);
            println!("  {place}, {faces:3} faces, opening {opening}: {time:6.1} µs; against rays {error}{against}");
        }
    }
}

/// Microseconds a point.
fn time(tree: &ClusterTree, model: &HairModel, receivers: &[Receiver], faces: u32, selection: Selection) -> f64 {
    let igloo: Igloo = igloo_for(&receivers[0], faces);
    let far = vec![f32::INFINITY; igloo.len()];
    let mut depth = vec![0.0; igloo.len()];
    let mut scratch = Scratch::default();
    let mut run = || {
        let start = Instant::now();
        for receiver in receivers {
            depth.fill(0.0);
            tree.optical_depths(receiver, &igloo, selection, &far, &mut depth, model, &mut scratch);
        }
        start.elapsed().as_secs_f64() * 1e6 / receivers.len() as f64
    };
    let mut times: Vec<f64> = (0..5).map(|_| run()).collect();
    times.sort_by(f64::total_cmp);
    times[2]
}

/// Order along a space-filling curve.
fn morton(p: glam::Vec3) -> u64 {
    let spread = |x: f32| {
        let bits = ((x + 4.0) * 128.0) as u64;
        (0..10).map(|bit| (bits >> bit & 1) << (3 * bit)).sum::<u64>()
    };
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}
