//! Surfaces: files and primitives, and what they are of.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Transform, Triple};

/// One surface: opaque, a mirror or of glass. Exactly one of `file`, `sphere`, `plane` and `teapot` is needed.
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
    /// What it is made of.
    pub material: SurfaceMaterial,
    /// For `mirror`: the share of the light that it reflects, 0 to 1, linear Rec.709.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub reflectance: Triple,
    /// For `glass`: index of refraction, over that of what is around it.
    #[schemars(range(min = 1.0, max = 4.0))]
    pub ior: f64,
    /// For `glass`: the share of the light that goes in and out again, beside what is reflected, 0 to 1, linear Rec.709. Each crossing takes its root.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub transmission: Triple,
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
            material: SurfaceMaterial::Diffuse,
            reflectance: [0.95; 3],
            ior: 1.5,
            transmission: [1.0; 3],
            smooth: true,
            visible: true,
        }
    }
}

/// What a surface is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SurfaceMaterial {
    /// It reflects the same in all directions (Lambert).
    #[default]
    Diffuse,
    /// It reflects in one direction. Hair and everything else is seen in it, and it throws caustics; to shadow rays it is opaque.
    Mirror,
    /// The border of a clear body: it reflects and refracts. The surface should be closed, its normals to the outside, and not overlap other glass. To shadow rays it is opaque: lamps shine through it as caustics.
    Glass,
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
