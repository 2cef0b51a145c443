//! More passes of a finished picture at the pixels that judge it.
//!
//! The noise of a picture is known all over it, from its streams; what is left for the few pixels that judge is its bias, which they tell badly beside noise
//! that is larger. Passes of the same settings and photons at those pixels alone take nearly nothing in a picture of many, leave the bias as it is and
//! take the noise away.

use super::pixels::{Drawn, Purpose};
use super::settings::work;
use super::streams::Streams;
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
pub struct Further<'a> {
    pub drawn: &'a [Drawn],
    /// The error asked for; none of the passes that a time leaves room for.
    pub error: Option<f64>,
    /// Mean of the picture.
    pub level: f64,
    /// Of random numbers, the picture's.
    pub seed: u32,
    /// Of a pass over the whole picture.
    pub work: f64,
}

impl Further<'_> {
    /// The mean of a picture's passes and of more at the pixels that judge it, in their order. Of the picture's alone where it has but one, which does not tell
    /// its noise.
    pub fn passes(
        &self,
        picture: &Mean,
        prepared: &mut Prepared<'_>,
        streams: &mut Streams,
        progress: &dyn Progress,
    ) -> Result<Mean, RenderError> {
        let window = prepared.window();
        let at: Vec<[u32; 2]> = self.drawn.iter().map(|drawn| drawn.at).collect();
        let (mut mean, passes) =
            (picture.at(&at.iter().map(|&at| window.index(at)).collect::<Vec<_>>()), picture.passes());
        let Some(error) = self.error.filter(|_| passes > 1) else { return Ok(mean) };
        let pixels = prepared.select(&at);
        progress.stage(Purpose::Judging.stage(), 0);
        let most = SHARE * self.work * f64::from(passes);
        let (mut done, mut until) = (0.0, passes);
        while self.noise(&mean) > (NOISE * error).powi(2) && done < most && until < MOST * passes {
            until = (until + (STEP * f64::from(until)).ceil() as u32).min(MOST * passes);
            while mean.passes() < until && done < most {
                streams.turn(prepared, self.seed, mean.passes(), progress)?;
                let found = prepared.pixels(&pixels, Pass::of(self.seed, mean.passes()), progress)?;
                done += work(prepared, &found);
                mean.add_pixels(&found.pixels);
            }
        }
        Ok(mean)
    }

    /// Mean variance at the pixels, as a share of the squared level.
    fn noise(&self, mean: &Mean) -> f64 {
        let of = |(index, drawn): (usize, &Drawn)| drawn.weight * mean.noise_of(index);
        self.drawn.iter().enumerate().map(of).sum::<f64>() / (self.drawn.len().max(1) as f64 * self.level.powi(2))
    }
}
