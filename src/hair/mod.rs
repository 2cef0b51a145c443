pub mod strands;
pub use strands::{Attribute, Strands};
