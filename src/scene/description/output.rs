//! What is sampled, and what is written.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
    /// Passes of different random numbers whose mean is the picture. From 5 on they fill the gaps that those before left, so many are worth more than their number. 1 unless given; 4 where `output.layers` has `standard-error`.
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

/// Which hair layers of a pixel are shaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LayerChoice {
    /// Those that are seen most: the most opaque that other hair does not hide.
    #[default]
    Seen,
    /// Those of lowest γ, as in the paper: the most opaque, hidden by other hair or not.
    Gamma,
    /// Drawn by chance so that each counts in the mean what is seen of it: noise in place of a lasting error. Surfaces have a point drawn in the pixel, too, and lamps are counted at all of its samples. For many `passes`.
    Drawn,
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
    /// Standard error of the beauty, from passes that differ in their random numbers only: channels `standard-error.R`, `.G` and `.B`. It tells noise, not bias, and is itself good to 40 % in a single pixel, as it comes from four groups of passes. Needs `sampling.passes` of 2 or more; 4 are rendered where it is not given.
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
