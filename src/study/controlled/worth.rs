//! What passes of some settings are worth: bias and noise against references that are noisy themselves.

/// What is aimed at, as a share of the error asked for: bias and noise are estimates.
pub const AIM: f64 = 0.85;

/// Passes at the most.
pub const MOST_PASSES: u32 = 10_000;

/// A pixel and its reference.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    pub at: [u32; 2],
    /// How much it counts in a mean over the pixels drawn: 1 on average.
    pub weight: f64,
    /// Beauty, from two independent halves.
    pub halves: [[f64; 3]; 2],
}

impl Truth {
    /// The mean of both halves.
    pub fn mean(&self, channel: usize) -> f64 {
        0.5 * (self.halves[0][channel] + self.halves[1][channel])
    }

    /// Estimate of the variance of the mean, over the channels.
    pub fn variance(&self) -> f64 {
        (0..3).map(|c| 0.25 * (self.halves[0][c] - self.halves[1][c]).powi(2)).sum::<f64>() / 3.0
    }

    /// Mean over the channels of the product of two differences.
    pub fn product(&self, a: [f64; 3], b: [f64; 3]) -> f64 {
        (0..3).map(|c| (a[c] - self.mean(c)) * (b[c] - self.mean(c))).sum::<f64>() / 3.0
    }
}

/// Settings that may be chosen, and what a pass of them is worth.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    /// Place on the knob; one beyond its end is the reference's own settings.
    pub place: usize,
    pub worth: Worth,
    /// Of a pass over the whole picture: lanes, or seconds where a time is asked for.
    pub work: f64,
    /// Seconds before the first pass.
    pub before: f64,
}

/// What a pass errs by: mean squares, relative to the square of the mean.
#[derive(Clone, Copy, Debug)]
pub struct Worth {
    /// What stays whatever the random numbers are.
    pub bias: f64,
    /// Standard error of the estimate of that.
    pub doubt: f64,
    /// What stays however many passes there are: the bias, and the noise of the photons of all streams.
    pub lasting: f64,
    /// What falls with their number.
    pub noise: f64,
}

impl Worth {
    /// From two or more runs, each with the pixels of the references in their order, that took turns in so many streams; two or more if there is more than one.
    /// `level` is the mean.
    pub fn new(truths: &[Truth], runs: &[Vec<[f64; 3]>], streams: usize, level: f64) -> Self {
        let count = runs.len() as f64;
        // Without streams each run is one of its own.
        let streams = if streams > 1 { streams } else { runs.len() };
        let alike: f64 = (0..streams).map(|stream| (runs.len() - stream).div_ceil(streams).pow(2) as f64).sum();
        let (mut sum, mut squares, mut lasting, mut noise) = (0.0, 0.0, 0.0, 0.0);
        let level2 = level * level;
        for (index, truth) in truths.iter().enumerate() {
            // The products of runs of different streams have the bias alone in them, those of different runs what lasts: Σ a b = (Σ a)² - Σ a².
            let square_of = |first: usize, step: usize| {
                let sum =
                    |c| runs.iter().skip(first).step_by(step).map(|run| run[index][c] - truth.mean(c)).sum::<f64>();
                [0, 1, 2].map(|c| sum(c).powi(2)).iter().sum::<f64>() / 3.0
            };
            let of_all = square_of(0, 1);
            let of_streams: f64 = (0..streams).map(|stream| square_of(stream, streams)).sum();
            let of_each = runs.iter().map(|run| truth.product(run[index], run[index])).sum::<f64>();
            let bias = truth.weight * ((of_all - of_streams) / (count * count - alike) - truth.variance());
            sum += bias;
            squares += bias * bias;
            lasting += truth.weight * ((of_all - of_each) / (count * (count - 1.0)) - truth.variance());
            noise += truth.weight * (of_each - of_all / count) / (count - 1.0);
        }
        let n = truths.len().max(1) as f64;
        let variance = (squares / n - (sum / n).powi(2)).max(0.0) / n;
        Self {
            bias: (sum / n).max(0.0) / level2,
            doubt: variance.sqrt() / level2,
            lasting: (lasting / n).max(0.0) / level2,
            noise: noise / n / level2,
        }
    }

    /// What lasts, as far as it is shown to be there: doubts about the references rule no settings out, since other pixels judge the picture.
    pub fn shown(&self) -> f64 {
        self.beyond_doubt(self.lasting)
    }

    /// The bias alone, as far as it is shown.
    pub fn shown_bias(&self) -> f64 {
        self.beyond_doubt(self.bias)
    }

    fn beyond_doubt(&self, square: f64) -> f64 {
        (square - self.doubt).max(0.0)
    }
}

impl Trial {
    /// Passes for a mean square error; none where what lasts alone is more.
    pub fn passes(&self, square: f64) -> Option<u32> {
        let room = square - self.worth.shown();
        let passes = (self.worth.noise / room).ceil().max(1.0);
        (room > 0.0 && passes <= f64::from(MOST_PASSES)).then_some(passes as u32)
    }
}

/// The least work that reaches an error; infinite where nothing does.
pub fn total(trials: &[Trial], error: f64) -> f64 {
    let square = (AIM * error).powi(2);
    let work = trials.iter().filter_map(|trial| Some(trial.work * f64::from(trial.passes(square)?)));
    work.fold(f64::INFINITY, f64::min)
}

/// The one with the least of something; there is at least one.
pub fn least(trials: &[Trial], value: impl Fn(&Trial) -> f64) -> &Trial {
    let mut best = &trials[0];
    for trial in trials {
        if value(trial) < value(best) {
            best = trial;
        }
    }
    best
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::hash::unit;

    /// A number that is nearly normal, of variance 1.
    pub fn normal(key: &[u32]) -> f64 {
        let sum: f64 = (0..12).map(|i| unit(&[key, &[i]].concat())).sum();
        sum - 6.0
    }

    fn trial(bias: f64, noise: f64, work: f64) -> Trial {
        Trial { place: 0, worth: Worth { bias, doubt: 0.0, lasting: bias, noise }, work, before: 0.0 }
    }

    #[test]
    fn passes_go_against_noise_and_never_against_bias() {
        let square = 0.01_f64.powi(2);
        assert_eq!(trial(0.0, 0.0, 1.0).passes(square), Some(1));
        assert_eq!(trial(0.5 * square, 2.0 * square, 1.0).passes(square), Some(4));
        assert_eq!(trial(1.1 * square, 0.0, 1.0).passes(square), None);
        let trials = [trial(0.9 * AIM * AIM * square, AIM * AIM * square, 1.0), trial(0.0, AIM * AIM * square, 5.0)];
        assert!((total(&trials, 0.01) - 5.0).abs() < 1e-9, "ten passes of the first, one of the second");
    }

    #[test]
    fn the_error_of_a_truth_is_without_its_noise() {
        // Halves 1 ± e: the mean is 1, its variance e²/... = (2e)²/4 = e².
        let truth = Truth { at: [0, 0], weight: 1.0, halves: [[1.1; 3], [0.9; 3]] };
        assert!((truth.variance() - 0.01).abs() < 1e-12);
        assert!((truth.product([1.2; 3], [1.3; 3]) - 0.06).abs() < 1e-12);
    }

    #[test]
    fn bias_and_noise_are_told_apart() {
        // A picture of 2 that is rendered .05 too bright with a deviation of .3; its reference has a deviation of .2 in each half. Over 20,000 pixels the
        // estimates are good to their doubt.
        let pixel = |key: [u32; 2], mean: f64, deviation: f64| [mean + deviation * normal(&key); 3];
        let truths: Vec<Truth> = (0..20_000)
            .map(|i| Truth { at: [0, 0], weight: 1.0, halves: [1, 2].map(|half| pixel([half, i], 2.0, 0.2)) })
            .collect();
        for runs in [2, 5] {
            let run = |n: u32| (0..20_000).map(|i| pixel([10 + n, i], 2.05, 0.3)).collect();
            let runs: Vec<Vec<[f64; 3]>> = (0..runs).map(run).collect();
            let worth = Worth::new(&truths, &runs, 1, 2.0);
            let (bias, noise) = (0.05_f64.powi(2) / 4.0, 0.3_f64.powi(2) / 4.0);
            assert!((worth.bias - bias).abs() < 4.0 * worth.doubt, "{worth:?} {bias}");
            assert!(worth.doubt < 0.7 * bias && (worth.noise / noise - 1.0).abs() < 0.05, "{worth:?}");
            assert!(
                (worth.lasting / worth.bias - 1.0).abs() < 1e-9,
                "without streams all that lasts is bias: {worth:?}"
            );
        }
        // Photons of four streams add a deviation of .1 that passes of a stream share: of many passes a quarter of its square is left.
        let run = |n: u32| {
            let of_stream = |i| 0.1 * normal(&[100 + n % 4, i]);
            (0..20_000).map(|i| pixel([10 + n, i], 2.05, 0.3).map(|value| value + of_stream(i))).collect()
        };
        let runs: Vec<Vec<[f64; 3]>> = (0..40).map(run).collect();
        let worth = Worth::new(&truths, &runs, 4, 2.0);
        let (bias, photons) = (0.05_f64.powi(2) / 4.0, 0.1_f64.powi(2) / 4.0);
        assert!((worth.bias - bias).abs() < 4.0 * worth.doubt, "{worth:?} {bias}");
        // Of 40 x 39 pairs 4 x 10 x 9 are of one stream.
        let lasting = bias + photons * 360.0 / 1560.0;
        assert!((worth.lasting - lasting).abs() < 4.0 * worth.doubt, "{worth:?} {lasting}");
    }
}
