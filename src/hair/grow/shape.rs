//! How a strand runs from its root.
//!
//! The axis of a strand is integrated along its direction in steps of equal length, so gravity bends it but does not
//! stretch it. It starts between the surface's normal and a random side and turns, in one plane, towards the direction
//! `start + gravity * down`. The share of the turn at the arc length s (0 to 1) is that of a cantilever under its own
//! weight, 1 - (1 - s)^3: most at the root, none at the free end. Curls are a helix around that axis.

use std::f64::consts::TAU;

use glam::DVec3;

use super::{Grow, Key, Purpose, Root};

/// The first step rises above the surface by at least this share of its length.
const CLEARANCE: f64 = 0.05;

/// A curl reaches its full radius at this share of the length.
const CURL_GROWN: f64 = 0.4;

/// The run of a strand, up to its length.
pub(super) struct Shape {
    root: DVec3,
    /// Normal of the surface below the root.
    surface: DVec3,
    /// Direction at the root.
    start: DVec3,
    /// Unit vector at right angles to `start`, which the bend turns it to.
    side: DVec3,
    /// The whole angle of the bend, in radians.
    bend: f64,
    curl_radius: f64,
    /// Angle of the helix at the root, in radians, and how much it turns along the strand, signed.
    curl: [f64; 2],
}

impl Shape {
    /// `phase` is where the helix starts, in turns.
    pub fn new(grow: &Grow, key: Key, root: &Root, up: DVec3, phase: f64) -> Self {
        let [u, v] = frame(root.normal);
        let (sin, cos) = (key.unit(Purpose::Side) * TAU).sin_cos();
        let aside = u * cos + v * sin;
        // Even density over a disc of radius `lean` in the plane at unit distance: a tuft, not a cone.
        let lean = grow.lean * key.unit(Purpose::Lean).sqrt();
        let start = rise((root.normal + lean * aside).normalize(), root.flat_normal);

        let pull = -grow.gravity.signum() * up;
        let cos = start.dot(pull).clamp(-1.0, 1.0);
        let across = pull - cos * start;
        let (side, sin) = match across.try_normalize() {
            // A strand that stands straight against the pull falls to its random side.
            Some(side) if across.length() > 1e-9 => (side, across.length()),
            _ => (perpendicular(start, aside), 0.0),
        };
        let strength = grow.gravity.abs();
        let bend = (strength * sin).atan2(1.0 + strength * cos);
        let shape = Self {
            root: root.position,
            surface: root.flat_normal,
            start,
            side,
            bend,
            curl_radius: grow.curl_radius,
            curl: [phase * TAU, grow.curl_frequency * TAU],
        };
        shape.with_hand(key)
    }

    /// Takes the sense of the helix, left or right, from a key.
    pub fn with_hand(mut self, key: Key) -> Self {
        let sign = if key.unit(Purpose::Hand) < 0.5 { -1.0 } else { 1.0 };
        self.curl[1] = sign * self.curl[1].abs();
        self
    }

    /// Calls `point(k, position)` for each of `count` points (at least two), root first.
    pub fn trace(&self, length: f64, count: usize, mut point: impl FnMut(usize, DVec3)) {
        let last = (count - 1) as f64;
        let step = length / last;
        let mut axis = self.root;
        point(0, axis);
        for k in 1..count {
            let middle = self.direction((k as f64 - 0.5) / last);
            let direction = if k == 1 { rise(middle, self.surface) } else { middle };
            axis += step * direction;
            let mut position = axis + self.curl(k as f64 / last);
            if k == 1 {
                // A wide curl of few segments may reach down again.
                let missing = CLEARANCE * step - (position - self.root).dot(self.surface);
                position += missing.max(0.0) * self.surface;
            }
            point(k, position);
        }
    }

    /// Unit direction of the axis at the arc length s.
    fn direction(&self, s: f64) -> DVec3 {
        let (sin, cos) = self.turned(s).sin_cos();
        self.start * cos + self.side * sin
    }

    /// The angle by which the axis has turned at s.
    fn turned(&self, s: f64) -> f64 {
        let left = 1.0 - s;
        self.bend * (1.0 - left * left * left)
    }

    /// Distance of the helix from the axis at s. The plane of the bend gives a frame that does not twist.
    fn curl(&self, s: f64) -> DVec3 {
        if self.curl_radius == 0.0 {
            return DVec3::ZERO;
        }
        let t = (s / CURL_GROWN).min(1.0);
        // Grows from nothing without a kink, so that the strand leaves its root along its direction.
        let radius = self.curl_radius * t * t * (3.0 - 2.0 * t);
        let (sin, cos) = self.turned(s).sin_cos();
        let inward = self.side * cos - self.start * sin;
        let (sin, cos) = (self.curl[0] + self.curl[1] * s).sin_cos();
        radius * (cos * inward + sin * self.start.cross(self.side))
    }
}

/// The direction, lifted where it would lie in the surface or below it.
fn rise(direction: DVec3, surface: DVec3) -> DVec3 {
    let height = direction.dot(surface);
    if height >= CLEARANCE {
        return direction;
    }
    let along = (direction - height * surface).normalize_or_zero();
    (CLEARANCE * surface + (1.0 - CLEARANCE * CLEARANCE).sqrt() * along).normalize()
}

/// The part of `hint` at right angles to a unit vector, made unit; any such direction where there is none.
fn perpendicular(unit: DVec3, hint: DVec3) -> DVec3 {
    let part = hint - unit.dot(hint) * unit;
    if part.length() > 1e-6 { part.normalize() } else { frame(unit)[0] }
}

/// Two directions at right angles to a unit vector and to each other, by the method of Duff et al., "Building an
/// Orthonormal Basis, Revisited" (2017): no division by a small number for any vector. `u x v = n`.
fn frame(n: DVec3) -> [DVec3; 2] {
    let sign = 1f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root(normal: DVec3) -> Root {
        Root { position: DVec3::new(1.0, 2.0, 3.0), normal, flat_normal: normal }
    }

    fn key(index: u32) -> Key {
        Key { seed: 1, stream: 0, index }
    }

    fn points(shape: &Shape, length: f64, count: usize) -> Vec<DVec3> {
        let mut points = vec![];
        shape.trace(length, count, |_, p| points.push(p));
        points
    }

    #[test]
    fn frames_are_orthonormal() {
        for n in [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::Z, DVec3::new(0.1, -0.4, -0.9).normalize()] {
            let [u, v] = frame(n);
            assert!(u.dot(n).abs() < 1e-12 && v.dot(n).abs() < 1e-12 && u.cross(v).distance(n) < 1e-12);
        }
    }

    #[test]
    fn gravity_bends_the_tip_as_far_as_it_says() {
        for (gravity, tip) in
            [(1.0, DVec3::new(1.0, -1.0, 0.0)), (0.5, DVec3::new(1.0, -0.5, 0.0)), (-2.0, DVec3::new(1.0, 2.0, 0.0))]
        {
            let grow = Grow { lean: 0.0, gravity, ..Grow::default() };
            let shape = Shape::new(&grow, key(0), &root(DVec3::X), DVec3::Y, 0.0);
            assert!(shape.direction(0.0).distance(DVec3::X) < 1e-12);
            assert!(shape.direction(1.0).distance(tip.normalize()) < 1e-12);
        }
        // Straight up: less than its own strength does not topple it, more makes it hang.
        for (gravity, tip) in [(0.9, DVec3::Y), (1.5, -DVec3::Y)] {
            let grow = Grow { lean: 0.0, gravity, ..Grow::default() };
            let shape = Shape::new(&grow, key(0), &root(DVec3::Y), DVec3::Y, 0.0);
            assert!(shape.direction(1.0).distance(tip) < 1e-12, "{gravity}");
        }
    }

    #[test]
    fn bends_are_smooth_and_keep_the_length() {
        for gravity in [0.0, 0.3, 3.0, 100.0, -5.0] {
            for i in 0..50 {
                let normal = DVec3::new(f64::from(i) - 25.0, 10.0, 5.0).normalize();
                let grow = Grow { gravity, lean: 2.0, ..Grow::default() };
                let p = points(&Shape::new(&grow, key(i), &root(normal), DVec3::Y, 0.0), 3.0, 41);
                let length: f64 = p.windows(2).map(|p| p[0].distance(p[1])).sum();
                assert!((length - 3.0).abs() < 1e-12);
                // At most half a turn, three times the mean rate at the root, but for the step that clears the surface.
                let limit = std::f64::consts::PI * 3.0 / 40.0;
                for w in p.windows(3).skip(1) {
                    let turn = (w[1] - w[0]).angle_between(w[2] - w[1]);
                    assert!(turn <= limit + 1e-6, "{turn}");
                }
            }
        }
    }

    #[test]
    fn curls_are_a_helix_around_the_axis() {
        let straight = Grow { lean: 0.3, gravity: 0.7, ..Grow::default() };
        let curled = Grow { curl_radius: 0.05, curl_frequency: 4.0, ..straight.clone() };
        let n = 201;
        let normal = DVec3::new(0.6, 0.8, 0.0);
        let axis = Shape::new(&straight, key(3), &root(normal), DVec3::Y, 0.2);
        let helix = Shape::new(&curled, key(3), &root(normal), DVec3::Y, 0.2);
        let (a, h) = (points(&axis, 1.0, n), points(&helix, 1.0, n));
        assert_eq!(a[0], h[0]);
        let mut turned = 0.0;
        for k in 1..n {
            let s = k as f64 / (n - 1) as f64;
            let (offset, before) = (h[k] - a[k], h[k - 1] - a[k - 1]);
            assert!(offset.dot(axis.direction(s)).abs() < 1e-12, "the offset is at right angles to the axis");
            if s >= CURL_GROWN {
                assert!((offset.length() - 0.05).abs() < 1e-12);
            }
            if s > CURL_GROWN {
                turned += before.angle_between(offset);
            }
        }
        assert!((turned / TAU - 4.0 * (1.0 - CURL_GROWN)).abs() < 0.05, "{}", turned / TAU);
    }
}
