//! Hair: strands, the files that hold them, and hair grown on surfaces.

pub mod formats;
pub mod grow;
pub mod inspect;
pub mod join;
pub mod model;
pub mod strands;

pub use model::{Colors, HairModel, OnStrand, SELF_WIDTHS, StrandSample};
pub use strands::{Attribute, Strands};
