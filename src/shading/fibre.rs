//! What every model of hair's reflection can do: F of a strand that is thinner than a pixel.
//!
//! A point stands for the strand's whole width, so F is the mean over the width: reflected radiance per incident radiance and
//! steradian of the incoming direction, its geometry term (the sine of the angle to the tangent) inside. Over all incoming
//! directions F adds up to the share of a uniform sky that the strand sends to the eye.

use std::fmt::Debug;

use glam::Vec3;

/// A point on a strand, and from where it is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrandPoint {
    /// Unit tangent, from root to tip.
    pub tangent: Vec3,
    /// Unit vector from the point towards the eye.
    pub view: Vec3,
    /// The strand's colour, 0 to 1, linear Rec.709; the model says what it means.
    pub color: Vec3,
}

/// The faces of an igloo, all of one solid angle.
#[derive(Clone, Copy, Debug)]
pub struct Faces<'a> {
    /// The middle of each face, a unit vector.
    pub centers: &'a [Vec3],
    /// Solid angle of a face, in steradians.
    pub solid_angle: f32,
}

/// An incoming direction chosen by chance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampled {
    /// Unit vector towards the light.
    pub incoming: Vec3,
    /// F for it.
    pub reflected: Vec3,
    /// Probability density with which it is chosen, per steradian; above 0.
    pub density: f32,
}

/// How the hair of one object reflects light.
pub trait Fibre: Debug + Send + Sync {
    /// F for light from the unit vector `incoming` (towards the light).
    fn reflect(&self, at: &StrandPoint, incoming: Vec3) -> Vec3;

    /// F of each face, averaged so that its sum over coarse faces keeps the energy; replaces what `reflected` holds.
    fn reflect_faces(&self, at: &StrandPoint, faces: &Faces, reflected: &mut Vec<Vec3>);

    /// A direction about in proportion to F, from four random numbers in [0, 1); none where F is 0.
    fn sample(&self, at: &StrandPoint, random: [f32; 4]) -> Option<Sampled>;

    /// The density with which [`Fibre::sample`] chooses this direction, per steradian.
    fn density(&self, at: &StrandPoint, incoming: Vec3) -> f32;
}

#[cfg(test)]
pub(super) mod testing;
