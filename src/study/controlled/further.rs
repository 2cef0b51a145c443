//! More passes of a finished picture at the pixels that judge it.
//!
//! The noise of a picture is known all over it, from its streams; what is left for the few pixels that judge is its bias, which they tell badly beside noise
//! that is larger. Passes of the same settings and photons at those pixels alone take nearly nothing in a picture of many, leave the bias as it is and
//! take the noise away.

use super::pixels::Purpose;
use super::references::Judges;
use super::settings::work;
use super::streams::Streams;
use super::worth::Truth;
use super::{Job, Picture};
use crate::render::progress::Progress;
use crate::render::{Mean, Pass, Prepared, RenderError};

/// Noise at the pixels that judge, as a share of the error asked for: beside that of their references nothing is seen of it.
const NOISE: f64 = 0.2;
/// Passes are added by this share of those that there are.
const STEP: f64 = 0.5;
/// The work of all of them, as a share of the picture's.
const SHARE: f64 = 0.2;
/// Passes at the most, as a multiple of the picture's.
const MOST: u32 = 32;

/// What more passes are for.
struct Further<'a> {
    pub judges: &'a Judges,
    pub error: f64,
    /// Mean of the picture.
    pub level: f64,
    /// Of a pass over the whole picture.
    pub work: f64,
}

impl Job<'_> {
    /// The mean of a picture's passes and of more at the pixels that judge it, in their order. Of the picture's alone where a time was asked for, and where it has
    /// but one pass, which does not tell its noise.
    pub(super) fn further(&mut self, picture: &Picture, judges: &Judges, level: f64) -> Result<Mean, RenderError> {
        let Picture { trial, window, mean, .. } = picture;
        let places: Vec<usize> = judges.truths.iter().map(|truth| window.index(truth.at)).collect();
        let at = mean.at(&places);
        let Some(error) = self.goal.error().filter(|_| mean.passes() > 1) else { return Ok(at) };
        let further = Further { judges, error, level, work: trial.work };
        if further.enough(&at) {
            return Ok(at);
        }
        let (seed, progress) = (self.given.sampling.seed, self.progress);
        let mut streams = std::mem::take(&mut self.streams);
        let mut prepared = self.prepare(trial.place, seed, streams.first())?;
        further.passes(at, &mut prepared, &mut streams, seed, progress)
    }
}

impl Further<'_> {
    /// Goes on from a mean.
    fn passes(
        &self,
        mut mean: Mean,
        prepared: &mut Prepared<'_>,
        streams: &mut Streams,
        seed: u32,
        progress: &dyn Progress,
    ) -> Result<Mean, RenderError> {
        progress.stage(Purpose::Judging.stage(), 0);
        let passes = mean.passes();
        let most = SHARE * self.work * f64::from(passes);
        let (mut done, mut until) = (0.0, passes);
        while !self.enough(&mean) && done < most && until < MOST * passes {
            until += (STEP * f64::from(until)).ceil() as u32;
            while mean.passes() < until && done < most {
                streams.turn(prepared, seed, mean.passes(), progress)?;
                let found = prepared.pixels(&self.judges.pixels, Pass::of(seed, mean.passes()), progress)?;
                done += work(prepared, &found);
                mean.add_pixels(&found.pixels);
            }
        }
        Ok(mean)
    }

    fn enough(&self, mean: &Mean) -> bool {
        self.noise(mean) <= (NOISE * self.error).powi(2)
    }

    /// Mean variance at the pixels, as a share of the squared level.
    fn noise(&self, mean: &Mean) -> f64 {
        let truths = &self.judges.truths;
        let of = |(index, truth): (usize, &Truth)| truth.weight * mean.variance_of(index).element_sum() / 3.0;
        truths.iter().enumerate().map(of).sum::<f64>() / (truths.len().max(1) as f64 * self.level.powi(2))
    }
}
