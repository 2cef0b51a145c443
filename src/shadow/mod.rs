//! What hair leaves of the light of one lamp, from maps that are made once in the lamp's view.
//!
//! A [`DeepMap`] holds a function of depth a pixel (Lokovic and Veach, "Deep Shadow Maps", 2000); a [`ShadowMap`] only the depth of
//! the nearest hair (Williams, "Casting Curved Shadows on Curved Surfaces", 1978), for comparison. Both know hair alone: what surfaces
//! block is found by rays. Transmittance is a single number, as the model's is: hair has no coloured transparency.

mod cells;
mod compress;
pub mod deep;
mod filter;
mod own;
pub mod plain;
mod receiver;
mod view;

pub use compress::{Node, compress};
pub use deep::{DeepMap, Footing};
pub use plain::ShadowMap;
pub use receiver::Point;
pub use view::{Cone, Seen, View};

use serde::Serialize;
use thiserror::Error;

use crate::fragment::BinError;

/// How finely a map is made and looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Pixels along a side of each of its images; where none, by the width of the hair.
    pub resolution: Option<u32>,
    /// Cells a pixel in which hair is scan-converted apart; rounded up to a square number.
    pub samples: u32,
    /// The largest error of a compressed function, at any depth.
    pub error: f32,
    /// Radius, in pixels, of the tent that pixels are weighted with: 1 is bilinear interpolation.
    pub filter: f32,
    /// No map takes more bytes than this: it is made again with half the resolution until it fits.
    pub most_bytes: usize,
}

impl Settings {
    /// The bound on a map's memory, unless another is asked for: 512 MiB.
    pub const MOST_BYTES: usize = 512 << 20;

    fn per_side(&self) -> u32 {
        f64::from(self.samples).sqrt().ceil().clamp(1.0, 8.0) as u32
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self { resolution: None, samples: 16, error: 0.004, filter: 1.0, most_bytes: Self::MOST_BYTES }
    }
}

/// What a map is, for the user.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Size {
    /// Images: one, or the six of a cube.
    pub images: usize,
    /// Pixels along a side of each.
    pub resolution: u32,
    /// Halvings of the resolution that the memory bound called for.
    pub halvings: u32,
    /// Nodes of all functions; for a plain map, its depths.
    pub nodes: usize,
    /// Memory that it keeps, in bytes.
    pub bytes: usize,
}

/// Why a map cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum MapError {
    #[error(transparent)]
    Bins(#[from] BinError),
    #[error("cancelled")]
    Cancelled,
    #[error("a shadow map takes more than {} MiB even at {resolution}x{resolution} pixels; raise the light's map_error or use shadows = \"raytraced\"", most_bytes >> 20)]
    Memory { resolution: u32, most_bytes: usize },
}
