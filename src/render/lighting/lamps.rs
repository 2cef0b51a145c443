//! Light of point, spot and directional lights.

use glam::Vec3;

use super::{Lighting, Lit, Workspace};
use crate::effects::ABSENT;
use crate::illumination::DirectLight;
use crate::illumination::lights::Incident;
use crate::render::clock::{Lap, Part};
use crate::render::shadows::HairShadow;
use crate::shadow::Point;
use crate::surface::SurfacePoint;
use crate::tally::{self, Work};

impl Lighting<'_> {
    /// What lights without extent would send to a point on a surface if nothing were in the way, the mean of the channels: W/m².
    pub(in crate::render) fn light_of_lamps(&self, point: &SurfacePoint) -> f32 {
        if ABSENT || !self.effects.lamps() {
            return 0.0;
        }
        let position = point.leaving();
        let incident = self.light.direct.iter().filter_map(|lamp| lamp.light.incident(position));
        incident.map(|i| i.irradiance.element_sum() / 3.0 * i.toward.dot(point.normal).max(0.0)).sum()
    }

    /// Lights without extent: through surfaces by a ray each, through hair as each of them asks for.
    /// Rays to them leave from `origin(direction)`.
    pub(super) fn direct(
        &self,
        point: &Point,
        space: &mut Workspace,
        origin: impl Fn(Vec3) -> Vec3,
        reflect: impl Fn(Vec3) -> Vec3,
        lit: &mut Lit,
    ) {
        if ABSENT || !self.effects.lamps() {
            return;
        }
        let mut lap = Lap::start();
        let position = point.position;
        let (shadows, by_hair, asked) = match point.on {
            Some(_) => (&self.shadows.on_hair, Part::HairShadowsOnHair, Work::HairShadowsOnHair),
            None => (&self.shadows.on_surfaces, Part::HairShadowsOnSurfaces, Work::HairShadowsOnSurfaces),
        };
        for (lamp, shadow) in self.light.direct.iter().zip(shadows) {
            let (part, work) = kind(&lamp.light);
            tally::add(work, 1);
            let seen = lamp.light.incident(position).and_then(|incident| {
                let Incident { toward, distance, irradiance } = incident;
                let reflected = reflect(toward) * irradiance;
                let hidden =
                    reflected == Vec3::ZERO || lamp.blocked && !self.light.sees(origin(toward), toward, distance);
                (!hidden).then_some((toward, distance, reflected))
            });
            lap.ends(part, &mut space.clock);
            let Some((toward, distance, reflected)) = seen else { continue };
            if matches!(**shadow, HairShadow::Free) {
                lit.direct += reflected;
                continue;
            }
            tally::add(asked, 1);
            let rays = || self.through_hair(position, toward, distance, point.on);
            lit.direct += reflected * shadow.transmittance(&self.scene.hair, point, rays);
            lap.ends(by_hair, &mut space.clock);
        }
    }
}

/// What the time and the samples of a light count as.
fn kind(light: &DirectLight) -> (Part, Work) {
    match light {
        DirectLight::Point { .. } => (Part::PointLights, Work::PointLight),
        DirectLight::Spot { .. } => (Part::SpotLights, Work::SpotLight),
        DirectLight::Directional { .. } => (Part::DirectionalLights, Work::DirectionalLight),
    }
}
