//! References of pixels, in two halves that share nothing random: not even photons.

use std::time::Instant;

use super::pixels::{Drawn, Purpose};
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

/// Share of a time for the references of each set.
const FOR_TRUTH: f64 = 0.1;
/// Pixels that are looked at before the clock is.
const AT_A_TIME: usize = 16;

/// A set of pixels with its references.
pub(super) struct Judges {
    pub pixels: Selection,
    pub truths: Vec<Truth>,
}

/// One half of all references, which shares nothing random with the other.
#[derive(Debug, Default)]
pub(super) struct Half {
    seed: u32,
    photons: Streams,
    /// Seconds that it takes to make the scene ready, without its photons.
    preparing: f64,
}

/// Pixels whose references are made.
struct Set<'a> {
    drawn: &'a [Drawn],
    purpose: Purpose,
    /// Once the scene was made ready.
    pixels: Option<Selection>,
}

/// Rounds of a half over a set of pixels, each a pass.
#[derive(Debug, Default)]
struct Rounds {
    done: u32,
    /// Means over them in the order of the pixels; fewer where time was short.
    means: Vec<[f64; 3]>,
}

impl Half {
    /// Both halves of a picture's references.
    pub fn both(seed: u32, goal: Goal) -> [Self; 2] {
        [0, 1].map(|half| Self {
            seed: hash(&[TRUTH, seed, half]),
            photons: Streams::new(goal.error()),
            preparing: 0.0,
        })
    }
}

impl Job<'_> {
    /// References of a set of pixels in rounds, as many as make their noise small against the error asked for.
    pub(super) fn references(&mut self, drawn: &[Drawn], purpose: Purpose, level: f64) -> Result<Judges, RenderError> {
        let mut halves = std::mem::take(&mut self.halves);
        let mut rounds = [Rounds::default(), Rounds::default()];
        let mut set = Set { drawn, purpose, pixels: None };
        let seconds = self.goal.time().map(|time| 0.5 * FOR_TRUTH * time);
        let mut until = 1;
        loop {
            for (half, rounds) in halves.iter_mut().zip(&mut rounds) {
                self.rounds(half, rounds, &mut set, until, seconds)?;
            }
            let Goal::Error(error) = self.goal else { break };
            let truths = truths(drawn, &rounds);
            let variance = truths.iter().map(|truth| truth.weight * truth.variance()).sum::<f64>();
            let enough = (NOISE * error * level).powi(2) * truths.len().max(1) as f64;
            // The variance of a mean of as many more rounds falls as many times, or faster, but for that of photons: not all of them at once.
            let wanted = (f64::from(until) * variance / enough).ceil() as u32;
            let next = wanted.clamp(until, (STEP * until).min(MOST_ROUNDS));
            if next == until {
                break;
            }
            until = next;
        }
        self.halves = halves;
        let mut pixels = set.pixels.unwrap_or_default();
        let truths = truths(drawn, &rounds);
        pixels.truncate(truths.len());
        Ok(Judges { pixels, truths })
    }

    /// Seconds that are kept for the references of those that judge.
    pub(super) fn kept(&self, time: f64) -> f64 {
        FOR_TRUTH * time + self.halves.iter().map(|half| half.preparing).sum::<f64>()
    }

    /// Adds rounds to a half until there are so many. Where only so many seconds are given for it, pixels as long as they last.
    fn rounds(
        &mut self,
        half: &mut Half,
        rounds: &mut Rounds,
        set: &mut Set<'_>,
        until: u32,
        seconds: Option<f64>,
    ) -> Result<(), RenderError> {
        let progress = self.progress;
        let begin = Instant::now();
        let mut prepared = self.prepare(KNOB.len(), half.seed, half.photons.first())?;
        // Photons are traced once.
        half.preparing = begin.elapsed().as_secs_f64() - prepared.statistics().seconds_of("tracing photons");
        let begin = Instant::now();
        let places = || set.drawn.iter().map(|drawn| drawn.at).collect::<Vec<_>>();
        let pixels = set.pixels.get_or_insert_with(|| prepared.select(&places()));
        progress.stage(set.purpose.stage(), u64::from(until - rounds.done) * pixels.len() as u64);
        let mut turns = 0;
        while rounds.done < until {
            half.photons.turn(&mut prepared, half.seed, turns, progress)?;
            turns += 1;
            let stream = hash(&[TRUTH, half.seed, set.purpose as u32]);
            let sequence = Sequence { seed: stream, place: rounds.done };
            let pass = Pass { seed: hash(&[stream, rounds.done]), sequence };
            let mut found = Vec::new();
            for some in pixels.parts(AT_A_TIME) {
                if !found.is_empty() && seconds.is_some_and(|seconds| begin.elapsed().as_secs_f64() > seconds) {
                    break;
                }
                let pixels = prepared.pixels(&some, pass, progress)?.pixels;
                found.extend(pixels.iter().map(|pixel| pixel.beauty.as_dvec3().to_array()));
            }
            rounds.add(found);
        }
        half.photons.end(prepared, half.seed, turns, progress)
    }
}

impl Rounds {
    /// Takes another round into the means.
    fn add(&mut self, found: Vec<[f64; 3]>) {
        self.done += 1;
        if self.done == 1 {
            self.means = found;
            return;
        }
        for (mean, new) in self.means.as_flattened_mut().iter_mut().zip(found.as_flattened()) {
            *mean += (new - *mean) / f64::from(self.done);
        }
    }
}

/// The references of a set: of the pixels that both halves have.
fn truths(drawn: &[Drawn], [a, b]: &[Rounds; 2]) -> Vec<Truth> {
    let both = drawn.iter().zip(a.means.iter().zip(&b.means));
    both.map(|(drawn, (a, b))| Truth { at: drawn.at, weight: drawn.weight, halves: [*a, *b] }).collect()
}
