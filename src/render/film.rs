//! The film: what each pixel of the rendered window has gathered.

use glam::Vec3;

use crate::fragment::PixelRect;

/// Depth where nothing is seen.
pub const EMPTY_DEPTH: f32 = 1e30;

/// One pixel. Colours are premultiplied by coverage; linear Rec.709.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    pub beauty: Vec3,
    pub direct: Vec3,
    pub environment: Vec3,
    pub unoccluded: Vec3,
    pub alpha: f32,
    /// Mean of Γ over what is seen; 1 where nothing is.
    pub occlusion: f32,
    /// Mean depth of what is seen, in scene units.
    pub depth: f32,
    /// Mean normal of the surfaces seen, of unit length, or zero.
    pub normal: Vec3,
    /// Mean tangent of the hair seen, of unit length, or zero.
    pub tangent: Vec3,
}

impl Pixel {
    pub(super) fn is_finite(&self) -> bool {
        let vectors = [self.beauty, self.direct, self.environment, self.unoccluded, self.normal, self.tangent];
        vectors.iter().all(|v| v.is_finite()) && [self.alpha, self.occlusion, self.depth].iter().all(|v| v.is_finite())
    }

    fn mean(pixels: &[Self]) -> Self {
        let weight = 1.0 / pixels.len().max(1) as f32;
        let vector = |get: fn(&Self) -> Vec3| pixels.iter().map(get).sum::<Vec3>() * weight;
        let number = |get: fn(&Self) -> f32| pixels.iter().map(get).sum::<f32>() * weight;
        Self {
            beauty: vector(|p| p.beauty),
            direct: vector(|p| p.direct),
            environment: vector(|p| p.environment),
            unoccluded: vector(|p| p.unoccluded),
            alpha: number(|p| p.alpha),
            occlusion: number(|p| p.occlusion),
            depth: number(|p| p.depth),
            normal: vector(|p| p.normal).normalize_or_zero(),
            tangent: vector(|p| p.tangent).normalize_or_zero(),
        }
    }
}

/// The pixels of a window of the picture, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    pub window: PixelRect,
    /// Width and height of the whole picture.
    pub full_size: [u32; 2],
    pub pixels: Vec<Pixel>,
    /// Standard error of each pixel's beauty; empty unless there were passes to tell it from.
    pub standard_error: Vec<Vec3>,
    /// CPU time of each pixel, in microseconds; empty unless it was wanted.
    pub cost: Vec<f32>,
}

impl Film {
    /// A black film.
    pub fn new(window: PixelRect, full_size: [u32; 2]) -> Self {
        let count = (window.max[0] - window.min[0]) as usize * (window.max[1] - window.min[1]) as usize;
        Self { window, full_size, pixels: vec![Pixel::default(); count], standard_error: Vec::new(), cost: Vec::new() }
    }

    /// Width of the window, in pixels.
    pub fn width(&self) -> usize {
        (self.window.max[0] - self.window.min[0]) as usize
    }

    /// Height of the window, in pixels.
    pub fn height(&self) -> usize {
        (self.window.max[1] - self.window.min[1]) as usize
    }

    /// Standard error of a pixel's beauty; zero where it is not known.
    pub fn error_of(&self, pixel: usize) -> Vec3 {
        self.standard_error.get(pixel).copied().unwrap_or_default()
    }

    fn index(&self, x: u32, y: u32) -> usize {
        self.window.index([x, y])
    }

    /// Puts a tile's pixels, row by row, in their place.
    pub fn place(&mut self, tile: &PixelRect, pixels: &[Pixel]) {
        let width = (tile.max[0] - tile.min[0]) as usize;
        for (row, y) in (tile.min[1]..tile.max[1]).enumerate() {
            let start = self.index(tile.min[0], y);
            self.pixels[start..start + width].copy_from_slice(&pixels[row * width..(row + 1) * width]);
        }
    }

    /// The same for what a tile's pixels cost; nothing where they were not timed.
    pub fn place_cost(&mut self, tile: &PixelRect, cost: &[f32]) {
        if cost.is_empty() {
            return;
        }
        self.cost.resize(self.pixels.len(), 0.0);
        let width = (tile.max[0] - tile.min[0]) as usize;
        for (row, y) in (tile.min[1]..tile.max[1]).enumerate() {
            let start = self.index(tile.min[0], y);
            self.cost[start..start + width].copy_from_slice(&cost[row * width..(row + 1) * width]);
        }
    }

    /// Replaces the marked pixels (column and row in the whole picture), and any that are not finite, by the mean of their
    /// unmarked neighbours; by black if there are none. Returns how many were replaced.
    pub fn mend(&mut self, marked: &[[u32; 2]]) -> usize {
        let mut bad: Vec<bool> = self.pixels.iter().map(|pixel| !pixel.is_finite()).collect();
        for &[x, y] in marked {
            bad[self.index(x, y)] = true;
        }
        let before = self.pixels.clone();
        let (width, height) = (self.width() as i64, self.height() as i64);
        for (i, _) in bad.iter().enumerate().filter(|(_, bad)| **bad) {
            let (x, y) = (i as i64 % width, i as i64 / width);
            let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy)));
            let inside = around.filter(|&(x, y)| (0..width).contains(&x) && (0..height).contains(&y));
            let sound = inside.map(|(x, y)| (y * width + x) as usize).filter(|&j| !bad[j]);
            let neighbours: Vec<Pixel> = sound.map(|j| before[j]).collect();
            self.pixels[i] = if neighbours.is_empty() { Pixel::default() } else { Pixel::mean(&neighbours) };
        }
        bad.iter().filter(|bad| **bad).count()
    }

    /// Mean of the beauty over the window.
    pub fn mean_beauty(&self) -> Vec3 {
        let sum = self.pixels.iter().fold(glam::DVec3::ZERO, |sum, pixel| sum + pixel.beauty.as_dvec3());
        (sum / self.pixels.len().max(1) as f64).as_vec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film() -> Film {
        let mut film = Film::new(PixelRect { min: [10, 20], max: [14, 23] }, [100, 100]);
        for (i, pixel) in film.pixels.iter_mut().enumerate() {
            pixel.beauty = Vec3::splat(i as f32);
        }
        film
    }

    #[test]
    fn a_tile_lands_in_its_place() {
        let mut film = film();
        let tile = PixelRect { min: [12, 21], max: [14, 23] };
        film.place(&tile, &[Pixel { alpha: 1.0, ..Pixel::default() }; 4]);
        let set: Vec<usize> = (0..12).filter(|&i| film.pixels[i].alpha == 1.0).collect();
        assert_eq!(set, [6, 7, 10, 11]);
    }

    #[test]
    fn bad_pixels_become_their_neighbours_mean() {
        let mut film = film();
        film.pixels[5].beauty.x = f32::NAN;
        film.pixels[0].beauty = Vec3::splat(1e9);
        assert_eq!(film.mend(&[[10, 20]]), 2);
        // Of the eight neighbours of pixel 5, pixel 0 is marked itself.
        let want = [1, 2, 4, 6, 8, 9, 10].iter().sum::<i32>() as f32 / 7.0;
        assert!((film.pixels[5].beauty.x - want).abs() < 1e-5);
        assert_eq!(film.pixels[0].beauty, Vec3::splat((1 + 4) as f32 / 2.0));
        assert_eq!(film.mend(&[]), 0);
    }
}
