//! What accuracy costs on a scene: pictures of many settings held against a converged reference.

pub mod errors;
mod frontier;
mod measure;
pub mod page;
mod plan;
mod probing;
pub mod results;
mod run;
pub mod settings;
pub mod state;
mod svg;

pub use results::{Advice, Point, Study};
pub use run::{Options, StudyError, study};
