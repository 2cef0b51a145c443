//! Γ: how much of each face of an igloo the hair lets through (paper, Eq. 8 and 10).
//!
//! Two independent estimators: `projection` of the segments on the igloo, far hair gathered in `clusters` or thinned out, and
//! `raytraced`. Both work in render space with `OnStrand`'s rule for what does not count, and both stop at the first opaque
//! surface, whose distance per face the caller knows.

pub mod clusters;
pub mod igloo;
mod lanes;
pub mod layer;
pub mod lookup;
pub mod projection;
pub mod raytraced;
mod walk;

use glam::{Mat3, Vec3};

pub use clusters::{ClusterTree, Selection};
pub use igloo::{Igloo, Span};
pub use layer::Transmittance;
pub use raytraced::HairRays;

use crate::hair::OnStrand;

/// The point for which Γ is asked.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Position in render space.
    pub position: Vec3,
    /// Where on which strand it is, if it is on hair.
    pub on: Option<OnStrand>,
    /// The igloo's axes in render space, as columns; an orthonormal matrix.
    pub frame: Mat3,
}

/// A frame whose z axis is the unit vector `normal` (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
pub fn frame_around(normal: Vec3) -> Mat3 {
    let sign = 1.0_f32.copysign(normal.z);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    let x = Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
    let y = Vec3::new(b, sign + normal.y * normal.y * a, -normal.y);
    Mat3::from_cols(x, y, normal)
}
