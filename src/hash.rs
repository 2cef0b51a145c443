//! Random numbers as a hash of what they are for.
//!
//! Nothing random comes from a generator with state: a number is named by its key (a seed, an index, a purpose), so
//! that it does not depend on the order of the work, on the number of threads, or on how many other numbers were
//! drawn. Each word of the key is absorbed into a 64-bit state by the finaliser of SplitMix64 in Stafford's variant 13
//! (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators", 2014), a bijection with full avalanche.

/// 2^64 divided by the golden ratio, odd: spreads small integers over all bits before they are mixed; its multiples modulo 2^64 are evenly spread.
pub const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The same for words of 32 bits.
pub const GOLDEN_32: u32 = (GOLDEN >> 32) as u32;

/// A bijection of 64-bit words in which each input bit changes each output bit with probability one half.
#[inline]
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// 64 random bits for a key. Keys of different length are different keys.
#[inline]
pub fn hash64(key: &[u32]) -> u64 {
    // The length goes in first: without it a key and the same key with a zero behind it could collide.
    let mut state = mix((key.len() as u64 + 1).wrapping_mul(GOLDEN));
    for &word in key {
        state = mix(state ^ u64::from(word).wrapping_add(1).wrapping_mul(GOLDEN)).wrapping_add(GOLDEN);
    }
    mix(state)
}

/// 32 random bits for a key.
#[inline]
pub fn hash(key: &[u32]) -> u32 {
    (hash64(key) >> 32) as u32
}

/// The number in [0, 1) that the upper 24 bits stand for. Never rounds up to 1.
#[inline]
pub fn to_unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// The number in [0, 1) that the upper 53 bits stand for. Never rounds up to 1.
#[inline]
pub fn to_unit64(bits: u64) -> f64 {
    (bits >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
}

/// A uniform number in [0, 1) for a key.
#[inline]
pub fn unit(key: &[u32]) -> f64 {
    to_unit64(hash64(key))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pearson's statistic against equal counts, as a standard score: (χ² - k) / sqrt(2k).
    fn score(counts: &[u32]) -> f64 {
        let total: f64 = counts.iter().map(|&c| f64::from(c)).sum();
        let expected = total / counts.len() as f64;
        let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
        let freedom = counts.len() as f64 - 1.0;
        (chi2 - freedom) / (2.0 * freedom).sqrt()
    }

    #[test]
    fn units_stay_below_one() {
        assert_eq!(to_unit(0), 0.0);
        assert!(to_unit(u32::MAX) < 1.0);
        assert!(to_unit64(u64::MAX) < 1.0);
        assert_eq!(to_unit64(1 << 63), 0.5);
    }

    #[test]
    fn counters_give_uniform_values() {
        // Once along each word of the key, as indices are used, and for several seeds.
        for seed in 0..4u32 {
            for word in 0..3usize {
                let mut counts = vec![0u32; 256];
                for i in 0..100_000u32 {
                    let mut key = [seed, 7, 3];
                    key[word] = i;
                    counts[(to_unit(hash(&key)) * 256.0) as usize] += 1;
                }
                let z = score(&counts);
                assert!(z.abs() < 5.0, "seed {seed}, word {word}: χ² is {z} deviations off");
            }
        }
    }

    #[test]
    fn neighbouring_keys_are_independent() {
        // Pairs (i, purpose 0), (i, purpose 1) and (i), (i + 1) must fill the square evenly.
        let mut purposes = vec![0u32; 32 * 32];
        let mut successors = vec![0u32; 32 * 32];
        for i in 0..200_000u32 {
            let cell = |a: u32, b: u32| (to_unit(a) * 32.0) as usize * 32 + (to_unit(b) * 32.0) as usize;
            purposes[cell(hash(&[1, i, 0]), hash(&[1, i, 1]))] += 1;
            successors[cell(hash(&[1, i, 0]), hash(&[1, i + 1, 0]))] += 1;
        }
        assert!(score(&purposes).abs() < 5.0, "{}", score(&purposes));
        assert!(score(&successors).abs() < 5.0, "{}", score(&successors));
    }

    #[test]
    fn every_input_bit_reaches_every_output_bit() {
        let trials = 2000u32;
        for word in 0..2usize {
            for bit in 0..32 {
                let mut flips = [0u32; 64];
                for i in 0..trials {
                    let mut key = [i, i.wrapping_mul(2_654_435_761)];
                    let before = hash64(&key);
                    key[word] ^= 1 << bit;
                    let change = before ^ hash64(&key);
                    for (out, n) in flips.iter_mut().enumerate() {
                        *n += (change >> out) as u32 & 1;
                    }
                }
                // Six standard deviations of a fair coin over `trials` throws, for 4,096 coins.
                let bound = 6.0 * (f64::from(trials) / 4.0).sqrt();
                for (out, &n) in flips.iter().enumerate() {
                    assert!((f64::from(n) - f64::from(trials) / 2.0).abs() < bound, "bit {bit} -> {out}: {n}");
                }
            }
        }
    }

    #[test]
    fn length_is_part_of_the_key() {
        assert_ne!(hash(&[]), hash(&[0]));
        assert_ne!(hash(&[0]), hash(&[0, 0]));
        assert_ne!(hash(&[1, 2]), hash(&[2, 1]));
    }
}
