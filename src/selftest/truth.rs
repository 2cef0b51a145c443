//! Truths in `f64`, each along another way than the program's own.

use glam::DVec3;

use crate::hair::HairModel;
use crate::occlusion::Receiver;

/// Solid angle of a ribbon of one width that faces the viewer, of what lies beyond its own width, over the sphere.
///
/// The program adds slices by the midpoint rule; this integrates them by Gauss-Legendre's rule (8 points on each of 32 parts), in the angle α
/// about the axis with h' = h cos α the distance of the slice's foot: ∫ dα (s2/r2 - s1/r1), the parts within one width taken away.
pub fn solid_angle(a: DVec3, b: DVec3, width: f64) -> f64 {
    let along = b - a;
    let length = along.length();
    if length == 0.0 {
        return 0.0;
    }
    let axis = along / length;
    // |a x u| has no cancellation of large numbers as a - (a·u) u has.
    let h = a.cross(axis).length().min(b.cross(axis).length());
    let from = a.dot(axis);
    from_axis(h, from, from + length, width)
}

/// The same with the axis at the distance `h`, from `from` to `to` of its foot.
pub fn from_axis(h: f64, from: f64, to: f64, width: f64) -> f64 {
    if h == 0.0 || width <= 0.0 {
        return 0.0;
    }
    let half = (0.5 * width / h).min(1.0).asin();
    let slice = |alpha: f64| {
        let h = h * alpha.cos();
        let inner = (width * width - h * h).max(0.0).sqrt();
        let before = (from, to.min(-inner));
        let after = (from.max(inner), to);
        let parts = if inner == 0.0 { [(from, to), (0.0, 0.0)] } else { [before, after] };
        parts.iter().filter(|(s1, s2)| s2 > s1).map(|&(s1, s2)| difference(h, s1, s2)).sum::<f64>()
    };
    // Even in α.
    2.0 * integral(slice, 0.0, half, 32)
}

/// s2/r2 - s1/r1 as sin(β2 - β1)-free difference: with tan β = s/h it is 2 cos((β1+β2)/2) sin((β2-β1)/2), and β2 - β1 is
/// atan2(h (s2 - s1), h² + s1 s2), which does not cancel.
fn difference(h: f64, s1: f64, s2: f64) -> f64 {
    let turn = (h * (s2 - s1)).atan2(h * h + s1 * s2);
    let (r1, r2) = (h.hypot(s1), h.hypot(s2));
    // cos of the mean direction, from the bisector of the two unit vectors (h, s) / r.
    let bisector = [h / r1 + h / r2, s1 / r1 + s2 / r2];
    let cosine = bisector[0] / bisector[0].hypot(bisector[1]);
    2.0 * cosine * (0.5 * turn).sin()
}

/// ∫ f by Gauss and Legendre's rule of eight points on each of `parts` equal parts.
pub fn integral(f: impl Fn(f64) -> f64, from: f64, to: f64, parts: u32) -> f64 {
    const NODES: [[f64; 2]; 4] = [
        [0.183_434_642_495_649_8, 0.362_683_783_378_362],
        [0.525_532_409_916_329, 0.313_706_645_877_887_3],
        [0.796_666_477_413_626_7, 0.222_381_034_453_374_5],
        [0.960_289_856_497_536_3, 0.101_228_536_290_376_26],
    ];
    let half = 0.5 * (to - from) / f64::from(parts);
    let mut sum = 0.0;
    for part in 0..parts {
        let middle = from + half * f64::from(2 * part + 1);
        sum += NODES.iter().map(|[x, w]| w * (f(middle - half * x) + f(middle + half * x))).sum::<f64>();
    }
    sum * half
}

/// A fraction of the sphere's directions, evenly spread: direction `index` of `count` of Fibonacci's lattice.
pub fn lattice(index: u32, count: u32) -> DVec3 {
    let z = 1.0 - (2.0 * f64::from(index) + 1.0) / f64::from(count);
    let (sin, cos) = (f64::from(index) * 2.399_963_229_728_653).sin_cos();
    let r = ((1.0 - z) * (1.0 + z)).sqrt();
    DVec3::new(r * cos, r * sin, z)
}

/// Transmittance of all hair along a ray by the stated rules: the product over segments whose axis passes within half a width, beyond one
/// width, of the receiver's own strand only what lies outside four widths of arc.
pub fn transmittance(model: &HairModel, receiver: &Receiver, direction: DVec3) -> f64 {
    transmittance_up_to(model, receiver, direction, f64::INFINITY)
}

/// The same of the hair nearer than `far`.
pub fn transmittance_up_to(model: &HairModel, receiver: &Receiver, direction: DVec3, far: f64) -> f64 {
    let origin = receiver.position.as_dvec3();
    (0..model.segments())
        .filter(|&s| crosses(model, receiver, s, origin, direction, far))
        .fold(1.0, |t, segment| t * f64::from(model.transparency[segment]))
}

fn crosses(model: &HairModel, receiver: &Receiver, segment: usize, origin: DVec3, direction: DVec3, far: f64) -> bool {
    let [a, b] = model.ends(segment).map(|end| end.as_dvec3() - origin);
    let along = b - a;
    let length2 = along.length_squared();
    let normal = along.cross(direction);
    let sine2 = normal.length_squared();
    if sine2 <= 1e-24 * length2 {
        return false;
    }
    let off = a.dot(normal).abs() / sine2.sqrt();
    let u = a.cross(direction).dot(normal) / -sine2;
    if !(0.0..1.0).contains(&u) {
        return false;
    }
    let [w0, w1] = model.widths(segment).map(f64::from);
    let width = w0 + u * (w1 - w0);
    let distance = (a + u * along).dot(direction);
    if off > 0.5 * width || distance <= width || distance >= far {
        return false;
    }
    receiver.on.filter(|on| on.strand == model.strand[segment]).is_none_or(|on| {
        let [from, to] = model.arcs(segment).map(f64::from);
        let [low, high] = on.excluded().map(f64::from);
        !(low..high).contains(&(from + u * (to - from)))
    })
}

/// Mean transmittance over the sphere, or over the hemisphere around the receiver's frame, by `count` directions of a lattice.
pub fn mean_transmittance(model: &HairModel, receiver: &Receiver, hemisphere: bool, count: u32) -> f64 {
    use rayon::prelude::*;
    let up = receiver.frame.z_axis.as_dvec3();
    let directions: Vec<DVec3> =
        (0..count).map(|i| lattice(i, count)).filter(|d| !hemisphere || d.dot(up) > 0.0).collect();
    let each = |&direction: &DVec3| transmittance(model, receiver, direction);
    let values: Vec<f64> = directions.par_iter().map(each).collect();
    // In a fixed order.
    values.iter().sum::<f64>() / values.len().max(1) as f64
}
