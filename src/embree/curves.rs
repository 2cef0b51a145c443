//! Hair segments in Embree.

use std::fmt;

use embree4_sys as sys;
use glam::Vec4;

use super::scene::{Buffer, GeometryKind, SceneHandle};
use super::{Device, Error, LARGEST_COORDINATE, check_coordinates, check_count};
use crate::tally::Work;

/// Hair segments, ready to be traced: ribbons that face the ray, of linearly interpolated radius.
///
/// A ray crosses a segment where, seen along the ray, the nearest point of the segment's axis is no farther away than the radius there. Two
/// rules of Embree and of this module:
/// - **Self-intersection.** Embree drops a crossing unless its distance along the ray exceeds twice the radius *at the crossing* (interpolated;
///   with a unit direction `distance > 2 * radius`, whatever `near` is). It judges by that only, so it is no substitute for excluding by identity.
/// - **Joints.** Embree's segments have round ends, so neighbours would both report a crossing at their joint. There `u` is clamped to exactly
///   0 or 1; such crossings are dropped. What remains ends
///   square, a bend leaves a gap or an overlap of at most a radius, and a ray through a joint to the last bit crosses neither side.
pub struct CurveScene {
    // Before the buffers: fields are dropped in this order.
    pub(super) scene: SceneHandle,
    vertices: Vec<Vec4>,
    segments: Vec<u32>,
}

impl CurveScene {
    /// Builds a scene of segments; no segments at all is allowed.
    ///
    /// `vertices` hold a position and a **radius** (half the width) in the same unit; segment `i` runs from vertex `segments[i]` to the next.
    /// Refuses vertices that are not finite and negative radii, which Embree would drop together with their segments, and vertices not there.
    pub fn build(device: &Device, vertices: Vec<Vec4>, segments: Vec<u32>) -> Result<Self, Error> {
        let count = vertices.len();
        check_count("vertices", count)?;
        check_count("segments", segments.len())?;
        for (index, vertex) in vertices.iter().enumerate() {
            check_coordinates(index, vertex.truncate())?;
            if !(0.0..LARGEST_COORDINATE).contains(&vertex.w) {
                return Err(Error::Radius { index, radius: vertex.w });
            }
        }
        if let Some(index) = segments.iter().position(|&first| first as usize + 1 >= count) {
            return Err(Error::Segment { index, first: segments[index], count });
        }
        let kind = GeometryKind {
            geometry: sys::RTC_GEOMETRY_TYPE_FLAT_LINEAR_CURVE,
            scene_flags: sys::RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS,
            argument_filter: true,
            during: "building a scene of hair segments",
            counted: [Work::CurveGeometries, Work::CurveSegments],
        };
        let vertex_buffer =
            Buffer { data: vertices.as_ptr().cast(), stride: size_of::<Vec4>(), count, format: sys::RTC_FORMAT_FLOAT4 };
        let index_buffer = Buffer {
            data: segments.as_ptr().cast(),
            stride: size_of::<u32>(),
            count: segments.len(),
            format: sys::RTC_FORMAT_UINT,
        };
        // SAFETY: both vectors go into the result beside the handle, are dropped after it and never changed, and a vector's elements do not
        // move with it; a vertex has 16 bytes; the indices, and the one after each, were checked.
        let scene = unsafe { SceneHandle::build(device, &kind, &vertex_buffer, &index_buffer)? };
        Ok(Self { scene, vertices, segments })
    }

    /// The vertices (position, radius), as given.
    pub fn vertices(&self) -> &[Vec4] {
        &self.vertices
    }

    /// The first vertex of each segment, as given.
    pub fn segments(&self) -> &[u32] {
        &self.segments
    }
}

impl fmt::Debug for CurveScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CurveScene({} segments)", self.segments.len())
    }
}
