//! Tress: hair and fur in scenes with global illumination.

pub mod camera;
pub mod fragment;
pub mod hair;
pub mod hash;
pub mod scene;
pub mod surface;
