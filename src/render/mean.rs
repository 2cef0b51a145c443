//! The mean of passes, and what their differences tell of its error.

use glam::{DVec3, Vec3};

use super::film::{EMPTY_DEPTH, Film, Pixel};
use super::pass::Pass;
use crate::fragment::PixelRect;

/// Passes added up one after the other, in `f64`.
#[derive(Clone, Debug)]
pub struct Mean {
    passes: u32,
    first: Film,
    sums: Vec<Sum>,
    /// Means of the beauty over the passes of each stream, pixel by pixel.
    streams: Vec<[Vec3; STREAMS]>,
    cost: Vec<f32>,
}

const STREAMS: usize = Pass::STREAMS as usize;

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    /// Mean of the beauty so far.
    beauty: DVec3,
    direct: DVec3,
    environment: DVec3,
    unoccluded: DVec3,
    normal: DVec3,
    tangent: DVec3,
    alpha: f64,
    /// Over the passes that saw something.
    occlusion: f64,
    depth: f64,
    seen: u32,
}

impl Mean {
    /// Of one pass.
    #[must_use]
    pub fn new(film: Film) -> Self {
        let (sums, cost) = (vec![Sum::default(); film.pixels.len()], vec![0.0; film.cost.len()]);
        let streams = vec![[Vec3::ZERO; STREAMS]; film.pixels.len()];
        let mut mean = Self { passes: 0, first: film.clone(), sums, streams, cost };
        mean.add(&film);
        mean
    }

    /// Adds a pass over the same window: the next one by number ([`Pass::of`]).
    pub fn add(&mut self, film: &Film) {
        self.add_pixels(&film.pixels);
        self.cost.iter_mut().zip(&film.cost).for_each(|(sum, cost)| *sum += cost);
    }

    /// The same without what they cost.
    pub fn add_pixels(&mut self, pixels: &[Pixel]) {
        let (stream, before) = (self.passes as usize % STREAMS, self.passes as usize / STREAMS);
        self.passes += 1;
        let n = f64::from(self.passes);
        for ((sum, means), pixel) in self.sums.iter_mut().zip(&mut self.streams).zip(pixels) {
            sum.add(pixel, n);
            means[stream] += (pixel.beauty - means[stream]) / (before + 1) as f32;
        }
    }

    /// The same passes at these pixels alone, counted along the rows of the window, as a row of them.
    #[must_use]
    pub fn at(&self, pixels: &[usize]) -> Self {
        let size = [pixels.len() as u32, 1];
        let mut first = Film::new(PixelRect { min: [0, 0], max: size }, size);
        first.pixels = pixels.iter().map(|&pixel| self.first.pixels[pixel]).collect();
        let sums = pixels.iter().map(|&pixel| self.sums[pixel]).collect();
        let streams = pixels.iter().map(|&pixel| self.streams[pixel]).collect();
        Self { passes: self.passes, first, sums, streams, cost: Vec::new() }
    }

    /// How many passes there are.
    #[must_use]
    pub fn passes(&self) -> u32 {
        self.passes
    }

    /// The mean of the beauty at a pixel, counted along the rows of the window.
    #[must_use]
    pub fn beauty(&self, pixel: usize) -> Vec3 {
        self.sums[pixel].beauty.as_vec3()
    }

    /// Pixels in which something is seen.
    pub fn seen(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.sums.len()).filter(|&pixel| self.sums[pixel].alpha > 0.0)
    }

    /// Variance of the beauty, mean over channels and the pixels in which something is seen; none of a single pass.
    #[must_use]
    pub fn variance(&self) -> Option<f64> {
        let of = |pixel| self.variance_of(pixel).element_sum();
        let (sum, count) = self.seen().fold((0.0, 0.0), |(sum, count), pixel| (sum + of(pixel), count + 3.0_f64));
        (self.passes > 1).then(|| sum / count.max(1.0))
    }

    /// Variance of a pixel's mean, of two or more passes.
    ///
    /// Passes of a stream go hand in hand, so their own spread says nothing: the streams' means, which are independent, tell it. With one's share w of the
    /// passes it is Σ w (m - mean)² / (streams - 1), which is right whatever the shares if passes are independent, and for equal shares if they are not.
    #[must_use]
    pub fn variance_of(&self, pixel: usize) -> DVec3 {
        let (n, streams) = (self.passes, self.passes.min(Pass::STREAMS));
        let squares = (0..streams).map(|stream| {
            let share = f64::from((n - stream).div_ceil(Pass::STREAMS)) / f64::from(n);
            let off = self.streams[pixel][stream as usize].as_dvec3() - self.sums[pixel].beauty;
            share * off * off
        });
        squares.sum::<DVec3>() / (f64::from(streams) - 1.0).max(1.0)
    }

    /// The mean of that over the channels; 0 of a single pass, which does not tell it.
    #[must_use]
    pub fn noise_of(&self, pixel: usize) -> f64 {
        self.variance_of(pixel).element_sum() / 3.0
    }

    /// The picture: of a single pass that pass itself, to the bit. With its standard error where there are two or more.
    #[must_use]
    pub fn film(self) -> Film {
        if self.passes < 2 {
            return self.first;
        }
        let n = f64::from(self.passes);
        let standard_error = (0..self.sums.len()).map(|pixel| root(self.variance_of(pixel))).collect();
        let pixels = self.sums.iter().map(|sum| sum.pixel(n)).collect();
        Film { standard_error, pixels, cost: self.cost, ..self.first }
    }
}

impl Sum {
    fn add(&mut self, pixel: &Pixel, n: f64) {
        let beauty = pixel.beauty.as_dvec3();
        self.beauty += (beauty - self.beauty) / n;
        for (sum, value) in [
            (&mut self.direct, pixel.direct),
            (&mut self.environment, pixel.environment),
            (&mut self.unoccluded, pixel.unoccluded),
            (&mut self.normal, pixel.normal),
            (&mut self.tangent, pixel.tangent),
        ] {
            *sum += value.as_dvec3();
        }
        self.alpha += f64::from(pixel.alpha);
        if pixel.depth < EMPTY_DEPTH {
            self.occlusion += f64::from(pixel.occlusion);
            self.depth += f64::from(pixel.depth);
            self.seen += 1;
        }
    }

    fn pixel(&self, n: f64) -> Pixel {
        let seen = f64::from(self.seen.max(1));
        let anything = self.seen > 0;
        Pixel {
            beauty: self.beauty.as_vec3(),
            direct: (self.direct / n).as_vec3(),
            environment: (self.environment / n).as_vec3(),
            unoccluded: (self.unoccluded / n).as_vec3(),
            alpha: (self.alpha / n) as f32,
            occlusion: if anything { (self.occlusion / seen) as f32 } else { 1.0 },
            depth: if anything { (self.depth / seen) as f32 } else { EMPTY_DEPTH },
            normal: self.normal.normalize_or_zero().as_vec3(),
            tangent: self.tangent.normalize_or_zero().as_vec3(),
        }
    }
}

fn root(v: DVec3) -> Vec3 {
    DVec3::new(v.x.sqrt(), v.y.sqrt(), v.z.sqrt()).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(values: &[f32]) -> Film {
        let mut film = Film::new(PixelRect { min: [0, 0], max: [values.len() as u32, 1] }, [values.len() as u32, 1]);
        for (pixel, &value) in film.pixels.iter_mut().zip(values) {
            let depth = if value > 0.0 { value } else { EMPTY_DEPTH };
            *pixel = Pixel { beauty: Vec3::splat(value), alpha: value, depth, occlusion: value, ..Pixel::default() };
        }
        film
    }

    #[test]
    fn a_single_pass_is_kept_to_the_bit() {
        let one = film(&[0.1, 0.7, 0.0]);
        assert_eq!(Mean::new(one.clone()).film(), one);
    }

    #[test]
    fn the_mean_and_its_standard_error_are_those_of_the_textbook() {
        let mut mean = Mean::new(film(&[1.0, 0.0]));
        for values in [[2.0, 0.0], [3.0, 0.0], [6.0, 4.0]] {
            mean.add(&film(&values));
        }
        let film = mean.film();
        // 1, 2, 3, 6: mean 3, sample variance 14/3, of the mean of four 14/12.
        assert_eq!(film.pixels[0].beauty, Vec3::splat(3.0));
        assert!((film.error_of(0).x - (14.0_f32 / 12.0).sqrt()).abs() < 1e-6);
        // Seen by one pass of four: the depth is that of what was seen, the coverage is of all.
        assert_eq!((film.pixels[1].depth, film.pixels[1].alpha), (4.0, 1.0));
    }

    #[test]
    fn passes_go_on_at_some_pixels_alone() {
        let passes = [[1.0, 5.0, 0.5], [2.0, 1.0, 0.25], [4.0, 0.0, 3.0]];
        let mut whole = Mean::new(film(&passes[0]));
        whole.add(&film(&passes[1]));
        let mut some = whole.at(&[2, 0]);
        whole.add(&film(&passes[2]));
        some.add_pixels(&[2, 0].map(|pixel| film(&passes[2]).pixels[pixel]));
        assert_eq!(some.passes(), 3);
        for (place, pixel) in [2, 0].into_iter().enumerate() {
            assert_eq!(some.beauty(place), whole.beauty(pixel));
            assert_eq!(some.variance_of(place), whole.variance_of(pixel));
        }
    }

    #[test]
    fn what_streams_agree_on_is_no_error() {
        // Each stream sees 0 and 2 in turn: passes differ, means of streams do not. Of six passes two streams have two, two have one.
        let mut mean = Mean::new(film(&[0.0]));
        for value in [0.0, 0.0, 0.0, 2.0, 2.0, 2.0, 2.0] {
            mean.add(&film(&[value]));
        }
        assert_eq!((mean.beauty(0).x, mean.variance()), (1.0, Some(0.0)));
        let mut mean = Mean::new(film(&[1.0]));
        for value in [2.0, 3.0, 6.0, 3.0, 0.0] {
            mean.add(&film(&[value]));
        }
        // Means 2, 1, 3, 6 with shares of a third, a third, a sixth, a sixth: 2.5; squares .25, 2.25, .25, 12.25.
        let variance = (0.25 / 3.0 + 2.25 / 3.0 + 0.25 / 6.0 + 12.25 / 6.0) / 3.0;
        assert!((mean.variance().unwrap() - variance).abs() < 1e-6 && mean.beauty(0).x == 2.5);
    }
}
