//! The error of the finished picture, by pixels that had no part in it.

use super::worth::{Trial, Truth};
use super::{Job, KNOB};
use crate::render::Film;
use crate::render::statistics::Claim;
use crate::scene::loaded::LampShadows;
use crate::study::statistics::{NORMAL, rms_of_squares};

impl Job<'_> {
    /// The claim; none of a picture in which nothing is seen.
    pub(super) fn claim(&self, film: &Film, judging: &[Truth], trial: Trial) -> Option<Claim> {
        let level = level(film)?;
        let index = |at| film.window.index(at);
        let square = |truth: &Truth| {
            let value = film.pixels[index(truth.at)].beauty.as_dvec3().to_array();
            truth.weight * truth.product(value, value) / (level * level)
        };
        let squares: Vec<f64> = judging.iter().map(square).collect();
        let variance = |truth: &Truth| truth.variance() + variance(film, index(truth.at));
        let variances: Vec<f64> =
            judging.iter().map(|truth| truth.weight * variance(truth) / (level * level)).collect();
        // Of passes the noise is known all over the picture; what the judges tell is the rest, the square of the bias.
        let bias = rms_of_squares(&squares, &variances)?;
        let noise = Noise::of(film, level);
        let square = bias.value.powi(2) + noise.square;
        let low = square - (bias.value.powi(2) - bias.low.unwrap_or(0.0).powi(2)).hypot(noise.reach);
        let high = square + (bias.high.unwrap_or(1.0).powi(2) - bias.value.powi(2)).hypot(noise.reach);
        let asked = self.goal.error();
        Some(Claim {
            asked,
            error: square.sqrt(),
            low: low.max(0.0).sqrt(),
            high: high.sqrt(),
            pixels: judging.len(),
            settings: KNOB.get(trial.place).map_or("reference", |(name, _)| *name).to_owned(),
            set: self.chosen(),
            reached: asked.is_none_or(|asked| square.sqrt() <= asked),
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
fn variance(film: &Film, pixel: usize) -> f64 {
    f64::from(film.error_of(pixel).length_squared()) / 3.0
}

/// Noise of a picture, from its passes.
struct Noise {
    /// Mean variance over what is seen, as a share of the squared mean.
    square: f64,
    /// By how much the mean of this picture's own squares may be off it: a squared normal variable of variance v has the variance 2 v², and few pixels may hold
    /// nearly all of it.
    reach: f64,
}

impl Noise {
    fn of(film: &Film, level: f64) -> Self {
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        for variance in seen(film).map(|pixel| variance(film, pixel)) {
            (sum, squares, count) = (sum + variance, squares + variance * variance, count + 1.0);
        }
        let scale = 1.0 / (count * level * level);
        Self { square: sum * scale, reach: NORMAL * (2.0_f64 * squares).sqrt() * scale }
    }
}
