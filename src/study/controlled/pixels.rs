//! Pixels at which an error is looked at.
//!
//! The error of a picture is a sum of squares, and a few pixels may hold nearly all of it: bright ones (the ceiling above a lamp), and noisy ones (hair in the
//! light of a lamp that is seen in few of its layers). Pixels drawn evenly would miss them and claim a fraction of the error. So pixels are drawn with a chance
//! that grows with the square of their light and, once there is a picture, with its variance, and evenly for the rest. Each counts for as many as it
//! stands for, and the mean is that over all pixels, whatever the chances.
//!
//! Those that choose settings are drawn from a coarse look at the picture; those that judge it from the finished picture.

use glam::Vec3;

use super::Job;
use crate::fragment::{self, PixelRect};
use crate::hash::{hash, unit};
use crate::render::{Mean, Pass, Pixel, RenderError};

/// Purposes of random numbers.
const LOOK: u32 = 0x4C4F_4F4B;
const DRAW: u32 = 0x4452_5043;
const ORDER: u32 = 0x4F52_4452;

/// Pixels that judge, at the most: a small part of the pixels may hold most of the bias, and few that judge miss it unawares.
const JUDGING: usize = 256;
/// One pixel in so many judges where the picture is small, but no fewer than choose.
const JUDGED: usize = 12;
/// Pixels that are looked at, at the most.
const LOOKED_AT: usize = 12_288;

/// What pixels are drawn for; a set's number among random numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    Choosing,
    Judging,
}

impl Purpose {
    /// Pixels that choose settings.
    pub const CHOOSING: usize = 96;

    /// What a render is doing with them, for its progress.
    pub fn stage(self) -> &'static str {
        match self {
            Self::Choosing => "calibrating",
            Self::Judging => "judging",
        }
    }
}

/// A pixel in which something is seen.
#[derive(Clone, Copy, Debug)]
struct Seen {
    at: [u32; 2],
    /// Mean over the channels.
    light: f64,
    /// Of the light, as far as it is known.
    variance: f64,
}

/// Pixels in which something is seen.
pub(super) struct Looked {
    seen: Vec<Seen>,
    /// Mean of the light.
    pub level: f64,
}

/// A pixel that was drawn, and how much it counts in a mean over those drawn: 1 on average.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    pub at: [u32; 2],
    pub weight: f64,
}

impl Job<'_> {
    /// Looks at the picture, or at pixels all over it.
    pub(super) fn look(&mut self) -> Result<Looked, RenderError> {
        let (seed, progress) = (self.given.sampling.seed, self.progress);
        let photons = self.streams.first();
        let prepared = self.prepare(0, seed, photons)?;
        let window = prepared.window();
        // One in each of as many runs of pixels, all of them in a small picture.
        let all = window.pixels() as usize;
        let count = all.min(LOOKED_AT);
        let number = |n: usize| {
            let place = (n as f64 + unit(&[LOOK, seed, n as u32])) * all as f64 / count as f64;
            if all == count { n } else { (place as usize).min(all - 1) }
        };
        let some: Vec<[u32; 2]> = (0..count).map(|n| window.at(number(n))).collect();
        progress.stage("looking for pixels", count as u64);
        let looked = prepared.pixels(&prepared.select(&some), Pass::alone(hash(&[LOOK, seed])), progress)?;
        let photons = prepared.into_photons();
        self.streams.put_first(photons);
        let seen = some.into_iter().zip(looked.pixels).filter(|(_, pixel)| pixel.alpha > 0.0);
        let place = |(at, pixel): ([u32; 2], Pixel)| Seen { at, light: light(pixel.beauty), variance: 0.0 };
        Ok(Looked::new(seen.map(place).collect()))
    }
}

impl Looked {
    /// At a picture over this window; a single pass tells no variance.
    pub fn at(picture: &Mean, window: &PixelRect) -> Self {
        let place = |pixel| Seen {
            at: window.at(pixel),
            light: light(picture.beauty(pixel)),
            variance: picture.noise_of(pixel),
        };
        Self::new(picture.seen().map(place).collect())
    }

    /// Pixels whose light and variance are none where they are no numbers.
    fn new(mut seen: Vec<Seen>) -> Self {
        for Seen { light, variance, .. } in &mut seen {
            for value in [light, variance] {
                *value = if value.is_finite() { *value } else { 0.0 };
            }
        }
        let level = seen.iter().map(|place| place.light).sum::<f64>() / seen.len().max(1) as f64;
        Self { seen, level: level.max(1e-30) }
    }

    /// A set of pixels, so many at the most and none twice in it. They come in any order, so that the first of them stand for all where time is short.
    pub fn draw(&self, seed: u32, purpose: Purpose, most: usize) -> Vec<Drawn> {
        let count = match purpose {
            Purpose::Choosing => Purpose::CHOOSING,
            Purpose::Judging => (self.seen.len() / JUDGED).clamp(Purpose::CHOOSING, JUDGING),
        };
        let count = count.min(most);
        let (sizes, set) = (self.sizes(), purpose as u32);
        let n = self.seen.len().max(1) as f64;
        let mut drawn = Vec::new();
        let random = unit(&[DRAW, seed, set]);
        fragment::draw(
            self.seen.len(),
            |index| sizes[index],
            count,
            random,
            |index, stands_for| {
                drawn.push(Drawn { at: self.seen[index].at, weight: stands_for / sizes[index] / n });
            },
        );
        // So far weights add up to 1 in the mean.
        let count = drawn.len() as f64;
        drawn.iter_mut().for_each(|drawn| drawn.weight *= count);
        drawn.sort_by_key(|&Drawn { at: [x, y], .. }| hash(&[ORDER, seed, set, x, y]));
        drawn
    }

    /// Chances of the pixels, 1 in the mean: as much of it for each of what is known of them, and evenly.
    fn sizes(&self) -> Vec<f64> {
        let n = self.seen.len().max(1) as f64;
        let known = [|place: &Seen| place.light.powi(2), |place: &Seen| place.variance];
        let means = known.map(|known| self.seen.iter().map(known).sum::<f64>() / n);
        let kinds = 1.0 + means.iter().filter(|&&mean| mean > 0.0).count() as f64;
        let share =
            |place: &Seen, (known, mean): (fn(&Seen) -> f64, f64)| if mean > 0.0 { known(place) / mean } else { 0.0 };
        let size = |place| (1.0 + known.into_iter().zip(means).map(|known| share(place, known)).sum::<f64>()) / kinds;
        self.seen.iter().map(size).collect()
    }
}

/// Mean over the channels.
pub(super) fn light(beauty: Vec3) -> f64 {
    beauty.as_dvec3().element_sum() / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nothing is known of its noise.
    fn place(at: [u32; 2], light: f64) -> Seen {
        Seen { at, light, variance: 0.0 }
    }

    /// Draws of a thousand pixels, three of which are always among them; the mean of `square` over all is met within 1 %, that of the weights within 2 %.
    fn check(place: impl Fn(u32) -> Seen, square: impl Fn(&Seen) -> f64) {
        let seen: Vec<Seen> = (0..1000).map(&place).collect();
        let truth = seen.iter().map(&square).sum::<f64>() / 1000.0;
        let looked = Looked::new(seen);
        let (mut sum, mut weights, draws) = (0.0, 0.0, 400);
        for seed in 0..draws {
            let drawn = looked.draw(seed, Purpose::Choosing, usize::MAX);
            assert_eq!(drawn.len(), Purpose::CHOOSING);
            assert!([7, 407, 807].iter().all(|&i| drawn.iter().any(|drawn| drawn.at == [i, 0])));
            let square = |drawn: &Drawn| drawn.weight * square(&place(drawn.at[0]));
            sum += drawn.iter().map(square).sum::<f64>() / drawn.len() as f64;
            weights += drawn.iter().map(|drawn| drawn.weight).sum::<f64>() / drawn.len() as f64;
        }
        assert!((sum / f64::from(draws) / truth - 1.0).abs() < 0.01);
        assert!((weights / f64::from(draws) - 1.0).abs() < 0.02);
    }

    #[test]
    fn bright_pixels_are_not_missed_and_the_mean_is_right() {
        // Three of them are a hundred times as bright and in error by a tenth of their light, as all are.
        let light = |i: u32| if i % 400 == 7 { 100.0 } else { 1.0 };
        check(|i| place([i, 0], light(i)), |place| (0.1 * place.light).powi(2));
    }

    #[test]
    fn noisy_pixels_are_not_missed_and_the_mean_is_right() {
        let variance = |i: u32| if i % 400 == 7 { 100.0 } else { 1e-3 };
        check(|i| Seen { variance: variance(i), ..place([i, 0], 1.0) }, |place| place.variance);
    }

    #[test]
    fn the_first_pixels_stand_for_all() {
        let looked = Looked::new((0..64 * 64).map(|i| place([i % 64, i / 64], 1.0)).collect());
        let mut below = 0;
        for seed in 0..100 {
            let [choosing, judging] =
                [Purpose::Choosing, Purpose::Judging].map(|purpose| looked.draw(seed, purpose, usize::MAX));
            assert_eq!([choosing.len(), judging.len()], [Purpose::CHOOSING, JUDGING]);
            below += judging[..16].iter().filter(|drawn| drawn.at[1] >= 32).count();
        }
        // 1,600 draws of a half: 800 with a deviation of less than 20.
        assert!((700..900).contains(&below), "{below}");
        // A small picture is judged by as many as choose.
        let judges = |looked: Looked| looked.draw(1, Purpose::Judging, usize::MAX).len();
        assert_eq!(judges(Looked::new((0..400).map(|i| place([i, 0], 1.0)).collect())), Purpose::CHOOSING);
        assert_eq!(judges(Looked::new(vec![place([3, 4], 1.0)])), 1);
    }
}
