//! Which effects a scene calls for. Found before anything is computed; what is off is not built, held or entered.

use serde::Serialize;

use crate::scene::description::{IndirectMode, Layer, OcclusionMode, Shadows};
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
            projected_occlusion: occluded && mode != OcclusionMode::Raytraced,
            raytraced_occlusion,
            calibration,
            hair_rays: hair
                && (raytraced_occlusion
                    || calibration
                    || raytraced_shadows
                    || (reflection || area_lights || small_sources) && mode != OcclusionMode::None),
            kajiya_kay: shaded(|shading| matches!(shading, HairShading::KajiyaKay { .. })),
            highlight: shaded(
                |shading| matches!(shading, HairShading::KajiyaKay { specular, .. } if *specular != glam::Vec3::ZERO),
            ),
            marschner: shaded(|shading| matches!(shading, HairShading::Marschner { .. })),
            unoccluded_layer: description.output.layers.contains(&Layer::EnvironmentUnoccluded),
        }
    }

    /// The plan in words, and what the scene file leaves out.
    pub fn list_for(&self, scene: &Scene) -> Vec<Effect> {
        let mut list = self.list();
        for left_out in &scene.description().effects.without {
            let name = serde_json::to_value(left_out).ok().and_then(|name| name.as_str().map(ToOwned::to_owned));
            for effect in list.iter_mut().filter(|effect| {
                let key = effect.name.replace(' ', "-");
                name.as_ref().is_some_and(|name| key == *name || key.starts_with(&format!("{name}-by-")))
            }) {
                effect.reason = "left out: effects.without names it".to_owned();
            }
        }
        list
    }

    /// The plan in words.
    pub fn list(&self) -> Vec<Effect> {
        let say = |name, on, because: &'static str, lacking: &'static str| Effect {
            name,
            on,
            reason: (if on { because } else { lacking }).to_owned(),
        };
        vec![
            say("hair", self.hair, "the scene has hair", "the scene has no hair"),
            say("surfaces", self.surfaces, "the scene has surfaces", "the scene has no visible surface"),
            say("environment", self.environment, "the environment shines", "the environment is black"),
            say(
                "small bright sources",
                self.small_sources,
                "the environment map has spots that the igloo's faces would blur too much",
                "no environment map, no spot in it that is worth it, or environment.sources is none",
            ),
            say("area lights", self.area_lights, "the scene has area lights", "the scene has no area light"),
            say(
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
            say(
                "light reflected by surfaces",
                self.reflection,
                "lit surfaces reflect light",
                "no lit surface reflects light, or indirect.mode is none",
            ),
            say(
                "more than one reflection",
                self.photons,
                "indirect.mode is photons and lit surfaces reflect light",
                "no lit surface reflects light, or another indirect.mode",
            ),
            say(
                "hair occlusion by projection",
                self.projected_occlusion,
                "occlusion.mode is igloo or auto and light arrives from all around",
                "no hair, no light from around, or another occlusion.mode",
            ),
            say(
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
                "lights, reflecting surfaces, ray-traced occlusion or its accuracy need them",
                "nothing needs them",
            ),
            say(
                "scattering by Kajiya and Kay",
                self.kajiya_kay,
                "hair has shading = \"kajiya-kay\", the default",
                "no hair has shading = \"kajiya-kay\"",
            ),
            say(
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
