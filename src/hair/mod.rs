//! Hair: strands as loaded or grown, and the model of all hair that is rendered.

pub mod model;
pub mod strands;

pub use model::{HairModel, OnStrand, StrandSample};
pub use strands::{Attribute, Strands};
