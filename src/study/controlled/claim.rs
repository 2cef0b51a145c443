//! The error of the finished picture, by pixels that had no part in it.
//!
//! The error is b + n, bias and noise. What the passes' streams tell of n is known all over the picture; b² is found at the pixels that judge, where more
//! passes have taken the noise away. The sum of both is off the square of b + n by two things that belong to the interval: n² differs from its mean, and n
//! goes with or against b.

use super::worth::{Trial, Truth};
use super::{Job, KNOB};
use crate::render::statistics::Claim;
use crate::render::{Film, Mean};
use crate::scene::loaded::LampShadows;
use crate::study::statistics::{NORMAL, rms_of_squares};

impl Job<'_> {
    /// The claim; none of a picture in which nothing is seen. `judged` are passes at the pixels of the references, in their order.
    pub(super) fn claim(&self, film: &Film, judging: &[Truth], judged: &Mean, trial: Trial) -> Option<Claim> {
        let [error, low, high] = error(film, judging, judged)?;
        let asked = self.goal.error();
        Some(Claim {
            asked,
            error,
            low,
            high,
            pixels: judging.len(),
            settings: KNOB.get(trial.place).map_or("reference", |(name, _)| *name).to_owned(),
            set: self.chosen(),
            reached: asked.is_none_or(|asked| error <= asked),
        })
    }

    /// The settings that were chosen, as after `--set`.
    fn chosen(&self) -> Vec<String> {
        let description = self.scene.description();
        let mut set = vec![
            format!("occlusion.accuracy={}", description.occlusion.accuracy),
            format!("occlusion.faces={}", description.occlusion.face_count()),
            format!("sampling.layers={}", description.sampling.layers),
            format!("sampling.area_light_samples={}", description.sampling.area_light_samples),
            format!("sampling.surface_samples={}", description.sampling.surface_samples),
        ];
        set.extend(description.occlusion.rays.map(|rays| format!("occlusion.rays={rays}")));
        let other = |(now, given): &(&LampShadows, &LampShadows)| now.mode != given.mode;
        let changed = self.scene.shadows.iter().zip(&self.shadows).filter(other);
        set.extend(changed.map(|(now, _)| format!("{}.shadows=raytraced", now.key)));
        set
    }
}

/// Relative RMS error of a picture, and the ends of its interval.
fn error(film: &Film, judging: &[Truth], judged: &Mean) -> Option<[f64; 3]> {
    let level = level(film)?;
    let scale = |truth: &Truth| truth.weight / (level * level);
    let square = |(index, truth): (usize, &Truth)| {
        let value = judged.beauty(index).as_dvec3().to_array();
        scale(truth) * truth.product(value, value)
    };
    let squares: Vec<f64> = judging.iter().enumerate().map(square).collect();
    let variance = |(index, truth): (usize, &Truth)| {
        scale(truth) * (truth.variance() + judged.variance_of(index).element_sum() / 3.0)
    };
    let variances: Vec<f64> = judging.iter().enumerate().map(variance).collect();
    let bias = rms_of_squares(&squares, &variances)?;
    let noise = Noise::of(film, level);
    // 2 b n has the variance 4 b² v.
    let both = judging.iter().zip(squares.iter().zip(&variances)).map(|(truth, (square, known))| {
        (square - known) * variance_in(film, film.window.index(truth.at)) / (level * level)
    });
    let both = (both.sum::<f64>() / judging.len() as f64).max(0.0) / noise.pixels;
    let reach = noise.reach.hypot(2.0 * NORMAL * both.sqrt());
    let square = bias.value.powi(2) + noise.square;
    let low = square - (bias.value.powi(2) - bias.low.unwrap_or(0.0).powi(2)).hypot(reach);
    let high = square + (bias.high.unwrap_or(1.0).powi(2) - bias.value.powi(2)).hypot(reach);
    Some([square, low.max(0.0), high].map(f64::sqrt))
}

/// Pixels in which something is seen.
fn seen(film: &Film) -> impl Iterator<Item = usize> + '_ {
    (0..film.pixels.len()).filter(|&pixel| film.pixels[pixel].alpha > 0.0)
}

/// Mean of the beauty where something is seen; none where that is black.
fn level(film: &Film) -> Option<f64> {
    let sum = seen(film).map(|pixel| film.pixels[pixel].beauty.as_dvec3().element_sum() / 3.0).sum::<f64>();
    let level = sum / seen(film).count() as f64;
    (level > 0.0).then_some(level)
}

/// Variance of a pixel, the mean of its channels; 0 of a single pass, which does not tell it.
fn variance_in(film: &Film, pixel: usize) -> f64 {
    f64::from(film.error_of(pixel).length_squared()) / 3.0
}

/// Noise of a picture, from its passes.
struct Noise {
    /// Mean variance over what is seen, as a share of the squared mean.
    square: f64,
    /// By how much the mean of this picture's own squares may be off it: a squared normal variable of variance v has the variance 2 v², and few pixels may hold
    /// nearly all of it.
    reach: f64,
    /// Pixels in which something is seen.
    pixels: f64,
}

impl Noise {
    fn of(film: &Film, level: f64) -> Self {
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        for variance in seen(film).map(|pixel| variance_in(film, pixel)) {
            (sum, squares, count) = (sum + variance, squares + variance * variance, count + 1.0);
        }
        let scale = 1.0 / (count * level * level);
        Self { square: sum * scale, reach: NORMAL * (2.0_f64 * squares).sqrt() * scale, pixels: count }
    }
}

#[cfg(test)]
mod tests {
    use super::super::worth::tests::normal;
    use super::*;
    use crate::fragment::PixelRect;
    use crate::render::Pixel;
    use glam::Vec3;

    const SIDE: u32 = 32;
    const JUDGES: u32 = 256;

    /// A pass over these pixels of a grey picture of 1 that is wrong by `bias` and has noise that few pixels hold much of.
    fn pass(number: u32, trial: u32, bias: f64, places: &[u32]) -> Vec<Pixel> {
        let value = |&place: &u32| {
            let noise = 0.04 * (1.2 * normal(&[1, trial, place])).exp();
            1.0 + wrong(trial, bias, place) + noise * normal(&[2, trial, place, number])
        };
        places
            .iter()
            .map(|place| Pixel { beauty: Vec3::splat(value(place) as f32), alpha: 1.0, ..Pixel::default() })
            .collect()
    }

    fn wrong(trial: u32, bias: f64, place: u32) -> f64 {
        bias * normal(&[3, trial, place])
    }

    /// Error, interval and what is true of a picture of 12 passes, with so many more at pixels whose halves of a reference have a noise of .03.
    fn trial(trial: u32, bias: f64, further: u32) -> ([f64; 3], f64) {
        let all: Vec<u32> = (0..SIDE * SIDE).collect();
        let mut film = Film::new(PixelRect { min: [0, 0], max: [SIDE; 2] }, [SIDE; 2]);
        film.pixels = pass(0, trial, bias, &all);
        let mut mean = Mean::new(film);
        (1..12).for_each(|number| mean.add_pixels(&pass(number, trial, bias, &all)));
        let places: Vec<u32> = (0..JUDGES).map(|n| n * SIDE * SIDE / JUDGES).collect();
        let mut judged = mean.at(&places.iter().map(|&place| place as usize).collect::<Vec<_>>());
        (12..12 + further).for_each(|number| judged.add_pixels(&pass(number, trial, bias, &places)));
        let half = |place, half| [1.0 + 0.03 * normal(&[4, trial, place, half]); 3];
        let judging: Vec<Truth> = places
            .iter()
            .map(|&place| Truth {
                at: [place % SIDE, place / SIDE],
                weight: 1.0,
                halves: [half(place, 0), half(place, 1)],
            })
            .collect();
        let film = mean.film();
        let square = film.pixels.iter().map(|pixel| (f64::from(pixel.beauty.x) - 1.0).powi(2)).sum::<f64>();
        let level = film.mean_beauty().x;
        (error(&film, &judging, &judged).unwrap(), (square / f64::from(SIDE * SIDE)).sqrt() / f64::from(level))
    }

    #[test]
    fn intervals_hold_the_error_and_further_passes_make_them_narrow() {
        let (mut held, mut all) = (0, 0);
        let mut widths = [0.0; 2];
        for bias in [0.0, 0.02] {
            for number in 0..24 {
                for (width, further) in widths.iter_mut().zip([0, 48]) {
                    let ([value, low, high], is) = trial(number, bias, further);
                    assert!(low <= value && value <= high);
                    held += u32::from((low..=high).contains(&is));
                    all += 1;
                    *width += high - low;
                }
            }
        }
        assert!(f64::from(held) >= 0.92 * f64::from(all), "{held} of {all}");
        assert!(widths[1] < 0.8 * widths[0], "{widths:?}");
    }
}
