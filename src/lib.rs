//! Tress: hair and fur in scenes with global illumination.

pub mod cli;
pub mod hair;
pub mod render;
pub mod scene;
pub mod surface;
