//! Small bright sources of an environment map: taken out of it and lit as lights of their own, with their true extent.
//!
//! A face average cannot say where in the face a lamp is, so its light would go through the Γ̄ of the whole face. Γ in one direction
//! differs from Γ̄ by less than 1: a source with the share s of the map's light that is smaller than a face can err by s of the light at most. One
//! that fills a faces errs less, as the errors of its parts are independent: by s / √a. Sources are taken, worst first, until those left would err
//! by less than `WORTH` together (root of the sum of squares: their errors are independent), at most `MOST`.
//!
//! Energies are irradiances on a surface that faces the source, W/m²; solid angles in steradians.

use glam::Vec3;

use super::Map;
use super::distribution::Distribution;
use crate::hash::{hash, to_unit};
use crate::z_order::z_order_2d;

/// What sources left in the map may err by, as a share of its light, if Γ were as far from its mean over the face as it can be.
const WORTH: f64 = 0.03;

/// Sources at the most: each costs every shading point a ray or more.
const MOST: usize = 16;

/// A source is brighter than this many times the mean of the map, all that is brighter than that counted as no brighter.
const CONTRAST: f64 = 4.0;

/// A source that fills more faces is not small: the faces resolve it.
const LARGEST: f64 = 16.0;

/// Purposes of random numbers.
const PLACE: u32 = 0x534D_414C;

/// What is found in a map.
#[derive(Clone, Debug)]
pub struct Sources {
    /// The map without what the sources took.
    pub rest: Map,
    pub list: Vec<Source>,
}

/// One source: the part of connected pixels that is above the threshold.
#[derive(Clone, Debug)]
pub struct Source {
    /// Pixels in Z-order, so that neighbours in the list are neighbours in the picture.
    pixels: Vec<(u32, Vec3)>,
    by_energy: Distribution,
    /// Irradiance on a surface that faces it.
    pub energy: Vec3,
    /// Share of the map's light.
    pub share: f64,
    pub solid_angle: f64,
    /// Its middle, in the map's axes.
    pub direction: Vec3,
}

/// The mean of the three channels: no lamp of a pure colour is overlooked.
fn brightness(color: Vec3) -> f32 {
    color.element_sum() / 3.0
}

/// A connected part of the map above the threshold.
struct Blob {
    pixels: Vec<u32>,
    /// Above the threshold.
    energy: f64,
    solid_angle: f64,
}

impl Blob {
    /// What leaving it in could err by, as in the file's head.
    fn error(&self, all: f64, face: f64) -> f64 {
        self.energy / all * (face / self.solid_angle).sqrt().min(1.0)
    }
}

impl Sources {
    /// The sources of a map that igloos of `faces` faces a hemisphere would blur; none where none is worth it.
    pub fn find(map: &Map, faces: u32) -> Option<Self> {
        let (threshold, all) = threshold(map)?;
        let face = std::f64::consts::TAU / f64::from(faces.max(1));
        let mut blobs = blobs(map, threshold, LARGEST * face);
        blobs.sort_by(|a, b| b.error(all, face).total_cmp(&a.error(all, face)).then(a.pixels[0].cmp(&b.pixels[0])));
        let mut left: f64 = blobs.iter().map(|blob| blob.error(all, face).powi(2)).sum();
        let mut taken = Vec::new();
        for blob in blobs {
            if left.sqrt() < WORTH || taken.len() == MOST {
                break;
            }
            left -= blob.error(all, face).powi(2);
            taken.push(blob);
        }
        if taken.is_empty() {
            return None;
        }
        let mut pixels = map.pixels.to_vec();
        let list = taken.into_iter().map(|blob| Source::new(map, blob, threshold, all, &mut pixels)).collect();
        Some(Self { rest: map.with_pixels(pixels), list })
    }

    /// Share of the map's light in all sources.
    pub fn share(&self) -> f64 {
        self.list.iter().map(|source| source.share).sum()
    }
}

impl Source {
    /// Takes what is above the threshold out of the pixels.
    fn new(map: &Map, blob: Blob, threshold: f32, all: f64, pixels: &mut [Vec3]) -> Self {
        let mut places = blob.pixels;
        let order = |pixel: u32| z_order_2d(pixel % map.width as u32, pixel / map.width as u32);
        places.sort_unstable_by_key(|&pixel| order(pixel));
        let (mut energy, mut direction) = (Vec3::ZERO, Vec3::ZERO);
        let mut list = Vec::with_capacity(places.len());
        let mut weights = Vec::with_capacity(places.len());
        for place in places {
            let (x, y) = (place as usize % map.width, place as usize / map.width);
            let whole = pixels[place as usize];
            let rest = whole * (threshold / brightness(whole)).min(1.0);
            let excess = (whole - rest).max(Vec3::ZERO);
            pixels[place as usize] = rest;
            let solid_angle = map.solid_angle(x, y);
            let weight = brightness(excess) * solid_angle;
            energy += excess * solid_angle;
            direction += map.direction(x, y, 0.5, 0.5) * weight;
            list.push((place, excess));
            weights.push(weight);
        }
        Self {
            pixels: list,
            by_energy: Distribution::new(weights.into_iter()),
            energy,
            share: blob.energy / all,
            solid_angle: blob.solid_angle,
            direction: direction.normalize_or(Vec3::Y),
        }
    }

    /// A direction of the source, chosen by its brightness, in the map's axes, and the energy that stands for the whole source there:
    /// the mean over `u` is exactly the source. Strata of `u` in [0, 1) are compact parts of the source; `key` places it in a pixel.
    pub fn sample(&self, map: &Map, u: f64, key: u32) -> Option<(Vec3, Vec3)> {
        let (index, _) = self.by_energy.choose(u)?;
        let (place, excess) = self.pixels[index];
        let jitter = |axis| to_unit(hash(&[PLACE, key, axis]));
        let direction = map.direction(place as usize % map.width, place as usize / map.width, jitter(0), jitter(1));
        // Colour over brightness, times the energy of all in brightness: the pixel's chance cancels its solid angle.
        Some((direction, excess * (self.by_energy.total() as f32 / brightness(excess))))
    }

    /// How many samples it gets, `most` at the most: the noise of a sum is least if each part has samples in proportion to its share
    /// and its spread, here its width in faces.
    pub fn samples(&self, face_width: f32, most: u32) -> u32 {
        let width = (self.solid_angle.sqrt() / f64::from(face_width)).min(1.0);
        ((f64::from(most) * self.share * width).ceil() as u32).clamp(1, most.max(1))
    }

    /// Angle from its middle within which it lies, roughly: the radius of a disc of its size.
    pub fn radius(&self) -> f32 {
        (self.solid_angle / std::f64::consts::PI).sqrt() as f32
    }
}

/// Chooses one of the sources for a surface with this normal (map axes) by what it may send there; gives it and its chance.
pub fn choose_one(list: &[Source], normal: Vec3, u: f64) -> Option<(&Source, f32)> {
    let worth = |source: &Source| {
        // As high as its upper edge may stand: no part that shines on the surface has a chance of zero.
        let upper = source.direction.dot(normal) + 2.0 * source.radius().min(1.0);
        brightness(source.energy) * upper.clamp(0.0, 1.0)
    };
    let by_worth = Distribution::new(list.iter().map(worth));
    let (index, _) = by_worth.choose(u)?;
    Some((&list[index], (f64::from(worth(&list[index])) / by_worth.total()) as f32))
}

/// The brightness above which sources stand out, and the energy of the whole map in brightness; none for a black or even map.
///
/// It is `CONTRAST` times the mean of min(brightness, threshold): the lamps do not raise it. Found on a histogram in f64.
fn threshold(map: &Map) -> Option<(f32, f64)> {
    const BINS: usize = 4096;
    // Twenty-four bins an octave over 2^-100 to 2^70.
    let bin = |b: f32| ((b.log2() + 100.0) * 24.0).clamp(0.0, (BINS - 1) as f32) as usize;
    let mut bins = vec![(0.0_f64, 0.0_f64); BINS];
    let mut brightest = 0.0_f32;
    for (index, &pixel) in map.pixels.iter().enumerate() {
        let b = brightness(pixel);
        if b > 0.0 {
            let solid_angle = f64::from(map.solid_angle(index % map.width, index / map.width));
            let bin = &mut bins[bin(b)];
            bin.0 += solid_angle;
            bin.1 += solid_angle * f64::from(b);
            brightest = brightest.max(if solid_angle > 0.0 { b } else { 0.0 });
        }
    }
    let all: f64 = bins.iter().map(|bin| bin.1).sum();
    let sphere = 4.0 * std::f64::consts::PI;
    let mut threshold = CONTRAST * all / sphere;
    // From above: each step is smaller than the one before, and stops at the highest threshold that holds itself.
    for _ in 0..200 {
        let clamped: f64 = bins.iter().map(|&(solid_angle, energy)| energy.min(solid_angle * threshold)).sum();
        let next = CONTRAST * clamped / sphere;
        let done = next > threshold * 0.9999;
        threshold = next;
        if done {
            break;
        }
    }
    let threshold = threshold as f32;
    (threshold.is_normal() && brightest > threshold).then_some((threshold, all))
}

/// The connected parts above the threshold, those of more than `largest` steradians left out. Pixels that touch at a corner are connected;
/// a lat-long map's sides are.
fn blobs(map: &Map, threshold: f32, largest: f64) -> Vec<Blob> {
    let (width, height) = (map.width as i64, map.height as i64);
    let mut open: Vec<bool> = map.pixels.iter().map(|&pixel| brightness(pixel) > threshold).collect();
    let mut found = Vec::new();
    let mut stack = Vec::new();
    for start in 0..open.len() {
        if !open[start] {
            continue;
        }
        open[start] = false;
        stack.push(start);
        let mut blob = Blob { pixels: Vec::new(), energy: 0.0, solid_angle: 0.0 };
        while let Some(index) = stack.pop() {
            let (x, y) = (index % map.width, index / map.width);
            let solid_angle = f64::from(map.solid_angle(x, y));
            blob.solid_angle += solid_angle;
            blob.energy += solid_angle * f64::from(brightness(map.pixels[index]) - threshold);
            if blob.solid_angle <= largest && solid_angle > 0.0 {
                blob.pixels.push(index as u32);
            }
            for (dx, dy) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
                let (mut nx, ny) = (x as i64 + dx, y as i64 + dy);
                if map.mapping == super::Mapping::LatLong {
                    nx = nx.rem_euclid(width);
                }
                if (0..width).contains(&nx) && (0..height).contains(&ny) {
                    let neighbour = (ny * width + nx) as usize;
                    if std::mem::take(&mut open[neighbour]) {
                        stack.push(neighbour);
                    }
                }
            }
        }
        if blob.solid_angle <= largest && !blob.pixels.is_empty() {
            found.push(blob);
        }
    }
    found
}

#[cfg(test)]
pub(super) mod tests;
