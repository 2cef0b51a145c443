//! The cross-check of deep shadow maps: what they say is left of a lamp's light, against rays through the same hair.
//!
//! A map is filtered, a ray is not: at one point a ray through opaque hair is 0 or 1. So what is compared is the mean of rays spread over the
//! pixels that the map weights at the point, from the point's own depth to the lamp, with the weights of the map. A map's values may
//! differ from it by the light's `map_error` and by what its pixels take as independent; the mean over points says whether a picture is too bright or too dark.

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::report::Verdict;
use super::statistics::{Sample, Summary};
use crate::hair::HairModel;
use crate::hash::{hash, to_unit};
use crate::illumination::DirectLight;
use crate::occlusion::HairRays;
use crate::occlusion::raytraced::Ray;
use crate::render::progress::Progress;
use crate::render::{HairShadow, Lighting, Place, ShadingPoint};
use crate::shadow::{DeepMap, Point};

/// Purpose of random numbers.
const SPREAD: u32 = 0x5350_5244;

/// Strata along a pixel's side, in each of which each half has one ray.
const STRATA: u32 = 6;

/// The RMS difference that is allowed, in accuracies of the mean: at few points of opaque hair a sound map is far off, .05 RMS at the most on
/// all hair that was measured, where its mean is within .01.
const FEW: f64 = 5.0;

/// A light's deep shadow map, held against rays.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Shadow {
    /// The light's key in the scene file.
    pub light: String,
    /// Rays through each pixel of the map that counts at a point.
    pub rays: u32,
    /// Points on hair, and on surfaces, that the light may reach; none where there are none.
    pub hair: Option<Summary>,
    pub surface: Option<Summary>,
}

impl Shadow {
    /// Whether the mean difference is within an accuracy, and the RMS difference within five times it, on hair and on surfaces.
    pub fn verdict(&self, accuracy: f64) -> Verdict {
        let kinds = [&self.hair, &self.surface].into_iter().flatten();
        Verdict::worst(kinds.map(|Summary { mean, rms, .. }| {
            let [Some(low), Some(high), Some(least), Some(most)] = [mean.low, mean.high, rms.low, rms.high] else {
                return Verdict::Undecided;
            };
            if low > accuracy || high < -accuracy || least > FEW * accuracy {
                Verdict::Exceeded
            } else if low >= -accuracy && high <= accuracy && most <= FEW * accuracy {
                Verdict::Held
            } else {
                Verdict::Undecided
            }
        }))
    }
}

/// All deep shadow maps of a scene at some points; none if the work was cancelled.
pub(super) fn shadows(
    lighting: &Lighting<'_>,
    rays: &HairRays,
    points: &[ShadingPoint],
    progress: &dyn Progress,
) -> Option<Vec<Shadow>> {
    let scene = lighting.scene();
    let all = lighting.hair_shadows();
    let mut found = Vec::new();
    for (index, (lamp, shadows)) in scene.direct.iter().zip(&scene.shadows).enumerate() {
        let maps = [&all.on_hair[index], &all.on_surfaces[index]];
        let [hair, surface] = [true, false].map(|on_hair| {
            let HairShadow::Deep(map) = &**maps[usize::from(!on_hair)] else { return Some(Vec::new()) };
            let bench = Bench { map, rays, model: &scene.hair, light: &lamp.light };
            let here = points.par_iter().filter(|point| matches!(point.place, Place::Hair { .. }) == on_hair);
            let samples = here.map(|point| (!progress.cancelled()).then(|| bench.sample(point)));
            samples.collect::<Option<Vec<_>>>().map(|samples| samples.into_iter().flatten().collect())
        });
        let (hair, surface): (Vec<Sample>, Vec<Sample>) = (hair?, surface?);
        if hair.is_empty() && surface.is_empty() {
            continue;
        }
        found.push(Shadow {
            light: shadows.key.clone(),
            rays: 2 * STRATA * STRATA,
            hair: Summary::of(&hair),
            surface: Summary::of(&surface),
        });
    }
    Some(found)
}

/// A map and what it is held against.
struct Bench<'a> {
    map: &'a DeepMap,
    rays: &'a HairRays,
    model: &'a HairModel,
    light: &'a DirectLight,
}

impl Bench<'_> {
    /// The map's value and the rays'; none where the light does not shine or nothing may be before it.
    fn sample(&self, point: &ShadingPoint) -> Option<Sample> {
        let position = point.receiver.position;
        self.light.incident(position)?;
        let at = Point { position, on: point.receiver.on };
        let reference = self.spread(position, &at, point.key)?;
        Some(Sample { value: f64::from(self.map.transmittance(self.model, &at)), reference })
    }

    /// Means over rays spread as the map weights its pixels, two of them, independent.
    fn spread(&self, position: Vec3, at: &Point, key: u32) -> Option<[f64; 2]> {
        let through = |origin: Vec3| {
            // Beyond a spot's cone next to a point inside it: as the map, which knows no cone.
            let (direction, far) = match *self.light {
                DirectLight::Point { position, .. } | DirectLight::Spot { position, .. } => {
                    ((position - origin).normalize(), position.distance(origin))
                }
                DirectLight::Directional { toward, .. } => (toward, f32::INFINITY),
            };
            f64::from(self.rays.transmittance(self.model, &Ray { origin, direction, far, on: at.on }, 0.0))
        };
        let half = |half| {
            let jitter = |pixel, stratum, axis| to_unit(hash(&[SPREAD, key, half, pixel, stratum, axis])).into();
            let places = self.map.footing(position, STRATA, jitter)?;
            Some(places.iter().map(|place| place.weight * through(place.origin)).sum())
        };
        Some([half(0)?, half(1)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shadow(mean: f64) -> Shadow {
        let samples: Vec<Sample> =
            (0..200).map(|i| Sample { value: 0.5 + mean + 1e-4 * f64::from(i % 2), reference: [0.5, 0.5] }).collect();
        Shadow { light: "light.point[0]".to_owned(), rays: 72, hair: Summary::of(&samples), surface: None }
    }

    #[test]
    fn a_map_is_judged_by_its_mean_to_both_sides() {
        assert_eq!(shadow(0.004).verdict(0.01), Verdict::Held);
        assert_eq!(shadow(0.02).verdict(0.01), Verdict::Exceeded);
        assert_eq!(shadow(-0.02).verdict(0.01), Verdict::Exceeded);
        assert_eq!(shadow(0.00995).verdict(0.01), Verdict::Undecided);
        // Right in the mean, but nowhere else.
        let samples: Vec<Sample> =
            (0..200).map(|i| Sample { value: if i % 2 == 0 { 0.4 } else { 0.6 }, reference: [0.5, 0.5] }).collect();
        assert_eq!(Shadow { hair: Summary::of(&samples), ..shadow(0.0) }.verdict(0.01), Verdict::Exceeded);
        let nothing = Shadow { hair: None, ..shadow(0.0) };
        assert_eq!(nothing.verdict(0.01), Verdict::Nothing);
    }
}
