pub mod mesh;
pub use mesh::{Material, Mesh};
