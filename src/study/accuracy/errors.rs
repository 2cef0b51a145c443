//! By how much pictures differ from a reference: relative to its mean, over the pixels in which something is seen.
//!
//! The reference is the mean of two independent halves a and b; its variance at a pixel, (a - b)²/4 on average, is taken out of mean squares.
//! Several pictures of the same settings and other seeds tell bias from noise: the mean of n of them has the bias of one and an n-th of its variance.

use serde::{Deserialize, Serialize};

use crate::image::{RgbImage, display};
use crate::render::Film;

/// A picture with its coverage, linear Rec.709.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    pub rgb: RgbImage,
    pub alpha: Vec<f32>,
}

impl From<&Film> for Picture {
    fn from(film: &Film) -> Self {
        let rgb = RgbImage {
            width: film.width() as u32,
            height: film.height() as u32,
            pixels: film.pixels.iter().map(|pixel| pixel.beauty.to_array()).collect(),
        };
        Self { rgb, alpha: film.pixels.iter().map(|pixel| pixel.alpha).collect() }
    }
}

/// A reference in two independent halves.
#[derive(Clone, Debug)]
pub struct Halves {
    pub halves: [Picture; 2],
    /// Their mean.
    pub mean: RgbImage,
    /// Pixels in which anything is seen.
    seen: Vec<usize>,
    /// Mean value over these.
    level: f64,
    /// Mean variance of the reference at a pixel and channel.
    variance: f64,
}

/// Errors of settings. All but `flip` are shares of the mean of the reference over what is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Root mean square of a single picture's difference, the reference's own noise taken out.
    pub rms: f64,
    /// What it may be as far as the reference tells: two standard errors more.
    pub at_most: f64,
    /// The part of it that differs from seed to seed; none from a single picture.
    pub noise: Option<f64>,
    /// The part that all seeds share: RMS over the pixels. Of a single picture all counts as bias.
    pub bias: f64,
    /// Mean difference: above 0 too bright.
    pub mean: f64,
    /// Largest difference of a pixel and channel, noise included.
    pub max: f64,
    /// Mean of NVIDIA's FLIP of the displayed pictures, 0 the same to 1.
    pub flip: f64,
}

impl Halves {
    /// Of two pictures of one size; none where they differ in size or nothing is seen.
    #[must_use]
    pub fn new(halves: [Picture; 2]) -> Option<Self> {
        let [a, b] = &halves;
        if (a.rgb.width, a.rgb.height) != (b.rgb.width, b.rgb.height) {
            return None;
        }
        let seen: Vec<usize> = (0..a.alpha.len()).filter(|&i| a.alpha[i] > 0.0 || b.alpha[i] > 0.0).collect();
        let mix = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| 0.5 * (a[c] + b[c]));
        let pixels: Vec<[f32; 3]> = a.rgb.pixels.iter().zip(&b.rgb.pixels).map(mix).collect();
        let count = 3.0 * seen.len() as f64;
        let level = seen.iter().flat_map(|&i| pixels[i]).map(f64::from).sum::<f64>() / count;
        let variance = mean_square(&a.rgb, &b.rgb, &seen) / 4.0;
        let mean = RgbImage { width: a.rgb.width, height: a.rgb.height, pixels };
        (level > 0.0).then_some(Self { halves, mean, seen, level, variance })
    }

    /// Standard error of the reference, RMS over pixels, as a share of its mean.
    #[must_use]
    pub fn standard_error(&self) -> f64 {
        self.variance.sqrt() / self.level
    }

    /// Pixels in which anything is seen, of all.
    #[must_use]
    pub fn seen(&self) -> [usize; 2] {
        [self.seen.len(), self.mean.pixels.len()]
    }

    /// Root mean square of a picture's difference, over pictures of the same settings; none without any, or where one has another size.
    #[must_use]
    pub fn rms(&self, pictures: &[RgbImage]) -> Option<f64> {
        let fits = |picture: &RgbImage| picture.pixels.len() == self.mean.pixels.len();
        if pictures.is_empty() || !pictures.iter().all(fits) {
            return None;
        }
        let squares = pictures.iter().map(|picture| mean_square(picture, &self.mean, &self.seen));
        let square = squares.sum::<f64>() / pictures.len() as f64;
        Some((square - self.variance).max(0.0).sqrt() / self.level)
    }

    /// Standard error of the mean square difference from the reference, its own noise taken out. With d the difference from the mean of both halves and n half the difference of
    /// these, d² - n² is a pixel's square on average: d has the error of that mean, n one of the same variance that is independent of it, and the variance of d² - n² is 4 d² n².
    fn doubt(&self, pictures: &[RgbImage]) -> f64 {
        let of_pixel = |&i: &usize| {
            let off = pictures.iter().map(|picture| square(picture.pixels[i], self.mean.pixels[i])).sum::<f64>();
            let [a, b] = [0, 1].map(|half| self.halves[half].rgb.pixels[i]);
            // Halved, and times 4.
            off / pictures.len() as f64 * square(a, b)
        };
        self.seen.iter().map(of_pixel).sum::<f64>().sqrt() / (3.0 * self.seen.len() as f64)
    }

    /// The error as [`Self::rms`] has it between what it is at least and at most as far as the reference tells: two standard errors to either side.
    #[must_use]
    pub fn range(&self, pictures: &[RgbImage]) -> Option<[f64; 3]> {
        let rms = self.rms(pictures)?;
        let reach = 2.0 * self.doubt(pictures) / self.level.powi(2);
        Some([-reach, 0.0, reach].map(|reach| (rms * rms + reach).max(0.0).sqrt()))
    }

    /// Errors of pictures of the same settings and different seeds; none without any, or where one has another size.
    #[must_use]
    pub fn errors(&self, pictures: &[RgbImage], exposure: f32) -> Option<Errors> {
        let size = |image: &RgbImage| (image.width, image.height);
        if pictures.is_empty() || pictures.iter().any(|picture| size(picture) != size(&self.mean)) {
            return None;
        }
        let n = pictures.len() as f64;
        let count = 3.0 * self.seen.len() as f64;
        let (mut of_mean, mut spread, mut sum, mut max) = (0.0, 0.0, 0.0, 0.0_f64);
        for (&pixel, channel) in self.seen.iter().flat_map(|pixel| (0..3).map(move |channel| (pixel, channel))) {
            let truth = f64::from(self.mean.pixels[pixel][channel]);
            let difference = |picture: &RgbImage| f64::from(picture.pixels[pixel][channel]) - truth;
            let mean = pictures.iter().map(difference).sum::<f64>() / n;
            sum += mean;
            of_mean += mean * mean;
            for picture in pictures {
                let d = difference(picture);
                spread += (d - mean).powi(2);
                max = max.max(d.abs());
            }
        }
        let variance = (pictures.len() > 1).then(|| spread / (n - 1.0) / count);
        let root = |square: f64| square.max(0.0).sqrt() / self.level;
        let [_, rms, at_most] = self.range(pictures)?;
        Some(Errors {
            rms,
            at_most,
            noise: variance.map(root),
            bias: root(of_mean / count - self.variance - variance.unwrap_or(0.0) / n),
            mean: sum / count / self.level,
            max: max / self.level,
            flip: flip(&self.mean, &pictures[0], exposure),
        })
    }
}

/// Square of the difference of two colours.
fn square(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum()
}

/// Mean square difference over some pixels and all channels.
fn mean_square(a: &RgbImage, b: &RgbImage, pixels: &[usize]) -> f64 {
    let square = |&i: &usize| square(a.pixels[i], b.pixels[i]);
    pixels.iter().map(square).sum::<f64>() / (3.0 * pixels.len().max(1) as f64)
}

/// Mean of FLIP at its usual viewing distance (67 pixels a degree) of what a display shows.
fn flip(reference: &RgbImage, picture: &RgbImage, exposure: f32) -> f64 {
    let image = |image: &RgbImage| {
        let bytes: Vec<u8> = image.pixels.iter().flat_map(|&pixel| display::to_srgb8(pixel, exposure)).collect();
        nv_flip::FlipImageRgb8::with_data(image.width, image.height, &bytes)
    };
    let map = nv_flip::flip(image(reference), image(picture), nv_flip::DEFAULT_PIXELS_PER_DEGREE);
    f64::from(nv_flip::FlipPool::from_image(&map).mean())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::unit;

    const SIDE: u32 = 64;

    fn picture(level: f64, noise: f64, seed: u32) -> Picture {
        let value = |i: u32, c: u32| (level + noise * 12.0_f64.sqrt() * (unit(&[seed, i, c]) - 0.5)) as f32;
        let pixels = (0..SIDE * SIDE).map(|i| [0, 1, 2].map(|c| value(i, c))).collect();
        Picture { rgb: RgbImage { width: SIDE, height: SIDE, pixels }, alpha: vec![1.0; (SIDE * SIDE) as usize] }
    }

    #[test]
    fn bias_and_noise_are_told_apart() {
        // The reference's own noise is as large as what is looked for.
        let reference = Halves::new([picture(0.5, 0.02, 1), picture(0.5, 0.02, 2)]).unwrap();
        assert!((reference.standard_error() / (0.02 / 2.0_f64.sqrt() / 0.5) - 1.0).abs() < 0.03);
        let pictures: Vec<RgbImage> = (3..7).map(|seed| picture(0.51, 0.01, seed).rgb).collect();
        let errors = reference.errors(&pictures, 0.0).unwrap();
        assert!((errors.noise.unwrap() / 0.02 - 1.0).abs() < 0.05, "{errors:?}");
        assert!((errors.bias / 0.02 - 1.0).abs() < 0.1, "{errors:?}");
        assert!((errors.mean / 0.02 - 1.0).abs() < 0.1, "{errors:?}");
        assert!((errors.rms / 0.02_f64.hypot(0.02) - 1.0).abs() < 0.05, "{errors:?}");
        assert!(errors.at_most > errors.rms && errors.at_most < 1.1 * errors.rms, "{errors:?}");
        // One picture alone cannot tell them apart.
        let one = reference.errors(&pictures[..1], 0.0).unwrap();
        assert!(one.noise.is_none() && (one.bias / one.rms - 1.0).abs() < 1e-9, "{one:?}");
        assert!(errors.flip > 0.0 && reference.errors(std::slice::from_ref(&reference.mean), 0.0).unwrap().flip == 0.0);
    }

    #[test]
    fn errors_are_below_what_they_may_be() {
        // A twentieth of the reference's noise: of few pixels the error is anything, and within two standard errors 95 times of 100.
        let of = |seed: u32| {
            let few = |mut picture: Picture| {
                picture.alpha[200..].fill(0.0);
                picture
            };
            let reference = Halves::new([1, 2].map(|half| few(picture(0.5, 0.05, 10 * seed + half)))).unwrap();
            let errors = reference.errors(&[picture(0.5, 0.005, 10 * seed + 3).rgb], 0.0).unwrap();
            let truth = 0.005 / reference.level;
            assert!(errors.at_most < 0.1, "{errors:?}");
            errors.at_most >= truth
        };
        let held = (0..200).filter(|&seed| of(seed)).count();
        assert!(held >= 190, "{held} of 200");
    }

    #[test]
    fn what_is_empty_does_not_count() {
        let mut halves = [picture(0.5, 0.0, 1), picture(0.5, 0.0, 2)];
        for half in &mut halves {
            half.alpha[100..].fill(0.0);
        }
        let reference = Halves::new(halves).unwrap();
        assert_eq!(reference.seen(), [100, 4096]);
        let mut other = picture(0.5, 0.0, 3).rgb;
        other.pixels[100..].fill([9.0; 3]);
        assert_eq!(reference.errors(&[other], 0.0).unwrap().max, 0.0);
        let black = picture(0.0, 0.0, 1);
        assert!(Halves::new([black.clone(), black]).is_none());
    }
}
