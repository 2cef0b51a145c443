//! The igloo: a hemisphere or a sphere cut into faces of exactly equal solid angle (paper, A.1 and Figure 8).
//!
//! The printed recipe measures a ring by the trapezoid rule and leaves the last ring with the rest. Here the rings' cumulative
//! face counts K_i are rounded first and the boundaries put at z_i = 1 - K_i / M (Archimedes: a zone's area is its height),
//! so every face has 2π / M steradians to rounding, for any M. Directions are unit vectors in the igloo's own frame, z up.

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Vec3};

/// Which part of the sphere an igloo covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Span {
    /// z >= 0: for a point on a surface, z along its normal.
    Hemisphere,
    /// Both hemispheres, for a point on hair.
    Sphere,
}

/// One ring of faces between two parallels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// z of the upper boundary.
    pub top: f32,
    /// z of the lower boundary.
    pub bottom: f32,
    /// Index of the ring's first face.
    pub first: u32,
    /// Number of faces; the sector `j` spans the azimuths `2π j / count` to `2π (j + 1) / count`.
    pub count: u32,
}

/// An igloo: rings of equal faces.
#[derive(Clone, Debug)]
pub struct Igloo {
    span: Span,
    rings: Vec<Ring>,
    faces: u32,
    /// Ring of the smallest z of each of `ring_table.len()` equal steps from z = 1 downwards.
    ring_table: Vec<u16>,
    table_scale: f32,
}

const TABLE: usize = 1024;

impl Igloo {
    /// An igloo with `per_hemisphere` faces on each hemisphere that it covers (at least 1). It holds a table: make it once for many points.
    pub fn new(span: Span, per_hemisphere: u32) -> Self {
        let m = per_hemisphere.max(1);
        let cumulative = cumulative_counts(m);
        let z = |k: u32| 1.0 - f64::from(k) / f64::from(m);
        let mut rings = Vec::new();
        for pair in cumulative.windows(2) {
            rings.push(Ring {
                top: z(pair[0]) as f32,
                bottom: z(pair[1]) as f32,
                first: pair[0],
                count: pair[1] - pair[0],
            });
        }
        let mut faces = m;
        if span == Span::Sphere {
            let upper = rings.clone();
            for ring in upper.iter().rev() {
                rings.push(Ring { top: -ring.bottom, bottom: -ring.top, first: faces, count: ring.count });
                faces += ring.count;
            }
        }
        Self::of_rings(span, rings, faces)
    }

    fn of_rings(span: Span, rings: Vec<Ring>, faces: u32) -> Self {
        let height = if span == Span::Sphere { 2.0 } else { 1.0 };
        let mut ring = 0;
        let ring_table = (0..=TABLE)
            .map(|i| {
                let z = 1.0 - height * i as f32 / TABLE as f32;
                while ring + 1 < rings.len() && rings[ring].bottom >= z {
                    ring += 1;
                }
                ring as u16
            })
            .collect();
        let table_scale = TABLE as f32 / height;
        Self { span, rings, faces, ring_table, table_scale }
    }

    /// Number of faces.
    pub fn len(&self) -> usize {
        self.faces as usize
    }

    /// Never true: an igloo has at least one face.
    pub fn is_empty(&self) -> bool {
        self.faces == 0
    }

    /// The part of the sphere that is covered.
    pub fn span(&self) -> Span {
        self.span
    }

    /// The rings from z = 1 downwards.
    pub fn rings(&self) -> &[Ring] {
        &self.rings
    }

    /// Solid angle of each face, in steradians.
    pub fn face_solid_angle(&self) -> f32 {
        match self.span {
            Span::Hemisphere => TAU / self.faces as f32,
            Span::Sphere => 2.0 * TAU / self.faces as f32,
        }
    }

    /// Side of a square of a face's solid angle, in radians: the face's width.
    pub fn face_width(&self) -> f32 {
        self.face_solid_angle().sqrt()
    }

    /// The ring that holds height `z`; heights outside the igloo give its first or last ring.
    #[inline]
    pub fn ring_of(&self, z: f32) -> usize {
        let step = ((1.0 - z) * self.table_scale).clamp(0.0, TABLE as f32) as usize;
        let mut ring = usize::from(self.ring_table[step]);
        // The table knows the ring of the step's upper edge, up to rounding; the ring itself decides.
        while ring + 1 < self.rings.len() && z < self.rings[ring].bottom {
            ring += 1;
        }
        while ring > 0 && z > self.rings[ring].top {
            ring -= 1;
        }
        ring
    }

    /// The sector of a ring with `count` faces that holds the azimuth of (x, y).
    #[inline]
    pub fn sector_of(x: f32, y: f32, count: u32) -> u32 {
        if count == 1 {
            return 0;
        }
        let turn = azimuth(x, y) * (1.0 / TAU);
        ((turn * count as f32) as u32).min(count - 1)
    }

    /// The face that holds a direction (not necessarily of unit length 1, but `z` must be its height on the unit sphere).
    #[inline]
    pub fn face_of(&self, direction: Vec3) -> usize {
        let ring = &self.rings[self.ring_of(direction.z)];
        (ring.first + Self::sector_of(direction.x, direction.y, ring.count)) as usize
    }

    /// The direction at (`across`, `down`) in [0, 1)² of a face: area-preserving, so that uniform numbers give uniform directions.
    pub fn direction(&self, face: usize, across: f32, down: f32) -> Vec3 {
        let ring = &self.rings[self.ring_of_face(face)];
        let z = ring.top + (ring.bottom - ring.top) * down;
        let sector = face as u32 - ring.first;
        let (sin, cos) = (TAU * (sector as f32 + across) / ring.count as f32).sin_cos();
        // (1 - z)(1 + z) keeps the radius exact to rounding next to the pole, where 1 - z² cancels.
        let radius = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
        Vec3::new(radius * cos, radius * sin, z)
    }

    /// The middle of a face; the pole for a cap.
    pub fn center(&self, face: usize) -> Vec3 {
        let ring = &self.rings[self.ring_of_face(face)];
        if ring.count == 1 && (ring.top == 1.0 || ring.bottom == -1.0) {
            return Vec3::new(0.0, 0.0, ring.top.max(ring.bottom.abs()).copysign(ring.top + ring.bottom));
        }
        self.direction(face, 0.5, 0.5)
    }

    /// The ring of a face.
    pub fn ring_of_face(&self, face: usize) -> usize {
        self.rings.partition_point(|ring| ring.first as usize <= face) - 1
    }
}

/// Cumulative numbers of faces at the ring boundaries of a hemisphere of `m` faces: 0, 1, ..., m, strictly increasing.
fn cumulative_counts(m: u32) -> Vec<u32> {
    let m_f = f64::from(m);
    // The top circle holds one face: 1 - cos θ_0 = 1 / M. From there to the equator, rings as high as a face is wide.
    let cap = (1.0 - 1.0 / m_f).acos();
    let width = (std::f64::consts::TAU / m_f).sqrt();
    let rings = ((std::f64::consts::FRAC_PI_2 - cap) / width).round().max(1.0) as u32;
    let mut counts = vec![0, 1];
    for i in 1..=rings {
        let theta = cap + (std::f64::consts::FRAC_PI_2 - cap) * f64::from(i) / f64::from(rings);
        let k = (m_f * (1.0 - theta.cos())).round() as u32;
        let k = if i == rings { m } else { k.min(m) };
        if k > counts[counts.len() - 1] {
            counts.push(k);
        }
    }
    counts
}

/// A frame whose z axis is the unit vector `normal` (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
pub fn frame_around(normal: Vec3) -> Mat3 {
    let sign = 1.0_f32.copysign(normal.z);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    let x = Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
    let y = Vec3::new(b, sign + normal.y * normal.y * a, -normal.y);
    Mat3::from_cols(x, y, normal)
}

/// Azimuth of (x, y) in [0, 2π), to 2e-6; 0 for the origin.
#[inline]
pub fn azimuth(x: f32, y: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let (low, high) = if ax < ay { (ax, ay) } else { (ay, ax) };
    if high <= 0.0 {
        return 0.0;
    }
    let angle = arctangent_unit(low / high);
    let angle = if ax < ay { PI / 2.0 - angle } else { angle };
    let angle = if x < 0.0 { PI - angle } else { angle };
    let angle = if y < 0.0 { TAU - angle } else { angle };
    if angle >= TAU { 0.0 } else { angle }
}

/// atan on [0, 1] by an odd minimax polynomial of degree 15, error below 2e-6.
#[inline]
pub fn arctangent_unit(x: f32) -> f32 {
    let s = x * x;
    let p = -0.004_054_058_f32;
    let p = p * s + 0.021_861_23;
    let p = p * s - 0.055_909_886;
    let p = p * s + 0.096_420_04;
    let p = p * s - 0.139_085_34;
    let p = p * s + 0.199_465_36;
    let p = p * s - 0.333_298_56;
    let p = p * s + 0.999_999_3;
    p * x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_have_equal_areas_to_1e_12() {
        for m in [1, 2, 3, 7, 50, 100, 333, 1000, 8000] {
            let counts = cumulative_counts(m);
            assert_eq!((counts[0], counts[counts.len() - 1]), (0, m));
            for pair in counts.windows(2) {
                let z = |k: u32| 1.0 - f64::from(k) / f64::from(m);
                let area = std::f64::consts::TAU * (z(pair[0]) - z(pair[1])) / f64::from(pair[1] - pair[0]);
                let want = std::f64::consts::TAU / f64::from(m);
                assert!((area / want - 1.0).abs() < 1e-12, "M = {m}: {area} against {want}");
            }
        }
    }

    #[test]
    fn faces_are_nearly_square() {
        for m in [50, 100, 400, 1000, 8000] {
            let igloo = Igloo::new(Span::Hemisphere, m);
            for ring in igloo.rings().iter().skip(1) {
                let height = ring.bottom.acos() - ring.top.acos();
                let middle = 0.5 * (ring.bottom.acos() + ring.top.acos());
                let aspect = TAU * middle.sin() / ring.count as f32 / height;
                assert!((0.6..1.6).contains(&aspect), "M = {m}, ring {ring:?}: aspect {aspect}");
            }
        }
    }

    #[test]
    fn a_direction_of_a_face_is_found_in_that_face() {
        for span in [Span::Hemisphere, Span::Sphere] {
            for m in [1, 2, 5, 100, 1000] {
                let igloo = Igloo::new(span, m);
                for face in 0..igloo.len() {
                    for (u, v) in [(0.5, 0.5), (0.01, 0.5), (0.99, 0.5), (0.5, 0.01), (0.5, 0.99)] {
                        let direction = igloo.direction(face, u, v);
                        assert!((direction.length() - 1.0).abs() < 1e-6);
                        assert_eq!(igloo.face_of(direction), face, "M = {m}, {direction:?}");
                    }
                    assert_eq!(igloo.face_of(igloo.center(face)), face);
                }
            }
        }
    }

    #[test]
    fn uniform_directions_fill_the_faces_evenly() {
        // Chi-squared over 200 faces with a Fibonacci lattice's far smaller discrepancy: every face within 3 % of its share.
        let igloo = Igloo::new(Span::Sphere, 100);
        let n = 1_000_000;
        let mut hits = vec![0_u32; igloo.len()];
        for i in 0..n {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / n as f64;
            let phi = i as f64 * 2.399_963_229_728_653;
            let r = (1.0 - z * z).sqrt();
            hits[igloo.face_of(Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32))] += 1;
        }
        let want = f64::from(n) / igloo.len() as f64;
        for (face, &count) in hits.iter().enumerate() {
            assert!((f64::from(count) / want - 1.0).abs() < 0.03, "face {face}: {count} of {want}");
        }
    }

    #[test]
    fn azimuth_is_the_arctangent() {
        for i in 0..100_000 {
            let angle = i as f64 / 100_000.0 * std::f64::consts::TAU;
            let got = f64::from(azimuth(angle.cos() as f32 * 3.0, angle.sin() as f32 * 3.0));
            let difference = (got - angle).abs();
            assert!(difference.min(std::f64::consts::TAU - difference) < 3e-6, "{angle}: {got}");
        }
        assert_eq!(azimuth(0.0, 0.0), 0.0);
    }
}
