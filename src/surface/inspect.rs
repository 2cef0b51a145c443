//! What a mesh is like: the facts behind `tress info`.

use std::collections::HashMap;

use glam::Vec3;
use serde::Serialize;

use super::mesh::Mesh;

/// Facts about a mesh.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    pub vertices: usize,
    pub triangles: usize,
    /// Lowest and highest corner of the box around it, over finite vertices.
    pub bounds: Option<[[f32; 3]; 2]>,
    /// In squared units of the positions.
    pub area: f64,
    /// Whether it has a normal at each vertex.
    pub normals: bool,
    /// Triangles of no area, or with a corner twice.
    pub degenerate_triangles: usize,
    pub not_finite_vertices: usize,
    /// Whether each edge belongs to two triangles that run along it in opposite directions; vertices at the same
    /// position count as one, and triangles of no area do not count.
    pub closed: bool,
    /// Edges that break the rule for `closed`.
    pub open_edges: usize,
    /// Triangles of each material.
    pub materials: Vec<MaterialReport>,
    /// What a user may not have meant.
    pub suspicious: Vec<String>,
}

/// Facts about a material of a mesh.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaterialReport {
    pub name: String,
    /// Linear Rec.709.
    pub diffuse: [f32; 3],
    pub triangles: usize,
}

/// Looks a mesh over. Its indices must be sound, as [`Mesh::validate`] tells; the positions need not be finite.
pub fn inspect(mesh: &Mesh) -> Report {
    let degenerate: Vec<bool> = (0..mesh.triangles.len()).map(|i| is_degenerate(mesh, i)).collect();
    let degenerate_triangles = degenerate.iter().filter(|d| **d).count();
    let open_edges = open_edges(mesh, &degenerate);
    let mut materials: Vec<MaterialReport> = (mesh.materials.iter())
        .map(|m| MaterialReport { name: m.name.clone(), diffuse: m.diffuse.to_array(), triangles: 0 })
        .collect();
    for &index in &mesh.material {
        materials[index as usize].triangles += 1;
    }
    let not_finite_vertices = mesh.positions.iter().filter(|p| !p.is_finite()).count();
    let closed = open_edges == 0 && degenerate_triangles < mesh.triangles.len();
    let mut suspicious = vec![];
    if degenerate_triangles > 0 {
        suspicious.push(format!("{degenerate_triangles} triangles have no area"));
    }
    if not_finite_vertices > 0 {
        suspicious.push(format!("{not_finite_vertices} vertices are not finite"));
    }
    if closed && mesh.volume() < 0.0 {
        suspicious.push("the mesh is closed, but its triangles face inwards".into());
    }
    Report {
        vertices: mesh.positions.len(),
        triangles: mesh.triangles.len(),
        bounds: mesh.bounds().map(|b| b.map(|c| c.to_array())),
        area: mesh.area(),
        normals: !mesh.normals.is_empty(),
        degenerate_triangles,
        not_finite_vertices,
        closed,
        open_edges,
        materials,
        suspicious,
    }
}

/// Whether a triangle has no area, up to the rounding of f64; one with a corner that is not finite has none.
pub(super) fn is_degenerate(mesh: &Mesh, triangle: usize) -> bool {
    let [a, b, c] = mesh.corners(triangle);
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    let share = mesh.area_vector(triangle).length() / longest;
    share.is_nan() || share <= 1e-12
}

/// Edges not shared by exactly one triangle on either side, with vertices welded by position.
fn open_edges(mesh: &Mesh, degenerate: &[bool]) -> usize {
    let mut welded: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.positions.len());
    // Adding zero makes -0 equal to 0.
    let key = |p: &Vec3| (*p + Vec3::ZERO).to_array().map(f32::to_bits);
    let weld: Vec<u32> =
        (mesh.positions.iter().enumerate()).map(|(i, p)| *welded.entry(key(p)).or_insert(i as u32)).collect();
    // Per edge, how many triangles run along it from the lower to the higher vertex, and how many back.
    let mut edges: HashMap<(u32, u32), [u32; 2]> = HashMap::with_capacity(mesh.triangles.len() * 3 / 2);
    for (triangle, _) in mesh.triangles.iter().zip(degenerate).filter(|(_, degenerate)| !**degenerate) {
        let [a, b, c] = triangle.map(|i| weld[i as usize]);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            edges.entry((from.min(to), from.max(to))).or_default()[usize::from(from > to)] += 1;
        }
    }
    edges.values().filter(|uses| **uses != [1, 1]).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::primitives::{plane, sphere};
    use glam::DVec3;

    #[test]
    fn closed_and_open_are_told_apart() {
        let mut mesh = sphere(DVec3::ZERO, 1.0);
        assert_eq!((inspect(&mesh).closed, inspect(&mesh).suspicious.len()), (true, 0));
        mesh.triangles.pop();
        mesh.material.pop();
        let report = inspect(&mesh);
        assert_eq!((report.closed, report.open_edges), (false, 3));
        let report = inspect(&plane(DVec3::ZERO, DVec3::Y, [1.0, 1.0]));
        assert_eq!((report.closed, report.open_edges, report.degenerate_triangles), (false, 4, 0));
    }

    #[test]
    fn seams_with_twin_vertices_count_as_closed() {
        let mesh = sphere(DVec3::ZERO, 1.0);
        let mut soup = Mesh { materials: mesh.materials.clone(), material: mesh.material.clone(), ..Mesh::default() };
        for triangle in &mesh.triangles {
            let base = soup.positions.len() as u32;
            soup.positions.extend(triangle.iter().map(|&i| mesh.positions[i as usize]));
            soup.triangles.push([base, base + 1, base + 2]);
        }
        assert!(inspect(&soup).closed);
        for triangle in &mut soup.triangles {
            triangle.swap(0, 1);
        }
        assert!(inspect(&soup).suspicious[0].contains("face inwards"));
        soup.triangles[5] = [0, 1, 1];
        soup.positions[40].x = f32::NAN;
        let report = inspect(&soup);
        assert_eq!((report.degenerate_triangles, report.not_finite_vertices), (2, 1));
        assert_eq!(report.suspicious.len(), 2);
    }
}
