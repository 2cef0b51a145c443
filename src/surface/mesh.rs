//! Triangle meshes.

use glam::{DVec3, Vec3};
use thiserror::Error;

/// Diffuse reflectance where nothing gives one: grey.
pub const DEFAULT_DIFFUSE: Vec3 = Vec3::splat(0.5);

/// A triangle mesh with one material a triangle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Unit normals, one a vertex, or empty.
    pub normals: Vec<Vec3>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Index into `materials`, one a triangle.
    pub material: Vec<u32>,
    /// The materials; at least one.
    pub materials: Vec<Material>,
}

/// An opaque Lambert surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the MTL file, for messages.
    pub name: String,
    /// Diffuse reflectance, 0 to 1, linear Rec.709.
    pub diffuse: Vec3,
}

impl Default for Material {
    fn default() -> Self {
        Self { name: "default".into(), diffuse: DEFAULT_DIFFUSE }
    }
}

/// A broken promise of [`Mesh`].
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Flaw {
    #[error("it has no triangles")]
    Empty,
    #[error("vertex {vertex} is {position}, which is not finite")]
    NotFinite { vertex: usize, position: Vec3 },
    #[error("normal {vertex} is {normal}, which is not of unit length")]
    Normal { vertex: usize, normal: Vec3 },
    #[error("{what}: {found} where there should be {expected}")]
    Length { what: &'static str, expected: usize, found: usize },
    #[error("triangle {triangle} uses {what} {index}, but there are only {count}")]
    Index { triangle: usize, what: &'static str, index: u32, count: usize },
}

impl Mesh {
    /// Checks everything that the fields promise.
    ///
    /// # Errors
    /// The first flaw found.
    pub fn validate(&self) -> Result<(), Flaw> {
        let (vertices, triangles) = (self.positions.len(), self.triangles.len());
        if triangles == 0 {
            return Err(Flaw::Empty);
        }
        if !self.normals.is_empty() && self.normals.len() != vertices {
            return Err(Flaw::Length { what: "normals", expected: vertices, found: self.normals.len() });
        }
        if self.material.len() != triangles {
            return Err(Flaw::Length { what: "material indices", expected: triangles, found: self.material.len() });
        }
        for (triangle, (corners, &material)) in self.triangles.iter().zip(&self.material).enumerate() {
            if let Some(&index) = corners.iter().find(|&&c| c as usize >= vertices) {
                return Err(Flaw::Index { triangle, what: "vertex", index, count: vertices });
            }
            if material as usize >= self.materials.len() {
                let count = self.materials.len();
                return Err(Flaw::Index { triangle, what: "material", index: material, count });
            }
        }
        if let Some(vertex) = self.positions.iter().position(|p| !p.is_finite()) {
            return Err(Flaw::NotFinite { vertex, position: self.positions[vertex] });
        }
        let is_unit = |n: &Vec3| (n.length() - 1.0).abs() <= 1e-3;
        if let Some(vertex) = self.normals.iter().position(|n| !is_unit(n)) {
            return Err(Flaw::Normal { vertex, normal: self.normals[vertex] });
        }
        Ok(())
    }

    /// The corners of the smallest box around all finite vertices; none where there are none.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        crate::hair::strands::bounds(&self.positions)
    }

    /// The corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|i| self.positions[i as usize].as_dvec3())
    }

    /// Twice the triangle's area in the direction of its geometric normal.
    #[inline]
    pub fn area_vector(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a)
    }

    /// Area of all triangles, in squared units of the positions.
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|i| 0.5 * self.area_vector(i).length()).sum()
    }

    /// The enclosed volume, negative where the mesh is inside out; means nothing for a mesh that is not closed.
    pub fn volume(&self) -> f64 {
        // Relative to a corner of the mesh: far from the origin the terms would cancel badly.
        let origin = self.positions.first().map_or(DVec3::ZERO, |p| p.as_dvec3());
        let term = |[a, b, c]: [DVec3; 3]| (a - origin).dot((b - origin).cross(c - origin)) / 6.0;
        (0..self.triangles.len()).map(|i| term(self.corners(i))).sum()
    }
}
