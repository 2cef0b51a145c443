//! Hair: strands as loaded or grown, and the model of all hair that is rendered.
//! Hair: strands, the files that hold them, and hair grown on surfaces.

pub mod formats;
pub mod inspect;
pub mod model;
pub mod strands;

pub use model::{HairModel, OnStrand, StrandSample};
pub use strands::{Attribute, Strands};
