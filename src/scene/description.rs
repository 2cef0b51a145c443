//! What the user wrote: the scene file as plain data.
//!
//! The structures here are the file format. Their doc comments, units and ranges become the JSON schema that
//! `tress schema` prints, and that schema is what a scene file is checked against, so each fact is stated once.
//! Lengths are in scene units unless a unit is named; colours are linear Rec.709; angles are in degrees.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A point, a direction or a colour: three numbers.
pub type Triple = [f64; 3];

/// A whole scene file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(title = "Tress scene")]
pub struct Description {
    /// Which scene axis points up: sets the camera's default up vector and the axis of the environment map.
    pub up: Axis,
    /// The camera.
    pub camera: Camera,
    /// Hair objects, each loaded from a file or grown on a surface.
    pub hair: Vec<Hair>,
    /// Opaque surfaces, each loaded from a file or given as a primitive.
    pub surface: Vec<Surface>,
    /// The light that arrives from infinitely far away.
    pub environment: Environment,
    /// Light sources inside the scene.
    pub light: Lights,
    /// Γ: how hair blocks the light of the environment and of other surfaces.
    pub occlusion: Occlusion,
    /// Light that surfaces reflect on hair and on each other.
    pub indirect: Indirect,
    /// Effects that are left out or forced on, whatever the scene calls for.
    pub effects: EffectChoice,
    /// How finely the picture is sampled.
    pub sampling: Sampling,
    /// What is written, and how.
    pub output: Output,
}

/// A coordinate axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    X,
    #[default]
    Y,
    Z,
}

/// A perspective camera. Right-handed; image rows run from the top.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {
    /// Where the camera stands, in scene units.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub position: Triple,
    /// The point it looks at, in scene units; must differ from `position`.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub target: Triple,
    /// The direction that is up in the picture; the scene's up axis unless given.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub up: Option<Triple>,
    /// Vertical field of view, in degrees.
    #[schemars(range(min = 0.01, max = 179.0))]
    pub fov: f64,
    /// Width and height of the picture, in pixels.
    #[schemars(inner(range(min = 1, max = 32768)))]
    pub resolution: [u32; 2],
    /// Distance of the near plane, in scene units; what is nearer is not drawn. A ten-thousandth of the scene's size unless given.
    #[schemars(range(min = 1e-9, max = 1e9))]
    pub near: Option<f64>,
    /// Whether the environment is seen behind the objects. Alpha is the objects' coverage either way.
    pub background: bool,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            position: [0.0, 0.0, 5.0],
            target: [0.0; 3],
            up: None,
            fov: 35.0,
            resolution: [512, 512],
            near: None,
            background: true,
        }
    }
}

/// Where an object is put: `translate * rotate * scale`, or a matrix. A point is a column vector on the right.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Transform {
    /// Moved by this much, in scene units.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub translate: Option<Triple>,
    /// Turned about the x axis, then y, then z, in degrees.
    #[schemars(inner(range(min = -36000.0, max = 36000.0)))]
    pub rotate: Option<Triple>,
    /// Scaled along x, y and z; a negative factor mirrors, zero is an error. Hair widths scale with the cube root of the product.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub scale: Option<Triple>,
    /// Instead of the three above: a 4x4 matrix by rows, the last row 0 0 0 1.
    #[schemars(inner(inner(range(min = -1e9, max = 1e9))))]
    pub matrix: Option<[[f64; 4]; 4]>,
}

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

/// One opaque surface. Exactly one of `file`, `sphere`, `plane` and `teapot` is needed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Surface {
    /// A name, for messages and for hair to grow on.
    pub name: Option<String>,
    /// A Wavefront OBJ file, relative to the scene file; its MTL gives diffuse colours.
    pub file: Option<PathBuf>,
    /// Instead of a file: a sphere.
    pub sphere: Option<Sphere>,
    /// Instead of a file: a rectangle.
    pub plane: Option<Plane>,
    /// Instead of a file: Newell's teapot.
    pub teapot: Option<Teapot>,
    /// Where the surface is put.
    pub transform: Transform,
    /// Diffuse reflectance, 0 to 1, linear Rec.709; replaces what the file says. 0.5 where nothing says.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<Triple>,
    /// Whether normals are interpolated over the triangles (where the mesh has them; spheres and teapots do).
    pub smooth: bool,
    /// Whether it is in the picture and blocks light. A surface that is not serves only for hair to grow on.
    pub visible: bool,
}

impl Default for Surface {
    fn default() -> Self {
        Self {
            name: None,
            file: None,
            sphere: None,
            plane: None,
            teapot: None,
            transform: Transform::default(),
            color: None,
            smooth: true,
            visible: true,
        }
    }
}

/// A sphere, tessellated finely enough that its outline strays from the circle by less than a thousandth of its radius.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sphere {
    /// Centre, in scene units.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub center: Triple,
    /// Radius, in scene units.
    #[schemars(range(min = 1e-9, max = 1e9))]
    pub radius: f64,
}

impl Default for Sphere {
    fn default() -> Self {
        Self { center: [0.0; 3], radius: 1.0 }
    }
}

/// A rectangle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Plane {
    /// Centre, in scene units.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub center: Triple,
    /// Normal, of any length but zero; the scene's up axis unless given.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub normal: Option<Triple>,
    /// Length of its two sides, in scene units.
    #[schemars(inner(range(min = 1e-9, max = 1e9)))]
    pub size: [f64; 2],
}

impl Default for Plane {
    fn default() -> Self {
        Self { center: [0.0; 3], normal: None, size: [10.0, 10.0] }
    }
}

/// Newell's teapot of 1975, tessellated to within a thousandth of its size. Its lid is towards the scene's up axis, its spout along x (along y in a scene with x up). It is open between rim and lid and at the ends of spout and handle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Teapot {
    /// The middle of its bounding box, in scene units.
    #[schemars(inner(range(min = -1e9, max = 1e9)))]
    pub center: Triple,
    /// Its length from handle to spout, in scene units; it is half as high and two thirds as deep.
    #[schemars(range(min = 1e-9, max = 1e9))]
    pub size: f64,
}

impl Default for Teapot {
    fn default() -> Self {
        Self { center: [0.0; 3], size: 2.0 }
    }
}

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
    /// None: neither hair nor surfaces are in the way of its light, nor of what surfaces send on of it.
    None,
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
    /// Photons of an estimate: more make it smoother and less sharp.
    #[schemars(range(min = 8, max = 1000))]
    pub neighbours: u32,
}

impl Default for Indirect {
    fn default() -> Self {
        Self { mode: IndirectMode::Photons, photons: 200_000, max_bounces: 64, neighbours: 64 }
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

/// How finely the picture is sampled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sampling {
    /// Hair layers a pixel that are lit and shaded; the others still attenuate, and take the colour of the nearest shaded one.
    #[schemars(range(min = 1, max = 100000))]
    pub layers: u32,
    /// Which layers these are.
    pub layer_choice: LayerChoice,
    /// Samples a pixel for the coverage of surfaces; rounded up to a square number.
    #[schemars(range(min = 16, max = 4096))]
    pub surface_samples: u32,
    /// Shadow rays a shading point towards each area light; rounded up to a square number.
    #[schemars(range(min = 1, max = 4096))]
    pub area_light_samples: u32,
    /// Seed of all random numbers.
    #[schemars(range(min = 0, max = u32::MAX))]
    pub seed: u32,
    /// Passes of different random numbers whose mean is the picture. 1 unless given; 4 where `output.layers` has `standard-error`.
    #[schemars(range(min = 1, max = 100000))]
    pub passes: Option<u32>,
}

impl Default for Sampling {
    fn default() -> Self {
        Self {
            layers: 6,
            layer_choice: LayerChoice::Seen,
            surface_samples: 16,
            area_light_samples: 16,
            seed: 0,
            passes: None,
        }
    }
}

impl Description {
    /// Passes whose mean the picture is.
    pub fn passes(&self) -> u32 {
        let wanted = self.output.layers.contains(&Layer::StandardError);
        self.sampling.passes.unwrap_or(if wanted { 4 } else { 1 })
    }
}

/// Which hair layers of a pixel are shaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LayerChoice {
    /// Those that are seen most: the most opaque that other hair does not hide.
    #[default]
    Seen,
    /// Those of lowest γ, as in the paper: the most opaque, hidden by other hair or not.
    Gamma,
}

/// What is written, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// The picture, relative to the scene file; its ending says the format. A run of `#` stands for the frame number. The command line's `-o` comes before it.
    pub file: Option<PathBuf>,
    /// Layers of an OpenEXR file. Other formats hold the beauty alone.
    pub layers: Vec<Layer>,
    /// Number format of an OpenEXR file's colours; depth, normal and tangent are always 32-bit float.
    pub pixel_type: PixelType,
    /// Compression of an OpenEXR file.
    pub compression: Compression,
    /// Leaves the render time out of the metadata, so that equal pictures make equal files.
    pub reproducible: bool,
    /// Exposure of PNG, JPEG and 8-bit TIFF files, in stops. OpenEXR files are never exposed.
    #[schemars(range(min = -50.0, max = 50.0))]
    pub exposure: f64,
}

impl Default for Output {
    fn default() -> Self {
        Self {
            file: None,
            layers: vec![Layer::Beauty, Layer::Alpha],
            pixel_type: PixelType::Half,
            compression: Compression::Zip,
            reproducible: false,
            exposure: 0.0,
        }
    }
}

/// A layer of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Layer {
    /// The picture itself: channels R, G, B.
    Beauty,
    /// Coverage by hair and surfaces: channel A.
    Alpha,
    /// Light from point and directional lights.
    Direct,
    /// Light from the environment, area lights and other surfaces, with hair occlusion.
    Environment,
    /// The same without hair occlusion.
    EnvironmentUnoccluded,
    /// Γ averaged over the directions: 0 wholly blocked to 1 free.
    Occlusion,
    /// Distance from the camera's plane in scene units, averaged over what is visible: channel `depth.Z`; 1e30 where nothing is.
    Depth,
    /// Normal of the surfaces, in world space.
    Normal,
    /// Tangent of the hair, in world space.
    Tangent,
    /// Standard error of the beauty, from passes that differ in their random numbers only: channels `standard-error.R`, `.G` and `.B`. It tells noise, not bias. Needs `sampling.passes` of 2 or more; 4 are rendered where it is not given.
    StandardError,
    /// CPU time that went into the pixel, in microseconds, of all passes: channel `cost.Y`. It differs from run to run, even with `reproducible`.
    Cost,
}

/// The number format of a picture's colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PixelType {
    #[default]
    Half,
    Float,
}

/// Compression of an OpenEXR file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    None,
    Rle,
    Zips,
    #[default]
    Zip,
    Piz,
    Pxr24,
    Dwaa,
    Dwab,
}
