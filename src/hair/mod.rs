//! Hair: strands, the files that hold them, and hair grown on surfaces.

pub mod formats;
pub mod grow;
pub mod inspect;
pub mod strands;
pub use strands::{Attribute, Strands};
