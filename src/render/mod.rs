//! The renderer: brings fragments, Γ, Λ and F together into a picture.

mod calibration;
mod clock;
pub mod costs;
pub mod cpu;
mod draw;
mod estimator;
mod faces;
pub mod film;
mod inspect;
mod lamp_lit;
mod lighting;
mod mean;
pub mod memory;
pub mod output;
mod passes;
mod photons;
mod pipeline;
pub mod plan;
pub mod progress;
mod reflections;
mod shadows;
mod specular;
pub mod statistics;
mod tile;

pub use calibration::{Found, Settled, settle};
pub use draw::{Drawn, Place, ShadingPoint, draw};
pub use film::Film;
pub use inspect::{Fragment, Inspected, Shading, inspect};
pub use lighting::{Around, Lighting, Workspace};
pub use mean::Mean;
pub use passes::{Pixels, Prepared, Selection, pass_seed};
pub use photons::Photons;
pub use pipeline::{Options, RenderError, render, with_threads};
pub use shadows::{HairShadow, HairShadows, Made};
pub use statistics::Statistics;
