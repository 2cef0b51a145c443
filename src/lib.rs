//! Tress: hair and fur in scenes with global illumination.

mod file;
pub mod hair;
pub mod hash;
pub mod scene;
pub mod surface;
pub mod transform;
