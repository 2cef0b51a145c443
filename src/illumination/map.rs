//! A picture of all directions, and the solid angles of its pixels.
//!
//! Directions are in the map's axes, y up. Solid angles in steradians, radiance in W/(m² sr).

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use crate::igloo::Igloo;

/// How a picture's pixels lie on the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Columns are longitudes, rows latitudes from the top: +Y at the top, +Z at the centre, +X at u = 1/4.
    LatLong,
    /// Debevec's light probes: +Z at the centre, the angle to it in proportion to the distance from the centre, -Z all along the
    /// circle that the square picture holds; +Y up, +X right (as a mirror ball shows it). What lies outside the circle is not used.
    Angular,
}

/// A picture of all directions; pixels finite and not negative, rows from the top.
#[derive(Clone, Debug)]
pub struct Map {
    pub mapping: Mapping,
    pub width: usize,
    pub height: usize,
    /// Shared: a large map is held once.
    pub pixels: Arc<Vec<Vec3>>,
}

impl Map {
    /// A map of `width * height` pixels; an angular one must be square.
    pub fn new(mapping: Mapping, width: usize, height: usize, pixels: Vec<Vec3>) -> Self {
        debug_assert!(pixels.len() == width * height && (mapping == Mapping::LatLong || width == height));
        Self { mapping, width, height, pixels: Arc::new(pixels) }
    }

    /// The same geometry with other pixels.
    pub fn with_pixels(&self, pixels: Vec<Vec3>) -> Self {
        Self::new(self.mapping, self.width, self.height, pixels)
    }

    /// Solid angle of a pixel; 0 outside an angular map's circle.
    pub fn solid_angle(&self, x: usize, y: usize) -> f32 {
        match self.mapping {
            Mapping::LatLong => row_solid_angle(y, self.height) / self.width as f32,
            Mapping::Angular => angular(x as f32 + 0.5, y as f32 + 0.5, self.width).map_or(0.0, |(_, weight)| weight),
        }
    }

    /// A direction in a pixel; uniform (`across`, `down`) in [0, 1)² make it uniform in solid angle, in an angular map nearly so.
    pub fn direction(&self, x: usize, y: usize, across: f32, down: f32) -> Vec3 {
        match self.mapping {
            Mapping::LatLong => {
                let edge = |k: usize| (PI * k as f32 / self.height as f32).cos();
                let cos = edge(y) + (edge(y + 1) - edge(y)) * down;
                let radius = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
                let (east, north) = longitude(x as f32 + across, self.width);
                Vec3::new(radius * east, cos, radius * north)
            }
            Mapping::Angular => {
                let middle = || angular(x as f32 + 0.5, y as f32 + 0.5, self.width);
                // A pixel that the circle cuts has its light where its middle is.
                let found = angular(x as f32 + across, y as f32 + down, self.width).or_else(middle);
                found.map_or(-Vec3::Z, |(direction, _)| direction)
            }
        }
    }

    /// Radiance from a unit direction, bilinear between pixels.
    pub fn lookup(&self, d: Vec3) -> Vec3 {
        match self.mapping {
            Mapping::LatLong => self.lookup_lat_long(d),
            Mapping::Angular => self.lookup_angular(d),
        }
    }

    /// Columns wrap round, rows end at the poles.
    fn lookup_lat_long(&self, d: Vec3) -> Vec3 {
        let (width, height) = (self.width, self.height);
        let turn = d.x.atan2(-d.z) / TAU;
        let u = (turn - turn.floor()) * width as f32 - 0.5;
        let v = d.y.clamp(-1.0, 1.0).acos() / PI * height as f32 - 0.5;
        let (left, top) = (u.floor(), v.floor());
        let (fu, fv) = (u - left, v - top);
        let column = |x: f32| (x as i64).rem_euclid(width as i64) as usize;
        let row = |y: f32| (y.max(0.0) as usize).min(height - 1);
        let at = |x: f32, y: f32| self.pixels[row(y) * width + column(x)];
        let upper = at(left, top).lerp(at(left + 1.0, top), fu);
        let lower = at(left, top + 1.0).lerp(at(left + 1.0, top + 1.0), fu);
        upper.lerp(lower, fv)
    }

    /// Pixels outside the circle do not count: the corners of a probe are black.
    fn lookup_angular(&self, d: Vec3) -> Vec3 {
        let size = self.width as f32;
        let across = d.x.hypot(d.y);
        // Straight ahead the angle over the distance from the axis is 1 / π.
        let scale = if across > 0.0 { across.atan2(d.z) / (PI * across) } else { 1.0 / PI };
        let (u, v) = (0.5 * size * (1.0 + d.x * scale) - 0.5, 0.5 * size * (1.0 - d.y * scale) - 0.5);
        let (left, top) = (u.floor(), v.floor());
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for (x, y) in [(left, top), (left + 1.0, top), (left, top + 1.0), (left + 1.0, top + 1.0)] {
            let inside = x >= 0.0 && y >= 0.0 && x < size && y < size;
            if inside && angular(x + 0.5, y + 0.5, self.width).is_some() {
                let weight = (1.0 - (u - x).abs()) * (1.0 - (v - y).abs()) + 1e-6;
                sum += self.pixels[y as usize * self.width + x as usize] * weight;
                weights += weight;
            }
        }
        if weights > 0.0 {
            return sum / weights;
        }
        // Straight behind, between the circle and the last pixels inside it: a pixel and a half towards the centre there are some.
        let inwards = 1.0 - 3.0 / size;
        let pixel = |z: f32| ((0.5 * size * (1.0 + z * inwards)).max(0.0) as usize).min(self.width - 1);
        self.pixels[pixel(-d.y * scale) * self.width + pixel(d.x * scale)]
    }

    /// Mean radiance over each face of an igloo, `from_map` turning the map's axes to the igloo's: sums over pixels, or parts of them.
    pub fn averages(&self, igloo: &Igloo, from_map: Mat3) -> Vec<Vec3> {
        // A pixel wider than an eighth of a face is taken in parts, so that its energy is not all in one face.
        let pixel = TAU / self.width.min(2 * self.height) as f32;
        let parts = (8.0 * pixel / igloo.face_width()).ceil().clamp(1.0, 64.0) as usize;
        // Bands of rows of a fixed size: the order of the sums must not depend on the number of threads.
        let band = self.height.div_ceil(16);
        let bands: Vec<usize> = (0..self.height).step_by(band).collect();
        let sums: Vec<Vec<Vec3>> = bands
            .par_iter()
            .map(|&first| {
                let mut sums = vec![Vec3::ZERO; igloo.len()];
                for row in first * parts..(first + band).min(self.height) * parts {
                    let pixels = &self.pixels[row / parts * self.width..][..self.width];
                    self.row_parts(row, parts, |column, direction, weight| {
                        sums[igloo.face_of(from_map * direction)] += pixels[column] * weight;
                    });
                }
                sums
            })
            .collect();
        // Energy over the face's true solid angle: a lamp keeps its energy whichever faces share it.
        let scale = 1.0 / igloo.face_solid_angle();
        (0..igloo.len()).map(|face| sums.iter().map(|band| band[face]).sum::<Vec3>() * scale).collect()
    }

    /// Column, direction and solid angle of the parts of a row, each pixel cut in `parts` both ways; `row` counts rows of parts.
    fn row_parts(&self, row: usize, parts: usize, mut take: impl FnMut(usize, Vec3, f32)) {
        let columns = self.width * parts;
        match self.mapping {
            Mapping::LatLong => {
                let (sin, cos) = (PI * (row as f32 + 0.5) / (self.height * parts) as f32).sin_cos();
                let weight = row_solid_angle(row, self.height * parts) / columns as f32;
                for column in 0..columns {
                    let (east, north) = longitude(column as f32 + 0.5, columns);
                    take(column / parts, Vec3::new(sin * east, cos, sin * north), weight);
                }
            }
            Mapping::Angular => {
                for column in 0..columns {
                    if let Some((direction, weight)) = angular(column as f32 + 0.5, row as f32 + 0.5, columns) {
                        take(column / parts, direction, weight);
                    }
                }
            }
        }
    }
}

/// Solid angle of a whole row of a lat-long map, 2π (cos θ_0 - cos θ_1) without cancellation.
fn row_solid_angle(row: usize, rows: usize) -> f32 {
    let half = 0.5 * PI / rows as f32;
    2.0 * TAU * (PI * (row as f32 + 0.5) / rows as f32).sin() * half.sin()
}

/// x and z at a column of a lat-long map, pixels counted from the left edge: u = 1/4 is +X, u = 1/2 is +Z.
fn longitude(x: f32, columns: usize) -> (f32, f32) {
    let (sin, cos) = (TAU * x / columns as f32).sin_cos();
    (sin, -cos)
}

/// Direction at a place of an angular map, in pixels from its upper left corner, and the solid angle of a pixel there: with θ = π r
/// the angle to the centre's direction, dω = sin θ dθ dφ = (2π/size)² sin θ / θ. None outside the circle.
fn angular(x: f32, y: f32, size: usize) -> Option<(Vec3, f32)> {
    let (u, v) = (2.0 * x / size as f32 - 1.0, 1.0 - 2.0 * y / size as f32);
    let r = u.hypot(v);
    if r > 1.0 {
        return None;
    }
    let (sin, cos) = (PI * r).sin_cos();
    let sinc = if r > 1e-4 { sin.max(0.0) / (PI * r) } else { 1.0 };
    let pixel = TAU / size as f32;
    Some((Vec3::new(u * PI * sinc, v * PI * sinc, cos), pixel * pixel * sinc))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::igloo::Span;

    fn ones(mapping: Mapping, width: usize, height: usize) -> Map {
        Map::new(mapping, width, height, vec![Vec3::ONE; width * height])
    }

    #[test]
    fn pixels_fill_the_sphere() {
        // An angular map's squares do not fill its circle exactly; what is missing lies where pixels have next to no solid angle.
        for (map, bound) in [
            (ones(Mapping::LatLong, 64, 32), 1e-5),
            (ones(Mapping::Angular, 32, 32), 4e-3),
            (ones(Mapping::Angular, 128, 128), 3e-4),
            (ones(Mapping::Angular, 512, 512), 3e-5),
        ] {
            let all = (0..map.width * map.height).map(|i| f64::from(map.solid_angle(i % map.width, i / map.width)));
            let error = all.sum::<f64>() / (4.0 * std::f64::consts::PI) - 1.0;
            assert!(error.abs() < bound, "{:?} {}: {error}", map.mapping, map.width);
        }
    }

    #[test]
    fn a_pixel_is_found_where_its_direction_points() {
        for (mapping, width, height) in [(Mapping::LatLong, 16, 8), (Mapping::Angular, 16, 16)] {
            for pixel in 0..width * height {
                let (x, y) = (pixel % width, pixel / width);
                let mut pixels = vec![Vec3::ZERO; width * height];
                pixels[pixel] = Vec3::ONE;
                let map = Map::new(mapping, width, height, pixels);
                if map.solid_angle(x, y) == 0.0 {
                    continue;
                }
                let middle = map.direction(x, y, 0.5, 0.5);
                assert!((middle.length() - 1.0).abs() < 1e-5);
                // The middle by area of a polar row is nearer to its neighbour than the middle of its rows.
                assert!(map.lookup(middle).x > 0.75, "{mapping:?} {x},{y}: {}", map.lookup(middle));
            }
        }
    }

    #[test]
    fn an_angular_map_looks_ahead_at_its_centre_and_back_at_its_rim() {
        let map = ones(Mapping::Angular, 64, 64);
        assert!(map.direction(32, 32, 0.0, 0.0).distance(Vec3::Z) < 1e-6);
        assert!(map.direction(48, 32, 0.0, 0.0).distance(Vec3::X) < 1e-5);
        assert!(map.direction(32, 16, 0.0, 0.0).distance(Vec3::Y) < 1e-5);
        // All of the sphere has a value, also straight behind: the black corners are not blended in.
        for i in 0..10_000 {
            let key = |axis| crate::hash::to_unit(crate::hash::hash(&[i, axis]));
            let igloo = Igloo::new(Span::Sphere, 1);
            let d = igloo.direction(i as usize % 2, key(0), key(1));
            assert!((map.lookup(d).x - 1.0).abs() < 1e-5, "{d}");
        }
        assert!(map.lookup(-Vec3::Z).x > 0.99 && map.lookup(Vec3::new(1e-4, 1e-4, -1.0).normalize()).x > 0.99);
    }

    #[test]
    fn averages_of_an_even_map_are_even() {
        for map in [ones(Mapping::LatLong, 64, 32), ones(Mapping::Angular, 64, 64)] {
            let igloo = Igloo::new(Span::Sphere, 36);
            for mean in map.averages(&igloo, Mat3::IDENTITY) {
                // Parts of pixels are an eighth of a face wide and go wholly to one face.
                assert!((mean.x - 1.0).abs() < 0.08, "{:?}: {mean}", map.mapping);
            }
        }
    }
}
