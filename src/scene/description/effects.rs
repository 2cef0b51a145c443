//! Effects that the user leaves out or forces on.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which effects are left out or forced on. `tress plan` lists all effects of a scene, and why each is on or off.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EffectChoice {
    /// Effects to be left out; nothing of theirs is built or computed.
    pub without: Vec<EffectName>,
    /// Effects to be run although the scene does not call for them: over what there is, or over nothing. They change no pixel, and cost time.
    #[serde(rename = "with")]
    pub forced: Vec<EffectName>,
}

/// An effect, or a group of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum EffectName {
    /// All hair.
    Hair,
    /// All surfaces, as shapes that are seen, block light and reflect it.
    Surfaces,
    /// Light from the environment, also behind the objects.
    Environment,
    /// Bright spots of an environment map as lights of their own; they stay in the map.
    SmallBrightSources,
    /// Light from area lights; they are still seen.
    AreaLights,
    /// All three of `point-lights`, `spot-lights` and `directional-lights`.
    PointAndDirectionalLights,
    /// Light from point lights.
    PointLights,
    /// Light from spot lights.
    SpotLights,
    /// Light from directional lights.
    DirectionalLights,
    /// Shadows by rays, of the lights that have them; without them their light goes through everything.
    RayTracedShadows,
    /// Shadows of hair by deep shadow maps, of the lights that have them; surfaces still block their light.
    DeepShadowMaps,
    /// Shadows of hair by plain shadow maps, of the lights that have them; surfaces still block their light.
    ShadowMaps,
    /// What hair takes from the light of point, spot and directional lights on hair.
    HairShadowsOnHair,
    /// The same on surfaces.
    HairShadowsOnSurfaces,
    /// Light that surfaces reflect; as `indirect.mode = "none"`.
    LightReflectedBySurfaces,
    /// Light that surfaces reflect more than once; as `indirect.mode = "single-bounce"`.
    MoreThanOneReflection,
    /// Surfaces that are mirrors or of glass. Not to be left out: `surface[].material` says what a surface is of.
    MirrorsAndGlass,
    /// Light that mirrors and glass throw on other things; as `indirect.caustic_photons = 0`. They are still seen.
    Caustics,
    /// Hair that blocks light from around; as `occlusion.mode = "none"`. Both of `hair-occlusion-by-projection` and `hair-occlusion-by-rays`.
    HairOcclusion,
    /// Hair occlusion by projection: left out, rays remain where `occlusion.mode` is `auto`.
    HairOcclusionByProjection,
    /// Hair occlusion by rays: left out, projection remains where `occlusion.mode` is `auto`.
    HairOcclusionByRays,
    /// Settings of hair occlusion found on the scene. Not to be left out: `occlusion.opening`, `thinning` or `rays` takes its place.
    SettingsByAccuracy,
    /// What rays need to go through hair. Not to be left out: it follows from the others.
    RaysThroughHair,
    /// Hair of `shading = "kajiya-kay"`. Not to be left out: hair reflects in some way.
    KajiyaKay,
    /// Highlights of such hair.
    Highlight,
    /// Hair of `shading = "marschner"`. Not to be left out: hair reflects in some way.
    Marschner,
    /// Colours that vary from strand to strand or along them; without them each hair object has the mean of its points.
    ColorVariation,
    /// The layer `environment-unoccluded`.
    UnoccludedLayer,
}
