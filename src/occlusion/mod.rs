//! Γ: how much of each face of an igloo the hair lets through (paper, Eq. 8 and 10).
//!
//! Two independent estimators: projection of the segments on the igloo, far hair gathered in `clusters` or `thinned` out, and
//! `raytraced`. A `segment` by itself is projected on the sphere (`projection`) or as in the paper (`tangent`). Both estimators work in render space with `OnStrand`'s rule for what does not count, and both stop at the first opaque
//! surface, whose distance per face the caller knows.

pub mod accuracy;
pub mod clusters;
pub mod depth_map;
mod lanes;
pub mod layer;
pub mod projection;
mod query;
mod raster;
pub mod raytraced;
mod ribbon;
pub mod segment;
mod sobol;
pub mod tangent;
#[cfg(test)]
mod testing;
pub mod thinned;
mod view;
mod walk;

use glam::{Mat3, Vec3};

pub use accuracy::{Calibration, Fineness, Reference, Site, calibrate};
pub use clusters::ClusterTree;
pub use depth_map::DepthMap;
pub use layer::Transmittance;
pub use query::{Instructions, Scratch};
pub use raytraced::{Crossings, HairRays, RaySettings};
pub use thinned::{ThinnedSegments, Thinning};

use crate::hair::OnStrand;
pub use crate::igloo::{Igloo, Span, frame_around};

/// How a segment by itself is projected on the igloo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// On the sphere, exactly, wide ribbons in slices (`projection`).
    Sphere,
    /// On the plane tangent to the hemisphere's top (paper, A.2; `tangent`).
    TangentPlane,
}

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
