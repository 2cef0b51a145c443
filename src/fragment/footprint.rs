//! What one hair segment covers in the image: a line with a width, clipped at the near plane and projected.
//!
//! Everything is in `f64`, because end points may lie 1e9 pixels outside the image. A position along the projected segment is its share s of
//! the way in the image, 0 to 1; depth and the segment's own parameter follow from s, since 1/z is linear in s under perspective.

use super::hair::{HairSegment, PixelRect};
use crate::camera::Projection;
use glam::{DVec2, DVec3};
use std::ops::Range;

/// A hair segment in the image, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Where the visible part begins.
    pub start: DVec2,
    /// From there to where it ends.
    pub delta: DVec2,
    /// Length of `delta`, above 0.
    pub length: f64,
    /// Widths at both ends; linear in between, because width / depth is.
    pub width: [f64; 2],
    inverse_depth: [f64; 2],
    parameter: [f64; 2],
    /// Bound on the rounding of positions computed from s.
    slack: f64,
}

impl Footprint {
    /// Clips and projects a segment. `None` if nothing of it can be seen: it lies in front of the near plane, it is a point in the image (a
    /// segment seen end-on covers nothing), or it has a number that is not finite.
    ///
    /// The width in pixels is d f / z of Eq. 7 times √(1 + (h/f)²), where h is the distance of the segment's line from the image centre. This is
    /// exact for a narrow ribbon that faces the eye; without it hair that runs around the image centre is too thin by the cosine of its
    /// angle from the axis.
    pub fn new(segment: &HairSegment, projection: &Projection) -> Option<Self> {
        let [p, q] = segment.ends.map(|end| end.as_dvec3());
        if !(p.is_finite() && q.is_finite() && segment.widths.iter().all(|w| w.is_finite())) {
            return None;
        }
        let parameter = visible_part(p.z, q.z, projection.near)?;
        let [p, q] = parameter.map(|u| {
            let point = p + u * (q - p);
            // Rounding must not put a clipped point in front of the plane.
            DVec3::new(point.x, point.y, point.z.max(projection.near))
        });
        let start = projection.pixel(p);
        let end = projection.pixel(q);
        let delta = end - start;
        let length = delta.x.hypot(delta.y);
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let off_axis = delta.perp_dot(start - projection.center) / length;
        let stretch = 1f64.hypot(off_axis / projection.focal);
        let inverse_depth = [1.0 / p.z, 1.0 / q.z];
        let [d0, d1] = segment.widths.map(|w| f64::from(w).max(0.0));
        let width = [0, 1].map(|i| (d0 + parameter[i] * (d1 - d0)) * projection.focal * stretch * inverse_depth[i]);
        let largest = start.abs().max(end.abs()).max_element() + width[0].max(width[1]);
        Some(Self { start, delta, length, width, inverse_depth, parameter, slack: 64.0 * f64::EPSILON * largest })
    }

    /// Whether it is so wide that its two edges matter and not only its middle line. Below 1/√2 pixels length x width never exceeds the pixel,
    /// even along its diagonal, so that the line loses nothing by clamping.
    pub fn is_wide(&self) -> bool {
        self.width[0].max(self.width[1]) > std::f64::consts::FRAC_1_SQRT_2
    }

    /// Width at s, in pixels.
    pub fn width_at(&self, s: f64) -> f64 {
        self.width[0] + s * (self.width[1] - self.width[0])
    }

    /// Depth at s.
    pub fn depth_at(&self, s: f64) -> f64 {
        let [w0, w1] = self.inverse_depth;
        1.0 / (w0 + s * (w1 - w0))
    }

    /// The segment's own parameter at s, 0 at its first end and 1 at its second.
    pub fn parameter_at(&self, s: f64) -> f64 {
        let [w0, w1] = self.inverse_depth;
        let [u0, u1] = self.parameter;
        // Both terms of the sum are positive: nothing cancels.
        u0 + (u1 - u0) * (s * w1 / (w0 * (1.0 - s) + s * w1))
    }

    /// The pixel rows that it may touch, within a rectangle.
    pub fn rows(&self, rect: &PixelRect) -> Range<u32> {
        let (low, high) = match self.is_wide() {
            false => min_max([self.start.y, self.start.y + self.delta.y]),
            true => min_max(self.corners().map(|corner| corner.y)),
        };
        cells(low - self.slack, high + self.slack, rect.min[1]..rect.max[1])
    }

    /// The pixel columns that it may touch between the heights `top` and `bottom`, within a rectangle. They depend on these heights and on the
    /// segment only, so that every rectangle sees the same candidates.
    pub fn columns(&self, top: f64, bottom: f64, rect: &PixelRect) -> Range<u32> {
        let range = match self.is_wide() {
            false => slab(self.start, self.delta, top, bottom),
            true => {
                let corners = self.corners();
                let edges = (0..4).map(|i| (corners[i], corners[(i + 1) % 4] - corners[i]));
                edges
                    .filter_map(|(from, along)| slab(from, along, top - self.slack, bottom + self.slack))
                    .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
            }
        };
        match range {
            Some((left, right)) => cells(left - self.slack, right + self.slack, rect.min[0]..rect.max[0]),
            None => 0..0,
        }
    }

    /// The four corners of the ribbon, in order around it.
    fn corners(&self) -> [DVec2; 4] {
        let end = self.start + self.delta;
        let across = self.delta.perp() * (0.5 / self.length);
        let [a, b] = self.width.map(|width| across * width);
        [self.start + a, end + b, end - b, self.start - a]
    }
}

/// The part of a segment behind the near plane, as parameters from its first to its second end.
fn visible_part(z0: f64, z1: f64, near: f64) -> Option<[f64; 2]> {
    let crossing = (near - z0) / (z1 - z0);
    match (z0 >= near, z1 >= near) {
        (true, true) => Some([0.0, 1.0]),
        (true, false) => Some([0.0, crossing]),
        (false, true) => Some([crossing, 1.0]),
        (false, false) => None,
    }
}

/// The shares of the way from `start` over `delta` that are spent between `low` and `high`. A way that does not move belongs to the cell
/// [low, high). The ends come from correctly rounded monotone functions of `low` and `high`: intervals of neighbouring cells meet exactly.
pub(super) fn interval(start: f64, delta: f64, low: f64, high: f64) -> Option<(f64, f64)> {
    if delta == 0.0 {
        return (low <= start && start < high).then_some((0.0, 1.0));
    }
    let a = (low - start) / delta;
    let b = (high - start) / delta;
    let enter = a.min(b).max(0.0);
    let leave = a.max(b).min(1.0);
    (enter < leave).then_some((enter, leave))
}

/// The range of x that a line segment has between two heights.
fn slab(start: DVec2, delta: DVec2, top: f64, bottom: f64) -> Option<(f64, f64)> {
    let (enter, leave) = interval(start.y, delta.y, top, bottom)?;
    Some(min_max([start.x + enter * delta.x, start.x + leave * delta.x]))
}

fn min_max<const N: usize>(values: [f64; N]) -> (f64, f64) {
    values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

/// The unit cells that the interval from `low` to `high` touches, within `limits`. Casts saturate, so that 1e9 pixels away is harmless.
fn cells(low: f64, high: f64, limits: Range<u32>) -> Range<u32> {
    let first = (low.floor() as u32).max(limits.start);
    let end = ((high.floor() + 1.0) as u32).min(limits.end);
    first..end.max(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    const PROJECTION: Projection = Projection { focal: 100.0, center: DVec2::new(50.0, 40.0), near: 0.5 };

    fn footprint(p: [f32; 3], q: [f32; 3], widths: [f32; 2]) -> Option<Footprint> {
        Footprint::new(&HairSegment { ends: [Vec3::from(p), Vec3::from(q)], widths, index: 0 }, &PROJECTION)
    }

    #[test]
    fn depth_and_parameter_are_perspective_correct() {
        let (p, q) = (DVec3::new(-1.0, 0.5, 2.0), DVec3::new(3.0, 1.0, 8.0));
        let shape = footprint([-1.0, 0.5, 2.0], [3.0, 1.0, 8.0], [0.0, 0.0]).unwrap();
        for s in [0.0, 0.1, 0.5, 0.9, 1.0] {
            let point = p + shape.parameter_at(s) * (q - p);
            assert!((PROJECTION.pixel(point) - (shape.start + s * shape.delta)).length() < 1e-12);
            assert!((shape.depth_at(s) - point.z).abs() < 1e-12);
        }
    }

    #[test]
    fn the_near_plane_cuts_exactly() {
        let shape = footprint([0.0, 0.0, -1.5], [2.0, 0.0, 2.5], [0.1, 0.3]).unwrap();
        assert_eq!(shape.depth_at(0.0), 0.5);
        assert_eq!(shape.parameter_at(0.0), 0.5);
        assert_eq!(shape.parameter_at(1.0), 1.0);
        assert!((shape.start.x - (50.0 + 100.0 * 1.0 / 0.5)).abs() < 1e-12);
        assert!((shape.width[0] - 0.2 * 100.0 / 0.5).abs() < 1e-5);
        // The same the other way round.
        let back = footprint([2.0, 0.0, 2.5], [0.0, 0.0, -1.5], [0.3, 0.1]).unwrap();
        assert_eq!(back.depth_at(1.0), 0.5);
        assert!((back.length - shape.length).abs() < 1e-12);
    }

    #[test]
    fn what_cannot_be_seen_has_no_footprint() {
        assert!(footprint([0.0, 0.0, -1.0], [1.0, 0.0, 0.49], [0.1; 2]).is_none(), "before the near plane");
        assert!(footprint([1.0, 0.0, 0.0], [2.0, 0.0, 0.5], [0.1; 2]).is_none(), "touches the near plane in a point");
        assert!(footprint([0.0, 0.0, 1.0], [0.0, 0.0, 9.0], [0.1; 2]).is_none(), "end-on");
        assert!(footprint([1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [0.1; 2]).is_none(), "no length");
        assert!(footprint([f32::NAN, 0.0, 1.0], [1.0, 1.0, 1.0], [0.1; 2]).is_none());
        assert!(footprint([0.0, 0.0, 1.0], [1.0, 1.0, 1.0], [f32::INFINITY; 2]).is_none());
    }

    #[test]
    fn the_width_is_that_of_a_ribbon_facing_the_eye() {
        // Off the axis by up to 60 degrees, in several directions; the ribbon's edges are projected as points.
        for angle in [0.0f32, 0.5, 1.3, 1.57, 2.2] {
            let (middle, along) = (Vec3::new(3.0, -1.0, 2.0), Vec3::new(angle.cos(), angle.sin(), 0.3));
            let ends = [middle - 1e-3 * along, middle + 1e-3 * along];
            let shape = Footprint::new(&HairSegment { ends, widths: [1e-4; 2], index: 0 }, &PROJECTION).unwrap();
            let across = along.as_dvec3().cross(middle.as_dvec3()).normalize() * 0.5e-4;
            let edge = PROJECTION.pixel(middle.as_dvec3() + across) - PROJECTION.pixel(middle.as_dvec3() - across);
            let width = edge.perp_dot(shape.delta).abs() / shape.length;
            assert!((shape.width_at(0.5) / width - 1.0).abs() < 1e-4, "{} {width}", shape.width_at(0.5));
        }
    }
}
