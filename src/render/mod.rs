//! The renderer.

pub mod progress;
