//! Γ: how much of each face of an igloo the hair lets through (paper, Eq. 8 and 10).
//!
//! Two independent estimators: `projection` of the segments on the igloo, far hair gathered in `clusters` or thinned out, and
//! `raytraced`. Both work in render space with `OnStrand`'s rule for what does not count, and both stop at the first opaque
//! surface, whose distance per face the caller knows.

pub mod clusters;
mod lanes;
pub mod layer;
pub mod projection;
pub mod raytraced;
mod sobol;
mod walk;

use glam::{Mat3, Vec3};

pub use clusters::{ClusterTree, Selection};
pub use layer::Transmittance;
pub use raytraced::{Crossings, HairRays, RaySettings};

use crate::hair::OnStrand;
pub use crate::igloo::{Igloo, Span, frame_around};

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
