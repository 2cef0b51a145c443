//! Tress: hair and fur in scenes with global illumination.

pub mod hair;
pub mod image;
pub mod scene;
pub mod surface;
