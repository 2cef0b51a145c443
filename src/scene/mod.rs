//! Scenes: what the user wrote.

mod check;
pub mod description;
pub mod document;
mod environment;
pub mod frame;
pub mod keypath;
pub mod loaded;
pub mod overrides;
mod parse;
pub mod reference;
pub mod schema;
pub mod space;
pub mod spans;
#[cfg(test)]
mod tests;
mod validate;

pub use document::{Document, Problem, Problems, SceneError, load};
pub use loaded::{AssetError, GrownHair, HairObject, Scene};
pub use schema::schema;
pub use spans::Place;
