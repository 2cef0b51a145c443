//! Points that fill a square evenly: Sobol's first two dimensions with Owen's scrambling.
//!
//! Any number of leading points is evenly spread, each is uniform by itself (so a mean over them is unbiased), and smooth integrands converge
//! faster than with jittered strata. The scrambling is done by a hash that lets each bit depend on the higher ones only (Laine and Karras,
//! "Stratified Sampling for Stochastic Transparency", 2011; Burley, "Practical Hash-based Owen Scrambling", 2020).

use crate::hash::to_unit;

/// Point `index` of the sequence that two random seeds name, in [0, 1)².
#[inline]
pub fn point(index: u32, seeds: [u32; 2]) -> [f32; 2] {
    // Scrambling works on reversed bits: of the first dimension (the radical inverse) those are the index itself.
    [scrambled(index, seeds[0]), scrambled(second(index), seeds[1])].map(to_unit)
}

/// The second dimension, its bits reversed: the columns of its matrix are the rows of Pascal's triangle modulo 2.
#[inline]
fn second(mut index: u32) -> u32 {
    let (mut column, mut bits) = (1_u32, 0);
    while index != 0 {
        if index & 1 != 0 {
            bits ^= column;
        }
        column ^= column << 1;
        index >>= 1;
    }
    bits
}

/// A permutation in which bit k of the result (counted from the top) depends on bits 0 to k of the reversed input only.
#[inline]
fn scrambled(reversed: u32, seed: u32) -> u32 {
    let mut bits = reversed.wrapping_add(seed);
    // Products by even numbers carry upwards only.
    for factor in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6_u32] {
        bits ^= bits.wrapping_mul(factor);
    }
    bits.reverse_bits()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::hash;

    #[test]
    fn each_elementary_interval_holds_one_of_2_to_the_n_points() {
        for seed in 0..50 {
            let seeds = [hash(&[seed, 0]), hash(&[seed, 1])];
            for log_columns in 0..=6_u32 {
                let (columns, rows) = (1_u32 << log_columns, 1_u32 << (6 - log_columns));
                let mut count = [0; 64];
                for index in 0..64 {
                    let [x, y] = point(index, seeds);
                    count[((x * columns as f32) as u32 * rows + (y * rows as f32) as u32) as usize] += 1;
                }
                assert_eq!(count, [1; 64], "seed {seed}, {columns} x {rows}");
            }
        }
    }

    #[test]
    fn each_point_is_uniform_over_the_seeds() {
        const SEEDS: u32 = 20_000;
        for index in [0, 1, 2, 5, 11] {
            let mut count = [0_u32; 64];
            for seed in 0..SEEDS {
                let [x, y] = point(index, [hash(&[seed, 0]), hash(&[seed, 1])]);
                assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y));
                count[(x * 8.0) as usize * 8 + (y * 8.0) as usize] += 1;
            }
            let expected = f64::from(SEEDS) / 64.0;
            let chi2: f64 = count.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
            // 63 degrees of freedom: mean 63, deviation 11.2.
            assert!(chi2 < 63.0 + 5.0 * 11.2, "point {index}: χ² {chi2}");
        }
    }
}
