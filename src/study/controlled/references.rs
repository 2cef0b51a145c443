//! References of pixels, in two halves that share nothing random: not even photons.

use super::pixels::Drawn;
use super::streams::Streams;
use super::worth::Truth;
use super::{Goal, Job, KNOB};
use crate::hash::hash;
use crate::render::{Pass, RenderError, Selection};
use crate::sequence::Sequence;

/// Purpose of random numbers.
const TRUTH: u32 = 0x5452_5554;

/// A reference's noise may be this share of the error asked for: over a set of pixels it is known well enough to be taken out. Where few pixels hold most of
/// it, what is left of it in the bias is of the order of its own square.
const NOISE: f64 = 0.5;
/// Rounds of a reference at the most.
const MOST_ROUNDS: u32 = 128;
/// Rounds grow at most so many times before their noise is looked at again.
const STEP: u32 = 4;

/// Share of a time for the references of both sets.
const FOR_TRUTH: f64 = 0.2;
/// Pixels that are looked at before the clock is.
const AT_A_TIME: usize = 16;

/// A set of pixels with its references.
pub(super) struct Judges {
    pub pixels: Selection,
    pub truths: Vec<Truth>,
}

/// One half of the references of both sets of pixels: a stream of rounds for each set. They share its photons.
struct Half {
    seed: u32,
    photons: Streams,
    /// Rounds done for each set.
    rounds: [u32; 2],
    /// Of each set, means over the rounds in the order of the pixels; fewer where time was short.
    means: [Vec<[f64; 3]>; 2],
}

impl Job<'_> {
    /// References of two sets of pixels in rounds, as many as make their noise small against the error asked for.
    pub(super) fn references(&mut self, drawn: &[Vec<Drawn>; 2], level: f64) -> Result<[Judges; 2], RenderError> {
        let seed = self.given.sampling.seed;
        let mut pixels: Option<[Selection; 2]> = None;
        let mut halves = [0, 1].map(|half| Half {
            seed: hash(&[TRUTH, seed, half]),
            photons: Streams::new(self.goal.error()),
            rounds: [0; 2],
            means: [Vec::new(), Vec::new()],
        });
        for (number, half) in halves.iter_mut().enumerate() {
            self.rounds(
                half,
                drawn,
                &mut pixels,
                [1; 2],
                [0, 1].map(|set| FOR_TRUTH * (2 * number + set + 1) as f64 / 4.0),
            )?;
        }
        if let Goal::Error(error) = self.goal {
            let mut rounds = [1; 2];
            loop {
                let next = [0, 1].map(|set| {
                    let truths = truths(&drawn[set], &halves, set);
                    let variance = truths.iter().map(|truth| truth.weight * truth.variance()).sum::<f64>();
                    let enough = (NOISE * error * level).powi(2) * truths.len().max(1) as f64;
                    // The variance of a mean of as many more rounds falls as many times, or faster: not all of them at once.
                    let wanted = (f64::from(rounds[set]) * variance / enough).ceil() as u32;
                    wanted.clamp(rounds[set], (STEP * rounds[set]).min(MOST_ROUNDS))
                });
                if next == rounds {
                    break;
                }
                rounds = next;
                for half in &mut halves {
                    self.rounds(half, drawn, &mut pixels, rounds, [1.0; 2])?;
                }
            }
        }
        let mut pixels = pixels.unwrap_or_default();
        Ok([0, 1].map(|set| {
            let truths = truths(&drawn[set], &halves, set);
            let mut pixels = std::mem::take(&mut pixels[set]);
            pixels.truncate(truths.len());
            Judges { pixels, truths }
        }))
    }

    /// Adds rounds to a half until each set has so many. Where a time is asked for, pixels only as long as less than this share of it is spent.
    fn rounds(
        &mut self,
        half: &mut Half,
        drawn: &[Vec<Drawn>; 2],
        pixels: &mut Option<[Selection; 2]>,
        until: [u32; 2],
        shares: [f64; 2],
    ) -> Result<(), RenderError> {
        let (progress, goal, begin) = (self.progress, self.goal, self.begin);
        let mut prepared = self.prepare(KNOB.len(), half.seed, half.photons.first())?;
        let places = |drawn: &Vec<Drawn>| drawn.iter().map(|drawn| drawn.at).collect::<Vec<_>>();
        let pixels = pixels.get_or_insert_with(|| [0, 1].map(|set| prepared.select(&places(&drawn[set]))));
        let left = [0, 1].map(|set| u64::from(until[set] - half.rounds[set]) * pixels[set].len() as u64);
        progress.stage("calibrating", left[0] + left[1]);
        let mut turns = 0;
        for set in [0, 1] {
            while half.rounds[set] < until[set] {
                half.photons.turn(&mut prepared, half.seed, turns, progress)?;
                turns += 1;
                let sequence = Sequence { seed: hash(&[TRUTH, half.seed, set as u32]), place: half.rounds[set] };
                let pass = Pass { seed: hash(&[TRUTH, half.seed, set as u32, half.rounds[set]]), sequence };
                let mut found = Vec::new();
                for some in pixels[set].parts(AT_A_TIME) {
                    let spent = |time: f64| begin.elapsed().as_secs_f64() > shares[set] * time;
                    if !found.is_empty() && matches!(goal, Goal::Time(time) if spent(time)) {
                        break;
                    }
                    let pixels = prepared.pixels(&some, pass, progress)?.pixels;
                    found.extend(pixels.iter().map(|pixel| pixel.beauty.as_dvec3().to_array()));
                }
                half.rounds[set] += 1;
                add(&mut half.means[set], found, half.rounds[set]);
            }
        }
        half.photons.end(prepared, half.seed, turns, progress)
    }
}

/// Takes a round, the `rounds`th, into the means.
fn add(means: &mut Vec<[f64; 3]>, found: Vec<[f64; 3]>, rounds: u32) {
    if rounds == 1 {
        *means = found;
        return;
    }
    for (mean, new) in means.as_flattened_mut().iter_mut().zip(found.as_flattened()) {
        *mean += (new - *mean) / f64::from(rounds);
    }
}

/// The references of a set: of the pixels that both halves have.
fn truths(drawn: &[Drawn], [a, b]: &[Half; 2], set: usize) -> Vec<Truth> {
    let both = drawn.iter().zip(a.means[set].iter().zip(&b.means[set]));
    both.map(|(drawn, (a, b))| Truth { at: drawn.at, weight: drawn.weight, halves: [*a, *b] }).collect()
}
