//! Projection of hair segments on the plane tangent to the igloo's top: the paper's own way (section 6 and appendix A.2).
//!
//! Seen from the shading point, rings become concentric circles about the plane's origin and sectors become rays, and a segment
//! stays straight: only circles and rays need be met. It is walked from v_0, the point of its line nearest the origin, outwards: in
//! two lines where v_0 lies on it (case 1), in one where it does not (case 2). A piece in a face covers l_n d / z_n steradians:
//! l_n the angle under which it is seen, d its width, z_n the mean of its ends' distances.
//!
//! It is here for comparison. What it loses against `projection`, which works on the sphere itself:
//! - An end on or below the horizon has no image, so a segment with one end above and one below is lost as a whole; on a sphere, for
//!   both hemispheres. (The paper speaks of an angle of 1e-37 degrees at the horizon; here images beyond `REACH` are lost as well.)
//! - 1 / z_n stands for the mean of 1 / z: a piece whose distance changes within the face covers too little.
//! - A ribbon wider than a face is not spread over the faces beside it; what it covers beyond its own faces is lost.
//!
//! As in every estimator nothing nearer than the segment's own width counts, nor anything behind the first opaque surface.

use glam::{Vec2, Vec3};

use super::projection::{Piece, Segment};
use crate::igloo::{Igloo, Ring, Span, azimuth};

/// Images farther from the plane's origin have no finite square in `f32`. It is 1e-18 radians short of the horizon.
const REACH: f32 = 1e18;

/// Projects a segment: gives `pieces` what each face sees of it, one entry a face.
///
/// The segment is relative to the shading point, in the igloo's frame; `far_of(face)` is the distance of the first opaque surface.
/// Pieces have no apparent width: in the paper each is a layer by itself.
pub fn project(igloo: &Igloo, segment: &Segment, far_of: &impl Fn(usize) -> f32, pieces: &mut Vec<Piece>) {
    pieces.clear();
    let rings = match igloo.span() {
        Span::Hemisphere => igloo.rings(),
        Span::Sphere => &igloo.rings()[..igloo.rings().len() / 2],
    };
    let below = segment.a.z < 0.0;
    let (mut a, mut b) = (segment.a, segment.b);
    if below && igloo.span() == Span::Sphere {
        // The lower hemisphere is the upper one's mirror image, ring by ring and sector by sector.
        (a.z, b.z) = (-a.z, -b.z);
    }
    if !(a.z > 0.0 && b.z > 0.0) {
        return;
    }
    let length = a.distance(b);
    if !(length > 0.0 && length.is_finite()) {
        return;
    }
    let widths = segment.widths.map(|width| width.max(0.0));
    let walk = &mut Walk { igloo, rings, below, far_of, a, b, widths, length, pieces };
    for [from, to] in beyond_width(a, b, length, widths).into_iter().flatten() {
        walk.line(from, to);
    }
}

/// The parts of a segment, as parameters 0 to 1, that are not nearer than its width.
fn beyond_width(a: Vec3, b: Vec3, length: f32, widths: [f32; 2]) -> [Option<[f32; 2]>; 2] {
    let whole = [Some([0.0, 1.0]), None];
    if a.length().min(b.length()) - length > widths[0].max(widths[1]) {
        return whole;
    }
    let axis = (b - a) / length;
    let s = -a.dot(axis);
    let h2 = (a + axis * s).length_squared();
    // The part that may be too near lies around the foot: its width there decides.
    let width = widths[0] + (widths[1] - widths[0]) * (s / length).clamp(0.0, 1.0);
    let inner2 = width * width - h2;
    if inner2 > 0.0 {
        let inner = inner2.sqrt();
        let (before, after) = (((s - inner) / length).min(1.0), ((s + inner) / length).max(0.0));
        return [(before > 0.0).then_some([0.0, before]), (after < 1.0).then_some([after, 1.0])];
    }
    whole
}

/// One segment's way over the faces.
struct Walk<'a, Far> {
    igloo: &'a Igloo,
    /// Those of the hemisphere that is projected, or of its mirror image.
    rings: &'a [Ring],
    below: bool,
    far_of: &'a Far,
    /// Ends in space, z towards the tangent plane.
    a: Vec3,
    b: Vec3,
    widths: [f32; 2],
    length: f32,
    pieces: &'a mut Vec<Piece>,
}

/// A half of the projected segment: the points `foot + t along` of the plane, `t` from `from >= 0` to `to`.
#[derive(Clone, Copy, Debug)]
struct Line {
    /// v_0.
    foot: Vec2,
    /// |v_0|².
    foot2: f32,
    /// Unit direction, away from v_0.
    along: Vec2,
    from: f32,
    to: f32,
    /// Parameters of the segment in space at `from` and `to`,
    ends: [f32; 2],
    /// and the inverse depths there. They are linear in t.
    inverse_depths: [f32; 2],
}

/// A point of a line where it enters or leaves a face.
#[derive(Clone, Copy, Debug)]
struct Cut {
    t: f32,
    /// Parameter of the segment in space.
    u: f32,
    /// From the shading point to the segment.
    distance: f32,
}

impl<Far: Fn(usize) -> f32> Walk<'_, Far> {
    /// Projects the part of the segment between two parameters and cuts it at v_0.
    fn line(&mut self, from: f32, to: f32) {
        let end = |u: f32| {
            let p = self.a.lerp(self.b, u);
            (p.truncate() / p.z, 1.0 / p.z, u)
        };
        let (mut near, mut far) = (end(from), end(to));
        if near.0.length_squared() > far.0.length_squared() {
            std::mem::swap(&mut near, &mut far);
        }
        let across = far.0 - near.0;
        let span = across.length();
        let seen = span > 0.0 && far.0.abs().max_element() < REACH && near.1.is_finite() && far.1.is_finite();
        if !seen {
            return;
        }
        let along = across / span;
        let t_near = near.0.dot(along);
        let foot = near.0 - along * t_near;
        let line = Line {
            foot,
            foot2: foot.length_squared(),
            along,
            from: t_near,
            to: t_near + span,
            ends: [near.2, far.2],
            inverse_depths: [near.1, far.1],
        };
        if t_near >= 0.0 {
            // Case 2.
            self.rings(&line);
            return;
        }
        // Case 1. Beyond v_0 the line leads to the farther end, before it to the nearer one.
        let share = (-t_near / span).min(1.0);
        let inverse_depth = near.1 + (far.1 - near.1) * share;
        let middle = near.2 + (far.2 - near.2) * (share * far.1 / inverse_depth).min(1.0);
        self.rings(&Line { from: 0.0, ends: [middle, far.2], inverse_depths: [inverse_depth, far.1], ..line });
        let back = Line {
            along: -along,
            from: 0.0,
            to: -t_near,
            ends: [middle, near.2],
            inverse_depths: [inverse_depth, near.1],
            ..line
        };
        self.rings(&back);
    }

    /// Goes outwards from circle to circle: on each side of v_0 each is met once at most, at t² = r_i² - |v_0|².
    ///
    /// No face is met twice on the way, but maybe on that of a line before: what falls into such a one's piece is added to it.
    fn rings(&mut self, line: &Line) {
        let others = self.pieces.len();
        let last = self.ring_of(line.point(line.to));
        let mut ring = self.ring_of(line.point(line.from)).min(last);
        let mut here = line.cut(line.from);
        while ring < last {
            let z = self.rings[ring].bottom;
            // r = tan θ, z = cos θ.
            let radius2 = (1.0 - z) * (1.0 + z) / (z * z);
            // Clamped to be monotone: rounding must not let the walk turn back.
            let crossing = line.cut((radius2 - line.foot2).max(0.0).sqrt().max(here.t).min(line.to));
            self.sectors(line, here, crossing, ring, others);
            here = crossing;
            ring += 1;
        }
        self.sectors(line, here, line.cut(line.to), ring, others);
    }

    fn ring_of(&self, point: Vec2) -> usize {
        self.igloo.ring_of(1.0 / (1.0 + point.length_squared()).sqrt()).min(self.rings.len() - 1)
    }

    /// Cuts a part that lies in one ring at the rays between the ring's sectors.
    fn sectors(&mut self, line: &Line, from: Cut, to: Cut, ring: usize, others: usize) {
        if to.t <= from.t {
            return;
        }
        let count = self.rings[ring].count;
        // Mirrored rings count from the other pole.
        let rings = self.igloo.rings();
        let first = if self.below { rings[rings.len() - 1 - ring].first } else { rings[ring].first };
        let (start, end) = (line.point(from.t), line.point(to.t));
        let mut sector = Igloo::sector_of(start.x, start.y, count);
        let last = Igloo::sector_of(end.x, end.y, count);
        let eastward = line.foot.perp_dot(line.along) > 0.0;
        let steps = if eastward { last + count - sector } else { sector + count - last } % count;
        // From v_0 outwards a line turns by less than a quarter of the circle; more means that rounding turned it back.
        let steps = if steps > count / 2 + 1 { 0 } else { steps };
        let mut here = from;
        for _ in 0..steps {
            let ray = if eastward { sector + 1 } else { sector };
            let crossing = line.cut(line.ray(ray as f32 / count as f32).max(here.t).min(to.t));
            self.emit(line, here, crossing, first + sector, others);
            here = crossing;
            sector = if eastward { (sector + 1) % count } else { (sector + count - 1) % count };
        }
        self.emit(line, here, to, first + sector, others);
    }

    fn emit(&mut self, line: &Line, from: Cut, to: Cut, face: u32, others: usize) {
        if to.t <= from.t {
            return;
        }
        // z_n.
        let distance = 0.5 * (from.distance + to.distance);
        let far = (self.far_of)(face as usize);
        let width = self.widths[0] + (self.widths[1] - self.widths[0]) * (0.5 * (from.u + to.u));
        // The width once more: it may grow faster along the segment than the distance.
        if !(distance > 0.0 && distance >= width && distance <= far) {
            return;
        }
        let solid_angle = line.angle(from.t, to.t) * (width / distance);
        let length = (to.u - from.u).abs() * self.length;
        if let Some(piece) = self.pieces[..others].iter_mut().find(|piece| piece.face == face) {
            piece.solid_angle += solid_angle;
            piece.length += length;
        } else {
            self.pieces.push(Piece { face, solid_angle, length, apparent_width: 0.0 });
        }
    }
}

impl Line {
    #[inline]
    fn point(&self, t: f32) -> Vec2 {
        self.foot + self.along * t
    }

    /// The segment at `t`: its parameter lies between the ends, weighted by inverse depth.
    fn cut(&self, t: f32) -> Cut {
        let share = ((t - self.from) / (self.to - self.from)).clamp(0.0, 1.0);
        let [w0, w1] = self.inverse_depths;
        let weighted = share * w1;
        let depth = 1.0 / ((1.0 - share) * w0 + weighted);
        let u = self.ends[0] + (self.ends[1] - self.ends[0]) * (weighted * depth).clamp(0.0, 1.0);
        Cut { t, u, distance: depth * (1.0 + self.foot2 + t * t).sqrt() }
    }

    /// l_n: the angle between the directions to two points. From the shading point, √(1 + |v_0|²) away from the line, it is
    /// atan(t_2 / g) - atan(t_1 / g), as one arctangent without cancellation.
    fn angle(&self, from: f32, to: f32) -> f32 {
        let g2 = 1.0 + self.foot2;
        azimuth(g2 + from * to, (to - from) * g2.sqrt())
    }

    /// Where the line meets the ray at `turn` (a share of the whole circle).
    fn ray(&self, turn: f32) -> f32 {
        let (sin, cos) = (std::f32::consts::TAU * turn).sin_cos();
        let across = |v: Vec2| v.y * cos - v.x * sin;
        -across(self.foot) / across(self.along)
    }
}

#[cfg(test)]
mod tests {
    use super::super::projection::{self, SLICE_WIDTH};
    use super::*;
    use crate::hash::unit;
    use proptest::prelude::*;

    fn pieces(igloo: &Igloo, a: Vec3, b: Vec3, widths: [f32; 2]) -> Vec<Piece> {
        let mut pieces = Vec::new();
        project(igloo, &Segment { a, b, widths }, &|_| f32::INFINITY, &mut pieces);
        pieces
    }

    fn total(pieces: &[Piece]) -> f64 {
        pieces.iter().map(|piece| f64::from(piece.solid_angle)).sum()
    }

    /// Solid angle in each face from `n` points along the segment, in `f64`: Σ d sin θ / r² Δl.
    fn sampled(igloo: &Igloo, a: Vec3, b: Vec3, width: f32, n: u32) -> Vec<f64> {
        let (a, b) = (a.as_dvec3(), b.as_dvec3());
        let step = (b - a) / f64::from(n);
        let mut faces = vec![0.0; igloo.len()];
        for i in 0..n {
            let p = a + step * (f64::from(i) + 0.5);
            let r = p.length();
            faces[igloo.face_of((p / r).as_vec3())] += f64::from(width) * (p / r).cross(step).length() / (r * r);
        }
        faces
    }

    /// A segment `length` long about a point 1 to 2 away whose height is at least `low` of its distance.
    fn somewhere(key: u32, low: f32, length: f32, lower: bool) -> [Vec3; 2] {
        let random = |i| unit(&[key, i]) as f32;
        let z = low + (1.0 - low) * random(0);
        let (sin, cos) = (std::f32::consts::TAU * random(1)).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        let middle = (1.0 + random(2)) * Vec3::new(radius * cos, radius * sin, if lower { -z } else { z });
        let half = 0.5 * length * Vec3::new(random(3) - 0.5, random(4) - 0.5, random(5) - 0.5).normalize();
        [middle - half, middle + half]
    }

    #[test]
    fn every_face_gets_what_samples_give_it() {
        // Well above the horizon (more than 17°, that is .3). The mean of the distances stands for that of their inverses: with a
        // piece of length l at distance r it is off by (l/r)²/4, if it points at the origin: here by 6.7 % for the longest, .09 % for the shortest.
        for (span, faces) in [(Span::Hemisphere, 60), (Span::Hemisphere, 400), (Span::Sphere, 30), (Span::Sphere, 100)]
        {
            let igloo = Igloo::new(span, faces);
            for (length, bound) in [(0.06, 2e-3), (0.25, 1.7e-2), (0.5, 7e-2)] {
                for key in 0..40 {
                    let [a, b] = somewhere(key, 0.6, length, span == Span::Sphere && key % 2 == 1);
                    let width = 1e-3;
                    let want = sampled(&igloo, a, b, width, 50_000);
                    let whole: f64 = want.iter().sum();
                    let mut got = vec![0.0; igloo.len()];
                    for piece in pieces(&igloo, a, b, [width; 2]) {
                        assert_eq!(got[piece.face as usize], 0.0, "two pieces in a face");
                        got[piece.face as usize] = f64::from(piece.solid_angle);
                    }
                    for (face, (got, want)) in got.iter().zip(&want).enumerate() {
                        assert!(
                            (got - want).abs() < bound * whole,
                            "{a} {b}, face {face}: {got} of {whole}, not {want}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn lengths_add_up_and_tapering_counts() {
        let igloo = Igloo::new(Span::Hemisphere, 200);
        for key in 0..300 {
            let [a, b] = somewhere(key, 0.7, 0.8, false);
            let even = pieces(&igloo, a, b, [2e-3; 2]);
            let length: f32 = even.iter().map(|piece| piece.length).sum();
            assert!((length / 0.8 - 1.0).abs() < 1e-4, "{a} {b}: {length}");
            // Half the width at one end: between half and all of the solid angle.
            let tapered = total(&pieces(&igloo, a, b, [2e-3, 1e-3])) / total(&even);
            assert!((0.5..1.0).contains(&tapered), "{a} {b}: {tapered}");
            let turned = total(&pieces(&igloo, b, a, [2e-3; 2])) / total(&even);
            assert!((turned - 1.0).abs() < 1e-4, "{a} {b}: {turned} when turned round");
        }
    }

    #[test]
    fn totals_in_the_middle_are_those_on_the_sphere() {
        let mut on_sphere = Vec::new();
        for span in [Span::Hemisphere, Span::Sphere] {
            let igloo = Igloo::new(span, 100);
            for key in 0..500 {
                let [a, b] = somewhere(key, 0.7, 0.1, span == Span::Sphere && key % 2 == 1);
                let segment = Segment { a, b, widths: [1e-3, 2e-3] };
                projection::project(&igloo, &segment, SLICE_WIDTH, &|_| f32::INFINITY, &mut on_sphere);
                let ratio = total(&pieces(&igloo, a, b, segment.widths)) / total(&on_sphere);
                // The average distance again: (l/r)²/4 is .0025 at most.
                assert!((-2.8e-3..1e-4).contains(&(ratio - 1.0)), "{a} {b}: {ratio}");
            }
        }
    }

    #[test]
    fn what_crosses_the_horizon_is_lost_and_what_comes_near_it_is_not() {
        let igloo = Igloo::new(Span::Sphere, 100);
        let mut on_sphere = Vec::new();
        let mut ratio = |a: Vec3, b: Vec3| {
            let segment = Segment { a, b, widths: [1e-3; 2] };
            projection::project(&igloo, &segment, SLICE_WIDTH, &|_| f32::INFINITY, &mut on_sphere);
            total(&pieces(&igloo, a, b, segment.widths)) / total(&on_sphere)
        };
        let b = Vec3::new(1.0, 0.1, 0.5);
        for low in [1e-1, 1e-3, 1e-6, 1e-12] {
            // Of the distance's mean some is lost in long pieces; of the horizon nothing.
            let kept = ratio(Vec3::new(1.0, -0.1, low), b);
            assert!((kept - 1.0).abs() < 0.01, "from height {low}: {kept}");
        }
        // The smallest part below the horizon takes all of the segment with it.
        for low in [0.0, -1e-6, -0.2, -0.5] {
            assert_eq!(ratio(Vec3::new(1.0, -0.1, low), b), 0.0, "from height {low}");
        }
    }

    #[test]
    fn a_share_of_random_hair_is_lost_at_the_horizon() {
        // Segments of length l at distance 1, directions and places uniform: one in l/4 crosses (the mean |Δz| is l/2, z uniform
        // over a height of 2).
        let igloo = Igloo::new(Span::Sphere, 100);
        let mut on_sphere = Vec::new();
        let (mut kept, mut all) = (0.0, 0.0);
        let length = 0.2;
        for key in 0..20_000 {
            let at = |i: u32| {
                let z = 2.0 * unit(&[key, i]) - 1.0;
                let (sin, cos) = (std::f64::consts::TAU * unit(&[key, i + 1])).sin_cos();
                Vec3::new(((1.0 - z * z).sqrt() * cos) as f32, ((1.0 - z * z).sqrt() * sin) as f32, z as f32)
            };
            let (middle, half) = (at(0), 0.5 * length * at(2));
            let segment = Segment { a: middle - half, b: middle + half, widths: [1e-3; 2] };
            projection::project(&igloo, &segment, SLICE_WIDTH, &|_| f32::INFINITY, &mut on_sphere);
            all += total(&on_sphere);
            kept += total(&pieces(&igloo, segment.a, segment.b, segment.widths));
        }
        let lost = 1.0 - kept / all;
        // 20,000 draws leave a standard deviation of .0016.
        assert!((lost - 0.05).abs() < 0.007, "{lost}");
    }

    #[test]
    fn nothing_nearer_than_the_width_or_behind_a_surface_counts() {
        let igloo = Igloo::new(Span::Hemisphere, 100);
        // Straight over the point at a height of half the width: what is left begins one width away.
        let (a, b) = (Vec3::new(-1.0, 0.0, 0.05), Vec3::new(1.0, 0.0, 0.05));
        let near = pieces(&igloo, a, b, [0.1; 2]);
        let length: f32 = near.iter().map(|piece| piece.length).sum();
        let want = 2.0 * (1.0 - (0.1_f32 * 0.1 - 0.05 * 0.05).sqrt());
        assert!((length - want).abs() < 1e-4, "{length}, not {want}");
        let mut behind = Vec::new();
        let segment = Segment { a: Vec3::new(0.5, 0.0, 1.0), b: Vec3::new(0.0, 0.5, 1.0), widths: [0.01; 2] };
        project(&igloo, &segment, &|_| 0.9, &mut behind);
        assert!(behind.is_empty());
        project(&igloo, &segment, &|_| 2.0, &mut behind);
        assert!(!behind.is_empty());
    }

    #[test]
    fn the_parts_before_and_behind_the_width_are_one_piece_of_a_face() {
        // Nearer than its width in the middle: two parts are left, and v_0 lies on neither.
        let (a, b) = (Vec3::new(0.0, 0.827_952_5, 1e-7), Vec3::new(0.0, -1.952_075_7, 0.126_787_72));
        for width in [0.495_714_72, 0.3, 0.1, 0.01] {
            for (span, faces) in [(Span::Hemisphere, 1), (Span::Hemisphere, 2), (Span::Sphere, 2), (Span::Sphere, 7)] {
                for (a, b) in [(a, b), (b, a)] {
                    let igloo = Igloo::new(span, faces);
                    let pieces = pieces(&igloo, a, b, [width; 2]);
                    let mut met: Vec<u32> = pieces.iter().map(|piece| piece.face).collect();
                    met.sort_unstable();
                    met.dedup();
                    assert_eq!(met.len(), pieces.len(), "{span:?}, {faces} faces, width {width}: {pieces:?}");
                    // And nothing is lost: both parts are as long as the segment outside of a ball of its width.
                    let axis = (b - a).normalize();
                    let h2 = (a - axis * a.dot(axis)).length_squared();
                    let want = a.distance(b) - 2.0 * (width * width - h2).max(0.0).sqrt();
                    let length: f32 = pieces.iter().map(|piece| piece.length).sum();
                    assert!((length / want - 1.0).abs() < 1e-4, "width {width}: {length}, not {want}");
                }
            }
        }
    }

    fn check(span: Span, faces: u32, a: Vec3, b: Vec3, widths: [f32; 2]) -> Result<(), TestCaseError> {
        let igloo = Igloo::new(span, faces);
        let pieces = pieces(&igloo, a, b, widths);
        prop_assert!(pieces.len() <= igloo.len());
        for piece in &pieces {
            prop_assert!((piece.face as usize) < igloo.len());
            // Nothing nearer than its width: at most one radian wide, and at most half a turn long.
            prop_assert!((0.0..3.5).contains(&piece.solid_angle), "{piece:?}");
            prop_assert!(piece.length >= 0.0 && piece.length.is_finite(), "{piece:?}");
            prop_assert_eq!(piece.apparent_width, 0.0);
        }
        Ok(())
    }

    /// Finite, of any exponent.
    fn any_float() -> impl Strategy<Value = f32> + Clone {
        use prop::num::f32::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
        POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO
    }

    fn any_vector() -> impl Strategy<Value = Vec3> {
        [any_float(), any_float(), any_float()].prop_map(Vec3::from_array)
    }

    fn near_vector() -> impl Strategy<Value = Vec3> {
        let special = prop::sample::select(vec![0.0_f32, 1e-7, -1e-7, 1e-4, 1.0]);
        let any = prop_oneof![-2.0_f32..2.0, special];
        [any.clone(), any.clone(), any].prop_map(Vec3::from_array)
    }

    fn any_span() -> impl Strategy<Value = (Span, u32)> {
        (prop::sample::select(vec![Span::Hemisphere, Span::Sphere]), prop::sample::select(vec![1_u32, 2, 7, 100]))
    }

    proptest! {
        #[test]
        fn any_finite_segment_covers_a_finite_part(
            (span, faces) in any_span(), a in any_vector(), b in any_vector(), widths in [any_float(), any_float()]
        ) {
            check(span, faces, a, b, widths)?;
        }

        #[test]
        fn awkward_segments_cover_a_finite_part(
            (span, faces) in any_span(), a in near_vector(), b in near_vector(), width in 0.0_f32..0.5
        ) {
            check(span, faces, a, b, [width, 0.5 * width])?;
            // Of no length, end-on, and through the point.
            check(span, faces, a, a, [width; 2])?;
            check(span, faces, a, 2.0 * a, [width; 2])?;
            check(span, faces, a, -a, [width; 2])?;
        }
    }
}
