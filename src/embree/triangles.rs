//! Surfaces in Embree: closest hit and occlusion.

use std::fmt;
use std::ptr;

use embree4_sys as sys;
use glam::Vec3;

use super::scene::{Buffer, GeometryKind, SceneHandle};
use super::{Device, Error, check_coordinates, check_count, embree_ray};
use crate::tally::{self, Work};

/// How many rays of [`TriangleScene::closest_from`] Embree gets at a time.
const PACKET: usize = 16;

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// In lengths of the ray's direction.
    pub distance: f32,
    /// Which triangle, as given to [`TriangleScene::build`].
    pub triangle: u32,
    /// Weight of the triangle's second vertex; the first has `1 - u - v`.
    pub u: f32,
    /// Weight of the triangle's third vertex.
    pub v: f32,
    /// Geometric normal `(v1 - v0) × (v2 - v0)`: its length is twice the triangle's area.
    pub normal: Vec3,
}

/// Triangles, ready to be traced. Watertight: a ray does not slip through a shared edge.
pub struct TriangleScene {
    // Before the buffers: fields are dropped in this order.
    scene: SceneHandle,
    /// One more than the caller gave, because Embree reads the last one with 16 bytes.
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl TriangleScene {
    /// Builds a scene of indexed triangles; no triangles at all is allowed.
    ///
    /// Refuses vertices that are not finite, which Embree would drop together with their triangles, and indices of vertices that are not there.
    pub fn build(device: &Device, mut positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<Self, Error> {
        let count = positions.len();
        check_count("vertices", count)?;
        check_count("triangles", triangles.len())?;
        positions.iter().enumerate().try_for_each(|(index, &p)| check_coordinates(index, p))?;
        if let Some(index) = triangles.iter().position(|t| t.iter().any(|&v| v as usize >= count)) {
            return Err(Error::Triangle { index, vertices: triangles[index], count });
        }
        positions.push(Vec3::ZERO);
        let kind = GeometryKind {
            geometry: sys::RTC_GEOMETRY_TYPE_TRIANGLE,
            scene_flags: sys::RTC_SCENE_FLAG_ROBUST,
            argument_filter: false,
            during: "building a scene of triangles",
            counted: [Work::TriangleGeometries, Work::Triangles],
        };
        let vertex_buffer = Buffer {
            data: positions.as_ptr().cast(),
            stride: size_of::<Vec3>(),
            count,
            format: sys::RTC_FORMAT_FLOAT3,
        };
        let index_buffer = Buffer {
            data: triangles.as_ptr().cast(),
            stride: size_of::<[u32; 3]>(),
            count: triangles.len(),
            format: sys::RTC_FORMAT_UINT3,
        };
        // SAFETY: both vectors go into the result beside the handle, are dropped after it and never changed, and a vector's elements do not
        // move with it; the vertex pushed above makes the last one readable as 16 bytes; the indices were checked.
        let scene = unsafe { SceneHandle::build(device, &kind, &vertex_buffer, &index_buffer)? };
        Ok(Self { scene, positions, triangles })
    }

    /// The vertices, as given.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions[..self.positions.len() - 1]
    }

    /// The triangles, as given.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The first triangle that the ray meets at a distance in `near..=far`, from either side. A ray that is not finite meets nothing.
    pub fn closest(&self, origin: Vec3, direction: Vec3, near: f32, far: f32) -> Option<TriangleHit> {
        let ray = embree_ray(origin, direction, near, far)?;
        tally::add(Work::FirstHits, 1);
        let none = u32::MAX;
        let hit = sys::RTCHit { primID: none, geomID: none, instID: [none], instPrimID: [none], ..Default::default() };
        let mut query = sys::RTCRayHit { ray, hit };
        // SAFETY: the scene is committed; `query` is a whole, aligned RTCRayHit; null arguments mean the defaults.
        unsafe { sys::rtcIntersect1(self.scene.scene, &raw mut query, ptr::null_mut()) };
        let hit = &query.hit;
        (hit.geomID != none).then(|| TriangleHit {
            distance: query.ray.tfar,
            triangle: hit.primID,
            u: hit.u,
            v: hit.v,
            normal: Vec3::new(hit.Ng_x, hit.Ng_y, hit.Ng_z),
        })
    }

    /// [`Self::closest`] for many rays from one point, neighbouring directions next to each other: `take` gets the number of each ray, in order, and
    /// what it meets.
    ///
    /// As sixteen rays at a time share their way through the tree, a ray costs a fraction of what it costs alone. Which of two triangles at the same
    /// distance is met may differ from [`Self::closest`].
    pub fn closest_from(&self, origin: Vec3, directions: &[Vec3], mut take: impl FnMut(usize, Option<TriangleHit>)) {
        tally::add(Work::GatherRays, directions.len() as u64);
        for (first, directions) in (0..).step_by(PACKET).zip(directions.chunks(PACKET)) {
            let hits = self.closest_packet(origin, directions);
            (0..directions.len()).for_each(|i| take(first + i, hits[i]));
        }
    }

    fn closest_packet(&self, origin: Vec3, directions: &[Vec3]) -> [Option<TriangleHit>; PACKET] {
        #[repr(C, align(64))]
        struct Valid([i32; PACKET]);
        let none = u32::MAX;
        let mut valid = Valid([0; PACKET]);
        let mut query = sys::RTCRayHit16::default();
        query.hit.geomID = [none; PACKET];
        query.hit.instID = [[none; PACKET]];
        query.hit.instPrimID = [[none; PACKET]];
        let rays = &mut query.ray;
        for (i, &direction) in directions.iter().enumerate().take(PACKET) {
            let Some(ray) = embree_ray(origin, direction, 0.0, f32::INFINITY) else { continue };
            valid.0[i] = -1;
            (rays.org_x[i], rays.org_y[i], rays.org_z[i]) = (ray.org_x, ray.org_y, ray.org_z);
            (rays.dir_x[i], rays.dir_y[i], rays.dir_z[i]) = (ray.dir_x, ray.dir_y, ray.dir_z);
            (rays.tnear[i], rays.tfar[i], rays.mask[i]) = (ray.tnear, ray.tfar, ray.mask);
        }
        // SAFETY: the scene is committed; mask and query are whole and aligned to 64 bytes, as Embree asks for, and live through the call, on
        // this thread alone; null arguments mean the defaults.
        unsafe { sys::rtcIntersect16(valid.0.as_ptr(), self.scene.scene, &raw mut query, ptr::null_mut()) };
        let (ray, hit) = (&query.ray, &query.hit);
        std::array::from_fn(|i| {
            (valid.0[i] != 0 && hit.geomID[i] != none).then(|| TriangleHit {
                distance: ray.tfar[i],
                triangle: hit.primID[i],
                u: hit.u[i],
                v: hit.v[i],
                normal: Vec3::new(hit.Ng_x[i], hit.Ng_y[i], hit.Ng_z[i]),
            })
        })
    }

    /// Whether the ray meets any triangle at a distance in `near..=far`.
    pub fn occluded(&self, origin: Vec3, direction: Vec3, near: f32, far: f32) -> bool {
        tally::add(Work::ShadowRays, 1);
        let Some(mut ray) = embree_ray(origin, direction, near, far) else { return false };
        // SAFETY: the scene is committed; `ray` is a whole, aligned RTCRay; null arguments mean the defaults.
        unsafe { sys::rtcOccluded1(self.scene.scene, &raw mut ray, ptr::null_mut()) };
        ray.tfar == f32::NEG_INFINITY
    }
}

impl fmt::Debug for TriangleScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "TriangleScene({} triangles)", self.triangles.len())
    }
}
