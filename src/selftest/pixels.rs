//! Hair in the image: the camera inside hair, the near plane through a strand, ends a billion pixels away, wide ribbons.

use glam::{DVec2, DVec3, Vec3};

use super::{Draw, Measured, Property, U32};
use crate::camera::Projection;
use crate::fragment::{HairFragment, HairSegment, PixelRect, scan_convert};

pub const PROPERTIES: &[Property] = &[
    Property { name: "image: length x width of a line", quick: 2000, check: line },
    Property { name: "image: area of a ribbon", quick: 500, check: ribbon },
    Property { name: "image: fragments are in range", quick: 2000, check: sane },
    Property { name: "image: crops give the same bits", quick: 1000, check: crops },
];

const SIDE: u32 = 48;

fn view(draw: &mut Draw) -> Projection {
    let focal = draw.scale(5.0, 1e4);
    Projection { focal, center: DVec2::splat(0.5 * f64::from(SIDE)), near: draw.pick(&[1e-4, 1e-2, 0.3]) }
}

/// A segment in camera space: before the camera, through the near plane, through the eye, far outside the image, of no depth.
fn segment(draw: &mut Draw, view: &Projection, widths: [f32; 2]) -> HairSegment {
    let z = draw.scale(1e-3, 10.0);
    let reach = 0.5 * f64::from(SIDE) / view.focal * z;
    let kind = draw.pick(&[0, 0, 0, 1, 2, 3, 4]);
    let mut place = || DVec3::new(reach * draw.between(-1.5, 1.5), reach * draw.between(-1.5, 1.5), z);
    let (mut a, mut b) = (place(), place());
    match kind {
        1 => b.z = -b.z,
        2 => a = DVec3::new(0.0, 0.0, view.near),
        3 => b *= 1e6,
        4 => b = a + (b - a) * 1e-6,
        _ => {}
    }
    HairSegment { ends: [a.as_vec3(), b.as_vec3()], widths, index: 3 }
}

fn fragments(segment: &HairSegment, view: &Projection, rect: &PixelRect) -> Vec<([u32; 2], HairFragment)> {
    let mut all = Vec::new();
    scan_convert(segment, view, rect, |x, y, fragment| all.push(([x, y], fragment)));
    all
}

const IMAGE: PixelRect = PixelRect { min: [0, 0], max: [SIDE, SIDE] };

/// The piece of a segment that is seen through the image, by a way of its own: in camera space, cut by the five planes of the view, as
/// parameters on the segment.
fn seen(segment: &HairSegment, view: &Projection) -> Option<[f64; 2]> {
    let [a, b] = segment.ends.map(|end: Vec3| end.as_dvec3());
    let half = 0.5 * f64::from(SIDE) / view.focal;
    let planes = [
        (DVec3::Z, view.near),
        (DVec3::new(1.0, 0.0, half), 0.0),
        (DVec3::new(-1.0, 0.0, half), 0.0),
        (DVec3::new(0.0, 1.0, half), 0.0),
        (DVec3::new(0.0, -1.0, half), 0.0),
    ];
    let (mut low, mut high) = (0.0_f64, 1.0_f64);
    for (normal, offset) in planes {
        let [p, q] = [a, b].map(|end| end.dot(normal) - offset);
        if p < 0.0 && q < 0.0 {
            return None;
        }
        if p < 0.0 {
            low = low.max(p / (p - q));
        } else if q < 0.0 {
            high = high.min(p / (p - q));
        }
    }
    (low < high).then_some([low, high])
}

/// Narrow hair: Σ coverage is the length of its image times its width, whatever pixels that is shared out to.
///
/// Width is linear along the image, so its mean is that of the ends: exact. Each fragment is rounded once to `f32`; cancellation of a pixel's
/// [enter, leave) with ends p pixels away loses p · 2^-53 · 64 of the length.
fn line(draw: &mut Draw) -> Measured {
    let view = view(draw);
    let thin = segment(draw, &view, [0.0; 2]);
    // Narrower than half a pixel at its nearer end: one line.
    let nearest = thin.ends.map(|end| f64::from(end.z)).into_iter().fold(f64::INFINITY, f64::min).max(view.near);
    let off = thin.ends.map(|e| f64::from(e.truncate().length()) / f64::from(e.z.abs()).max(view.near));
    let stretch = 1.0 + off[0].max(off[1]);
    let width = (draw.scale(1e-7, 0.3) * nearest / view.focal / stretch) as f32;
    let thin = HairSegment { widths: [width; 2], ..thin };
    let got: f64 = fragments(&thin, &view, &IMAGE).iter().map(|(_, f)| f64::from(f.coverage)).sum();
    let Some(range) = seen(&thin, &view) else { return Measured { error: got, bound: 1e-9 } };
    let [a, b] = thin.ends.map(|end| end.as_dvec3());
    let [p, q] = range.map(|u| a.lerp(b, u));
    let image = |v: DVec3| DVec2::new(v.x, -v.y) * (view.focal / v.z);
    let (start, end) = (image(p), image(q));
    // The ribbon that faces the eye: √(1 + (h/f)²), h the distance of the line from the centre, from the plane through eye and segment.
    let normal = a.cross(b).normalize_or_zero();
    let sine = normal.truncate().length();
    let widths = [p, q].map(|v| f64::from(width) * view.focal / v.z / sine.max(1e-300));
    let want = start.distance(end) * 0.5 * (widths[0] + widths[1]);
    // How well the plane is known: roundoff of f64 over the segment's own length as seen.
    let reach = thin.ends.iter().map(|e| view.focal * f64::from(e.length()) / f64::from(e.z.abs()).max(view.near));
    let pixels = reach.fold(1.0, f64::max);
    let condition = (a.length() * b.length() / a.cross(b).length().max(1e-300)).min(1e12);
    let rounding = 4.0 * U32 * want + 256.0 * f64::EPSILON * pixels * (widths[0] + widths[1]);
    Measured { error: (got - want).abs(), bound: rounding + 16.0 * f64::EPSILON * condition * want }
}

/// Wide hair: Σ coverage is the area of its quadrilateral inside the image, by integration over scan lines. Its corners are at half the width in the image beside the
/// middle line; where the ribbon leans so that this is off by more than a sixteenth of itself, they are projected from their places in space.
fn ribbon(draw: &mut Draw) -> Measured {
    let view = Projection { focal: 24.0, center: DVec2::splat(0.5 * f64::from(SIDE)), near: 1e-2 };
    let place = |draw: &mut Draw| DVec2::new(draw.between(-20.0, 68.0), draw.between(-20.0, 68.0));
    let (p, q) = (place(draw), place(draw));
    let depth = draw.scale(2e-2, 100.0);
    let delta = q - p;
    let length = delta.length();
    if length < 1e-3 {
        return Measured { error: 0.0, bound: 0.0 };
    }
    let off = delta.perp_dot(p - view.center) / length;
    let stretch = 1f64.hypot(off / view.focal);
    let pixels = draw.scale(1.0, 40.0);
    let width = (pixels * depth / view.focal / stretch) as f32;
    let at = |v: DVec2| {
        let v = (v - view.center) * (depth / view.focal);
        Vec3::new(v.x as f32, -v.y as f32, depth as f32)
    };
    let wide = HairSegment { ends: [at(p), at(q)], widths: [width; 2], index: 0 };
    let got: f64 = fragments(&wide, &view, &IMAGE).iter().map(|(_, f)| f64::from(f.coverage)).sum();
    let across = delta.perp() * (0.5 * pixels / length);
    let leans = 0.5 * pixels * off.abs() / (view.focal.powi(2) + off.powi(2)) > 1.0 / 16.0;
    let corners = if leans {
        let [a, b] = wide.ends.map(|end| end.as_dvec3());
        // What is nearer than a thousandth of the depth is far outside the image.
        let normal = a.cross(b - a).normalize();
        let reach = 0.5 * f64::from(width);
        let corner = |end: DVec3, side: f64| {
            let most = (1.0 - 1e-3) * end.z / (-side * normal.z).max(1e-300);
            view.pixel(end + normal * (side * reach.min(most)))
        };
        [corner(a, 1.0), corner(b, 1.0), corner(b, -1.0), corner(a, -1.0)]
    } else {
        [p + across, q + across, q - across, p - across]
    };
    let want = area_within(&corners, f64::from(SIDE));
    // The ends are rounded to f32: 2 roundoffs of 100 pixels times the outline's length; each fragment once more.
    let outline = 2.0 * (length + pixels);
    // Where it leans an edge in the image moves by up to (1 - lean)^-2 of what an end does, which is 8 for one that is still seen at this view.
    let share = if leans { 8.0 } else { 1.0 };
    Measured { error: (got - want).abs(), bound: share * 16.0 * U32 * 100.0 * outline + 4.0 * U32 * want }
}

/// Area of a convex polygon within a square from the origin: ∫ over rows of the width inside, exact between the heights at which anything changes.
fn area_within(corners: &[DVec2; 4], side: f64) -> f64 {
    let mut heights: Vec<f64> = corners.iter().map(|c| c.y).chain([0.0, side]).collect();
    for i in 0..4 {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        // Where an edge meets the square's upright sides.
        heights.extend(
            [0.0, side].map(|x| a.y + (b.y - a.y) * ((x - a.x) / (b.x - a.x))).into_iter().filter(|y| y.is_finite()),
        );
    }
    heights.iter_mut().for_each(|y| *y = y.clamp(0.0, side));
    heights.sort_by(f64::total_cmp);
    let width = |y: f64| {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..4 {
            let (a, b) = (corners[i], corners[(i + 1) % 4]);
            if (a.y <= y) != (b.y <= y) {
                let x = a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y));
                (low, high) = (low.min(x), high.max(x));
            }
        }
        (high.min(side) - low.max(0.0)).max(0.0)
    };
    // Linear between neighbouring heights: the midpoint rule is exact.
    heights.windows(2).map(|pair| (pair[1] - pair[0]) * width(0.5 * (pair[0] + pair[1]))).sum()
}

/// Depth, coverage and parameters are what they say, whatever the segment: a count of those that are not.
fn sane(draw: &mut Draw) -> Measured {
    let view = view(draw);
    let wide = draw.scale(1e-7, 10.0) as f32;
    let taper = draw.pick(&[0.0_f32, 1.0]);
    let segment = segment(draw, &view, [wide, taper * wide]);
    let near = view.near as f32;
    let bad = fragments(&segment, &view, &IMAGE).into_iter().filter(|([x, y], f)| {
        !(f.depth >= near * (1.0 - 1e-6)
            && f.depth.is_finite()
            && f.coverage > 0.0
            && f.coverage <= 1.0
            && (0.0..=1.0).contains(&f.u)
            && (0.0..=1.0).contains(&f.span)
            && *x < SIDE
            && *y < SIDE)
    });
    Measured { error: bad.count() as f64, bound: 0.0 }
}

/// A part of the picture is the same part of the whole, to the bit.
fn crops(draw: &mut Draw) -> Measured {
    let view = view(draw);
    let width = draw.scale(1e-5, 1.0) as f32;
    let segment = segment(draw, &view, [width; 2]);
    let cut = draw.between(1.0, f64::from(SIDE)) as u32;
    let rect = PixelRect { min: [cut / 2, cut / 3], max: [cut.max(2), SIDE] };
    let inside = |at: &[u32; 2]| (0..2).all(|i| (rect.min[i]..rect.max[i]).contains(&at[i]));
    let whole: Vec<_> = fragments(&segment, &view, &IMAGE).into_iter().filter(|(at, _)| inside(at)).collect();
    let part = fragments(&segment, &view, &rect);
    Measured { error: f64::from(u8::from(whole != part)), bound: 0.0 }
}
