//! Hot spots: parts of surfaces that reflect so much more light than the rest that rays which meet them by chance would speckle the picture, as
//! the ceiling above a lamp. Their radiance is split at a cap: what is below comes by gather rays, what is above also from samples of the photons that
//! arrive there, as from a light.
//!
//! What is below is a function of the place alone, min(1, cap / radiance) of the map's own radiance there. What is above both ways share by the balance
//! heuristic (Veach and Guibas 1995, "Optimally Combining Sampling Techniques for Monte Carlo Rendering"): samples alone would be without bound near a spot, as 1/d², gather
//! rays alone speckle far from it. The weights are functions of place, distance and angle and add up to 1, so that the parts together are the whole, however
//! good the map is. Power in W, radiance in W/(m² sr).

use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;

use super::{Irradiance, Photon};
use crate::hash::unit;
use crate::illumination::distribution::Distribution;
use crate::illumination::lights::Incident;
use crate::z_order::z_order;

/// The cap, in medians of the radiance over the surfaces' area.
const CONTRAST: f32 = 6.0;
/// Spots that reflect less of all reflected light are left to chance.
const WORTH: f32 = 0.01;
/// Gather rays per steradian for each sample of the spots: 64 faces a hemisphere and 16 samples. Near enough for others: it says how the light is shared,
/// not how much there is.
const RAYS: f32 = 0.6;
/// Half the side of the cube in which the order of places matters, in render units: the room around the hair.
const SPACE: f32 = 32.0;
/// Purpose of random numbers.
const HOT: u32 = 0x484F_5421;

/// The spots of a scene.
#[derive(Debug)]
pub struct HotSpots {
    cap: f32,
    photons: Vec<Hot>,
    by_power: Distribution,
    /// Their part of all reflected power.
    share: f32,
}

/// A photon in a spot.
#[derive(Clone, Copy, Debug)]
struct Hot {
    position: Vec3,
    normal: Vec3,
    /// What it reflects above the cap.
    power: Vec3,
    /// Chance that a sample is there, for each unit of area.
    density: f32,
}

fn brightness(color: Vec3) -> f32 {
    color.element_sum() / 3.0
}

/// The part of a place's light below the cap.
fn below(cap: f32, albedo: Vec3, irradiance: Vec3) -> f32 {
    let radiance = brightness(albedo * irradiance) / PI;
    if radiance > cap { cap / radiance } else { 1.0 }
}

/// What samples of spots count of a place's light above the cap, over the squared distance, and what gather rays do: `density` is the chance of a sample for each
/// unit of area, `cosine` that at the spot, above 0.
fn shares(density: f32, distance2: f32, cosine: f32) -> [f32; 2] {
    // n p d² / cos against the rays, both for each steradian; multiplied by cos / n, so that nothing is divided by 0 or grows without bound.
    let (by_sample, by_ray) = (density, RAYS * cosine);
    let all = by_sample * distance2 + by_ray;
    [by_sample / all, by_ray / all]
}

impl HotSpots {
    /// The spots in a scene's photons; none where there is nothing worth it. `known` is the map's irradiance at a photon.
    pub(super) fn find(photons: &[Photon], known: impl Fn(&Photon) -> Option<Irradiance> + Sync) -> Option<Self> {
        let known: Vec<Option<Irradiance>> = photons.par_iter().map(&known).collect();
        let radiance = |(photon, known): (&Photon, &Option<Irradiance>)| {
            known.map(|known| brightness(photon.albedo * known.total) / PI).filter(|radiance| *radiance > 0.0)
        };
        let mut all: Vec<f32> = photons.iter().zip(&known).filter_map(radiance).collect();
        all.sort_unstable_by(f32::total_cmp);
        // Photons are as dense as the irradiance: one over it is the area that each stands for.
        let area: f64 = all.iter().map(|radiance| 1.0 / f64::from(*radiance)).sum();
        let mut sum = 0.0;
        let median = all.iter().find(|radiance| {
            sum += 1.0 / f64::from(**radiance);
            sum >= 0.5 * area
        })?;
        let cap = CONTRAST * median;
        let mut hot = Vec::new();
        for (photon, known) in photons.iter().zip(&known) {
            let Some(known) = known else { continue };
            let above = 1.0 - below(cap, photon.albedo, known.total);
            if above > 0.0 {
                let (position, normal, power) = (photon.position, photon.normal, photon.albedo * photon.power * above);
                hot.push(Hot { position, normal, power, density: brightness(photon.albedo * known.total) * above });
            }
        }
        let total: f32 = photons.iter().map(|photon| brightness(photon.albedo * photon.power)).sum();
        let share = hot.iter().map(|hot| brightness(hot.power)).sum::<f32>() / total;
        // Of light that is not finite nothing is worth it either.
        if share.partial_cmp(&WORTH) != Some(std::cmp::Ordering::Greater) {
            return None;
        }
        // Strata of the running sum are then compact parts of the spots.
        hot.sort_by_cached_key(|hot| z_order(hot.position, SPACE));
        let by_power = Distribution::new(hot.iter().map(|hot| brightness(hot.power)));
        hot.iter_mut().for_each(|hot| hot.density /= by_power.total() as f32);
        Some(Self { cap, photons: hot, by_power, share })
    }

    /// What gather rays count of a place with this reflectance and irradiance of the map, at a distance and at the cosine of an angle to its normal.
    /// Not inlined: as [`Self::below`].
    #[inline(never)]
    pub fn by_rays(&self, albedo: Vec3, irradiance: Vec3, distance: f32, cosine: f32) -> f32 {
        let below = below(self.cap, albedo, irradiance);
        if below == 1.0 || cosine <= 0.0 {
            return below;
        }
        let density = brightness(albedo * irradiance) * (1.0 - below) / self.by_power.total() as f32;
        let [_, by_rays] = shares(density, distance * distance, cosine);
        below + (1.0 - below) * by_rays
    }

    /// What is below the cap of a place with this reflectance and irradiance of the map.
    /// Not inlined: without photons nothing of it is to run, not even ahead of the question whether there are any.
    #[inline(never)]
    pub fn below(&self, albedo: Vec3, irradiance: Vec3) -> f32 {
        below(self.cap, albedo, irradiance)
    }

    /// Samples that a point takes of them, `most` at the most: by their part of the light.
    pub fn samples(&self, most: u32) -> u32 {
        ((4.0 * self.share).min(1.0) * most as f32).ceil() as u32
    }

    /// Mean of the channels of the power that they reflect above the cap.
    pub(super) fn power(&self) -> f32 {
        self.by_power.total() as f32
    }

    /// A place in them, its unit normal, and the power that stands for all of them there; chosen by power with a uniform number in [0, 1).
    pub(super) fn choose(&self, u: f64) -> Option<(Vec3, Vec3, Vec3)> {
        let (index, _) = self.by_power.choose(u)?;
        let hot = &self.photons[index];
        Some((hot.position, hot.normal, hot.power * (self.by_power.total() as f32 / brightness(hot.power))))
    }

    /// Light from the spots at a point, above the cap and less what [`Self::by_rays`] counts, whether or not something is in the way: `count` stratified
    /// samples. Each `Incident::irradiance` is its share; `key` names the random numbers.
    pub fn light(&self, position: Vec3, count: u32, key: u32, mut take: impl FnMut(&Incident)) {
        for sample in 0..count {
            let u = (f64::from(sample) + unit(&[HOT, key, sample])) / f64::from(count);
            let Some((index, _)) = self.by_power.choose(u) else { return };
            let hot = &self.photons[index];
            let to_spot = hot.position - position;
            let distance2 = to_spot.length_squared();
            let distance = distance2.sqrt();
            let toward = to_spot / distance;
            let cosine = -toward.dot(hot.normal);
            // At the spot itself there is no direction, and the cosine no number.
            if cosine <= 0.0 || cosine.is_nan() {
                continue;
            }
            let stands_for = self.by_power.total() as f32 / (brightness(hot.power) * count as f32);
            let [by_samples, _] = shares(hot.density, distance2, cosine);
            let irradiance = hot.power * (stands_for * cosine * by_samples / PI);
            take(&Incident { toward, distance, irradiance });
        }
    }
}
