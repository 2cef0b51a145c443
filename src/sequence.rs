//! Random numbers that passes spread evenly together.
//!
//! With numbers of its own in each pass the error of a mean falls with the root of their count. Here a number begins at the hash of its key and goes on by one
//! step a pass, around a circle: by the fraction of the golden ratio, or a pair by the first two powers of the inverse plastic number (Roberts 2018, "R2"),
//! so that n passes fill the circle, or the square, in steps of about 1/n. In each pass alone the number is as uniform and as independent of others as its
//! hash is, so no pass is biased.

use crate::hash::{GOLDEN, to_unit, to_unit64};

/// 1 / p and 1 / p² for the real root p of p³ = p + 1, times 2^32.
const PLASTIC: [u32; 2] = [0xc13f_a9a9, 0x91e1_0da5];

/// Which numbers, and how many steps have been done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sequence {
    /// Part of the keys of all its numbers.
    pub seed: u32,
    pub place: u32,
}

impl Sequence {
    /// The first of a sequence.
    pub fn start(seed: u32) -> Self {
        Self { seed, place: 0 }
    }

    /// The number in [0, 1) that began at the hash of a key.
    #[inline]
    pub fn number(self, hash: u64) -> f64 {
        to_unit64(hash.wrapping_add(GOLDEN.wrapping_mul(u64::from(self.place))))
    }

    /// The pair in [0, 1)² that began at the hashes of two keys.
    #[inline]
    pub fn pair(self, hashes: [u32; 2]) -> [f32; 2] {
        [0, 1].map(|axis| to_unit(hashes[axis].wrapping_add(PLASTIC[axis].wrapping_mul(self.place))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::{hash, hash64};

    fn places(count: u32) -> impl Iterator<Item = Sequence> {
        (0..count).map(|place| Sequence { seed: 0, place })
    }

    #[test]
    fn steps_are_the_roots_that_they_should_be() {
        let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
        assert!((to_unit64(GOLDEN) - golden).abs() < 1e-15);
        let [a, b] = PLASTIC.map(|step| f64::from(step) / 4_294_967_296.0);
        let p = 1.0 / a;
        assert!((p.powi(3) - p - 1.0).abs() < 1e-8 && (b - a * a).abs() < 1e-9);
    }

    #[test]
    fn n_numbers_leave_no_gap_wider_than_three_nths() {
        for key in 0..50 {
            for count in [2, 3, 7, 16, 100, 1000] {
                let mut numbers: Vec<f64> = places(count).map(|s| s.number(hash64(&[key]))).collect();
                numbers.sort_by(f64::total_cmp);
                let around = numbers[0] + 1.0 - numbers[numbers.len() - 1];
                let widest = numbers.windows(2).map(|w| w[1] - w[0]).fold(around, f64::max);
                assert!(widest < 3.0 / f64::from(count), "{count} numbers: {widest}");
            }
        }
    }

    #[test]
    fn means_over_pairs_converge_faster_than_independent_ones() {
        // x y over the square has the mean 1/4 and the deviation .22: 256 independent pairs miss by .0138 in the mean square.
        let error = |key: u32| {
            let product =
                |s: Sequence| s.pair([hash(&[key, 0]), hash(&[key, 1])]).map(f64::from).iter().product::<f64>();
            places(256).map(product).sum::<f64>() / 256.0 - 0.25
        };
        let square = (0..200).map(|key| error(key).powi(2)).sum::<f64>() / 200.0;
        assert!(square.sqrt() < 0.0138 / 4.0, "{}", square.sqrt());
    }

    #[test]
    fn one_place_alone_is_uniform() {
        let bins = (0..20_000).fold([0_u32; 16], |mut bins, key| {
            let [x, y] = Sequence { seed: 0, place: 12_345 }.pair([hash(&[key, 0]), hash(&[key, 1])]);
            bins[(x * 4.0) as usize * 4 + (y * 4.0) as usize] += 1;
            bins
        });
        let chi2: f64 = bins.iter().map(|&n| (f64::from(n) - 1250.0).powi(2) / 1250.0).sum();
        // 15 degrees of freedom: above 37.7 once in a thousand.
        assert!(chi2 < 37.7, "{chi2}");
    }
}
