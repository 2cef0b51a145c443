//! The mean of passes, and what their differences tell of its error.

use glam::{DVec3, Vec3};

use super::film::{EMPTY_DEPTH, Film, Pixel};

/// Passes added up one after the other, in `f64`.
#[derive(Clone, Debug)]
pub struct Mean {
    passes: u32,
    first: Film,
    sums: Vec<Sum>,
    cost: Vec<f32>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    /// Mean of the beauty so far, and sum of the squares around it (Welford).
    beauty: DVec3,
    squares: DVec3,
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
        let mut mean = Self { passes: 0, first: film.clone(), sums, cost };
        mean.add(&film);
        mean
    }

    /// Adds a pass over the same window.
    pub fn add(&mut self, film: &Film) {
        self.passes += 1;
        let n = f64::from(self.passes);
        for (sum, pixel) in self.sums.iter_mut().zip(&film.pixels) {
            sum.add(pixel, n);
        }
        self.cost.iter_mut().zip(&film.cost).for_each(|(sum, cost)| *sum += cost);
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

    /// Variance of the beauty, mean over channels and the pixels in which something is seen; none of a single pass.
    #[must_use]
    pub fn variance(&self) -> Option<f64> {
        let n = f64::from(self.passes);
        let seen = self.sums.iter().filter(|sum| sum.alpha > 0.0);
        let (sum, count) = seen.fold((0.0, 0.0), |(sum, count), of| (sum + of.squares.element_sum(), count + 3.0_f64));
        (self.passes > 1).then(|| sum / (n * (n - 1.0)) / count.max(1.0))
    }

    /// The picture: of a single pass that pass itself, to the bit. With its standard error where there are two or more.
    #[must_use]
    pub fn film(self) -> Film {
        if self.passes < 2 {
            return self.first;
        }
        let n = f64::from(self.passes);
        let mut film = self.first;
        film.standard_error = self.sums.iter().map(|sum| sum.standard_error(n)).collect();
        film.pixels = self.sums.iter().map(|sum| sum.pixel(n)).collect();
        film.cost = self.cost;
        film
    }
}

impl Sum {
    fn add(&mut self, pixel: &Pixel, n: f64) {
        let beauty = pixel.beauty.as_dvec3();
        let before = beauty - self.beauty;
        self.beauty += before / n;
        self.squares += before * (beauty - self.beauty);
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

    fn standard_error(&self, n: f64) -> Vec3 {
        let variance = (self.squares / (n * (n - 1.0))).max(DVec3::ZERO);
        DVec3::new(variance.x.sqrt(), variance.y.sqrt(), variance.z.sqrt()).as_vec3()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fragment::PixelRect;

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
}
