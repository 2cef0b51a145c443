//! Pixels at which an error is looked at.
//!
//! The error of a picture is a sum of squares, and a few bright pixels (the ceiling above a lamp) may hold nearly all of it: pixels drawn evenly would miss them
//! and claim a fraction of the error. So the picture is looked at coarsely first, and pixels are drawn with a chance that grows with the square of their
//! light, half of it evenly; each then counts for as many as it stands for, and the mean is that over all pixels, whatever the chances.

use super::Job;
use crate::fragment;
use crate::hash::{hash, unit};
use crate::render::{Pass, RenderError};

/// Purposes of random numbers.
const LOOK: u32 = 0x4C4F_4F4B;
const DRAW: u32 = 0x4452_5043;
const ORDER: u32 = 0x4F52_4452;

/// Pixels that choose settings.
const CHOOSING: usize = 96;
/// Pixels that judge, at the most: a small part of the pixels may hold most of the bias, and few that judge miss it unawares.
const JUDGING: usize = 256;
/// One pixel in so many judges where the picture is small, but no fewer than choose.
const JUDGED: usize = 12;
/// Pixels that are looked at, at the most.
const LOOKED_AT: usize = 12_288;

/// A coarse look at a picture: the pixels in which something is seen, and their light.
pub(super) struct Looked {
    seen: Vec<([u32; 2], f64)>,
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
        let [width, height] = [0, 1].map(|i| (window.max[i] - window.min[i]) as usize);
        // One in each of as many runs of pixels, all of them in a small picture.
        let (all, count) = (width * height, (width * height).min(LOOKED_AT));
        let number = |n: usize| {
            let place = (n as f64 + unit(&[LOOK, seed, n as u32])) * all as f64 / count as f64;
            if all == count { n } else { (place as usize).min(all - 1) }
        };
        let place = |pixel: usize| [window.min[0] + (pixel % width) as u32, window.min[1] + (pixel / width) as u32];
        let some: Vec<[u32; 2]> = (0..count).map(|n| place(number(n))).collect();
        progress.stage("looking for pixels", count as u64);
        let looked = prepared.pixels(&prepared.select(&some), Pass::alone(hash(&[LOOK, seed])), progress)?;
        let photons = prepared.into_photons();
        self.streams.put_first(photons);
        let light = some.into_iter().zip(looked.pixels).filter(|(_, pixel)| pixel.alpha > 0.0);
        Ok(Looked::new(light.map(|(at, pixel)| (at, pixel.beauty.as_dvec3().element_sum() / 3.0)).collect()))
    }
}

impl Looked {
    /// Pixels and their light, which is none where it is no number.
    fn new(mut seen: Vec<([u32; 2], f64)>) -> Self {
        for (_, light) in &mut seen {
            *light = if light.is_finite() { *light } else { 0.0 };
        }
        let level = seen.iter().map(|(_, light)| light).sum::<f64>() / seen.len().max(1) as f64;
        Self { seen, level: level.max(1e-30) }
    }

    /// Pixels that choose settings, and others that judge the picture.
    pub fn sets(&self, seed: u32) -> [Vec<Drawn>; 2] {
        let judging = (self.seen.len() / JUDGED).clamp(CHOOSING, JUDGING);
        [self.draw(seed, 0, CHOOSING), self.draw(seed, 1, judging)]
    }

    /// A set of pixels, none twice in it. They come in any order, so that the first of them stand for all where time is short.
    fn draw(&self, seed: u32, set: u32, count: usize) -> Vec<Drawn> {
        let n = self.seen.len().max(1) as f64;
        let squares = (self.seen.iter().map(|(_, light)| light * light).sum::<f64>() / n).max(1e-60);
        let size = |index: usize| 0.5 + 0.5 * self.seen[index].1.powi(2) / squares;
        let mut drawn = Vec::new();
        let random = unit(&[DRAW, seed, set]);
        fragment::draw(self.seen.len(), size, count, random, |index, stands_for| {
            drawn.push(Drawn { at: self.seen[index].0, weight: stands_for / size(index) / n });
        });
        // So far weights add up to 1 in the mean.
        let count = drawn.len() as f64;
        drawn.iter_mut().for_each(|drawn| drawn.weight *= count);
        drawn.sort_by_key(|&Drawn { at: [x, y], .. }| hash(&[ORDER, seed, set, x, y]));
        drawn
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bright_pixels_are_not_missed_and_the_mean_is_right() {
        // A thousand pixels, three of them a hundred times as bright and in error by a tenth of their light, as all are.
        let light = |i: u32| if i % 400 == 7 { 100.0 } else { 1.0 };
        let looked = Looked::new((0..1000).map(|i| ([i, 0], light(i))).collect());
        let truth = (0..1000).map(|i| (0.1 * light(i)).powi(2)).sum::<f64>() / 1000.0;
        let (mut sum, mut weights, draws) = (0.0, 0.0, 400);
        for seed in 0..draws {
            let drawn = looked.draw(seed, 0, CHOOSING);
            assert_eq!(drawn.len(), CHOOSING);
            assert!([7, 407, 807].iter().all(|&i| drawn.iter().any(|drawn| drawn.at == [i, 0])));
            let square = |drawn: &Drawn| drawn.weight * (0.1 * light(drawn.at[0])).powi(2);
            sum += drawn.iter().map(square).sum::<f64>() / drawn.len() as f64;
            weights += drawn.iter().map(|drawn| drawn.weight).sum::<f64>() / drawn.len() as f64;
        }
        assert!((sum / f64::from(draws) / truth - 1.0).abs() < 0.01);
        assert!((weights / f64::from(draws) - 1.0).abs() < 0.02);
    }

    #[test]
    fn the_first_pixels_stand_for_all() {
        let looked = Looked::new((0..64 * 64).map(|i| ([i % 64, i / 64], 1.0)).collect());
        let mut below = 0;
        for seed in 0..100 {
            let [choosing, judging] = looked.sets(seed);
            assert_eq!([choosing.len(), judging.len()], [CHOOSING, JUDGING]);
            below += judging[..16].iter().filter(|drawn| drawn.at[1] >= 32).count();
        }
        // 1,600 draws of a half: 800 with a deviation of less than 20.
        assert!((700..900).contains(&below), "{below}");
        // A small picture is judged by as many as choose.
        let small = Looked::new((0..400).map(|i| ([i, 0], 1.0)).collect());
        assert_eq!(small.sets(1).map(|set| set.len()), [CHOOSING; 2]);
        assert_eq!(Looked::new(vec![([3, 4], 1.0)]).sets(1).map(|set| set.len()), [1; 2]);
    }
}
