//! Effects that the user leaves out of a scene, whatever it calls for: `effects.without`.
//!
//! What an effect comes from is taken out of the loaded scene, before anything is derived from it. So nothing of an effect that is left out can be
//! built, held or entered.

use glam::Vec3;

use super::description::{EffectName, IndirectMode, Layer, OcclusionMode, Shadows};
use super::{HairShading, Scene};
use crate::hair::HairModel;
use crate::illumination::{DirectLight, Radiance};
use crate::surface::SurfaceModel;

impl Scene {
    /// Takes out what the scene file's `effects.without` names.
    pub(super) fn leave_out(&mut self) {
        for &effect in self.description().effects.without.clone().iter().flat_map(EffectName::parts) {
            self.leave_out_one(effect);
        }
    }

    fn leave_out_one(&mut self, effect: EffectName) {
        let description = &mut self.document.description;
        let (mode, indirect) = (&mut description.occlusion.mode, &mut description.indirect.mode);
        match effect {
            EffectName::Hair => self.hair = HairModel::default(),
            EffectName::Surfaces => self.surfaces = SurfaceModel::default(),
            EffectName::Environment => {
                self.radiance = Radiance::Uniform(Vec3::ZERO);
                self.sources = None;
            }
            EffectName::SmallBrightSources => self.sources = None,
            EffectName::AreaLights => self.area.clear(),
            EffectName::PointLights => self.keep_lamps(|light| !matches!(light, DirectLight::Point { .. })),
            EffectName::SpotLights => self.keep_lamps(|light| !matches!(light, DirectLight::Spot { .. })),
            EffectName::DirectionalLights => self.keep_lamps(|light| !matches!(light, DirectLight::Directional { .. })),
            EffectName::RayTracedShadows => {
                for (lamp, shadows) in self.direct.iter_mut().zip(&mut self.shadows) {
                    if shadows.mode == Shadows::Raytraced {
                        (lamp.blocked, shadows.mode) = (false, Shadows::None);
                    }
                }
            }
            EffectName::DeepShadowMaps => self.no_hair_shadows(Shadows::DeepMap),
            EffectName::ShadowMaps => self.no_hair_shadows(Shadows::Map),
            EffectName::LightReflectedBySurfaces => *indirect = IndirectMode::None,
            EffectName::MoreThanOneReflection if *indirect == IndirectMode::Photons => {
                *indirect = IndirectMode::SingleBounce;
            }
            EffectName::HairOcclusionByProjection => {
                *mode = match *mode {
                    OcclusionMode::Igloo => OcclusionMode::None,
                    OcclusionMode::Auto => OcclusionMode::Raytraced,
                    other => other,
                }
            }
            EffectName::HairOcclusionByRays => {
                *mode = match *mode {
                    OcclusionMode::Raytraced => OcclusionMode::None,
                    OcclusionMode::Auto => OcclusionMode::Igloo,
                    other => other,
                }
            }
            EffectName::Highlight => {
                for object in &mut self.hair_objects {
                    if let HairShading::KajiyaKay { specular, .. } = &mut object.shading {
                        *specular = Vec3::ZERO;
                    }
                }
            }
            EffectName::ColorVariation => self.hair.mean_colors(),
            EffectName::UnoccludedLayer => {
                let layers = &mut description.output.layers;
                layers.retain(|layer| *layer != Layer::EnvironmentUnoccluded);
                if layers.is_empty() {
                    layers.push(Layer::Beauty);
                }
            }
            // Shadows on one kind of thing are not in the scene: the plan has them. Of the rest, groups are taken apart and what follows
            // from others is refused.
            _ => {}
        }
    }

    fn keep_lamps(&mut self, keep: impl Fn(&DirectLight) -> bool) {
        let kept: Vec<bool> = self.direct.iter().map(|lamp| keep(&lamp.light)).collect();
        let (mut lamps, mut shadows) = (kept.iter(), kept.iter());
        self.direct.retain(|_| lamps.next() == Some(&true));
        self.shadows.retain(|_| shadows.next() == Some(&true));
    }

    /// Hair lets all light of the lamps with this mode through; surfaces do not.
    fn no_hair_shadows(&mut self, mode: Shadows) {
        self.shadows.iter_mut().filter(|shadows| shadows.mode == mode).for_each(|s| s.mode = Shadows::None);
    }
}
