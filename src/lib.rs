//! Tress: hair and fur in scenes with global illumination.

pub mod embree;
pub mod hair;
pub mod scene;
pub mod surface;
