//! What the user wrote: the scene file as plain data.
//!
//! The structures here are the file format. Their doc comments, units and ranges become the JSON schema that
//! `tress schema` prints, and that schema is what a scene file is checked against, so each fact is stated once.
//! Lengths are in scene units unless a unit is named; colours are linear Rec.709; angles are in degrees.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

mod effects;
mod estimators;
mod hair;
mod light;
mod output;
mod surface;

pub use effects::*;
pub use estimators::*;
pub use hair::*;
pub use light::*;
pub use output::*;
pub use surface::*;

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
    /// Surfaces, each loaded from a file or given as a primitive.
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

impl Description {
    /// Passes whose mean the picture is.
    pub fn passes(&self) -> u32 {
        let wanted = self.output.layers.contains(&Layer::StandardError);
        self.sampling.passes.unwrap_or(if wanted { 4 } else { 1 })
    }
}
