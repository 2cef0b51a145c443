//! How hair occlusion and reflected light are found.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How Γ is found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Occlusion {
    /// The estimator.
    pub mode: OcclusionMode,
    /// How accurate hair occlusion is to be: root mean square error of sky visibility (0 to 1) over the points that are shaded. The fineness of the projection, or the number of rays, that reaches it is found on the scene itself, unless `opening` or `rays` say it.
    #[schemars(range(min = 1e-4, max = 0.5))]
    pub accuracy: f64,
    /// Faces of equal area on one hemisphere of the igloo, for all light from around; hair uses two hemispheres. By the accuracy unless given: 64 for 0.01.
    #[schemars(range(min = 1, max = 100000))]
    pub faces: Option<u32>,
    /// For the igloo, in place of the accuracy: hair whose extent is below this many widths of a face is projected as one lump, on a map of two cells a face (on surfaces four); 0 projects every segment by itself, on whole faces. Without effect where that is done anyway: with `thinning`, on the tangent plane, or where transmittance is by `segment-length`.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub opening: Option<f64>,
    /// For the igloo: how a segment by itself is projected.
    pub projection: ProjectionRule,
    /// What one crossing of a strand lets through.
    pub transmittance: TransmittanceRule,
    /// For `segment-length`: the length of hair over which a strand's transparency holds, in scene units (the paper's σ is per this length).
    #[schemars(range(min = 1e-9, max = 1e9))]
    pub unit_length: f64,
    /// For the igloo: use only a part of the hair, segment by segment, and scale it up (the paper's section 5). Layers then cover whole faces. Unless given, all hair is used.
    pub thinning: Option<Thinning>,
    /// For `raytraced`, in place of the accuracy: rays a shading point, rounded up to whole rays a face.
    #[schemars(range(min = 1, max = 10000000))]
    pub rays: Option<u32>,
    /// For `raytraced`: what crossings do to a ray. Rays to point and directional lights always multiply.
    pub crossings: CrossingRule,
    /// For `stochastic` crossings: the share of its light below which a ray goes on by chance. 1: each crossing absorbs the whole ray or nothing.
    #[schemars(range(min = 1e-4, max = 1.0))]
    pub roulette: f64,
    /// For crossings that multiply: a ray ends when less than this share of its light is left.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub residual: f64,
}

impl Default for Occlusion {
    fn default() -> Self {
        Self {
            mode: OcclusionMode::Igloo,
            accuracy: 0.01,
            faces: None,
            opening: None,
            projection: ProjectionRule::Sphere,
            transmittance: TransmittanceRule::Crossing,
            unit_length: 1.0,
            thinning: None,
            rays: None,
            crossings: CrossingRule::Stochastic,
            roulette: 0.25,
            residual: 1e-3,
        }
    }
}

impl Occlusion {
    /// Whether hair is projected segment by segment: where that is asked for, and where a crossing depends on the length that a face sees.
    pub fn by_segments(&self) -> bool {
        self.thinning.is_some()
            || self.projection == ProjectionRule::TangentPlane
            || self.transmittance == TransmittanceRule::SegmentLength
            || self.opening == Some(0.0) && self.mode == OcclusionMode::Igloo
    }

    /// Whether settings are to be found on the scene itself, for its accuracy.
    pub fn wants_calibration(&self) -> bool {
        match self.mode {
            OcclusionMode::None => false,
            OcclusionMode::Igloo => self.opening.is_none() && !self.by_segments(),
            OcclusionMode::Raytraced => self.rays.is_none(),
            OcclusionMode::Auto => true,
        }
    }

    /// Faces a hemisphere: as given, else by the accuracy.
    pub fn face_count(&self) -> u32 {
        self.faces.unwrap_or((0.64 / self.accuracy).round().clamp(36.0, 400.0) as u32)
    }
}

/// The estimator of Γ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum OcclusionMode {
    /// Projection of the hair on the igloo's faces.
    #[default]
    Igloo,
    /// Rays through the hair.
    Raytraced,
    /// That of the two that is expected to take less time for the accuracy.
    Auto,
    /// Hair blocks nothing of the environment's light: Γ is 1.
    None,
}

/// How a segment is projected on the igloo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ProjectionRule {
    /// On the sphere itself, exactly.
    #[default]
    Sphere,
    /// The paper's appendix A.2, for comparison: every segment by itself, on the plane tangent to the hemisphere's top. What crosses the horizon is lost.
    TangentPlane,
}

/// When a ray ends in the hair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CrossingRule {
    /// What all let through is multiplied, until less than `residual` is left.
    Multiply,
    /// Below the share `roulette` of its light a ray goes on by chance, so that the mean stays right: little more than half of the time, a little more noise.
    #[default]
    Stochastic,
}

/// What one crossing of a strand lets through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TransmittanceRule {
    /// The strand's transparency, once a crossing.
    #[default]
    Crossing,
    /// The paper's Eq. 7: transparency to the power of the length of hair visible in the region.
    SegmentLength,
}

/// Light that surfaces reflect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Indirect {
    /// How many reflections count.
    pub mode: IndirectMode,
    /// Photons that leave the lights, shared out by their power.
    #[schemars(range(min = 1000, max = 20000000))]
    pub photons: u32,
    /// Reflections after which a photon's way ends; what would follow is lost.
    #[schemars(range(min = 1, max = 1000))]
    pub max_bounces: u32,
    /// Photons that leave lamps (not the sky without its small bright sources) towards mirrors and glass, for the light that these throw on other things; 0: none is thrown. Without such surfaces, and where `mode` is `none`, there are none.
    #[schemars(range(min = 0, max = 20000000))]
    pub caustic_photons: u32,
    /// Mirrors and glass that a ray, of the camera too, or a photon of a caustic meets one after the other at the most; what is beyond is lost. How much that is, a render tells.
    #[schemars(range(min = 1, max = 1000))]
    pub specular_depth: u32,
    /// Photons of an estimate: more make it smoother and less sharp.
    #[schemars(range(min = 8, max = 1000))]
    pub neighbours: u32,
    /// How far, in widths of an igloo's face, a surface that points on hair see by a shared ray may be from where a ray of their own would have met it; 0: each point has its own rays. Sharing makes large pictures faster and smoother.
    #[schemars(range(min = 0.0, max = 4.0))]
    pub sharing: f64,
}

impl Default for Indirect {
    fn default() -> Self {
        Self {
            mode: IndirectMode::Photons,
            photons: 200_000,
            max_bounces: 64,
            caustic_photons: 200_000,
            specular_depth: 16,
            neighbours: 64,
            sharing: 0.0,
        }
    }
}

/// How many reflections count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum IndirectMode {
    /// All: photon mapping with final gathering.
    #[default]
    Photons,
    /// One between a light and the point that is shaded.
    SingleBounce,
    /// None: surfaces block light, but what they meet gets none from them.
    None,
}

/// Thinning of the hair for Γ. Strands are chosen by a hash, so that a smaller set is inside a larger one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Thinning {
    /// Share of the strands that is used everywhere (5.1), above 0 to 1.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub fraction: f64,
    /// View-dependent thinning (5.2): at n times this distance one strand in n is used. In scene units; not done unless given.
    #[schemars(range(min = 1e-9, max = 1e9))]
    pub distance_unit: Option<f64>,
}

impl Default for Thinning {
    fn default() -> Self {
        Self { fraction: 1.0, distance_unit: None }
    }
}
