//! What rays see in mirrors and glass: from surface to surface, each time one way, until something else is met.

use glam::Vec3;

use super::Illumination;
use crate::hash::{hash, to_unit};
use crate::surface::SurfacePoint;

/// Purposes of random numbers.
const WAY: u32 = 0x5741_5920;
const MET: u32 = 0x4D45_5420;

/// What a ray sees in a mirror or through glass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Radiance, hair on the first leg left out.
    pub radiance: Vec3,
    /// Share of the ray that was still under way when it had met the most surfaces that it may.
    pub cut: f32,
}

impl Illumination {
    /// Radiance that comes back along a ray of unit direction from the mirror or glass that it met: what surfaces reflect, hot spots up to their cap,
    /// and the sky without its small bright sources. All other light reaches a point by way of mirrors and glass as caustics. At most `depth` of such surfaces are met, the
    /// first counted.
    pub fn seen_in(
        &self,
        first: &SurfacePoint,
        direction: Vec3,
        depth: u32,
        key: u32,
        hair: &impl Fn(Vec3, Vec3, f32) -> f32,
    ) -> Seen {
        let (Some(surfaces), mut hit, mut direction) = (&self.surfaces, *first, direction) else {
            return Seen::default();
        };
        let (mut weight, mut length) = (Vec3::ONE, first.distance);
        for met in 0..depth {
            let Some(optics) = hit.optics else { break };
            let way = optics.ways(&hit, direction).choose(to_unit(hash(&[WAY, key, met])));
            weight *= way.share * way.squeeze;
            if weight == Vec3::ZERO {
                return Seen::default();
            }
            direction = way.direction;
            let Some(next) = surfaces.closest(way.origin, direction, 0.0, f32::INFINITY) else {
                let left = hair(way.origin, direction, f32::INFINITY);
                return Seen { radiance: weight * self.environment.radiance_of_rest(direction) * left, cut: 0.0 };
            };
            weight *= hair(way.origin, direction, next.distance);
            length += next.distance;
            hit = next;
        }
        if let Some(optics) = hit.optics {
            let cut = weight.element_sum() / 3.0 * optics.density(hit.outside);
            return Seen { radiance: Vec3::ZERO, cut };
        }
        // How far the light has come says how finely the photons must tell it.
        hit.distance = length;
        Seen { radiance: weight * self.reflected_in_mirror(&hit, hash(&[MET, key]), hair), cut: 0.0 }
    }
}
