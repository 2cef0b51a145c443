//! The renderer: brings fragments, Γ, Λ and F together into a picture.

pub mod film;
mod lighting;
pub mod output;
mod pipeline;
pub mod progress;
pub mod statistics;
mod tile;

pub use film::Film;
pub use pipeline::{Options, RenderError, render};
pub use statistics::Statistics;
