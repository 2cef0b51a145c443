//! All surfaces of a scene as one model in render space, and the rays that meet it.

use glam::{DVec3, Vec3};

use super::{Mesh, Optics};
use crate::embree::{Device, Error, TriangleHit, TriangleScene};

/// What a triangle is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finish {
    /// Diffuse reflectance, 0 to 1.
    pub albedo: Vec3,
    /// Radiance that leaves the side of the triangle's winding, W/(m² sr); zero but for area lights.
    pub emission: Vec3,
    /// Where light goes on from a surface that is not diffuse; its albedo is zero.
    pub optics: Option<Optics>,
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
        let finish = |albedo| Finish { albedo, emission: Vec3::ZERO, optics: None };
        self.finishes.extend(mesh.materials.iter().map(|m| finish(m.diffuse)));
        self.add_triangles(&mesh.positions, if smooth { &mesh.normals } else { &[] }, &mesh.triangles);
        self.finish.extend(mesh.material.iter().map(|&m| finishes + m));
    }

    /// Adds a mesh of mirror or glass, whatever its materials say.
    pub fn add_optics(&mut self, mesh: &Mesh, smooth: bool, optics: Optics) {
        let finish = self.finishes.len() as u32;
        self.finishes.push(Finish { albedo: Vec3::ZERO, emission: Vec3::ZERO, optics: Some(optics) });
        self.add_triangles(&mesh.positions, if smooth { &mesh.normals } else { &[] }, &mesh.triangles);
        self.finish.extend(std::iter::repeat_n(finish, mesh.triangles.len()));
    }

    /// Adds a rectangle that shines from the side of `edge_u` x `edge_v` and reflects nothing.
    pub fn add_light(&mut self, corner: Vec3, edge_u: Vec3, edge_v: Vec3, radiance: Vec3) {
        let corners = [corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v];
        self.add_triangles(&corners, &[], &[[0, 1, 2], [0, 2, 3]]);
        self.light_triangles += 2;
        self.finish.extend([self.finishes.len() as u32; 2]);
        self.finishes.push(Finish { albedo: Vec3::ZERO, emission: radiance, optics: None });
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
        self.finishes.iter().any(|finish| finish.albedo != Vec3::ZERO || finish.optics.is_some())
    }

    /// Whether any surface is a mirror or of glass.
    pub fn is_specular(&self) -> bool {
        self.finishes.iter().any(|finish| finish.optics.is_some())
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
    /// Where rays leave from: the position, but clear of the triangle's edges, and off the surface.
    pub leaving: Vec3,
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
    /// Where light goes on from a surface that is not diffuse.
    pub optics: Option<Optics>,
    /// Whether the ray comes from the side of the triangle's winding.
    pub outside: bool,
}

impl SurfacePoint {
    /// A place of a flat white surface, seen from a distance of 1.
    #[cfg(test)]
    pub(crate) fn white(position: Vec3, normal: Vec3) -> Self {
        Self {
            distance: 1.0,
            position,
            leaving: position,
            flat_normal: normal,
            normal,
            triangle: 0,
            finish: 0,
            albedo: Vec3::ONE,
            emission: Vec3::ZERO,
            optics: None,
            outside: true,
        }
    }

    /// An origin for rays that leave the surface.
    pub fn leaving(&self) -> Vec3 {
        self.leaving
    }
}

/// How far points are moved off a surface: the rounding error of their position (after Wächter and Binder 2019, "A Fast and Robust Method for
/// Avoiding Self-Intersection").
fn lift(position: Vec3) -> f32 {
    let size = position.abs().max(Vec3::splat(1.0 / 64.0));
    (size * (32.0 * f32::EPSILON)).length()
}

/// A point of a surface, moved off it on the side of its unit normal by the rounding error of its position.
pub fn lifted(position: Vec3, normal: Vec3) -> Vec3 {
    position + normal * lift(position)
}

/// How many lifts a point from which rays leave is away from its triangle's edges, at least, where the triangle is so large. At an edge another wall may
/// begin: a point beside it by less than rounding is beyond that wall, and where the walls meet at an angle φ one that is lifted off the first is, from 1 / tan φ
/// lifts on: 2 are enough for 27 degrees.
const CLEAR: f32 = 2.0;

/// A point of a triangle by its weights, moved towards the middle until it is [`CLEAR`] of the edges.
fn clear_of_edges(position: Vec3, weights: [f32; 3], corners: [Vec3; 3], twice_area: f32) -> Vec3 {
    let distance = CLEAR * lift(position);
    let mut share = 0.0_f32;
    for (i, weight) in weights.into_iter().enumerate() {
        let edge = corners[(i + 1) % 3].distance(corners[(i + 2) % 3]);
        // The weight at which the point is so far from this edge. In the middle it is a third.
        let least = distance * edge / twice_area;
        if weight < least {
            share = share.max(((least - weight) / (1.0 / 3.0 - weight).max(f32::MIN_POSITIVE)).min(1.0));
        }
    }
    if share == 0.0 {
        return position;
    }
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    position + (middle - position) * share
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
        let places = corners.map(|v| self.scene.positions()[v]);
        let mix = |values: &[Vec3]| (0..3).map(|i| values[corners[i]] * weights[i]).sum::<Vec3>();
        let outside = hit.normal.dot(direction) <= 0.0;
        let side = if outside { 1.0 } else { -1.0 };
        let flat_normal = hit.normal.normalize_or(-direction * side) * side;
        // An interpolated normal that turns away from the ray would light the point from behind: the triangle's own then.
        let smooth = mix(&self.normals).normalize_or_zero() * side;
        let normal = if smooth.dot(direction) < 0.0 { smooth } else { flat_normal };
        let finish = self.finish[hit.triangle as usize];
        let Finish { albedo, emission, optics } = self.finishes[finish as usize];
        // From the corners, not along the ray: its error does not grow with the distance.
        let position = mix(self.scene.positions());
        let clear = clear_of_edges(position, weights, places, hit.normal.length());
        SurfacePoint {
            distance: hit.distance,
            position,
            leaving: lifted(clear, flat_normal),
            flat_normal,
            normal,
            triangle: hit.triangle,
            finish,
            albedo,
            emission: if outside { emission } else { Vec3::ZERO },
            optics,
            outside,
        }
    }

    /// Where a ray towards a light leaves from a point: from the surface that its normals tell of, where the light is behind the triangle but before that.
    ///
    /// A facet of a rounded body that turns away from the light where the body does not would else shadow itself: all black beside its lit
    /// neighbours. Each corner has a tangent plane by its normal; the point is moved to the mean of its feet on those that it lies below (Hanika 2021,
    /// "Hacking the Shadow Terminator"), which is outside a rounded body by a fraction of its facets' sag. Where a body is hollow nothing is moved.
    pub fn toward_light(&self, point: &SurfacePoint, toward: Vec3) -> Vec3 {
        if toward.dot(point.flat_normal) >= 0.0 || toward.dot(point.normal) <= 0.0 {
            return point.leaving;
        }
        let corners = self.scene.triangles()[point.triangle as usize].map(|v| v as usize);
        // Products of four small sides would leave the normal numbers of f32.
        let places = corners.map(|v| self.scene.positions()[v].as_dvec3());
        let (here, flat) = (point.position.as_dvec3(), point.flat_normal.as_dvec3());
        let normal = (places[1] - places[0]).cross(places[2] - places[0]);
        let side = if normal.dot(flat) >= 0.0 { 1.0 } else { -1.0 };
        let mut moved = DVec3::ZERO;
        for i in 0..3 {
            let [a, b] = [places[(i + 1) % 3], places[(i + 2) % 3]].map(|corner| corner - here);
            let weight = (a.cross(b).dot(normal) / normal.length_squared()).clamp(0.0, 1.0);
            let tangent = self.normals[corners[i]].as_dvec3().normalize_or_zero() * side;
            moved -= tangent * ((here - places[i]).dot(tangent).min(0.0) * weight);
        }
        if !moved.is_finite() {
            return point.leaving;
        }
        lifted((here + moved).as_vec3(), point.normal)
    }

    /// The corners of the smallest box around all surfaces; none where there are none.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        crate::hair::strands::bounds(self.scene.positions())
    }

    /// A ball around all triangles of each mirror or glass finish: the finish, centre and radius.
    pub fn specular_balls(&self) -> Vec<(u32, Vec3, f32)> {
        let mut points: Vec<Vec<Vec3>> = vec![Vec::new(); self.finishes.len()];
        for (corners, &finish) in self.scene.triangles().iter().zip(&self.finish) {
            if self.finishes[finish as usize].optics.is_some() {
                points[finish as usize].extend(corners.map(|v| self.scene.positions()[v as usize]));
            }
        }
        let ball = |(finish, points): (usize, &Vec<Vec3>)| {
            let [low, high] = crate::hair::strands::bounds(points)?;
            let center = 0.5 * (low + high);
            let radius = points.iter().map(|point| point.distance(center)).fold(0.0, f32::max);
            // A little wider: rounding must not leave a point outside.
            Some((finish as u32, center, radius * 1.0001))
        };
        points.iter().enumerate().filter_map(ball).collect()
    }

    /// Whether anything lies on a ray with unit direction between `near` and `far`.
    pub fn blocks(&self, origin: Vec3, direction: Vec3, near: f32, far: f32) -> bool {
        self.scene.occluded(origin, direction, near, far)
    }
}
