//! Triangle meshes.

use glam::Vec3;

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
