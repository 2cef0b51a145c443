//! The error of the finished picture, by pixels that had no part in it.
//!
//! The error is b + n, bias and noise. What the passes' streams tell of n is known all over the picture; b² is found at the pixels that judge, where more
//! passes have taken the noise away. The sum of both is off the square of b + n by two things that belong to the interval: n² differs from its mean, and n
//! goes with or against b.

use super::pixels::light;
use super::worth::Truth;
use super::{Job, KNOB, Picture};
use crate::fragment::PixelRect;
use crate::render::Mean;
use crate::render::statistics::Claim;
use crate::scene::loaded::LampShadows;
use crate::study::statistics::{NORMAL, rms_of_squares};

impl Job<'_> {
    /// The claim, with the scene as its picture has it; none of a picture in which nothing is seen.
    pub(super) fn claim(&self, picture: &Picture, judging: &[Truth]) -> Option<Claim> {
        let Picture { trial, window, mean, judged, .. } = picture;
        let [error, low, high] = error(mean, window, judging, judged)?;
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
fn error(picture: &Mean, window: &PixelRect, judging: &[Truth], judged: &Mean) -> Option<[f64; 3]> {
    let level = level(picture)?;
    let scale = |truth: &Truth| truth.weight / (level * level);
    let square = |(index, truth): (usize, &Truth)| {
        let value = judged.beauty(index).as_dvec3().to_array();
        scale(truth) * truth.product(value, value)
    };
    let squares: Vec<f64> = judging.iter().enumerate().map(square).collect();
    let variance = |(index, truth): (usize, &Truth)| scale(truth) * (truth.variance() + judged.noise_of(index));
    let variances: Vec<f64> = judging.iter().enumerate().map(variance).collect();
    let bias = rms_of_squares(&squares, &variances)?;
    let noise = Noise::of(picture, level);
    // 2 b n has the variance 4 b² v.
    let both = judging
        .iter()
        .zip(squares.iter().zip(&variances))
        .map(|(truth, (square, known))| (square - known) * picture.noise_of(window.index(truth.at)) / (level * level));
    let both = (both.sum::<f64>() / judging.len() as f64).max(0.0) / noise.pixels;
    let reach = noise.reach.hypot(2.0 * NORMAL * both.sqrt());
    let square = bias.value.powi(2) + noise.square;
    let low = square - (bias.value.powi(2) - bias.low.unwrap_or(0.0).powi(2)).hypot(reach);
    let high = square + (bias.high.unwrap_or(f64::INFINITY).powi(2) - bias.value.powi(2)).hypot(reach);
    Some([square, low.max(0.0), high].map(f64::sqrt))
}

/// Mean of the beauty where something is seen; none where that is black.
fn level(picture: &Mean) -> Option<f64> {
    let sum = picture.seen().map(|pixel| light(picture.beauty(pixel))).sum::<f64>();
    let level = sum / picture.seen().count() as f64;
    (level > 0.0).then_some(level)
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
    fn of(picture: &Mean, level: f64) -> Self {
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        for variance in picture.seen().map(|pixel| picture.noise_of(pixel)) {
            (sum, squares, count) = (sum + variance, squares + variance * variance, count + 1.0);
        }
        let scale = 1.0 / (count * level * level);
        Self { square: sum * scale, reach: NORMAL * (2.0_f64 * squares).sqrt() * scale, pixels: count }
    }
}

#[cfg(test)]
mod tests {
    use super::super::pixels::{Drawn, Looked, Purpose};
    use super::super::worth::tests::normal;
    use super::*;
    use crate::render::{Film, Pixel};
    use glam::Vec3;

    const SIDE: u32 = 48;

    /// A pass over these pixels of a grey picture of 1 that is wrong by `bias` and has noise that few pixels hold much of.
    fn pass(number: u32, trial: u32, bias: f64, places: &[u32]) -> Vec<Pixel> {
        let value = |&place: &u32| {
            1.0 + wrong(trial, bias, place) + 0.04 * rough(trial, place) * normal(&[2, trial, place, number])
        };
        places
            .iter()
            .map(|place| Pixel { beauty: Vec3::splat(value(place) as f32), alpha: 1.0, ..Pixel::default() })
            .collect()
    }

    /// Noise of a pixel, as a multiple of that of most.
    fn rough(trial: u32, place: u32) -> f64 {
        (1.2 * normal(&[1, trial, place])).exp()
    }

    fn wrong(trial: u32, bias: f64, place: u32) -> f64 {
        bias * normal(&[3, trial, place])
    }

    /// Error, interval and what is true of a picture of 12 passes, with so many more at pixels that are drawn by what is known of it. Halves of references have
    /// three eighths of the noise of a pass.
    fn trial(trial: u32, bias: f64, further: u32) -> ([f64; 3], f64) {
        let window = PixelRect { min: [0, 0], max: [SIDE; 2] };
        let all: Vec<u32> = (0..SIDE * SIDE).collect();
        let mut film = Film::new(window, [SIDE; 2]);
        film.pixels = pass(0, trial, bias, &all);
        let mut mean = Mean::new(film);
        (1..12).for_each(|number| mean.add_pixels(&pass(number, trial, bias, &all)));
        let drawn = Looked::at(&mean, &window).draw(trial, Purpose::Judging, usize::MAX);
        let places: Vec<u32> = drawn.iter().map(|drawn| window.index(drawn.at) as u32).collect();
        let mut judged = mean.at(&places.iter().map(|&place| place as usize).collect::<Vec<_>>());
        (12..12 + further).for_each(|number| judged.add_pixels(&pass(number, trial, bias, &places)));
        let truth = |(drawn, &place): (&Drawn, &u32)| {
            let half = |half| [1.0 + 0.015 * rough(trial, place) * normal(&[4, trial, place, half]); 3];
            Truth { at: drawn.at, weight: drawn.weight, halves: [half(0), half(1)] }
        };
        let judging: Vec<Truth> = drawn.iter().zip(&places).map(truth).collect();
        let square = mean.seen().map(|pixel| (f64::from(mean.beauty(pixel).x) - 1.0).powi(2)).sum::<f64>();
        let is = (square / f64::from(SIDE * SIDE)).sqrt() / level(&mean).unwrap();
        (error(&mean, &window, &judging, &judged).unwrap(), is)
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
        eprintln!("{held} of {all}, widths {widths:?}");
        assert!(f64::from(held) >= 0.92 * f64::from(all), "{held} of {all}");
        assert!(widths[1] < 0.8 * widths[0], "{widths:?}");
    }
}
