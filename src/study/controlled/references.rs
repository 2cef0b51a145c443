//! References of pixels, in two halves that share nothing random: not even photons.

use super::pixels::Drawn;
use super::worth::Truth;
use super::{Goal, Job, KNOB};
use crate::hash::hash;
use crate::render::{Photons, RenderError};

/// Purpose of random numbers.
const TRUTH: u32 = 0x5452_5554;

/// A reference's noise may be this share of the error asked for: over a set of pixels it is known well enough to be taken out.
const NOISE: f64 = 1.0;
/// Rounds of a reference at the most.
const MOST_ROUNDS: u32 = 64;

/// Share of a time for the references of both sets.
const FOR_TRUTH: f64 = 0.2;
/// Pixels that are looked at before the clock is.
const AT_A_TIME: usize = 16;

/// One half of the references of a set of pixels.
struct Half {
    seed: u32,
    rounds: u32,
    photons: Option<Photons>,
    /// Means over the rounds, in the order of the pixels; fewer where time was short.
    means: Vec<[f64; 3]>,
}

impl Job<'_> {
    /// References in rounds, as many as make their noise small against the error asked for. `set` is the number of the set of pixels.
    pub(super) fn references(&mut self, drawn: &[Drawn], set: u32, level: f64) -> Result<Vec<Truth>, RenderError> {
        let seed = self.given.sampling.seed;
        let mut halves = [0, 1].map(|half| Half {
            seed: hash(&[TRUTH, seed, set, half]),
            rounds: 0,
            photons: None,
            means: Vec::new(),
        });
        let share = |half: u32| FOR_TRUTH * f64::from(2 * set + half + 1) / 4.0;
        self.rounds(&mut halves[0], drawn, 1, share(0))?;
        let some = &drawn[..halves[0].means.len()];
        self.rounds(&mut halves[1], some, 1, share(1))?;
        if let Goal::Error(error) = self.goal {
            let truths = truths(some, &halves);
            let variance = truths.iter().map(|truth| truth.weight * truth.variance()).sum::<f64>();
            let enough = (NOISE * error * level).powi(2) * truths.len().max(1) as f64;
            // The variance of a mean of as many more rounds falls as many times.
            let rounds = (variance / enough).ceil().clamp(1.0, f64::from(MOST_ROUNDS)) as u32;
            for half in halves.iter_mut().filter(|_| rounds > 1) {
                self.rounds(half, some, rounds, 1.0)?;
            }
        }
        Ok(truths(some, &halves))
    }

    /// Adds rounds to a half until there are so many. Where a time is asked for, pixels only as long as less than this share of it is spent.
    fn rounds(&mut self, half: &mut Half, drawn: &[Drawn], until: u32, share: f64) -> Result<(), RenderError> {
        let (progress, goal, begin) = (self.progress, self.goal, self.begin);
        let prepared = self.prepare_with(KNOB.len(), half.seed, half.photons.take())?;
        progress.stage("calibrating", u64::from(until - half.rounds) * drawn.len() as u64);
        let at: Vec<[u32; 2]> = drawn.iter().map(|drawn| drawn.at).collect();
        while half.rounds < until {
            let round = hash(&[TRUTH, half.seed, half.rounds]);
            let mut found = Vec::new();
            for some in at.chunks(AT_A_TIME) {
                let spent = |time: f64| begin.elapsed().as_secs_f64() > share * time;
                if !found.is_empty() && matches!(goal, Goal::Time(time) if spent(time)) {
                    break;
                }
                let pixels = prepared.pixels(some, round, progress)?.pixels;
                found.extend(pixels.iter().map(|pixel| pixel.beauty.as_dvec3().to_array()));
            }
            half.rounds += 1;
            if half.means.is_empty() {
                half.means = found;
                continue;
            }
            let share = 1.0 / f64::from(half.rounds);
            for (mean, new) in half.means.as_flattened_mut().iter_mut().zip(found.as_flattened()) {
                *mean += share * (new - *mean);
            }
        }
        half.photons = Some(prepared.into_photons());
        Ok(())
    }
}

fn truths(drawn: &[Drawn], [a, b]: &[Half; 2]) -> Vec<Truth> {
    let both = drawn.iter().zip(a.means.iter().zip(&b.means));
    both.map(|(drawn, (a, b))| Truth { at: drawn.at, weight: drawn.weight, halves: [*a, *b] }).collect()
}
