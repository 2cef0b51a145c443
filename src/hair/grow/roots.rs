//! Where strands stand: random points of equal density on the triangles whose slope is in range.

use glam::DVec3;

use super::{GrowError, Key, Purpose};
use crate::surface::Mesh;

/// Slopes are compared with this tolerance: normals are stored in f32.
const TOLERANCE: f64 = 1e-6;

/// Points tried for a strand. Each lies on a triangle that reaches into the range of slopes; few are ever needed.
const ATTEMPTS: u32 = 10_000;

/// Where a strand stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Root {
    pub position: DVec3,
    /// Unit normal, interpolated where the mesh has normals.
    pub normal: DVec3,
    /// Unit normal of the triangle, on the same side.
    pub flat_normal: DVec3,
}

/// The part of a mesh that roots may stand on.
pub(super) struct Roots<'a> {
    mesh: &'a Mesh,
    /// Triangles that reach into the range of slopes.
    triangles: Vec<u32>,
    /// Twice the area of those triangles, summed up to and including each.
    cumulative: Vec<f64>,
    slope: [f64; 2],
    up: DVec3,
}

impl<'a> Roots<'a> {
    pub fn new(mesh: &'a Mesh, slope: [f64; 2], up: DVec3) -> Result<Self, GrowError> {
        let mut roots = Self { mesh, triangles: vec![], cumulative: vec![], slope, up };
        let (mut total, mut any) = (0.0, false);
        for triangle in 0..mesh.triangles.len() {
            let area_vector = mesh.area_vector(triangle);
            let area = area_vector.length();
            if !(area > 0.0 && area.is_finite()) {
                continue;
            }
            any = true;
            if roots.reaches_slope(triangle, area_vector / area) {
                total += area;
                roots.triangles.push(triangle as u32);
                roots.cumulative.push(total);
            }
        }
        match (any, roots.triangles.is_empty() || !total.is_finite()) {
            (false, _) => Err(GrowError::NoArea),
            (true, true) => Err(roots.no_slope()),
            _ => Ok(roots),
        }
    }

    /// Area of the triangles that roots may stand on, in squared scene units.
    pub fn area(&self) -> f64 {
        0.5 * self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// The root for a key.
    pub fn sample(&self, key: Key) -> Result<Root, GrowError> {
        let total = self.cumulative.last().copied().unwrap_or(0.0);
        for attempt in 0..ATTEMPTS {
            let at = key.attempt(Purpose::Triangle, attempt) * total;
            // The product may round up to the total itself.
            let slot = self.cumulative.partition_point(|&sum| sum <= at).min(self.triangles.len() - 1);
            let root = self.point(self.triangles[slot] as usize, key, attempt);
            if self.in_range(root.normal.dot(self.up)) {
                return Ok(root);
            }
        }
        Err(self.no_slope())
    }

    fn no_slope(&self) -> GrowError {
        GrowError::NoSlope { low: self.slope[0], high: self.slope[1] }
    }

    fn in_range(&self, cosine: f64) -> bool {
        (self.slope[0] - TOLERANCE..=self.slope[1] + TOLERANCE).contains(&cosine)
    }

    /// A point of even density on a triangle: the square root turns two uniform numbers into barycentric coordinates.
    fn point(&self, triangle: usize, key: Key, attempt: u32) -> Root {
        let across = key.attempt(Purpose::Across, attempt).sqrt();
        let along = key.attempt(Purpose::Along, attempt);
        let weights = [1.0 - across, across * (1.0 - along), across * along];
        let blend = |values: [DVec3; 3]| values[0] * weights[0] + values[1] * weights[1] + values[2] * weights[2];
        let flat = self.mesh.area_vector(triangle).normalize();
        let normal = match self.corner_normals(triangle) {
            Some(normals) => blend(normals).try_normalize().unwrap_or(flat),
            None => flat,
        };
        // The stored normals say where outside is, even if the triangle is wound the wrong way.
        let flat_normal = if flat.dot(normal) < 0.0 { -flat } else { flat };
        Root { position: blend(self.mesh.corners(triangle)), normal, flat_normal }
    }

    fn corner_normals(&self, triangle: usize) -> Option<[DVec3; 3]> {
        let normals = &self.mesh.normals;
        (!normals.is_empty()).then(|| self.mesh.triangles[triangle].map(|i| normals[i as usize].as_dvec3()))
    }

    /// Whether any point of the triangle can have a slope in range. Interpolated normals lie in the cone around the
    /// corners' mean that holds all corners' normals.
    fn reaches_slope(&self, triangle: usize, flat: DVec3) -> bool {
        let Some(normals) = self.corner_normals(triangle) else { return self.in_range(flat.dot(self.up)) };
        let Some(axis) = (normals[0] + normals[1] + normals[2]).try_normalize() else { return true };
        let angle = |a: DVec3, b: DVec3| a.dot(b).clamp(-1.0, 1.0).acos();
        let spread = normals.iter().map(|&n| angle(axis, n)).fold(0.0, f64::max);
        if spread >= std::f64::consts::FRAC_PI_2 {
            return true;
        }
        let tilt = angle(axis, self.up);
        let highest = (tilt - spread).max(0.0).cos();
        let lowest = (tilt + spread).min(std::f64::consts::PI).cos();
        lowest <= self.slope[1] + TOLERANCE && highest >= self.slope[0] - TOLERANCE
    }
}
