//! Strands: hair as one structure of arrays.

use glam::Vec3;

/// A quantity that is the same everywhere, or given per strand, or per point.
#[derive(Clone, Debug, PartialEq)]
pub enum Attribute<T> {
    Uniform(T),
    PerStrand(Vec<T>),
    PerPoint(Vec<T>),
}

impl<T: Copy> Attribute<T> {
    /// The value at a point of a strand; `point` counts over all strands.
    pub fn at(&self, strand: usize, point: usize) -> T {
        match self {
            Self::Uniform(value) => *value,
            Self::PerStrand(values) => values[strand],
            Self::PerPoint(values) => values[point],
        }
    }
}

/// Hair: polylines with a width, a colour and a transparency, in the space of whoever holds them.
#[derive(Clone, Debug, PartialEq)]
pub struct Strands {
    /// The points of all strands, one strand after the other, root first.
    pub points: Vec<Vec3>,
    /// Where each strand begins in `points`, and one past the last: strand `i` owns `first[i]..first[i + 1]`, at least two points.
    pub first: Vec<u32>,
    /// Width (diameter), in the units of `points`.
    pub width: Attribute<f32>,
    /// Diffuse reflectance, linear Rec.709.
    pub color: Attribute<Vec3>,
    /// Transmittance of one crossing, 0 opaque to 1 invisible.
    pub transparency: Attribute<f32>,
}
