//! What asks for its light: a point on a strand or on a surface.

use glam::Vec3;

use crate::hair::{OnStrand, StrandSample};

/// A point that is lit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    pub position: Vec3,
    /// Where on which strand; none on a surface.
    pub on: Option<OnStrand>,
}

impl Point {
    /// On a strand.
    pub fn on_hair(sample: &StrandSample) -> Self {
        Self { position: sample.position, on: Some(sample.on) }
    }

    /// On a surface.
    pub fn on_surface(position: Vec3) -> Self {
        Self { position, on: None }
    }
}
