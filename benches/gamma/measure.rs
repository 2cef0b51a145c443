//! CPU times, values and errors.

use glam::Vec3;
use rayon::prelude::*;
use tress::hash::hash;
use tress::occlusion::{ClusterTree, Crossings, DepthMap, Fineness, HairRays, Igloo, RaySettings, Receiver, Scratch};

use crate::common::models::{Difference, mean};
use crate::scene::Case;
use tress::hair::HairModel;

/// Faces a hemisphere.
pub const FACES: u32 = 100;

/// CPU time of this thread, in seconds: other processes on the machine do not count.
pub fn thread_time() -> f64 {
    let time = nix::time::clock_gettime(nix::time::ClockId::CLOCK_THREAD_CPUTIME_ID).unwrap();
    time.tv_sec() as f64 + time.tv_nsec() as f64 * 1e-9
}

/// Medians of what some runs return, over `rounds` rounds in which each runs once.
pub fn medians<const N: usize>(rounds: usize, mut runs: [&mut dyn FnMut() -> f64; N]) -> [f64; N] {
    let mut times = [const { Vec::new() }; N];
    for _ in 0..rounds {
        for (run, times) in runs.iter_mut().zip(&mut times) {
            times.push(run());
        }
    }
    times.map(median)
}

pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Points along a curve that fills space: as in a picture's tile, neighbours in the order are near each other.
pub fn in_order(mut receivers: Vec<Receiver>) -> Vec<Receiver> {
    let place = |p: Vec3| {
        let spread = |x: f32| (0..10).map(|bit| (((x + 4.0) * 128.0) as u64 >> bit & 1) << (3 * bit)).sum::<u64>();
        spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
    };
    receivers.sort_by_key(|receiver| place(receiver.position));
    receivers
}

/// One projected query: settings made ready for an igloo.
pub struct Query<'a> {
    pub tree: &'a ClusterTree,
    pub model: &'a HairModel,
    pub igloo: &'a Igloo,
    pub map: DepthMap,
    pub opening: f32,
}

impl<'a> Query<'a> {
    pub fn new(tree: &'a ClusterTree, model: &'a HairModel, igloo: &'a Igloo, fineness: Fineness) -> Self {
        let map = fineness.map(igloo);
        let opening = fineness.angle(&map);
        Self { tree, model, igloo, map, opening }
    }

    /// Γ of each face.
    pub fn fill(&self, receiver: &Receiver, far: Option<&[f32]>, gamma: &mut [f32], scratch: &mut Scratch) {
        self.tree.transmittances(self.model, receiver, &self.map, self.opening, far, gamma, scratch);
    }

    /// Γ̄ of each point, on all threads.
    pub fn values(&self, receivers: &[Receiver]) -> Vec<f64> {
        let start = || (Scratch::default(), vec![0.0; self.igloo.len()]);
        let value = |(scratch, gamma): &mut (Scratch, Vec<f32>), receiver: &Receiver| {
            self.fill(receiver, None, gamma, scratch);
            mean(gamma)
        };
        receivers.par_iter().map_init(start, value).collect()
    }

    /// CPU time a point, in seconds.
    pub fn time(&self, receivers: &[Receiver], scratch: &mut Scratch) -> f64 {
        let mut gamma = vec![0.0; self.igloo.len()];
        let start = thread_time();
        for receiver in receivers {
            self.fill(receiver, None, &mut gamma, scratch);
            std::hint::black_box(&gamma);
        }
        (thread_time() - start) / receivers.len() as f64
    }

    /// Median of the CPU time a point.
    pub fn median_time(&self, receivers: &[Receiver]) -> f64 {
        let mut scratch = Scratch::default();
        median((0..5).map(|_| self.time(receivers, &mut scratch)).collect())
    }
}

/// Γ by rays over an igloo with nothing behind the hair.
pub struct Traced<'a> {
    rays: &'a HairRays,
    model: &'a HairModel,
    igloo: &'a Igloo,
    far: Vec<f32>,
}

impl<'a> Traced<'a> {
    pub fn new(case: &'a Case, igloo: &'a Igloo) -> Self {
        Self { rays: case.rays(), model: &case.model, igloo, far: vec![f32::INFINITY; igloo.len()] }
    }

    fn value(&self, receiver: &Receiver, settings: &RaySettings, key: u32) -> f64 {
        let mut gamma = vec![0.0; self.igloo.len()];
        self.rays.transmittances(self.model, receiver, self.igloo, settings, &self.far, key, &mut gamma);
        mean(&gamma)
    }

    /// Γ̄ of each point, on all threads.
    pub fn values(&self, receivers: &[Receiver], settings: &RaySettings) -> Vec<f64> {
        let value = |(key, receiver): (usize, &Receiver)| self.value(receiver, settings, key as u32);
        receivers.par_iter().enumerate().map(value).collect()
    }

    /// CPU time a point, in seconds.
    pub fn time(&self, receivers: &[Receiver], settings: &RaySettings) -> f64 {
        let start = thread_time();
        for (key, receiver) in receivers.iter().enumerate() {
            std::hint::black_box(self.value(receiver, settings, key as u32));
        }
        (thread_time() - start) / receivers.len() as f64
    }

    /// Root mean square error with a number of rays in each face, over four sets of random numbers.
    fn error(&self, receivers: &[Receiver], truth: &[f64], per_face: u32) -> f64 {
        let settings = RaySettings::fastest(per_face * self.igloo.len() as u32);
        let all: Vec<(usize, u32)> = (0..truth.len()).flat_map(|i| (1..=4).map(move |key| (i, key))).collect();
        let value = |&(i, key): &(usize, u32)| self.value(&receivers[i], &settings, hash(&[key, i as u32]));
        let values: Vec<f64> = all.par_iter().map(value).collect();
        let truth: Vec<f64> = all.iter().map(|&(i, _)| truth[i]).collect();
        Difference::between(&values, &truth).rms
    }

    /// The smallest number of rays a point whose error is within `accuracy`, and that error.
    pub fn fewest(&self, receivers: &[Receiver], truth: &[f64], accuracy: f64) -> (u32, f64) {
        // The error falls faster than with the root of the number: the search goes up from well below what that says.
        let guess = 2.0 * (self.error(receivers, truth, 2) / accuracy).powi(2);
        let mut per_face = ((0.3 * guess) as u32).max(1);
        loop {
            let error = self.error(receivers, truth, per_face);
            if error <= accuracy {
                return (per_face * self.igloo.len() as u32, error);
            }
            per_face += 1 + per_face / 16;
        }
    }
}

/// Rays that multiply until a thousandth is left.
pub fn multiplied(rays: u32) -> RaySettings {
    RaySettings { crossings: Crossings::Multiply { residual: 1e-3 }, ..RaySettings::fastest(rays) }
}
