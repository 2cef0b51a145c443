//! Which effects a scene calls for, and which run. Found before anything is computed; what is off is not built, held or entered.
//!
//! An effect that is forced on (`effects.with`) runs over what there is, or over nothing, and what comes of it is not counted: it changes no pixel.

use std::fmt;

use serde::Serialize;

use crate::hair::Colors;
use crate::illumination::DirectLight;
use crate::scene::description::{EffectChoice, EffectName, IndirectMode, Layer, OcclusionMode, Shadows};
use crate::scene::{HairShading, Scene};

/// Whether all but hair and the environment is compiled out of the work on pixels: the feature `absent`.
pub const ABSENT: bool = cfg!(feature = "absent");

/// One effect, and why it is on or off.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Effect {
    /// What `effects.with` and `effects.without` call it.
    pub key: EffectName,
    pub name: &'static str,
    pub on: bool,
    /// Whether it is on although the scene does not call for it.
    pub forced: bool,
    /// Whether the user leaves it out.
    pub left_out: bool,
    pub reason: String,
}

/// The plan for a scene; by default nothing is on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
    /// Light comes from point lights,
    pub point_lights: bool,
    /// from spot lights,
    pub spot_lights: bool,
    /// from directional lights.
    pub directional_lights: bool,
    /// Some of these have ray-traced shadows.
    pub raytraced_shadows: bool,
    /// Some have deep shadow maps of hair.
    pub deep_maps: bool,
    /// Some have plain shadow maps of hair.
    pub shadow_maps: bool,
    /// Hair dims the light of such lights on hair.
    pub hair_shadows_on_hair: bool,
    /// And on surfaces.
    pub hair_shadows_on_surfaces: bool,
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
    /// Hair has colours that vary.
    pub color_variation: bool,
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
        let lit_by = |wanted: fn(&DirectLight) -> bool| scene.direct.iter().any(|lamp| wanted(&lamp.light));
        let shadowed_by = |mode| scene.shadows.iter().any(|shadows| shadows.mode == mode);
        let hair_shadows = |name| {
            let left_out = description.effects.without.iter().any(|without| without.parts().contains(&name));
            hair && !left_out && scene.shadows.iter().any(|shadows| shadows.mode != Shadows::None)
        };
        let hair_shadows_on_hair = hair_shadows(EffectName::HairShadowsOnHair);
        let hair_shadows_on_surfaces =
            hair_shadows(EffectName::HairShadowsOnSurfaces) && surfaces && scene.surfaces.reflects();
        let hair_shadows = hair_shadows_on_hair || hair_shadows_on_surfaces;
        let raytraced_shadows = shadowed_by(Shadows::Raytraced) && (hair || surfaces);
        let reflection = description.indirect.mode != IndirectMode::None
            && surfaces
            && (environment || area_lights || !scene.direct.is_empty())
            && scene.surfaces.reflects();
        let specular = scene.surfaces.is_specular();
        let caustics = specular
            && description.indirect.mode != IndirectMode::None
            && description.indirect.caustic_photons > 0
            && (!scene.direct.is_empty()
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
            point_lights: lit_by(|light| matches!(light, DirectLight::Point { .. })),
            spot_lights: lit_by(|light| matches!(light, DirectLight::Spot { .. })),
            directional_lights: lit_by(|light| matches!(light, DirectLight::Directional { .. })),
            raytraced_shadows,
            deep_maps: hair_shadows && shadowed_by(Shadows::DeepMap),
            shadow_maps: hair_shadows && shadowed_by(Shadows::Map),
            hair_shadows_on_hair,
            hair_shadows_on_surfaces,
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
                    || hair_shadows && shadowed_by(Shadows::Raytraced)
                    || specular
                    || (reflection || area_lights || small_sources) && mode != OcclusionMode::None),
            kajiya_kay: shaded(|shading| matches!(shading, HairShading::KajiyaKay { .. })),
            highlight: shaded(
                |shading| matches!(shading, HairShading::KajiyaKay { specular, .. } if *specular != glam::Vec3::ZERO),
            ),
            marschner: shaded(|shading| matches!(shading, HairShading::Marschner { .. })),
            color_variation: hair && matches!(scene.hair.color, Colors::PerPoint(_)),
            unoccluded_layer: description.output.layers.contains(&Layer::EnvironmentUnoccluded),
        }
    }

    /// Whether light comes from lights without extent.
    pub fn lamps(&self) -> bool {
        self.point_lights || self.spot_lights || self.directional_lights
    }

    /// What runs where these effects are forced on.
    #[must_use]
    pub fn with(mut self, forced: &[EffectName]) -> Self {
        for &name in forced.iter().flat_map(EffectName::parts) {
            if let Some(on) = self.flag(name) {
                *on = true;
            }
            // Nothing of theirs could run without.
            let by_rays = matches!(
                name,
                EffectName::SettingsByAccuracy | EffectName::HairOcclusionByRays | EffectName::RayTracedShadows
            );
            self.hair_rays |= by_rays && self.hair;
        }
        self
    }

    /// Where it is noted whether an effect is on; none for groups.
    fn flag(&mut self, name: EffectName) -> Option<&mut bool> {
        Some(match name {
            EffectName::Hair => &mut self.hair,
            EffectName::Surfaces => &mut self.surfaces,
            EffectName::Environment => &mut self.environment,
            EffectName::SmallBrightSources => &mut self.small_sources,
            EffectName::AreaLights => &mut self.area_lights,
            EffectName::PointLights => &mut self.point_lights,
            EffectName::SpotLights => &mut self.spot_lights,
            EffectName::DirectionalLights => &mut self.directional_lights,
            EffectName::RayTracedShadows => &mut self.raytraced_shadows,
            EffectName::DeepShadowMaps => &mut self.deep_maps,
            EffectName::ShadowMaps => &mut self.shadow_maps,
            EffectName::HairShadowsOnHair => &mut self.hair_shadows_on_hair,
            EffectName::HairShadowsOnSurfaces => &mut self.hair_shadows_on_surfaces,
            EffectName::LightReflectedBySurfaces => &mut self.reflection,
            EffectName::MoreThanOneReflection => &mut self.photons,
            EffectName::MirrorsAndGlass => &mut self.specular,
            EffectName::Caustics => &mut self.caustics,
            EffectName::HairOcclusionByProjection => &mut self.projected_occlusion,
            EffectName::HairOcclusionByRays => &mut self.raytraced_occlusion,
            EffectName::SettingsByAccuracy => &mut self.calibration,
            EffectName::RaysThroughHair => &mut self.hair_rays,
            EffectName::KajiyaKay => &mut self.kajiya_kay,
            EffectName::Highlight => &mut self.highlight,
            EffectName::Marschner => &mut self.marschner,
            EffectName::ColorVariation => &mut self.color_variation,
            EffectName::UnoccludedLayer => &mut self.unoccluded_layer,
            EffectName::PointAndDirectionalLights | EffectName::HairOcclusion => return None,
        })
    }

    /// The plan in words, with what the scene file leaves out and forces on. `self` is what the scene calls for.
    pub fn list(&self, choice: &EffectChoice) -> Vec<Effect> {
        let names = |list: &[EffectName], key| list.iter().any(|name| name.parts().contains(&key));
        REASONS
            .iter()
            .map(|&(key, name, because, lacking)| {
                let called_for = { *self }.flag(key).is_some_and(|on| *on);
                let forced = !called_for && names(&choice.forced, key);
                let left_out = !called_for && names(&choice.without, key);
                let reason = match (called_for, forced, left_out) {
                    (true, ..) => because.to_owned(),
                    (_, true, _) => format!("forced: effects.with names it, though {lacking}"),
                    (.., true) => "left out: effects.without names it".to_owned(),
                    _ => lacking.to_owned(),
                };
                Effect { key, name, on: called_for || forced, forced, left_out, reason }
            })
            .collect()
    }
}

impl EffectName {
    /// The effects that a name stands for: itself, or the members of a group.
    pub fn parts(&self) -> &[Self] {
        match self {
            Self::PointAndDirectionalLights => &[Self::PointLights, Self::SpotLights, Self::DirectionalLights],
            Self::HairOcclusion => &[Self::HairOcclusionByProjection, Self::HairOcclusionByRays],
            _ => std::slice::from_ref(self),
        }
    }

    /// What to do in place of leaving it out, where that cannot be.
    pub fn not_left_out(self) -> Option<&'static str> {
        match self {
            Self::SettingsByAccuracy => {
                Some("hair occlusion needs settings; occlusion.opening or occlusion.rays gives them")
            }
            Self::RaysThroughHair => Some("it is on where another effect needs it; leave that one out"),
            Self::MirrorsAndGlass => Some("surface[].material says what a surface is of"),
            Self::KajiyaKay | Self::Marschner => Some("hair has to reflect in some way; hair[].shading says how"),
            _ => None,
        }
    }
}

impl fmt::Display for EffectName {
    /// As it is written in scene files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// Each effect with its name, why it is on, and what is missing where it is off.
const REASONS: [(EffectName, &str, &str, &str); 26] = [
    (EffectName::Hair, "hair", "the scene has hair", "the scene has no hair"),
    (EffectName::Surfaces, "surfaces", "the scene has surfaces", "the scene has no visible surface"),
    (EffectName::Environment, "environment", "the environment shines", "the environment is black"),
    (
        EffectName::SmallBrightSources,
        "small bright sources",
        "the environment map has spots that the igloo's faces would blur too much",
        "there is no environment map, no spot in it that is worth it, or environment.sources is none",
    ),
    (EffectName::AreaLights, "area lights", "the scene has area lights", "the scene has no area light"),
    (EffectName::PointLights, "point lights", "the scene has point lights", "the scene has no point light"),
    (EffectName::SpotLights, "spot lights", "the scene has spot lights", "the scene has no spot light"),
    (
        EffectName::DirectionalLights,
        "directional lights",
        "the scene has directional lights",
        "the scene has no directional light",
    ),
    (
        EffectName::RayTracedShadows,
        "ray-traced shadows",
        "a light's shadows are raytraced, and there is hair or a surface",
        "no light's shadows are raytraced, or there is nothing to cast them",
    ),
    (
        EffectName::DeepShadowMaps,
        "deep shadow maps",
        "a light's shadows are deep-map, and there is hair",
        "no light's shadows are deep-map, or there is no hair",
    ),
    (
        EffectName::ShadowMaps,
        "shadow maps",
        "a light's shadows are map, and there is hair",
        "no light's shadows are map, or there is no hair",
    ),
    (
        EffectName::HairShadowsOnHair,
        "hair shadows on hair",
        "a point, spot or directional light has shadows, and there is hair to cast and to catch them",
        "no point, spot or directional light has shadows, or there is no hair",
    ),
    (
        EffectName::HairShadowsOnSurfaces,
        "hair shadows on surfaces",
        "a point, spot or directional light has shadows, and there is hair to cast and a surface to catch them",
        "no point, spot or directional light has shadows, or there is no hair, or no surface that reflects light",
    ),
    (
        EffectName::LightReflectedBySurfaces,
        "light reflected by surfaces",
        "lit surfaces reflect light",
        "no lit surface reflects light, or indirect.mode is none",
    ),
    (
        EffectName::MoreThanOneReflection,
        "more than one reflection",
        "indirect.mode is photons and lit surfaces reflect light",
        "no lit surface reflects light, or indirect.mode is another",
    ),
    (
        EffectName::MirrorsAndGlass,
        "mirrors and glass",
        "a surface has material = \"mirror\" or \"glass\"",
        "no surface has a mirror or glass material",
    ),
    (
        EffectName::Caustics,
        "caustics",
        "light falls on mirrors or glass",
        "there is no mirror or glass, no light on it, or indirect.mode is none, or indirect.caustic_photons 0",
    ),
    (
        EffectName::HairOcclusionByProjection,
        "hair occlusion by projection",
        "occlusion.mode is igloo or auto and light arrives from all around",
        "there is no hair, no light from around, or another occlusion.mode",
    ),
    (
        EffectName::HairOcclusionByRays,
        "hair occlusion by rays",
        "occlusion.mode is raytraced or auto and light arrives from all around",
        "there is no hair, no light from around, or another occlusion.mode",
    ),
    (
        EffectName::SettingsByAccuracy,
        "settings by accuracy",
        "occlusion.accuracy decides how finely hair occlusion is found",
        "there is no hair occlusion, or occlusion.opening, thinning, projection or rays says how finely",
    ),
    (
        EffectName::RaysThroughHair,
        "rays through hair",
        "lights, reflecting surfaces, mirrors, ray-traced occlusion or its accuracy need them",
        "nothing needs them",
    ),
    (
        EffectName::KajiyaKay,
        "scattering by Kajiya and Kay",
        "hair has shading = \"kajiya-kay\", the default",
        "no hair has shading = \"kajiya-kay\"",
    ),
    (
        EffectName::Highlight,
        "highlight",
        "hair has a specular colour",
        "no hair of shading = \"kajiya-kay\" has a specular colour",
    ),
    (
        EffectName::Marschner,
        "scattering by Marschner",
        "hair has shading = \"marschner\": light that it reflects and refracts as a fibre",
        "no hair has shading = \"marschner\"",
    ),
    (
        EffectName::ColorVariation,
        "colours that vary",
        "hair has colours that vary from strand to strand or along them: one is held for each point",
        "there is no hair, or each hair object has one colour",
    ),
    (EffectName::UnoccludedLayer, "unoccluded layer", "output.layers asks for it", "output.layers does not ask for it"),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn choice(with: &[EffectName], without: &[EffectName]) -> EffectChoice {
        EffectChoice { forced: with.to_vec(), without: without.to_vec() }
    }

    #[test]
    fn what_is_left_out_says_so_and_nothing_else_does() {
        let left_out = |without: &[EffectName]| {
            let list = Effects::default().list(&choice(&[], without)).into_iter();
            list.filter(|effect| effect.reason.contains("effects.without"))
                .map(|effect| effect.name)
                .collect::<Vec<_>>()
        };
        assert!(left_out(&[]).is_empty());
        let lamps = ["point lights", "spot lights", "directional lights"];
        assert_eq!(left_out(&[EffectName::PointAndDirectionalLights]), lamps);
        assert_eq!(left_out(&[EffectName::HairOcclusion]), ["hair occlusion by projection", "hair occlusion by rays"]);
        assert_eq!(left_out(&[EffectName::Hair]), ["hair"]);
        let on = Effects { hair: true, ..Effects::default() };
        assert!(!on.list(&choice(&[], &[EffectName::Hair]))[0].reason.contains("without"));
    }

    #[test]
    fn what_is_forced_is_on_and_says_so() {
        for (index, &(key, ..)) in REASONS.iter().enumerate() {
            let forced = [key];
            let list = Effects::default().list(&choice(&forced, &[]));
            let on: Vec<usize> = (0..list.len()).filter(|&i| list[i].on).collect();
            assert_eq!(on, [index], "{key}");
            assert!(list[index].forced && list[index].reason.starts_with("forced: "), "{:?}", list[index]);
            // The plan and what runs agree.
            assert_eq!({ Effects::default().with(&forced) }.flag(key), Some(&mut true), "{key}");
            // What the scene calls for is not forced.
            let called_for = Effects::default().with(&forced).list(&choice(&forced, &[]));
            assert!(called_for[index].on && !called_for[index].forced, "{key}");
        }
    }

    #[test]
    fn names_are_those_of_scene_files() {
        assert_eq!(EffectName::HairShadowsOnHair.to_string(), "hair-shadows-on-hair");
        assert_eq!(EffectName::RayTracedShadows.to_string(), "ray-traced-shadows");
    }
}
