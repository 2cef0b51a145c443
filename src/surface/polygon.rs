//! Cutting plane polygons into triangles.
//!
//! Convex ones become fans. Others are cut by ears: a corner is cut off where it is convex and no other corner lies in
//! its triangle (Meisters, "Polygons Have Ears", 1975).

use glam::{DVec2, DVec3};

/// Polygons with more corners become fans whatever their form: cutting ears takes time with the square of the corners.
const MAX_EARS: usize = 2048;

/// The triangles of a polygon.
#[derive(Debug, PartialEq)]
pub(super) struct Cut {
    /// Corners by their number in the polygon, wound as it is.
    pub triangles: Vec<[usize; 3]>,
    /// Whether the triangles fill the polygon; otherwise it crosses itself, has no area, or has too many corners to find out.
    pub clean: bool,
}

/// Cuts a polygon of at least three corners; corners out of a common plane are projected to the mean one.
pub(super) fn cut(corners: &[DVec3]) -> Cut {
    let n = corners.len();
    let fan = |clean| Cut { triangles: (2..n).map(|k| [0, k - 1, k]).collect(), clean };
    if n <= 3 {
        return fan(true);
    }
    let Some(flat) = flatten(corners) else { return fan(false) };
    // A fan is right where each of its triangles is on the same side; that holds for all convex polygons and many more.
    if (2..n).all(|k| twice_area(flat[0], flat[k - 1], flat[k]) >= 0.0) && turns_once(&flat) {
        return fan(true);
    }
    if n > MAX_EARS {
        return fan(false);
    }
    ears(&flat)
}

/// The polygon in its mean plane, counter-clockwise; nothing for one without area. The normal is Newell's.
fn flatten(corners: &[DVec3]) -> Option<Vec<DVec2>> {
    let origin = corners[0];
    let next = corners.iter().cycle().skip(1);
    let normal: DVec3 = corners.iter().zip(next).map(|(a, b)| (*a - origin).cross(*b - origin)).sum();
    let normal = normal.try_normalize()?;
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u);
    Some(corners.iter().map(|p| DVec2::new((*p - origin).dot(u), (*p - origin).dot(v))).collect())
}

fn twice_area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Whether the outline turns by one whole turn in all, as one that does not cross itself does.
fn turns_once(flat: &[DVec2]) -> bool {
    let next = flat.iter().cycle().skip(1);
    let edges: Vec<DVec2> = flat.iter().zip(next).map(|(a, b)| *b - *a).filter(|edge| *edge != DVec2::ZERO).collect();
    let total: f64 = edges.iter().zip(edges.iter().cycle().skip(1)).map(|(a, b)| a.angle_to(*b)).sum();
    (total - std::f64::consts::TAU).abs() < 0.1
}

fn ears(flat: &[DVec2]) -> Cut {
    let mut left: Vec<usize> = (0..flat.len()).collect();
    let mut triangles = Vec::with_capacity(flat.len() - 2);
    let mut clean = turns_once(flat);
    let mut at = 0;
    while left.len() > 3 {
        let n = left.len();
        let corner = |k: usize| [left[(k + n - 1) % n], left[k % n], left[(k + 1) % n]];
        // Going on from the last ear instead of from the first corner keeps the triangles from becoming slivers.
        let ear = (at..at + n).find(|&k| is_ear(flat, &left, corner(k)));
        // Without an ear some corners may lie on a line: cutting one off changes nothing.
        let on_line = |[a, b, c]: [usize; 3]| twice_area(flat[a], flat[b], flat[c]) == 0.0;
        let flat_corner = || (at..at + n).find(|&k| on_line(corner(k)));
        let chosen = ear.or_else(flat_corner).unwrap_or_else(|| {
            clean = false;
            at
        });
        triangles.push(corner(chosen));
        left.remove(chosen % n);
        at = chosen % n % left.len();
    }
    triangles.push([left[0], left[1], left[2]]);
    Cut { triangles, clean }
}

/// Whether a corner is convex and its triangle holds no other corner, on its edges neither.
fn is_ear(flat: &[DVec2], left: &[usize], [a, b, c]: [usize; 3]) -> bool {
    let (pa, pb, pc) = (flat[a], flat[b], flat[c]);
    if twice_area(pa, pb, pc) <= 0.0 {
        return false;
    }
    left.iter().map(|&i| flat[i]).all(|p| {
        // Corners at the same place, as where a hole is joined by a slit, do not count.
        let same = p == pa || p == pb || p == pc;
        let inside = twice_area(pa, pb, p) >= 0.0 && twice_area(pb, pc, p) >= 0.0 && twice_area(pc, pa, p) >= 0.0;
        same || !inside
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use proptest::prelude::*;

    /// Twice the signed area by the shoelace formula, and of each triangle.
    fn areas(flat: &[DVec2], cut: &Cut) -> (f64, Vec<f64>) {
        let n = flat.len();
        let whole = (0..n).map(|k| flat[k].perp_dot(flat[(k + 1) % n])).sum();
        (whole, cut.triangles.iter().map(|t| twice_area(flat[t[0]], flat[t[1]], flat[t[2]])).collect())
    }

    fn in_space(flat: &[DVec2]) -> Vec<DVec3> {
        let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.7);
        flat.iter().map(|p| turn * p.extend(0.0) + DVec3::new(5.0, 6.0, 7.0)).collect()
    }

    fn check(flat: &[DVec2]) {
        let cut = cut(&in_space(flat));
        let (whole, parts) = areas(flat, &cut);
        assert_eq!(cut.triangles.len(), flat.len() - 2);
        assert!(cut.clean && parts.iter().all(|a| *a > -1e-9), "{flat:?} {cut:?}");
        assert!((parts.iter().sum::<f64>() - whole).abs() < 1e-9 * whole, "{cut:?}");
    }

    #[test]
    fn arrows_letters_and_combs_are_filled() {
        let p = DVec2::new;
        // An arrow-head of four corners, for each corner to begin with.
        let arrow = [p(0.0, 0.0), p(2.0, -1.0), p(1.0, 0.0), p(2.0, 1.0)];
        for k in 0..4 {
            let mut turned = arrow;
            turned.rotate_left(k);
            check(&turned);
        }
        check(&[p(0., 0.), p(3., 0.), p(3., 1.), p(1., 1.), p(1., 3.), p(0., 3.)]);
        // A comb with corners in a line, whose fan would cross the gaps.
        let mut comb = vec![p(9.0, 0.0), p(9.0, 3.0)];
        for k in (0..4).rev() {
            let x = 2.0 * f64::from(k);
            comb.extend([p(x + 1.5, 3.0), p(x + 1.5, 1.0), p(x + 1.0, 1.0), p(x + 1.0, 3.0)]);
        }
        comb.extend([p(0.0, 3.0), p(0.0, 0.0)]);
        check(&comb);
    }

    #[test]
    fn hopeless_polygons_end_in_some_triangles() {
        let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        assert!(cut(&[p(1.0, 1.0); 7]).triangles.len() == 5);
        let bow_tie = [p(0.0, 0.0), p(2.0, 2.0), p(2.0, 0.0), p(0.0, 1.0)];
        assert_eq!(cut(&bow_tie).triangles.len(), 2);
        let star: Vec<DVec3> = (0..5).map(|k| f64::from(2 * k) * 1.256_637).map(|a| p(a.cos(), a.sin())).collect();
        assert!(!cut(&star).clean);
        let zigzag: Vec<DVec3> = (0..5000).map(|k| p(f64::from(k), f64::from(k % 2))).collect();
        assert_eq!(cut(&zigzag).triangles.len(), 4998);
    }

    proptest! {
        #[test]
        fn star_shaped_polygons_are_filled(radii in prop::collection::vec(0.05f64..1.0, 3..40)) {
            let n = radii.len() as f64;
            let at = |(k, r): (usize, &f64)| DVec2::from_angle(k as f64 / n * std::f64::consts::TAU) * *r;
            check(&radii.iter().enumerate().map(at).collect::<Vec<_>>());
        }
    }
}
