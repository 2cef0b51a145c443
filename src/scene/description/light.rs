//! The environment, lights and their shadows.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Triple;

/// Light from infinitely far away: one of `file`, `color` and `gradient`; black unless given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Environment {
    /// A picture of all directions (HDR, EXR or what else OpenImageIO reads), relative to the scene file. In a scene with y up its centre is +Z; in a lat-long picture u = 1/4 is +X.
    pub file: Option<PathBuf>,
    /// How a picture's pixels lie on the sphere.
    pub mapping: EnvironmentMapping,
    /// Whether small bright spots of a picture (suns, lamps) are taken out of it and lit as lights of their own, with sharp shadows through hair.
    pub sources: EnvironmentSources,
    /// Instead: the same radiance from everywhere, in W/(m² sr), linear Rec.709.
    #[schemars(inner(range(min = 0.0, max = 1e20)))]
    pub color: Option<Triple>,
    /// Instead: a sky of three colours.
    pub gradient: Option<Gradient>,
    /// Factor on the radiance.
    #[schemars(range(min = 0.0, max = 1e20))]
    pub scale: f64,
    /// Turned about the up axis by this angle, in degrees, counter-clockwise seen from above.
    #[schemars(range(min = -36000.0, max = 36000.0))]
    pub rotate: f64,
}

impl Default for Environment {
    fn default() -> Self {
        Self {
            file: None,
            mapping: EnvironmentMapping::Auto,
            sources: EnvironmentSources::Auto,
            color: None,
            gradient: None,
            scale: 1.0,
            rotate: 0.0,
        }
    }
}

/// How the pixels of an environment's picture lie on the sphere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum EnvironmentMapping {
    /// By the picture's shape: lat-long where it is twice as wide as high, angular where it is square.
    #[default]
    Auto,
    /// Columns are longitudes, rows latitudes.
    LatLong,
    /// Debevec's light probes: the angle to the centre's direction grows with the distance from the centre, to 180 degrees at the circle that touches the sides; +X is right of the centre, as in a mirror ball.
    Angular,
}

/// What becomes of small bright spots of an environment's picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EnvironmentSources {
    /// Those that the igloo's faces would blur too much are lights: as many as it takes for those left to err by less than 3 % of the picture's light together, at most 16. Their samples are at most `sampling.area_light_samples` each.
    #[default]
    Auto,
    /// They stay in the picture.
    None,
}

/// A sky: radiance in W/(m² sr), linear in the sine of the elevation between the three.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gradient {
    /// Straight up.
    #[schemars(inner(range(min = 0.0, max = 1e20)))]
    pub zenith: Triple,
    /// At the horizon.
    #[schemars(inner(range(min = 0.0, max = 1e20)))]
    pub horizon: Triple,
    /// Straight down.
    #[schemars(inner(range(min = 0.0, max = 1e20)))]
    pub nadir: Triple,
}

/// Light sources inside the scene, by kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Lights {
    /// Points that shine the same in every direction.
    pub point: Vec<PointLight>,
    /// Points that shine in a cone.
    pub spot: Vec<SpotLight>,
    /// Suns: parallel light.
    pub directional: Vec<DirectionalLight>,
    /// Rectangles that shine from one side.
    pub rect: Vec<RectLight>,
}

/// A point light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointLight {
    /// Where it is, in scene units.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub position: Triple,
    /// Radiant intensity, in W/sr with the scene unit as metre, linear Rec.709.
    #[schemars(inner(range(min = 0.0, max = 1e20)))]
    pub intensity: Triple,
    /// How shadows of it are found.
    #[serde(default)]
    pub shadows: Shadows,
    /// For shadow maps: pixels along a side of each image (a light among the hair has six); by the width of the hair unless given.
    #[schemars(range(min = 16, max = 8192))]
    pub map_resolution: Option<u32>,
    /// For `deep-map`: the largest error of what a pixel lets through, at any depth.
    #[serde(default = "map_error")]
    #[schemars(range(min = 0.0, max = 0.5))]
    pub map_error: f64,
}

/// A directional light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DirectionalLight {
    /// Where the light travels to, of any length but zero.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub direction: Triple,
    /// Irradiance on a surface that faces it, in W/m², linear Rec.709.
    #[schemars(inner(range(min = 0.0, max = 1e20)))]
    pub irradiance: Triple,
    /// How shadows of it are found.
    #[serde(default)]
    pub shadows: Shadows,
    /// For shadow maps: pixels along a side of each image (a light among the hair has six); by the width of the hair unless given.
    #[schemars(range(min = 16, max = 8192))]
    pub map_resolution: Option<u32>,
    /// For `deep-map`: the largest error of what a pixel lets through, at any depth.
    #[serde(default = "map_error")]
    #[schemars(range(min = 0.0, max = 0.5))]
    pub map_error: f64,
}

/// A light in a point that shines in a cone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpotLight {
    /// Where it is, in scene units.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub position: Triple,
    /// The axis of its cone, away from the light, of any length but zero.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub direction: Triple,
    /// Opening of the cone, from edge to edge, in degrees.
    #[schemars(range(min = 0.01, max = 180.0))]
    pub angle: f64,
    /// Share of the cone's half angle, from its edge inwards, over which the light fades: 0 for a sharp edge, 1 for one that begins at the axis.
    #[serde(default = "blend")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub blend: f64,
    /// Radiant intensity on the axis, in W/sr with the scene unit as metre, linear Rec.709.
    #[schemars(inner(range(min = 0.0, max = 1e20)))]
    pub intensity: Triple,
    /// How shadows of it are found.
    #[serde(default)]
    pub shadows: Shadows,
    /// For shadow maps: pixels along a side of each image (a light among the hair has six); by the width of the hair unless given.
    #[schemars(range(min = 16, max = 8192))]
    pub map_resolution: Option<u32>,
    /// For `deep-map`: the largest error of what a pixel lets through, at any depth.
    #[serde(default = "map_error")]
    #[schemars(range(min = 0.0, max = 0.5))]
    pub map_error: f64,
}

/// How shadows of a light without extent are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Shadows {
    /// By a ray through surfaces and hair for each point: sharp and exact, and the slowest in thick hair.
    #[default]
    Raytraced,
    /// Of hair by a deep shadow map: what is left of the light, as a function of depth, in each pixel of the light's view. Softened by about a pixel, at a cost that does not grow with the hair behind the pixel. Of surfaces by rays. Light that surfaces send on goes through hair by rays.
    DeepMap,
    /// Of hair by a plain shadow map, for comparison: a pixel holds one depth, and each hair is in it with the chance of what it blocks there, so that a pixel is lit or dark. Right on average, but noisy. Else as `deep-map`.
    Map,
    /// None: neither hair nor surfaces are in the way of its light, nor of what surfaces send on of it. Its photons, which bring light that is reflected more than once and caustics, are blocked as others are.
    None,
}

impl Shadows {
    /// Whether hair's shadows come from a map.
    pub fn is_map(self) -> bool {
        matches!(self, Self::DeepMap | Self::Map)
    }
}

fn map_error() -> f64 {
    0.004
}

fn blend() -> f64 {
    0.15
}

/// A rectangular area light. It blocks light like any surface and is seen by the camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RectLight {
    /// Centre, in scene units.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub center: Triple,
    /// First side, from corner to corner, in scene units.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub edge_u: Triple,
    /// Second side; light leaves on the side of edge_u x edge_v.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub edge_v: Triple,
    /// Radiance, in W/(m² sr), linear Rec.709.
    #[schemars(inner(range(min = 0.0, max = 1e20)))]
    pub radiance: Triple,
}
