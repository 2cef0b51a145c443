//! Σ F · Γ̄ · Λ̄ over the faces of an igloo (paper, Eq. 5 discretised).

use glam::Vec3;

use crate::hash::{hash, to_unit};
use crate::tally::{self, Work};

/// Purpose of the random numbers that leave out what is worth little.
const WORTH: u32 = 0x574F_5254;

/// A surface that a face's ray met is lit in any case where the face passes on at least this share of what the faces do in the mean, else by a
/// chance in proportion. Higher shares cost more in noise than they save in time (`docs/method.md`).
const WORTH_A_LOOK: f32 = 0.25;

/// Light that arrives at a point, where some of the faces end at surfaces.
#[derive(Debug, Default)]
pub struct Arriving {
    /// Λ̄ of each face.
    pub radiance: Vec<Vec3>,
    /// How much it counts with hair and without, as [`Roulette::counts`]; empty where all of it does.
    pub counts: Vec<[f32; 2]>,
}

/// Russian roulette among the surfaces that faces' rays met: those that are lit count the more, so nothing is lost in the mean.
#[derive(Clone, Copy, Debug)]
pub struct Roulette {
    key: u32,
    /// What a face must pass on of a radiance of 1 to be looked at in any case, with hair and without.
    enough: [f32; 2],
}

impl Roulette {
    /// For the faces of one point; `key` names its random numbers. F of a face times its solid angle is `free(face)`, Γ̄ `gamma`.
    pub fn new(key: u32, free: impl Fn(usize) -> Vec3, gamma: &[f32]) -> Self {
        let mut enough = [0.0; 2];
        for (face, &gamma) in gamma.iter().enumerate() {
            let most = free(face).max_element();
            enough = [enough[0] + most * gamma, enough[1] + most];
        }
        Self { key, enough: enough.map(|all| WORTH_A_LOOK * all / gamma.len() as f32) }
    }

    /// How much the surface of a face counts in the sum with hair and in that without; 0 where it is left out. Neither depends on whether
    /// the other is wanted.
    pub fn counts(&self, face: usize, free: Vec3, gamma: f32) -> [f32; 2] {
        let most = free.max_element();
        let random = to_unit(hash(&[WORTH, self.key, face as u32]));
        let count = |passed_on: f32, enough: f32| {
            // What is no number shall be seen: it is lit.
            let chance = (passed_on / enough).min(1.0);
            if passed_on == 0.0 || random >= chance { 0.0 } else { 1.0 / chance }
        };
        [count(most * gamma, self.enough[0]), count(most, self.enough[1])]
    }
}

/// The sum over the faces, with hair and, where `UNOCCLUDED`, also without.
///
/// F of a face times its solid angle is `free(face)`, Γ̄ `gamma`, Λ̄ `light`, which counts as [`Roulette::counts`] says (empty: once). Compiled for each case: what is off is not asked for at each face.
pub fn sum<const UNOCCLUDED: bool>(
    free: impl Fn(usize) -> Vec3,
    gamma: &[f32],
    light: &[Vec3],
    counts: &[[f32; 2]],
) -> [Vec3; 2] {
    let [mut occluded, mut unoccluded] = [Vec3::ZERO; 2];
    if UNOCCLUDED {
        tally::add(Work::UnoccludedFaces, gamma.len() as u64);
    }
    for (face, (&gamma, &light)) in gamma.iter().zip(light).enumerate() {
        let free = free(face);
        let [with_hair, without] = counts.get(face).copied().unwrap_or([1.0; 2]);
        occluded += free * gamma * light * with_hair;
        if UNOCCLUDED {
            unoccluded += free * light * without;
        }
    }
    [occluded, unoccluded]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_with_hair_does_not_depend_on_the_other() {
        let (gamma, light) = ([0.3, 1e-9, 0.7, 0.0], [Vec3::ONE, Vec3::X, Vec3::Y, Vec3::Z]);
        let free = |face: usize| Vec3::splat(0.1 * (face + 1) as f32);
        for key in 0..100 {
            let roulette = Roulette::new(key, free, &gamma);
            // The faces in the middle end at surfaces.
            let met = |face| roulette.counts(face, free(face), gamma[face]);
            let counts = [[1.0; 2], met(1), met(2), [1.0; 2]];
            assert_eq!(counts[1][0], 0.0, "next to nothing comes through");
            // Alone, the sum has no light of the second face, which is not worth a look.
            let mut alone = light;
            alone[1] = Vec3::ZERO;
            let [occluded, none] = sum::<false>(free, &gamma, &alone, &counts);
            let [same, unoccluded] = sum::<true>(free, &gamma, &light, &counts);
            assert_eq!((occluded, none), (same, Vec3::ZERO));
            assert!((unoccluded - Vec3::new(0.3, 0.4, 0.5)).abs().max_element() < 1e-6, "{unoccluded}");
        }
        let [lit, _] = Roulette::new(0, free, &[f32::NAN; 4]).counts(1, free(1), f32::NAN);
        assert_eq!(lit, 1.0, "what is no number is seen");
    }

    #[test]
    fn roulette_loses_nothing_in_the_mean() {
        // A thousand faces whose Γ̄ falls by orders of magnitude. The mean of the counts of each is 1, with a deviation of √((1/p - 1) / n).
        let gamma: Vec<f32> = (0..1000).map(|face| (-0.03 * face as f32).exp()).collect();
        let free = |face: usize| Vec3::new(0.5, 1.0, 0.1) * (1.0 + (face % 3) as f32);
        let rounds = 4000;
        for face in [0, 10, 150, 180, 220, 250] {
            let mut sum = 0.0;
            let mut chance = 0.0_f64;
            for key in 0..rounds {
                let [count, _] = Roulette::new(key, free, &gamma).counts(face, free(face), gamma[face]);
                sum += f64::from(count);
                chance = if count > 0.0 { 1.0 / f64::from(count) } else { chance };
            }
            let (mean, n) = (sum / f64::from(rounds), f64::from(rounds));
            let deviation = ((1.0 / chance - 1.0) / n).sqrt();
            assert!((mean - 1.0).abs() <= 4.0 * deviation, "face {face}: {mean}, deviation {deviation}");
            assert_eq!(face <= 10, mean == 1.0, "face {face}: only the first are lit in any case");
        }
    }
}
