//! Choosing one of many things by weight.

/// Things with weights, chosen by inverting the running sum: the map from numbers to things is monotone, so that strata of
/// numbers stay strata of things (an alias table would scatter them).
#[derive(Clone, Debug, Default)]
pub struct Distribution {
    /// Sum of the weights up to and with each thing.
    sums: Vec<f64>,
}

impl Distribution {
    /// Weights must be finite and not negative.
    pub fn new(weights: impl Iterator<Item = f32>) -> Self {
        let mut sum = 0.0;
        let add = |weight: f32| {
            sum += f64::from(weight);
            sum
        };
        Self { sums: weights.map(add).collect() }
    }

    /// Sum of all weights.
    pub fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// A thing's share of the weights, 0 to 1.
    pub fn share(&self, index: usize) -> f64 {
        let before = if index > 0 { self.sums[index - 1] } else { 0.0 };
        (self.sums[index] - before) / self.total()
    }

    /// The thing at `u` in [0, 1), and the place in [0, 1) inside its share; none where all weights are zero.
    pub fn choose(&self, u: f64) -> Option<(usize, f64)> {
        let target = u * self.total();
        // The first whose sum is beyond the target has a weight above zero.
        let index = self.sums.partition_point(|&sum| sum <= target);
        let sum = *self.sums.get(index)?;
        let before = if index > 0 { self.sums[index - 1] } else { 0.0 };
        Some((index, ((target - before) / (sum - before)).clamp(0.0, 1.0 - f64::EPSILON)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn things_come_as_often_as_they_weigh() {
        let weights = [0.0_f32, 3.0, 1e-3, 0.0, 5.0, 0.5, 0.0];
        let distribution = Distribution::new(weights.into_iter());
        let n = 200_000;
        let mut counts = [0_u32; 7];
        for i in 0..n {
            let (index, place) = distribution.choose(crate::hash::unit(&[i])).expect("weights");
            assert!((0.0..1.0).contains(&place));
            counts[index] += 1;
        }
        let mut chi2 = 0.0;
        for (count, weight) in counts.into_iter().zip(weights) {
            let want = f64::from(weight) / distribution.total() * f64::from(n);
            if want == 0.0 {
                assert_eq!(count, 0);
            } else {
                chi2 += (f64::from(count) - want).powi(2) / want;
            }
        }
        // 3 degrees of freedom: beyond 21.1 once in 10,000.
        assert!(chi2 < 21.1, "{chi2}: {counts:?}");
        assert!(Distribution::new([0.0, 0.0].into_iter()).choose(0.5).is_none());
        assert!(Distribution::default().choose(0.0).is_none());
    }
}
