//! From a direction to a face by a table over the octahedral map (Engelhardt and Dachsbacher 2008), without branches or arctangents.
//!
//! The map folds the sphere's octahedron into the square [-1, 1]²; a cell of the square holds the face under its middle. Next to a
//! border between faces the answer may be the neighbour: good enough for lumps of hair, not for projecting a segment.

use glam::Vec3;

use super::{Igloo, Span};

/// Cells of the square for each face of a whole sphere.
const CELLS_PER_FACE: usize = 16;

/// Largest side of the table: 4 MiB.
const LARGEST_SIDE: usize = 1024;

/// The table.
#[derive(Clone, Debug, Default)]
pub struct FaceTable {
    side: usize,
    faces: Vec<u32>,
}

impl FaceTable {
    /// The table of an igloo. Directions below a hemisphere give a face of its lowest ring.
    pub fn new(igloo: &Igloo) -> Self {
        let whole = if igloo.span() == Span::Sphere { igloo.len() } else { 2 * igloo.len() };
        // An even side puts the horizon on the diagonals of cells and the poles on a corner.
        let side = (2 * ((CELLS_PER_FACE * whole) as f64).sqrt().div_euclid(2.0) as usize).clamp(8, LARGEST_SIDE);
        let middle = |i: usize| (i as f32 + 0.5) / side as f32 * 2.0 - 1.0;
        let face = |cell: usize| {
            let direction = unfold(middle(cell % side), middle(cell / side)).normalize();
            igloo.face_of(direction) as u32
        };
        Self { side, faces: (0..side * side).map(face).collect() }
    }

    /// Cells along a side.
    pub fn side(&self) -> usize {
        self.side
    }

    /// The face of each cell, row by row.
    pub fn faces(&self) -> &[u32] {
        &self.faces
    }
}

/// The direction (not of unit length) of a point of the square.
fn unfold(x: f32, y: f32) -> Vec3 {
    let z = 1.0 - x.abs() - y.abs();
    if z >= 0.0 { Vec3::new(x, y, z) } else { Vec3::new((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y), z) }
}
