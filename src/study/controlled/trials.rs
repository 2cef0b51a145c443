//! What passes of settings are worth, and which settings are chosen.

use std::time::Instant;

use super::references::Judges;
use super::settings::work;
use super::worth::{AIM, MOST_PASSES, Trial, Worth, least, total};
use super::{Goal, Job, KNOB};
use crate::hash::hash;
use crate::render::{Pass, RenderError};

/// Purpose of random numbers.
const TRIAL: u32 = 0x5452_4941;

/// Runs of a trial are enough where its bias is known to this share of the square aimed at, or where there are so many and they have taken more than this
/// share of the work of the best settings so far.
const DOUBT: f64 = 0.25;
const RUNS: usize = 12;
const SHARE: f64 = 0.05;
/// Runs at the most.
const MOST_RUNS: usize = 400;

/// The coarsest place of the knob that is tried first, by the error asked for: below each of these errors the next one.
const FIRST: [f64; 3] = [0.1, 0.04, 0.015];

/// Settings that reach the error with fewer passes are not held against finer ones: a pass of those takes more than all of these.
const FEW: u32 = 3;

/// Share of a time for all that comes before the picture.
const FOR_TRIALS: f64 = 0.25;

impl Job<'_> {
    /// What a pass is worth at places of the knob, as far as it can pay.
    pub(super) fn trials(&mut self, judges: &Judges, level: f64) -> Result<Vec<Trial>, RenderError> {
        match self.goal {
            Goal::Error(error) => self.trials_to_an_error(judges, level, error),
            Goal::Time(time) => self.trials_in_a_time(judges, level, time),
        }
    }

    /// From a guess to finer places as long as that makes the error less work or possible at all, else to coarser ones as long as that is less work.
    fn trials_to_an_error(&mut self, judges: &Judges, level: f64, error: f64) -> Result<Vec<Trial>, RenderError> {
        let square = (AIM * error).powi(2);
        let first = FIRST.iter().filter(|&&bound| error < bound).count();
        let mut trials: Vec<Trial> = Vec::new();
        for place in first..=KNOB.len() {
            let before = total(&trials, error);
            let trial = self.trial(place, judges, level, before)?;
            trials.push(trial);
            let few = trial.passes(square).is_some_and(|passes| passes < FEW);
            if few || (before.is_finite() && total(&trials, error) >= before) {
                break;
            }
        }
        for place in (0..first).rev() {
            let before = total(&trials, error);
            if before.is_infinite() {
                break;
            }
            // What finer places made less work, or possible, coarser ones do not.
            if least(&trials, |trial| total(&[*trial], error)).place > place + 1 {
                break;
            }
            trials.push(self.trial(place, judges, level, before)?);
            if total(&trials, error) >= before {
                break;
            }
        }
        Ok(trials)
    }

    /// From the coarsest place on, as long as there is time.
    fn trials_in_a_time(&mut self, judges: &Judges, level: f64, time: f64) -> Result<Vec<Trial>, RenderError> {
        let mut trials: Vec<Trial> = Vec::new();
        for place in 0..=KNOB.len() {
            if self.elapsed() > FOR_TRIALS * time && !trials.is_empty() {
                break;
            }
            let left = self.left(time);
            let trial = self.trial(place, judges, level, 0.0)?;
            trials.push(trial);
            if trial.work > left {
                break;
            }
        }
        Ok(trials)
    }

    /// Runs of a place at the pixels of references. `best` is the least work that other places take.
    fn trial(&mut self, place: usize, judges: &Judges, level: f64, best: f64) -> Result<Trial, RenderError> {
        let (seed, progress, goal) = (self.given.sampling.seed, self.progress, self.goal);
        let begin = Instant::now();
        let mut streams = std::mem::take(&mut self.streams);
        let mut prepared = self.prepare(place, seed, streams.first())?;
        let before = begin.elapsed().as_secs_f64();
        progress.stage("trying settings", 0);
        let Judges { pixels, truths } = judges;
        let window = prepared.window();
        let all = f64::from(window.max[0] - window.min[0]) * f64::from(window.max[1] - window.min[1]);
        let begin = Instant::now();
        let (mut runs, mut counted): (Vec<Vec<[f64; 3]>>, f64) = (Vec::new(), 0.0);
        let (worth, scale) = loop {
            streams.turn(&mut prepared, seed, runs.len() as u32, progress)?;
            let pass = Pass::alone(hash(&[TRIAL, seed, runs.len() as u32]));
            let found = prepared.pixels(pixels, pass, progress)?;
            counted += work(&prepared, &found);
            runs.push(found.pixels.iter().map(|pixel| pixel.beauty.as_dvec3().to_array()).collect());
            if runs.len() < 2 * streams.count() {
                continue;
            }
            let worth = Worth::new(truths, &runs, streams.count(), level);
            let scale = all / (truths.len() * runs.len()).max(1) as f64;
            let Goal::Error(error) = goal else { break (worth, scale) };
            let square = (AIM * error).powi(2);
            // The work of these settings alone, had they no bias, if nothing else is known.
            let needed = best.min(scale * counted * (worth.noise / square).max(1.0));
            let enough = runs.len() >= RUNS && counted > SHARE * needed;
            if worth.doubt < DOUBT * square || enough || runs.len() >= MOST_RUNS {
                break (worth, scale);
            }
        };
        let work = match goal {
            Goal::Error(_) => scale * counted,
            Goal::Time(_) => scale * begin.elapsed().as_secs_f64(),
        };
        streams.end(prepared, seed, runs.len() as u32, progress)?;
        self.streams = streams;
        Ok(Trial { place, worth, work, before })
    }

    /// The settings that take least work for the error, or leave the least error for the time; and how many passes.
    pub(super) fn choose(&self, trials: &[Trial]) -> (Trial, u32) {
        let left = match self.goal {
            Goal::Error(error) => {
                let square = (AIM * error).powi(2);
                let best = trials
                    .iter()
                    .filter_map(|trial| Some((trial, trial.passes(square)?)))
                    .min_by(|a, b| (a.0.work * f64::from(a.1)).total_cmp(&(b.0.work * f64::from(b.1))));
                // None: what errs least in its bias, in passes that hardly add to it.
                return best.map_or_else(
                    || {
                        let least = *least(trials, |trial| trial.worth.shown());
                        (least, least.passes(square.max(1.1 * least.worth.shown())).unwrap_or(64))
                    },
                    |(trial, passes)| (*trial, passes),
                );
            }
            Goal::Time(time) => self.left(time),
        };
        let passes = |trial: &Trial| ((left - trial.before) / trial.work.max(1e-9)).floor();
        let possible: Vec<Trial> = trials.iter().filter(|trial| passes(trial) >= 1.0).copied().collect();
        if possible.is_empty() {
            return (*least(trials, |trial| trial.work), 1);
        }
        let best = *least(&possible, |trial| trial.worth.shown() + trial.worth.noise / passes(trial).max(1.0));
        (best, passes(&best).min(f64::from(MOST_PASSES)) as u32)
    }
}
