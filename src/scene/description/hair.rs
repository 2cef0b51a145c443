//! Hair objects, and how hair grows.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Transform, Triple};

/// One hair object. Exactly one of `file` and `grow` is needed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Hair {
    /// A name for messages.
    pub name: Option<String>,
    /// A hair file, relative to the scene file.
    pub file: Option<PathBuf>,
    /// What kind of file it is; told from the file's ending and first bytes unless given.
    pub format: HairFormat,
    /// Instead of a file: hair grown on a surface of this scene.
    pub grow: Option<Grow>,
    /// Where the hair is put. Grown hair is put where its surface is; this comes on top.
    pub transform: Transform,
    /// Width (diameter) of every strand, in the hair's own units before its transform; replaces what the file says.
    #[schemars(range(min = 1e-9, max = 1e6))]
    pub width: Option<f64>,
    /// Whether a file's thickness is a strand's diameter or its radius. HAIR files do not say: diameter unless given. Text files hold radii by definition.
    pub thickness_is: Option<ThicknessIs>,
    /// Transmittance of one crossing of a strand, 0 opaque to 1 invisible; replaces what the file says. It is what other strands let through to a point, straight on; with `marschner` its like is the share of the light that goes through a strand, some 0.7 for blond hair and 0.2 for black.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub transparency: Option<f64>,
    /// Diffuse reflectance, 0 to 1, linear Rec.709; replaces what the file says. With `marschner` see `color_is`.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<Triple>,
    /// How a strand reflects.
    pub shading: Shading,
    /// For `kajiya-kay`: albedo of the highlight: the share of the incident light that it reflects, 0 to 1, linear Rec.709.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub specular: Triple,
    /// For `kajiya-kay`: sharpness of the highlight: the exponent of Kajiya and Kay, without unit.
    #[schemars(range(min = 1.0, max = 10000.0))]
    pub exponent: f64,
    /// Whether light from all around reaches it: environment, area lights and surfaces. If not, point and directional lights alone light it, as in renderers without global illumination.
    pub gather: bool,
    /// For `marschner`: what `color` says, from which the absorption in a strand is found.
    pub color_is: ColorIs,
    /// For `marschner`: longitudinal roughness β_m, along the strand, 0 smooth to 1 rough.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub roughness: f64,
    /// For `marschner`: azimuthal roughness β_n, around the strand, 0 smooth to 1 rough.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub azimuthal_roughness: f64,
    /// For `marschner`: tilt of the cuticle's scales, in degrees; positive where they open towards the tip.
    #[schemars(range(min = -20.0, max = 20.0))]
    pub cuticle_tilt: f64,
    /// For `marschner`: index of refraction.
    #[schemars(range(min = 1.05, max = 3.0))]
    pub ior: f64,
}

impl Default for Hair {
    fn default() -> Self {
        Self {
            name: None,
            file: None,
            format: HairFormat::Auto,
            grow: None,
            transform: Transform::default(),
            width: None,
            thickness_is: None,
            transparency: None,
            color: None,
            shading: Shading::KajiyaKay,
            specular: [0.1; 3],
            exponent: 60.0,
            gather: true,
            color_is: ColorIs::Strand,
            roughness: 0.3,
            azimuthal_roughness: 0.3,
            cuticle_tilt: 2.0,
            ior: 1.55,
        }
    }
}

/// How a strand reflects light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Shading {
    /// A diffuse term and a highlight (Kajiya and Kay 1989), as in the paper.
    #[default]
    KajiyaKay,
    /// Reflection and refraction in a rough, coloured fibre (Marschner et al. 2003, d'Eon et al. 2011, Chiang et al. 2016).
    Marschner,
}

/// What the colour of hair that reflects as a fibre does is the share of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ColorIs {
    /// Of the light that enters a strand under a uniform sky, the share that leaves it; the highlight comes on top, as with `kajiya-kay`. Hair looks like its `color`.
    #[default]
    Strand,
    /// The albedo of dense hair after all scattering from strand to strand (Chiang et al. 2016), as in renderers that follow it. Here that light is left out, so that hair comes out paler than `color`.
    DenseHair,
}

/// The kind of a hair file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum HairFormat {
    /// Told from the file's ending and first bytes.
    #[default]
    Auto,
    /// Cem Yuksel's HAIR format.
    Hair,
    /// TressFX 3 or 4.
    Tfx,
    /// Lines of `x y z radius`, a blank line between strands.
    Text,
}

/// What a hair file's thickness means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ThicknessIs {
    Diameter,
    Radius,
}

/// Hair that the program grows. Lengths are in the scene's units, where the surface stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Grow {
    /// The name of the surface that it grows on, at random points of equal density.
    pub on: String,
    /// Number of strands.
    #[schemars(range(min = 1, max = 20000000))]
    pub count: u32,
    /// Only where the cosine between the surface's normal and the scene's up axis lies in this range (-1 to 1).
    #[schemars(inner(range(min = -1.0, max = 1.0)))]
    pub slope: [f64; 2],
    /// Length of a strand, in scene units.
    #[schemars(range(min = 1e-9, max = 1e6))]
    pub length: f64,
    /// By how much lengths vary: a strand's length is `length * (1 ± length_variation)`, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub length_variation: f64,
    /// Segments a strand.
    #[schemars(range(min = 1, max = 10000))]
    pub segments: u32,
    /// Width (diameter) at the root, in scene units.
    #[schemars(range(min = 1e-9, max = 1e6))]
    pub width_root: f64,
    /// Width (diameter) at the tip, in scene units.
    #[schemars(range(min = 1e-9, max = 1e6))]
    pub width_tip: f64,
    /// How far a strand leans away from the surface's normal to a random side, as the tangent of the angle.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub lean: f64,
    /// How strongly the strand bends towards the scene's down, as a share of its length's direction at the tip; negative bends up.
    #[schemars(range(min = -100.0, max = 100.0))]
    pub gravity: f64,
    /// Radius of the curls, in scene units.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub curl_radius: f64,
    /// Turns of a curl along a whole strand.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub curl_frequency: f64,
    /// How far the strands of a clump close up at their tips, 0 not at all to 1 wholly.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub clumping: f64,
    /// Strands a clump.
    #[schemars(range(min = 1, max = 100000))]
    pub clump_size: u32,
    /// By how much the colour varies from strand to strand, as a share of its brightness, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub color_variation: f64,
    /// Seed of all that is random about it.
    #[schemars(range(min = 0, max = u32::MAX))]
    pub seed: u32,
}

impl Default for Grow {
    fn default() -> Self {
        Self {
            on: String::new(),
            count: 10_000,
            slope: [-1.0, 1.0],
            length: 0.5,
            length_variation: 0.2,
            segments: 12,
            width_root: 0.002,
            width_tip: 0.001,
            lean: 0.2,
            gravity: 0.3,
            curl_radius: 0.0,
            curl_frequency: 3.0,
            clumping: 0.0,
            clump_size: 25,
            color_variation: 0.0,
            seed: 1,
        }
    }
}
