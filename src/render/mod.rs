//! The renderer: brings fragments, Γ, Λ and F together into a picture.

mod calibration;
mod draw;
mod estimator;
pub mod film;
mod lighting;
pub mod output;
mod pipeline;
pub mod progress;
mod shadows;
pub mod statistics;
mod tile;

pub use calibration::{Found, Settled, settle};
pub use draw::{Drawn, Place, ShadingPoint, draw};
pub use film::Film;
pub use lighting::{Around, Lighting, Workspace};
pub use pipeline::{Options, RenderError, render, with_threads};
pub use shadows::Made;
pub use statistics::Statistics;
