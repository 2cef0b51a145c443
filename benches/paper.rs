//! The paper's own ways to Γ: CPU time a point on one thread, and error against rays, both over the same points on hair.
//!
//! `cargo bench --bench paper [-- STRANDS RAYS]`; 50,000 strands of 20 segments and 50,000 rays a point unless given.

#[path = "../tests/common/mod.rs"]
mod common;

use common::models::*;
use nix::sys::resource::{UsageWho, getrusage};
use tress::embree::Device;
use tress::hair::HairModel;
use tress::occlusion::{HairRays, Igloo, Projection, Receiver, Span, ThinnedSegments, Thinning, Transmittance, layer};

const POINTS: u32 = 32;
const FACES: u32 = 100;

fn main() {
    let given: Vec<u32> = std::env::args().skip(1).filter_map(|argument| argument.parse().ok()).collect();
    let strands = given.first().copied().unwrap_or(50_000);
    let rays = given.get(1).copied().unwrap_or(50_000);
    let model = grow(Style::Ball, strands, 20, 0.003 * (50_000.0 / strands as f32).min(10.0), 0.5);
    let receivers = on_hair(&model, POINTS);
    let hair_rays = HairRays::build(&Device::new().unwrap(), &model, Transmittance::Crossing).unwrap();
    let truth = traced(&hair_rays, &model, &receivers, rays);
    let level = truth.iter().sum::<f64>() / truth.len() as f64;
    println!("{} segments, {POINTS} points, {FACES} faces; Γ̄ {level:.4} by {rays} rays a point", model.segments());

    let bench = Bench { model: &model, receivers: &receivers, truth: &truth };
    let crossing = ThinnedSegments::build(&model, Transmittance::Crossing);
    let fraction = |fraction| Thinning { fraction, distance_unit: f32::INFINITY };
    let unit = |distance_unit| Thinning { fraction: 1.0, distance_unit };
    for (name, projection) in [("sphere", Projection::Sphere), ("tangent plane", Projection::TangentPlane)] {
        bench.segments(&format!("all segments, {name}"), &crossing, Thinning::NONE, projection);
        for share in [0.1, 0.03] {
            bench.segments(&format!("5.1, {} %, {name}", share * 100.0), &crossing, fraction(share), projection);
        }
        for distance in [1.0, 0.5, 0.25, 0.05] {
            bench.segments(&format!("5.2, unit {distance}, {name}"), &crossing, unit(distance), projection);
        }
        for length in [0.0125, 0.025, 0.05] {
            let by_length = ThinnedSegments::build(&model, Transmittance::SegmentLength { unit: length });
            bench.segments(&format!("Eq. 7, L_n of {length}, {name}"), &by_length, Thinning::NONE, projection);
        }
    }
}

struct Bench<'a> {
    model: &'a HairModel,
    receivers: &'a [Receiver],
    truth: &'a [f64],
}

impl Bench<'_> {
    fn segments(&self, name: &str, segments: &ThinnedSegments, thinning: Thinning, projection: Projection) {
        let igloo = Igloo::new(Span::Sphere, FACES);
        let mut used = 0;
        for receiver in self.receivers {
            segments.selected(self.model, receiver.position, &thinning, |_, _| used += 1);
        }
        let name = format!("{name} ({} segments a point)", used / self.receivers.len());
        let mut pieces = Vec::new();
        self.report(&name, &igloo, |receiver, far, depth| {
            segments.optical_depths(receiver, &igloo, &thinning, projection, far, depth, self.model, &mut pieces);
        });
    }

    /// Time is the median of up to nine runs over all points, fewer where they take long.
    fn report(&self, name: &str, igloo: &Igloo, mut fill: impl FnMut(&Receiver, &[f32], &mut [f32])) {
        let far = vec![f32::INFINITY; igloo.len()];
        let mut depth = vec![0.0; igloo.len()];
        let mut value = Vec::new();
        let mut times = Vec::new();
        let begin = cpu_seconds();
        while times.len() < 9 && (times.is_empty() || cpu_seconds() - begin < 2.0) {
            value.clear();
            let mut seconds = 0.0;
            for receiver in self.receivers {
                let start = cpu_seconds();
                depth.fill(0.0);
                fill(receiver, &far, &mut depth);
                seconds += cpu_seconds() - start;
                layer::transmittances(&mut depth);
                value.push(depth.iter().map(|&gamma| f64::from(gamma)).sum::<f64>() / depth.len() as f64);
            }
            times.push(seconds * 1e6 / self.receivers.len() as f64);
        }
        times.sort_by(f64::total_cmp);
        println!("{name}: {:.0} µs; {}", times[times.len() / 2], Difference::between(&value, self.truth));
    }
}

/// CPU time of this thread: other programs do not count.
fn cpu_seconds() -> f64 {
    let usage = getrusage(UsageWho::RUSAGE_THREAD).expect("the kernel counts");
    [usage.user_time(), usage.system_time()].iter().map(|t| t.tv_sec() as f64 + 1e-6 * t.tv_usec() as f64).sum()
}
