//! Effects that the user leaves out of a scene, whatever it calls for: `effects.without`.
//!
//! What an effect comes from is taken out of the loaded scene, before anything is derived from it. So nothing of an effect that is left out can be
//! built, held or entered.

use glam::Vec3;

use super::description::{EffectName, IndirectMode, OcclusionMode};
use super::{HairShading, Scene};
use crate::hair::HairModel;
use crate::illumination::Radiance;
use crate::surface::SurfaceModel;

impl Scene {
    /// Takes out what the scene file's `effects.without` names.
    pub(super) fn leave_out(&mut self) {
        for effect in self.description().effects.without.clone() {
            self.leave_out_one(effect);
        }
    }

    fn leave_out_one(&mut self, effect: EffectName) {
        let description = &mut self.document.description;
        match effect {
            EffectName::Hair => self.hair = HairModel::default(),
            EffectName::Surfaces => self.surfaces = SurfaceModel::default(),
            EffectName::Environment => {
                self.radiance = Radiance::Uniform(Vec3::ZERO);
                self.sources = None;
            }
            EffectName::SmallBrightSources => self.sources = None,
            EffectName::AreaLights => self.area.clear(),
            EffectName::PointAndDirectionalLights => {
                self.direct.clear();
                self.shadows.clear();
            }
            EffectName::LightReflectedBySurfaces => description.indirect.mode = IndirectMode::None,
            EffectName::MoreThanOneReflection => {
                if description.indirect.mode == IndirectMode::Photons {
                    description.indirect.mode = IndirectMode::SingleBounce;
                }
            }
            EffectName::Caustics => description.indirect.caustic_photons = 0,
            EffectName::HairOcclusion => description.occlusion.mode = OcclusionMode::None,
            EffectName::Highlight => {
                for object in &mut self.hair_objects {
                    if let HairShading::KajiyaKay { specular, .. } = &mut object.shading {
                        *specular = Vec3::ZERO;
                    }
                }
            }
        }
    }
}
