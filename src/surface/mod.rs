//! Surfaces: triangle meshes with a material a triangle.

pub mod inspect;
pub mod mesh;
pub mod model;
pub mod obj;
pub mod optics;
mod polygon;
pub mod primitives;
mod screen;
pub mod teapot;
pub use mesh::{Material, Mesh};
pub use model::{SurfaceModel, SurfacePoint, Surfaces, lifted};
pub use optics::Optics;
