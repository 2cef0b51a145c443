//! Tress: hair and fur in scenes with global illumination.

pub mod camera;
pub mod cli;
pub mod effects;
pub mod embree;
pub mod fragment;
pub mod hair;
pub mod hash;
pub mod igloo;
pub mod illumination;
pub mod image;
pub mod occlusion;
pub mod render;
pub mod scene;
pub mod selftest;
pub mod sequence;
pub mod shading;
pub mod shadow;
pub mod study;
pub mod surface;
pub mod tally;
pub mod transform;

mod file;
mod z_order;
