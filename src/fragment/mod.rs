//! Stage 1 (section 4.1 of the paper): hair segments and surfaces as fragments of pixels, and their layers.
//!
//! All of this is pure computation in camera space and pixels; how surfaces are hit comes in through a closure.

pub mod bins;
mod choice;
mod footprint;
pub mod hair;
pub mod layers;
pub mod surface;

pub use bins::{BinError, Bins, TileGrid, assign};
pub use choice::draw;
pub use hair::{HairFragment, HairSegment, PixelRect, scan_convert};
pub use layers::{Layer, MIN_WEIGHT, PixelLayers, Rank, Shaded};
pub use surface::{NO_SURFACE, SurfaceGroup, SurfaceHit, SurfacePixel, SurfaceSample};
