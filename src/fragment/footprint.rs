//! What one hair segment covers in the image: a line with a width, clipped at the near plane and projected.
//!
//! Everything is in `f64`, because end points may lie 1e9 pixels outside the image. A position along the projected segment is its share s of
//! the way in the image, 0 to 1; depth and the segment's own parameter follow from s, since 1/z is linear in s under perspective.

use super::hair::{HairSegment, PixelRect};
use crate::camera::Projection;
use glam::{DVec2, DVec3};
use std::ops::Range;

/// From this on, half a width as a share of the depth, times the sine of the ribbon's angle from the axis, the ribbon's corners are projected one by one.
const LEAN: f64 = 1.0 / 16.0;
/// A corner's depth as a share of the middle line's, at least: one behind the eye has no image. What is cut off is far outside any picture.
const NEAREST_CORNER: f64 = 1e-3;

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
    /// The corners of a ribbon that leans so much that its edges are not as far from its middle line in the image as its width says.
    leaning: Option<[DVec2; 4]>,
    /// Bound on the rounding of positions computed from s.
    slack: f64,
}

impl Footprint {
    /// Clips and projects a segment. `None` if nothing of it can be seen: it lies in front of the near plane, it is a point in the image (a
    /// segment seen end-on covers nothing), or it has a number that is not finite.
    ///
    /// The width in pixels is d f / z of Eq. 7 times √(1 + (h/f)²), where h is the distance of the segment's line from the image centre. This is
    /// exact for a narrow ribbon that faces the eye; without it hair that runs around the image centre is too thin by the cosine of its
    /// angle from the axis. A ribbon wide beside its depth and far off the axis leans: one edge is nearer to the eye than the other, which may be behind it.
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
        let lean = width.map(|w| 0.5 * w * off_axis / (projection.focal.powi(2) + off_axis.powi(2)));
        let leaning = (lean[0].abs().max(lean[1].abs()) > LEAN)
            .then(|| leaning_corners([start, end], delta / length, width, lean, projection));
        let largest = start.abs().max(end.abs()).max_element() + width[0].max(width[1]);
        let largest = leaning.iter().flatten().fold(largest, |largest, corner| largest.max(corner.abs().max_element()));
        let slack = 64.0 * f64::EPSILON * largest;
        Some(Self { start, delta, length, width, inverse_depth, parameter, leaning, slack })
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

    /// The four corners of a leaning ribbon, in order around it; none where the width along the middle line says all.
    pub fn leaning(&self) -> Option<[DVec2; 4]> {
        self.leaning
    }

    /// The four corners of the ribbon, in order around it.
    fn corners(&self) -> [DVec2; 4] {
        if let Some(corners) = self.leaning {
            return corners;
        }
        let end = self.start + self.delta;
        let across = self.delta.perp() * (0.5 / self.length);
        let [a, b] = self.width.map(|width| across * width);
        [self.start + a, end + b, end - b, self.start - a]
    }
}

/// The corners of a ribbon that faces the eye, projected one by one: at half a width e beside the middle line, in the direction that
/// makes the angle θ of that line's plane with the image's axis, depth is z - e sin θ. `lean` is e sin θ / z at both ends.
fn leaning_corners(
    ends: [DVec2; 2],
    along: DVec2,
    width: [f64; 2],
    lean: [f64; 2],
    projection: &Projection,
) -> [DVec2; 4] {
    let across = along.perp();
    let corner = |i: usize, side: f64| {
        let share = 1.0 - side * lean[i];
        // As far across as leaves the corner before the eye.
        let part = if share < NEAREST_CORNER { (1.0 - NEAREST_CORNER) / (1.0 - share) } else { 1.0 };
        let share = share.max(NEAREST_CORNER);
        let from_center = ends[i] - projection.center;
        let off = from_center.dot(across);
        let cosine2 = 1.0 / (1.0 + (off / projection.focal).powi(2));
        projection.center + (from_center + across * (side * part * 0.5 * width[i] * cosine2)) / share
    };
    [corner(0, 1.0), corner(1, 1.0), corner(1, -1.0), corner(0, -1.0)]
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

    #[test]
    fn a_ribbon_far_off_the_axis_covers_what_its_edges_enclose() {
        // A strand wider than its depth that passes beside the eye, 88 degrees off the axis: its middle line's image is 3,500 pixels away, its width there
        // nearly 10,000. It must not reach the image, whose corner is 45 degrees off; one that does reach it, to where its edge is.
        for (height, depth, width) in [(0.389f32, 0.011f32, 0.03f32), (0.3, 0.2, 0.2), (-0.3, 0.2, 0.3)] {
            let ends = [Vec3::new(-0.6, height, depth), Vec3::new(0.6, height, depth + 0.01)];
            let shape = Footprint::new(
                &HairSegment { ends, widths: [width; 2], index: 0 },
                &Projection { near: 1e-5, ..PROJECTION },
            )
            .unwrap();
            let corners = shape.leaning().expect("it leans");
            let [a, b] = ends.map(|end| end.as_dvec3());
            let across = (b - a).cross(a).normalize() * f64::from(0.5 * width);
            for point in [a + across, a - across, b + across, b - across].into_iter().filter(|p| p.z > 1e-3) {
                let pixel = PROJECTION.pixel(point);
                let nearest = corners.map(|corner| corner.distance(pixel)).into_iter().fold(f64::INFINITY, f64::min);
                assert!(nearest < 1e-9 * pixel.length(), "{point} at {pixel}: {corners:?}");
            }
            // In the image the way round turns to one side only.
            let turns = [0, 1, 2, 3].map(|i| {
                let [a, b, c] = [0, 1, 2].map(|k| corners[(i + k) % 4]);
                (b - a).perp_dot(c - b)
            });
            assert!(turns.iter().all(|&turn| turn < 0.0), "{turns:?}");
        }
        assert!(footprint([-0.6, 0.3, 2.0], [0.6, 0.4, 3.0], [0.05; 2]).unwrap().leaning().is_none());
    }
}
