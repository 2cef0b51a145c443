//! Segments on the igloo: near the pole, the meridians and the horizon, end-on, shorter than a digit, touched by the point, wide.

use glam::{DVec3, Vec3};

use super::truth;
use super::{Draw, Measured, Property, U32};
use crate::igloo::{Igloo, Span, azimuth, frame_around};
use crate::occlusion::projection::{Piece, SLICE_WIDTH, Segment, project};

pub const PROPERTIES: &[Property] = &[
    Property { name: "segment: solid angle, narrow", quick: 4000, check: narrow },
    Property { name: "segment: solid angle, wide", quick: 1000, check: wide },
    Property { name: "segment: share of each face", quick: 150, check: faces },
    Property { name: "segment: cut at the horizon", quick: 2000, check: horizon },
    Property { name: "segment: scaled by a power of two", quick: 2000, check: scaled },
    Property { name: "segment: reversed", quick: 2000, check: reversed },
    Property { name: "igloo: azimuth", quick: 4000, check: azimuths },
    Property { name: "igloo: frame around a normal", quick: 4000, check: frames },
    Property { name: "igloo: a direction's face holds it", quick: 4000, check: face_of },
];

/// A segment: somewhere, end-on, through the point, ending at it, next to it, hardly longer than a digit.
fn segment(draw: &mut Draw) -> [Vec3; 2] {
    let kind = draw.pick(&[0, 0, 0, 1, 2, 3, 4, 5]);
    let (toward, along) = (draw.direction(), draw.direction());
    let distance = draw.scale(1e-6, 10.0);
    let length = draw.scale(1e-6, 10.0);
    let tiny = draw.pick(&[0.0, 1e-9, 1e-7, 1e-6, 1e-5]);
    let start = toward * distance;
    let [a, b] = match kind {
        0 => [start, start + along * length],
        // End-on, or nearly.
        1 => [start, start + (toward + along * tiny).normalize() * length],
        // Through the point, or past it by a millionth.
        2 => [along * tiny - toward * distance, along * tiny + toward * length],
        // From the point, or from next to it.
        3 => [along * tiny, toward * distance],
        // Past it at the distance: the foot lies within.
        4 => {
            let across = toward.any_orthonormal_vector();
            [start - across * length, start + across * (0.7 * length)]
        }
        // Of one digit or two.
        _ => [start, start + along * (distance * 3e-7)],
    };
    [a.as_vec3(), b.as_vec3()]
}

fn pieces(igloo: &Igloo, a: Vec3, b: Vec3, widths: [f32; 2]) -> Vec<Piece> {
    let mut pieces = Vec::new();
    project(igloo, &Segment { a, b, widths }, SLICE_WIDTH, &|_| f32::INFINITY, &mut pieces);
    pieces
}

fn total(pieces: &[Piece]) -> f64 {
    pieces.iter().map(|piece| f64::from(piece.solid_angle)).sum()
}

/// The truth, and by how much it changes when the distance of the axis changes by its rounding.
///
/// The foot is near - u (near·u): its rounding is at most 3 |near| (u itself is rounded, too), with 4 roundoffs to spare 8. The positions along
/// the line have 4 roundoffs of the farther end. This is the condition of the problem, not a fault of the formula: no
/// method that sees the ends as `f32` can do better than a few roundoffs of |near|.
fn truth_and_slack(a: Vec3, b: Vec3, width: f32) -> (f64, f64) {
    let (a, b, width) = (a.as_dvec3(), b.as_dvec3(), f64::from(width));
    let along = b - a;
    let length = along.length();
    if length == 0.0 {
        return (0.0, 0.0);
    }
    let axis = along / length;
    let from = a.dot(axis);
    let h = a.cross(axis).length();
    let (near, far) = (a.length().min(b.length()), a.length().max(b.length()));
    let value = truth::from_axis(h, from, from + length, width);
    let (dh, ds) = (8.0 * U32 * near, 4.0 * U32 * far);
    let mut slack = 0.0_f64;
    for sign in [-1.0, 1.0] {
        for shift in [-ds, 0.0, ds] {
            for stretch in [-ds, ds] {
                let h = (h + sign * dh).max(0.0);
                let other = truth::from_axis(h, from + shift - stretch, from + length + shift + stretch, width);
                slack = slack.max((other - value).abs());
            }
        }
    }
    // An axis that rounding may put through the point covers anything from nothing to what it covers at that distance. End-on, segments
    // below a millionth of their distance from the axis are taken for nothing.
    if h <= dh + 1.1e-6 * h.hypot(from.abs().max((from + length).abs())) {
        let most = dh + 1.1e-6 * h.hypot(from.abs().max((from + length).abs()));
        for part in 1..=8 {
            slack = slack.max(truth::from_axis(most * f64::from(part) / 8.0, from, from + length, width));
        }
        slack = slack.max(value);
    }
    (value, slack)
}

/// One slice: the closed form. Its angle about the axis is asin by its series up to .05 (1e-6 of it left out).
fn narrow(draw: &mut Draw) -> Measured {
    let igloo = Igloo::new(Span::Sphere, draw.pick(&[1, 7, 100, 400]));
    let [a, b] = segment(draw);
    let h = a.as_dvec3().cross((b - a).as_dvec3().normalize_or_zero()).length();
    // Narrower than a third of a face from its nearest point on, and nowhere within its own width.
    let nearest = nearest(a, b);
    let width = (draw.scale(1e-7, 1e-1) * nearest) as f32 * (SLICE_WIDTH * igloo.face_width()).min(1.0);
    if f64::from(width) > 0.5 * h {
        return at_the_axis(&igloo, a, b, width);
    }
    let (want, slack) = truth_and_slack(a, b, width);
    let got = total(&pieces(&igloo, a, b, [width; 2]));
    // Roundings of the sum over pieces: each piece's difference of sines is without cancellation only while both ends lie on one side of the foot;
    // 24 roundoffs of the whole turn's sine (2) times the angle.
    let angle = f64::from(width) / h.max(f64::MIN_POSITIVE);
    // One slice stands for all: the integrand goes as cos α to a power from -2 to 2, so its middle is off by α²/3 of the whole at most.
    let slices = 0.25 * angle * angle / 2.0;
    let rounding = 3e-6 * want + 48.0 * U32 * angle * want.min(1.0);
    Measured { error: (got - want).abs(), bound: slack + slices * want + rounding }
}

/// Where the point lies within the strand's half width the middle line says little: what is covered stays within what a ribbon can.
fn at_the_axis(igloo: &Igloo, a: Vec3, b: Vec3, width: f32) -> Measured {
    let got = total(&pieces(igloo, a, b, [width; 2]));
    // The half-planes through the axis cover 2 asin(1) = π at most, times s/r from -1 to 1.
    Measured { error: if got >= 0.0 { got } else { f64::NAN }, bound: std::f64::consts::TAU * (1.0 + 1e-5) }
}

fn nearest(a: Vec3, b: Vec3) -> f64 {
    let (a, b) = (a.as_dvec3(), b.as_dvec3());
    let along = b - a;
    let t = (-a.dot(along) / along.length_squared()).clamp(0.0, 1.0);
    if t.is_nan() { a.length() } else { a.lerp(b, t).length() }
}

/// Many slices, by the midpoint rule, up to as wide as ten times the distance.
///
/// A slice's integrand is √-like only where slices end at the ribbon's own width or α comes near π/2; there the midpoint rule of n slices
/// is good to n^-3/2 of what it sums. With 100 faces a ribbon of half a turn has 38 slices and more: .004 of 2π steradians; elsewhere n^-2.
fn wide(draw: &mut Draw) -> Measured {
    let igloo = Igloo::new(Span::Sphere, draw.pick(&[100, 400]));
    let [a, b] = segment(draw);
    let h = a.as_dvec3().cross((b - a).as_dvec3().normalize_or_zero()).length();
    let width = (draw.scale(0.1, 20.0) * h.max(1e-6)) as f32;
    if h < 1e-5 * f64::from(a.length().max(b.length())) {
        return at_the_axis(&igloo, a, b, width);
    }
    let (want, slack) = truth_and_slack(a, b, width);
    let got = total(&pieces(&igloo, a, b, [width; 2]));
    Measured { error: (got - want).abs(), bound: 1.5 * slack + 0.004 * std::f64::consts::TAU }
}

/// What each face gets, against the segment in 20,000 points, each in the face that holds its direction in `f64`.
///
/// A point within 1e-5 of a boundary may lie in either face: a segment may run along a meridian, or through the pole.
fn faces(draw: &mut Draw) -> Measured {
    let span = draw.pick(&[Span::Sphere, Span::Hemisphere]);
    let igloo = Igloo::new(span, draw.pick(&[1, 5, 64, 300]));
    let (toward, along) = (draw.direction(), draw.direction());
    let length = draw.scale(1e-3, 4.0);
    let (a, b) = ((toward - along * (0.4 * length)).as_vec3(), (toward + along * (0.6 * length)).as_vec3());
    let axis = (b - a).as_dvec3().normalize_or_zero();
    let h = a.as_dvec3().cross(axis).length();
    if h < 1e-3 {
        return Measured { error: 0.0, bound: 0.0 };
    }
    let width = (1e-3 * nearest(a, b)) as f32;
    let mut got = vec![0.0; igloo.len()];
    for piece in pieces(&igloo, a, b, [width; 2]) {
        got[piece.face as usize] += f64::from(piece.solid_angle);
    }
    let points = 20_000;
    let (from, to) = (a.as_dvec3().dot(axis), b.as_dvec3().dot(axis));
    let foot = a.as_dvec3() - axis * from;
    let (start, end) = ((from / h).atan(), (to / h).atan());
    let step = (end - start) / f64::from(points);
    // What a face holds surely, and what it may hold: points within 1e-5 of a boundary may lie on either side.
    let mut want = vec![[0.0; 2]; igloo.len()];
    for i in 0..points {
        // Even in the angle from the foot: dω = 2 asin(d / 2h) cos β dβ.
        let beta = start + step * (f64::from(i) + 0.5);
        let d = foot / h * beta.cos() + axis * beta.sin();
        let amount = 2.0 * (0.5 * f64::from(width) / h).asin() * beta.cos() * step;
        let seen = |d: DVec3| (span == Span::Sphere || d.z > 0.0).then(|| face_in_f64(&igloo, d));
        let mut near: Vec<Option<usize>> = (0..8)
            .map(|corner| {
                let off = |bit: u32| if corner >> bit & 1 == 1 { 1e-5 } else { -1e-5 };
                seen(d + DVec3::new(off(0), off(1), off(2)))
            })
            .collect();
        near.sort_unstable();
        near.dedup();
        if let [Some(face)] = near[..] {
            want[face][0] += amount;
        }
        near.iter().flatten().for_each(|&face| want[face][1] += amount);
    }
    let whole = f64::from(width) / h;
    let beyond = |(got, [sure, any]): (&f64, &[f64; 2])| (sure - got).max(got - any).max(0.0);
    let error = got.iter().zip(&want).map(beyond).fold(0.0, f64::max);
    // A point each side of two boundaries, and the arctangent's 2e-6 of a turn at each.
    Measured { error, bound: whole * (3.0 * step.abs() + 2e-5) }
}

fn face_in_f64(igloo: &Igloo, d: DVec3) -> usize {
    let ring = igloo.rings().iter().position(|ring| d.z >= f64::from(ring.bottom)).unwrap_or(igloo.rings().len() - 1);
    let ring = &igloo.rings()[ring];
    let turn = (d.y.atan2(d.x) / std::f64::consts::TAU).rem_euclid(1.0);
    (ring.first + ((turn * f64::from(ring.count)) as u32).min(ring.count - 1)) as usize
}

/// Both hemispheres of a sphere see what two igloos of one hemisphere see; nothing is lost or seen twice at the horizon.
fn horizon(draw: &mut Draw) -> Measured {
    let toward = draw.direction();
    let along = draw.direction();
    let lift = draw.pick(&[0.0, 1e-38, 1e-30, 1e-12, 1e-7, 1e-3]) * draw.pick(&[-1.0, 1.0]);
    let length = draw.scale(1e-4, 3.0);
    let a = DVec3::new(toward.x, toward.y, lift).as_vec3();
    let b = (a.as_dvec3() + along * length).as_vec3();
    let width = draw.scale(1e-6, 1e-3) as f32;
    if nearest(a, b) < 1e-2 {
        return Measured { error: 0.0, bound: 0.0 };
    }
    let faces = draw.pick(&[1, 30, 100]);
    let half = Igloo::new(Span::Hemisphere, faces);
    let upper = total(&pieces(&half, a, b, [width; 2]));
    let turned = |v: Vec3| Vec3::new(v.x, -v.y, -v.z);
    let lower = total(&pieces(&half, turned(a), turned(b), [width; 2]));
    let whole = total(&pieces(&Igloo::new(Span::Sphere, faces), a, b, [width; 2]));
    // Where it crosses the horizon is rounded once for both: a cut moves by 4 roundoffs of the segment's length.
    let (_, slack) = truth_and_slack(a, b, width);
    let mut bound = 1e-5 * whole + 2.0 * slack + 32.0 * U32 * f64::from(width) * (1.0 + length) / nearest(a, b).powi(2);
    if f64::from(a.z.abs().max(b.z.abs())) <= 16.0 * U32 * f64::from(a.length().max(b.length())) {
        // In the horizon but for its rounding it may be seen from neither side, or from either.
        bound += whole;
    }
    Measured { error: (upper + lower - whole).abs(), bound }
}

/// Lengths in any unit: by powers of two every operation scales exactly, so the bits are the same, for segments that are longer than what counts
/// as a point (1e-9) in both units.
fn scaled(draw: &mut Draw) -> Measured {
    let igloo = Igloo::new(Span::Sphere, 100);
    let [a, b] = segment(draw);
    let b = if a.distance(b) < 1e-8 { a + (b - a).normalize_or(Vec3::X) * a.length().max(1e-2) } else { b };
    let width = draw.scale(1e-6, 1.0) as f32;
    let factor = f32::powi(2.0, draw.pick(&[-3, -2, -1, 3, 10, 20]));
    let here = pieces(&igloo, a, b, [width, 0.5 * width]);
    let there = pieces(&igloo, a * factor, b * factor, [width * factor, 0.5 * width * factor]);
    let same = here.len() == there.len()
        && here.iter().zip(&there).all(|(p, q)| (p.face, p.solid_angle) == (q.face, q.solid_angle));
    Measured { error: f64::from(u8::from(!same)), bound: 0.0 }
}

/// From root to tip or from tip to root: the same ribbon.
fn reversed(draw: &mut Draw) -> Measured {
    let igloo = Igloo::new(Span::Sphere, 100);
    let [a, b] = segment(draw);
    let width = (draw.scale(1e-6, 1e-2) * nearest(a, b)) as f32;
    let h = a.as_dvec3().cross((b - a).as_dvec3().normalize_or_zero()).length();
    if f64::from(width) > 0.5 * h {
        return at_the_axis(&igloo, a, b, width);
    }
    let (want, slack) = truth_and_slack(a, b, width);
    let error = total(&pieces(&igloo, a, b, [width; 2])) - total(&pieces(&igloo, b, a, [width; 2]));
    Measured { error: error.abs(), bound: 2.0 * slack + 4e-6 * want }
}

/// The polynomial's 2e-6, and 3 roundoffs of a turn.
fn azimuths(draw: &mut Draw) -> Measured {
    let angle = std::f64::consts::TAU * draw.unit();
    let radius = draw.scale(1e-30, 1e30);
    let (x, y) = ((radius * angle.cos()) as f32, (radius * angle.sin()) as f32);
    let want = f64::from(y).atan2(f64::from(x)).rem_euclid(std::f64::consts::TAU);
    let error = (f64::from(azimuth(x, y)) - want).abs();
    Measured {
        error: error.min((std::f64::consts::TAU - error).abs()),
        bound: 2e-6 + 3.0 * U32 * std::f64::consts::TAU,
    }
}

/// Orthonormal to 8 roundoffs, also straight down, where older formulas divide by zero.
fn frames(draw: &mut Draw) -> Measured {
    let normal = draw.direction().as_vec3().normalize();
    let frame = frame_around(normal).as_dmat3();
    let product = frame.transpose() * frame - glam::DMat3::IDENTITY;
    let error = product.to_cols_array().into_iter().map(f64::abs).fold((frame.determinant() - 1.0).abs(), f64::max);
    Measured { error, bound: 8.0 * U32 }
}

/// The face found lies within 3e-6 of the direction: the azimuth's error.
fn face_of(draw: &mut Draw) -> Measured {
    let igloo = Igloo::new(Span::Sphere, draw.pick(&[1, 2, 36, 1000]));
    let d = draw.direction().as_vec3();
    let face = igloo.face_of(d) as u32;
    let ring = &igloo.rings()[igloo.ring_of_face(face as usize)];
    let beyond = |x: f64, low: f64, high: f64| (low - x).max(x - high).max(0.0);
    let mut error = beyond(d.z.into(), ring.bottom.into(), ring.top.into());
    if ring.count > 1 {
        let step = std::f64::consts::TAU / f64::from(ring.count);
        let at = f64::from(d.y).atan2(d.x.into()).rem_euclid(std::f64::consts::TAU);
        let low = f64::from(face - ring.first) * step;
        let turn = std::f64::consts::TAU;
        let off = [at - turn, at, at + turn].map(|at| beyond(at, low, low + step)).into_iter().fold(turn, f64::min);
        // Times the radius: at the pole every azimuth is as good.
        error = error.max(off * f64::from(d.x).hypot(d.y.into()));
    }
    Measured { error, bound: 4e-6 }
}
