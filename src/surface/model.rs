//! All surfaces of a scene as one model in render space, and the rays that meet it.

use glam::Vec3;

use super::Mesh;
use crate::embree::{Device, Error, TriangleHit, TriangleScene};

/// What a triangle is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finish {
    /// Diffuse reflectance, 0 to 1.
    pub albedo: Vec3,
    /// Radiance that leaves the side of the triangle's winding, W/(m² sr); zero but for area lights.
    pub emission: Vec3,
}

/// Surfaces of a whole scene.
#[derive(Clone, Debug, Default)]
pub struct SurfaceModel {
    positions: Vec<Vec3>,
    /// Unit normals, zero where a triangle is flat.
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// Index into `finishes`, one a triangle.
    finish: Vec<u32>,
    finishes: Vec<Finish>,
    /// How many of the triangles are area lights.
    light_triangles: usize,
}

impl SurfaceModel {
    /// Adds a mesh that reflects as its materials say. With `smooth` its normals are interpolated, where it has them.
    pub fn add(&mut self, mesh: &Mesh, smooth: bool) {
        let finishes = self.finishes.len() as u32;
        self.finishes.extend(mesh.materials.iter().map(|m| Finish { albedo: m.diffuse, emission: Vec3::ZERO }));
        self.add_triangles(&mesh.positions, if smooth { &mesh.normals } else { &[] }, &mesh.triangles);
        self.finish.extend(mesh.material.iter().map(|&m| finishes + m));
    }

    /// Adds a rectangle that shines from the side of `edge_u` x `edge_v` and reflects nothing.
    pub fn add_light(&mut self, corner: Vec3, edge_u: Vec3, edge_v: Vec3, radiance: Vec3) {
        let corners = [corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v];
        self.add_triangles(&corners, &[], &[[0, 1, 2], [0, 2, 3]]);
        self.light_triangles += 2;
        self.finish.extend([self.finishes.len() as u32; 2]);
        self.finishes.push(Finish { albedo: Vec3::ZERO, emission: radiance });
    }

    fn add_triangles(&mut self, positions: &[Vec3], normals: &[Vec3], triangles: &[[u32; 3]]) {
        let base = self.positions.len() as u32;
        self.positions.extend_from_slice(positions);
        self.normals.extend_from_slice(normals);
        self.normals.resize(self.positions.len(), Vec3::ZERO);
        self.triangles.extend(triangles.iter().map(|t| t.map(|v| v + base)));
    }

    /// Whether there are no surfaces.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Whether any surface reflects light.
    pub fn reflects(&self) -> bool {
        self.finishes.iter().any(|finish| finish.albedo != Vec3::ZERO)
    }

    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.triangles.len()
    }

    /// Number of triangles that are no area lights.
    pub fn mesh_triangles(&self) -> usize {
        self.triangles.len() - self.light_triangles
    }

    /// Vertex positions.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// What it holds, in bytes.
    pub fn bytes(&self) -> u64 {
        let vertices = size_of_val(&self.positions[..]) + size_of_val(&self.normals[..]);
        let triangles = size_of_val(&self.triangles[..]) + size_of_val(&self.finish[..]);
        (vertices + triangles + size_of_val(&self.finishes[..])) as u64
    }

    /// Builds what rays need.
    ///
    /// # Errors
    /// Embree's own.
    pub fn into_traceable(self, device: &Device) -> Result<Surfaces, Error> {
        let scene = TriangleScene::build(device, self.positions, self.triangles)?;
        Ok(Surfaces { scene, normals: self.normals, finish: self.finish, finishes: self.finishes })
    }
}

/// Surfaces that rays can meet.
#[derive(Debug)]
pub struct Surfaces {
    scene: TriangleScene,
    normals: Vec<Vec3>,
    finish: Vec<u32>,
    finishes: Vec<Finish>,
}

/// Where a ray meets a surface. Normals are on the side that the ray comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    pub distance: f32,
    pub position: Vec3,
    /// Unit normal of the triangle.
    pub flat_normal: Vec3,
    /// Unit normal for shading, interpolated where the surface is smooth.
    pub normal: Vec3,
    pub triangle: u32,
    /// Index of the finish: one an object and material.
    pub finish: u32,
    pub albedo: Vec3,
    /// Radiance towards the ray's origin.
    pub emission: Vec3,
}

impl SurfacePoint {
    /// An origin for rays that leave the surface.
    pub fn leaving(&self) -> Vec3 {
        lifted(self.position, self.flat_normal)
    }
}

/// A point of a surface, moved off it on the side of its unit normal by the rounding error of its position (after Wächter and Binder 2019,
/// "A Fast and Robust Method for Avoiding Self-Intersection").
pub fn lifted(position: Vec3, normal: Vec3) -> Vec3 {
    let size = position.abs().max(Vec3::splat(1.0 / 64.0));
    position + normal * (size * (32.0 * f32::EPSILON)).length()
}

impl Surfaces {
    /// The first surface along a ray with unit direction, nearer than `far`.
    pub fn closest(&self, origin: Vec3, direction: Vec3, near: f32, far: f32) -> Option<SurfacePoint> {
        self.scene.closest(origin, direction, near, far).map(|hit| self.point(&hit, direction))
    }

    /// The first surfaces along rays of unit direction from one point, as [`TriangleScene::closest_from`] gives them.
    pub fn closest_from(&self, origin: Vec3, directions: &[Vec3], mut take: impl FnMut(usize, Option<SurfacePoint>)) {
        self.scene.closest_from(origin, directions, |i, hit| take(i, hit.map(|hit| self.point(&hit, directions[i]))));
    }

    /// What a ray with unit direction meets there.
    fn point(&self, hit: &TriangleHit, direction: Vec3) -> SurfacePoint {
        let corners = self.scene.triangles()[hit.triangle as usize].map(|v| v as usize);
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let mix = |values: &[Vec3]| (0..3).map(|i| values[corners[i]] * weights[i]).sum::<Vec3>();
        let outside = hit.normal.dot(direction) <= 0.0;
        let side = if outside { 1.0 } else { -1.0 };
        let flat_normal = hit.normal.normalize_or(-direction * side) * side;
        // An interpolated normal that turns away from the ray would light the point from behind: the triangle's own then.
        let smooth = mix(&self.normals).normalize_or_zero() * side;
        let normal = if smooth.dot(direction) < 0.0 { smooth } else { flat_normal };
        let finish = self.finish[hit.triangle as usize];
        let Finish { albedo, emission } = self.finishes[finish as usize];
        SurfacePoint {
            distance: hit.distance,
            // From the corners, not along the ray: its error does not grow with the distance.
            position: mix(self.scene.positions()),
            flat_normal,
            normal,
            triangle: hit.triangle,
            finish,
            albedo,
            emission: if outside { emission } else { Vec3::ZERO },
        }
    }

    /// The corners of the smallest box around all surfaces; none where there are none.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        crate::hair::strands::bounds(self.scene.positions())
    }

    /// Whether anything lies on a ray with unit direction between `near` and `far`.
    pub fn blocks(&self, origin: Vec3, direction: Vec3, near: f32, far: f32) -> bool {
        self.scene.occluded(origin, direction, near, far)
    }
}
