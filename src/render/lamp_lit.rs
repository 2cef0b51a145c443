//! Which of a pixel's surface samples are lit where passes are to add up to the pixel's mean.
//!
//! Light from a lamp near a surface changes a hundredfold within a pixel: one sample stands badly for all of them. What lamps would send if nothing were in
//! the way costs no ray and is known at every sample, so its mean u over the samples is, too; only what is in the way is looked up at one sample, drawn with
//! a chance in proportion to u_i. That sample's light times mean(u) / u_i has the pixel's mean, and no noise but that of the shadow's edge.

use crate::fragment::{NO_SURFACE, SurfaceSample};
use crate::hash::hash64;
use crate::sequence::Sequence;
use crate::surface::SurfacePoint;

/// Purpose of random numbers.
const SAMPLE: u32 = 0x534D_504C;

/// From this variance of u, as a share of its squared mean, on a pixel has more samples: with n strata of a smooth function the error of the mean is
/// about .4 of the change across the pixel over n.
const UNEVEN: f32 = 0.04;

/// Where lamps light a group of samples, and how much that counts.
#[derive(Clone, Copy, Debug)]
pub struct LampLit {
    pub at: SurfacePoint,
    pub counts: f32,
}

/// What lamps would send to the samples of a pixel that meet a surface, in their order.
#[derive(Default)]
pub(super) struct FromLamps(Vec<f32>);

impl FromLamps {
    /// Looks at the samples that met something.
    pub fn find(&mut self, met: &[SurfacePoint], light: impl Fn(&SurfacePoint) -> f32) {
        self.0.clear();
        self.0.extend(met.iter().map(light));
    }

    /// Whether the light differs much within one of `groups` groups.
    pub fn uneven(&self, samples: &[SurfaceSample], groups: usize) -> bool {
        (0..groups).any(|group| {
            let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
            for u in of_group(samples, group).map(|sample| self.0[sample]) {
                (sum, squares, count) = (sum + u, squares + u * u, count + 1.0);
            }
            count * squares - sum * sum > UNEVEN * sum * sum
        })
    }

    /// The numbers, among the samples that met something, of the sample of a group that is lit by all else, and of the one that lamps light with what it
    /// counts; none of the latter where no lamp shines. The random numbers are a sequence's in a pixel.
    pub fn draw(
        &self,
        samples: &[SurfaceSample],
        group: usize,
        sequence: Sequence,
        [x, y]: [u32; 2],
    ) -> (usize, Option<(usize, f32)>) {
        let number = |axis| sequence.number(hash64(&[SAMPLE, sequence.seed, x, y, group as u32, axis]));
        let all = of_group(samples, group).count();
        let place = ((number(0) * all as f64) as usize).min(all.saturating_sub(1));
        let gathers = of_group(samples, group).nth(place).unwrap_or(0);
        let total: f64 = of_group(samples, group).map(|sample| f64::from(self.0[sample])).sum();
        if !total.is_finite() || total <= 0.0 {
            return (gathers, None);
        }
        let mut left = number(1) * total;
        let mut lit = None;
        for sample in of_group(samples, group).filter(|&sample| self.0[sample] > 0.0) {
            lit = Some((sample, (total / all as f64 / f64::from(self.0[sample])) as f32));
            left -= f64::from(self.0[sample]);
            if left < 0.0 {
                break;
            }
        }
        (gathers, lit)
    }
}

/// The numbers of a group's samples, among those that met something.
fn of_group(samples: &[SurfaceSample], group: usize) -> impl Iterator<Item = usize> + '_ {
    let met = samples.iter().filter(|sample| sample.group != NO_SURFACE).enumerate();
    met.filter(move |(_, sample)| sample.group as usize == group).map(|(number, _)| number)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(group: u32) -> SurfaceSample {
        SurfaceSample { depth: 1.0, group }
    }

    #[test]
    fn what_is_drawn_has_the_mean_of_all() {
        // Light u and visibility v of five samples of group 1, between others.
        let samples =
            [sample(1), SurfaceSample::EMPTY, sample(0), sample(1), sample(1), sample(0), sample(1), sample(1)];
        let lamps = FromLamps(vec![1.0, 7.0, 100.0, 0.0, 9.0, 5.0, 0.5]);
        let seen = [1.0, 1.0, 0.25, 1.0, 1.0, 0.5, 1.0];
        let truth = (1.0 + 100.0 * 0.25 + 0.0 + 5.0 * 0.5 + 0.5) / 5.0;
        let (mut sum, mut gathered) = (0.0, [0; 7]);
        let draws = 40_000;
        for seed in 0..draws {
            let (gathers, lit) = lamps.draw(&samples, 1, Sequence::start(seed), [3, 4]);
            gathered[gathers] += 1;
            let (at, counts) = lit.unwrap();
            sum += f64::from(lamps.0[at] * counts) * seen[at];
        }
        // Of one draw the deviation is below .25 of the light without shadows, 21.3.
        assert!((sum / f64::from(draws) - truth).abs() < 4.0 * 0.25 * 21.3 / f64::from(draws).sqrt(), "{sum} {truth}");
        assert_eq!([gathered[1], gathered[4]], [0, 0], "these are of another group");
        assert!([0, 2, 3, 5, 6].iter().all(|&n| (f64::from(gathered[n]) / f64::from(draws) - 0.2).abs() < 0.01));
    }

    #[test]
    fn dark_and_even_groups_are_told_apart() {
        let samples = [sample(0); 4];
        let dark = FromLamps(vec![0.0; 4]);
        assert!(dark.draw(&samples, 0, Sequence::start(1), [2, 3]).1.is_none() && !dark.uneven(&samples, 1));
        assert!(!FromLamps(vec![1.0, 1.1, 0.9, 1.0]).uneven(&samples, 1));
        assert!(FromLamps(vec![1.0, 2.0, 0.5, 1.0]).uneven(&samples, 1));
        let endless = FromLamps(vec![f32::INFINITY; 4]);
        assert!(endless.draw(&samples, 0, Sequence::start(1), [2, 3]).1.is_none());
    }
}
