//! Which effects a scene calls for. Found before anything is computed; what is off is not built, held or entered.

use serde::Serialize;

use crate::scene::description::{EffectName, IndirectMode, Layer, OcclusionMode, Shadows};
use crate::scene::{HairShading, Scene};

/// One effect, and why it is on or off.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Effect {
    pub name: &'static str,
    pub on: bool,
    pub reason: String,
}

/// The plan for a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effects {
    /// There is hair.
    pub hair: bool,
    /// There are surfaces, or area lights, that block light and are seen.
    pub surfaces: bool,
    /// Light comes from the environment.
    pub environment: bool,
    /// The environment map has small bright sources, lit as lights of their own.
    pub small_sources: bool,
    /// Light comes from area lights.
    pub area_lights: bool,
    /// Light comes from point, spot or directional lights.
    pub direct_lights: bool,
    /// Some of these have ray-traced shadows.
    pub raytraced_shadows: bool,
    /// Some have deep shadow maps of hair.
    pub deep_maps: bool,
    /// Some have plain shadow maps of hair.
    pub shadow_maps: bool,
    /// Surfaces reflect light on hair and on each other.
    pub reflection: bool,
    /// More than one reflection counts: a photon map.
    pub photons: bool,
    /// Surfaces are mirrors or of glass.
    pub specular: bool,
    /// Light falls on them: photons aimed at them.
    pub caustics: bool,
    /// Γ by projection: a tree over the segments.
    pub projected_occlusion: bool,
    /// Γ by rays.
    pub raytraced_occlusion: bool,
    /// Settings of Γ are found on the scene, for its accuracy.
    pub calibration: bool,
    /// Rays through hair for anything: a curve BVH.
    pub hair_rays: bool,
    /// Hair reflects by Kajiya and Kay.
    pub kajiya_kay: bool,
    /// Such hair has a highlight.
    pub highlight: bool,
    /// Hair reflects as a fibre does: tables of its lobes.
    pub marschner: bool,
    /// Light without hair occlusion is wanted as a layer of its own.
    pub unoccluded_layer: bool,
}

impl Effects {
    /// The effects that a scene calls for.
    pub fn of(scene: &Scene) -> Self {
        let description = scene.description();
        let hair = !scene.hair.is_empty();
        let surfaces = !scene.surfaces.is_empty();
        let environment = !scene.radiance.is_black();
        let small_sources = scene.sources.is_some();
        let area_lights = !scene.area.is_empty();
        let direct_lights = !scene.direct.is_empty();
        let shadowed_by = |mode| scene.shadows.iter().any(|shadows| shadows.mode == mode);
        let raytraced_shadows = shadowed_by(Shadows::Raytraced) && (hair || surfaces);
        let reflection = description.indirect.mode != IndirectMode::None
            && surfaces
            && (environment || area_lights || direct_lights)
            && scene.surfaces.reflects();
        let specular = scene.surfaces.is_specular();
        let caustics = specular
            && description.indirect.mode != IndirectMode::None
            && description.indirect.caustic_photons > 0
            && (direct_lights
                || area_lights
                || small_sources
                || reflection && description.indirect.mode == IndirectMode::Photons);
        let incident = environment || area_lights || reflection;
        let mode = description.occlusion.mode;
        let occluded = hair && incident && mode != OcclusionMode::None;
        let raytraced_occlusion = occluded && mode != OcclusionMode::Igloo;
        let calibration = occluded && description.occlusion.wants_calibration();
        let shaded =
            |wanted: fn(&HairShading) -> bool| hair && scene.hair_objects.iter().any(|object| wanted(&object.shading));
        Self {
            hair,
            surfaces,
            environment,
            small_sources,
            area_lights,
            direct_lights,
            raytraced_shadows,
            deep_maps: hair && shadowed_by(Shadows::DeepMap),
            shadow_maps: hair && shadowed_by(Shadows::Map),
            reflection,
            photons: reflection && description.indirect.mode == IndirectMode::Photons,
            specular,
            caustics,
            projected_occlusion: occluded && mode != OcclusionMode::Raytraced,
            raytraced_occlusion,
            calibration,
            hair_rays: hair
                && (raytraced_occlusion
                    || calibration
                    || raytraced_shadows
                    || specular
                    || (reflection || area_lights || small_sources) && mode != OcclusionMode::None),
            kajiya_kay: shaded(|shading| matches!(shading, HairShading::KajiyaKay { .. })),
            highlight: shaded(
                |shading| matches!(shading, HairShading::KajiyaKay { specular, .. } if *specular != glam::Vec3::ZERO),
            ),
            marschner: shaded(|shading| matches!(shading, HairShading::Marschner { .. })),
            unoccluded_layer: description.output.layers.contains(&Layer::EnvironmentUnoccluded),
        }
    }

    /// The plan in words, for a scene from which the effects of `without` are left out.
    pub fn list(&self, without: &[EffectName]) -> Vec<Effect> {
        let say_of = |key: Option<EffectName>, name, on, because: &str, lacking: &str| {
            let left_out = key.is_some_and(|key| without.contains(&key));
            let reason = match (on, left_out) {
                (true, _) => because,
                (false, true) => "left out: effects.without names it",
                (false, false) => lacking,
            };
            Effect { name, on, reason: reason.to_owned() }
        };
        let say = |name, on, because, lacking| say_of(None, name, on, because, lacking);
        let can_go = |key, name, on, because, lacking| say_of(Some(key), name, on, because, lacking);
        vec![
            can_go(EffectName::Hair, "hair", self.hair, "the scene has hair", "the scene has no hair"),
            can_go(
                EffectName::Surfaces,
                "surfaces",
                self.surfaces,
                "the scene has surfaces",
                "the scene has no visible surface",
            ),
            can_go(
                EffectName::Environment,
                "environment",
                self.environment,
                "the environment shines",
                "the environment is black",
            ),
            can_go(
                EffectName::SmallBrightSources,
                "small bright sources",
                self.small_sources,
                "the environment map has spots that the igloo's faces would blur too much",
                "no environment map, no spot in it that is worth it, or environment.sources is none",
            ),
            can_go(
                EffectName::AreaLights,
                "area lights",
                self.area_lights,
                "the scene has area lights",
                "the scene has no area light",
            ),
            can_go(
                EffectName::PointAndDirectionalLights,
                "point, spot and directional lights",
                self.direct_lights,
                "the scene has such lights",
                "the scene has no such light",
            ),
            say(
                "ray-traced shadows",
                self.raytraced_shadows,
                "a light's shadows are raytraced, and there is hair or a surface",
                "no light's shadows are raytraced, or there is nothing to cast them",
            ),
            say(
                "deep shadow maps",
                self.deep_maps,
                "a light's shadows are deep-map, and there is hair",
                "no light's shadows are deep-map, or there is no hair",
            ),
            say(
                "shadow maps",
                self.shadow_maps,
                "a light's shadows are map, and there is hair",
                "no light's shadows are map, or there is no hair",
            ),
            can_go(
                EffectName::LightReflectedBySurfaces,
                "light reflected by surfaces",
                self.reflection,
                "lit surfaces reflect light",
                "no lit surface reflects light, or indirect.mode is none",
            ),
            can_go(
                EffectName::MoreThanOneReflection,
                "more than one reflection",
                self.photons,
                "indirect.mode is photons and lit surfaces reflect light",
                "no lit surface reflects light, or another indirect.mode",
            ),
            say(
                "mirrors and glass",
                self.specular,
                "a surface has material = \"mirror\" or \"glass\"",
                "no surface has a mirror or glass material",
            ),
            can_go(
                EffectName::Caustics,
                "caustics",
                self.caustics,
                "light falls on mirrors or glass",
                if self.specular {
                    "no light falls on mirrors or glass, indirect.mode is none, or indirect.caustic_photons is 0"
                } else {
                    "no surface has a mirror or glass material"
                },
            ),
            can_go(
                EffectName::HairOcclusion,
                "hair occlusion by projection",
                self.projected_occlusion,
                "occlusion.mode is igloo or auto and light arrives from all around",
                "no hair, no light from around, or another occlusion.mode",
            ),
            can_go(
                EffectName::HairOcclusion,
                "hair occlusion by rays",
                self.raytraced_occlusion,
                "occlusion.mode is raytraced or auto and light arrives from all around",
                "no hair, no light from around, or another occlusion.mode",
            ),
            say(
                "settings by accuracy",
                self.calibration,
                "occlusion.accuracy decides how finely hair occlusion is found",
                "no hair occlusion, or occlusion.opening, thinning, projection or rays says how finely",
            ),
            say(
                "rays through hair",
                self.hair_rays,
                "lights, reflecting surfaces, mirrors, ray-traced occlusion or its accuracy need them",
                "nothing needs them",
            ),
            say(
                "scattering by Kajiya and Kay",
                self.kajiya_kay,
                "hair has shading = \"kajiya-kay\", the default",
                "no hair has shading = \"kajiya-kay\"",
            ),
            can_go(
                EffectName::Highlight,
                "highlight",
                self.highlight,
                "hair has a specular colour",
                "no hair of shading = \"kajiya-kay\" has a specular colour",
            ),
            say(
                "scattering by Marschner",
                self.marschner,
                "hair has shading = \"marschner\": light that it reflects and refracts as a fibre",
                "no hair has shading = \"marschner\"",
            ),
            say(
                "unoccluded layer",
                self.unoccluded_layer,
                "output.layers asks for it",
                "output.layers does not ask for it",
            ),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_says_so_and_nothing_else_does() {
        // Nothing is on: an empty scene's plan.
        let none = Effects {
            hair: false,
            surfaces: false,
            environment: false,
            small_sources: false,
            area_lights: false,
            direct_lights: false,
            raytraced_shadows: false,
            deep_maps: false,
            shadow_maps: false,
            reflection: false,
            photons: false,
            specular: false,
            caustics: false,
            projected_occlusion: false,
            raytraced_occlusion: false,
            calibration: false,
            hair_rays: false,
            kajiya_kay: false,
            highlight: false,
            marschner: false,
            unoccluded_layer: false,
        };
        let left_out = |without: &[EffectName]| {
            let list = none.list(without).into_iter();
            list.filter(|effect| effect.reason.contains("effects.without"))
                .map(|effect| effect.name)
                .collect::<Vec<_>>()
        };
        assert!(left_out(&[]).is_empty());
        assert_eq!(left_out(&[EffectName::PointAndDirectionalLights]), ["point, spot and directional lights"]);
        assert_eq!(left_out(&[EffectName::HairOcclusion]), ["hair occlusion by projection", "hair occlusion by rays"]);
        assert_eq!(left_out(&[EffectName::Hair]), ["hair"]);
        let on = Effects { hair: true, ..none };
        assert!(!on.list(&[EffectName::Hair])[0].reason.contains("without"));
    }
}
