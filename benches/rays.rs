//! Γ by rays: CPU time of one thread a ray, and to a given RMS error of Γ̄ over the igloo, for each way of tracing.
//!
//! `cargo bench --bench rays [-- TRUTH_RAYS]`; 50,000 strands of 20 segments, transparency 0.5. Variants are timed in turns, five times, and
//! the medians taken. Truth: `TRUTH_RAYS` (60,000) rays a point, all crossings multiplied.

#[path = "../tests/common/mod.rs"]
mod common;

use common::models::*;
use rayon::prelude::*;
use tress::embree::Device;
use tress::hair::HairModel;
use tress::hash::{hash, to_unit};
use tress::occlusion::raytraced::Ray;
use tress::occlusion::{Crossings, HairRays, Igloo, RaySettings, Receiver, Transmittance};

const POINTS: u32 = 24;
/// The error to be reached, root mean square over the points.
const ERROR: f64 = 0.004;

#[derive(Clone, Copy)]
enum Variant {
    /// One ray after the other, jittered in strata of its face: nothing spared.
    Jittered { residual: f32 },
    /// As the library does it.
    Settings(Crossings),
}

struct Bench<'a> {
    rays: &'a HairRays,
    model: &'a HairModel,
    receivers: &'a [Receiver],
    igloo: Igloo,
    far: Vec<f32>,
}

fn main() {
    let truth_rays = std::env::args().skip(1).find_map(|argument| argument.parse().ok()).unwrap_or(60_000);
    let model = grow(Style::Ball, 50_000, 20, 0.003, 0.5);
    let rays = HairRays::build(&Device::new().unwrap(), &model, Transmittance::Crossing).unwrap();
    for (place, receivers) in [("hair", on_hair(&model, POINTS)), ("floor", on_floor(-1.6, POINTS))] {
        let igloo = igloo_for(&receivers[0], 100);
        let far = vec![f32::INFINITY; igloo.len()];
        let truth = traced(&rays, &model, &receivers, truth_rays);
        let bench = Bench { rays: &rays, model: &model, receivers: &receivers, igloo, far };
        println!("{place}: mean {:.4}", truth.iter().sum::<f64>() / truth.len() as f64);
        bench.neighbours();
        bench.table(&truth);
    }
}

fn variants() -> Vec<(String, Variant)> {
    let multiplied = [0.0, 1e-3, 1e-2]
        .map(|residual| (format!("Sobol, residual {residual}"), Variant::Settings(Crossings::Multiply { residual })));
    let stochastic = [0.1, RaySettings::ROULETTE, 0.5, 1.0]
        .map(|roulette| (format!("Sobol, roulette {roulette}"), Variant::Settings(Crossings::Stochastic { roulette })));
    let jittered =
        [0.0, 1e-3].map(|residual| (format!("jittered, residual {residual}"), Variant::Jittered { residual }));
    jittered.into_iter().chain(multiplied).chain(stochastic).collect()
}

impl Bench<'_> {
    fn table(&self, truth: &[f64]) {
        let faces = self.igloo.len() as u32;
        let counts = [2, 4, 8, 12].map(|per_face| per_face * faces);
        let variants = variants();
        let mut times = vec![[const { Vec::new() }; 2]; variants.len()];
        for round in 0..5 {
            for ((_, variant), times) in variants.iter().zip(&mut times) {
                for packets in [false, true] {
                    times[usize::from(packets)].push(self.microseconds(*variant, packets, 8 * faces, round));
                }
            }
        }
        println!("  {:24} µs a ray alone, in packets; RMS at {counts:?} rays; to {ERROR}; confirmed", "");
        for ((name, variant), times) in variants.into_iter().zip(times) {
            let times = times.map(|mut times| {
                times.sort_by(f64::total_cmp);
                times[times.len() / 2]
            });
            let errors = counts.map(|count| self.error(variant, count, 8, truth).rms);
            // Straight in logarithms between the counts.
            let above = errors[1..3].iter().take_while(|&&error| error > ERROR).count();
            let [x0, x1] = [above, above + 1].map(|i| f64::from(counts[i]).ln());
            let [y0, y1] = [above, above + 1].map(|i| errors[i].ln());
            let needed = (x0 + (ERROR.ln() - y0) * (x1 - x0) / (y1 - y0)).exp();
            let count = ((needed / f64::from(faces)).round() as u32).max(1) * faces;
            let confirmed = self.error(variant, count, 16, truth);
            let took = self.microseconds(variant, true, count, 9);
            println!(
                "  {name:24} {:.3} {:.3}; {}; {needed:.0} rays, {:.2} ms; {count} rays, {:.2} ms: {confirmed}",
                times[0],
                times[1],
                errors.map(|error| format!("{error:.5}")).join(" "),
                needed * times[1] * 1e-3,
                took * f64::from(count) * 1e-3,
            );
        }
    }

    /// Packets at their best: neighbouring directions a degree apart, one in each of 10,000 faces a hemisphere.
    fn neighbours(&self) {
        let igloo = igloo_for(&self.receivers[0], 10_000);
        let far = vec![f32::INFINITY; igloo.len()];
        let receivers = &self.receivers[..8];
        let bench = Bench { rays: self.rays, model: self.model, receivers, igloo, far };
        let count = bench.igloo.len() as u32;
        for crossings in [Crossings::Multiply { residual: 0.0 }, RaySettings::fastest(1).crossings] {
            let mut times = [const { Vec::new() }; 2];
            for round in 0..3 {
                for packets in [false, true] {
                    let time = bench.microseconds(Variant::Settings(crossings), packets, count, round);
                    times[usize::from(packets)].push(time);
                }
            }
            let [alone, packets] = times.map(|mut times| {
                times.sort_by(f64::total_cmp);
                times[1]
            });
            println!("  a degree apart, {crossings:?}: µs a ray alone {alone:.3}, in packets {packets:.3}");
        }
    }

    /// CPU time of this thread a ray.
    fn microseconds(&self, variant: Variant, packets: bool, count: u32, key: u32) -> f64 {
        let start = thread_time();
        for (i, receiver) in self.receivers.iter().enumerate() {
            std::hint::black_box(self.value(variant, packets, receiver, count, hash(&[key, i as u32])));
        }
        (thread_time() - start) * 1e6 / (f64::from(count) * self.receivers.len() as f64)
    }

    fn error(&self, variant: Variant, count: u32, keys: u32, truth: &[f64]) -> Difference {
        let all: Vec<(usize, u32)> = (0..truth.len()).flat_map(|i| (0..keys).map(move |key| (i, key))).collect();
        let value =
            |&(i, key): &(usize, u32)| self.value(variant, true, &self.receivers[i], count, hash(&[key, i as u32, 1]));
        let values: Vec<f64> = all.par_iter().map(value).collect();
        let truth: Vec<f64> = all.iter().map(|&(i, _)| truth[i]).collect();
        Difference::between(&values, &truth)
    }

    fn value(&self, variant: Variant, packets: bool, receiver: &Receiver, count: u32, key: u32) -> f64 {
        let mut gamma = vec![0.0; self.igloo.len()];
        match variant {
            Variant::Jittered { residual } => self.jittered(receiver, count, residual, key, &mut gamma),
            Variant::Settings(crossings) => {
                let settings = RaySettings { rays: count, crossings, packets };
                let Self { rays, model, igloo, far, .. } = self;
                rays.transmittances(model, receiver, igloo, &settings, far, key, &mut gamma);
            }
        }
        gamma.iter().map(|&gamma| f64::from(gamma)).sum::<f64>() / gamma.len() as f64
    }

    fn jittered(&self, receiver: &Receiver, count: u32, residual: f32, key: u32, gamma: &mut [f32]) {
        let per_face = count.div_ceil(self.igloo.len() as u32);
        let rows = f64::from(per_face).sqrt().floor() as u32;
        let columns = per_face.div_ceil(rows);
        for (face, gamma) in gamma.iter_mut().enumerate() {
            for stratum in 0..columns * rows {
                let jitter = |axis: u32| to_unit(hash(&[2, key, face as u32, stratum, axis]));
                let across = ((stratum % columns) as f32 + jitter(0)) / columns as f32;
                let down = ((stratum / columns) as f32 + jitter(1)) / rows as f32;
                let direction = receiver.frame * self.igloo.direction(face, across, down);
                let ray = Ray { origin: receiver.position, direction, far: self.far[face], on: receiver.on };
                *gamma += self.rays.transmittance(self.model, &ray, residual) / (columns * rows) as f32;
            }
        }
    }
}

/// CPU time of this thread, in seconds: other processes on the machine do not count.
fn thread_time() -> f64 {
    let time = nix::time::clock_gettime(nix::time::ClockId::CLOCK_THREAD_CPUTIME_ID).unwrap();
    time.tv_sec() as f64 + time.tv_nsec() as f64 * 1e-9
}
