//! A lamp's view of the hair: one image that just holds it, or the six of a cube where the lamp is among the hair.
//!
//! Places in an image run from 0 to 1 from its upper left corner. Depth is measured along the image's axis, less `base`, the depth of the
//! middle of the hair: differences stay exact in `f32` however far away the lamp is. All lengths are in render space.

use glam::{DVec2, DVec3, Vec3};

use crate::camera::Projection;
use crate::fragment::{HairFragment, HairSegment};
use crate::hair::HairModel;

/// The part of an image that stays free around the hair, as a share of its half width.
const MARGIN: f64 = 0.02;
/// Depth from which on hair is seen by a lamp; hair that touches the lamp casts no shadow.
const NEAR: f64 = 1e-5;
/// At this depth a perspective image is as good as parallel: rays spread by less than 1e-6 of a pixel's width over 4,096 pixels.
const FAR_AWAY: f64 = 1e10;
/// A wider image than this half angle is cut in six.
const WIDEST: f64 = std::f64::consts::FRAC_PI_4;

/// A cone of directions from a lamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Unit vector from the lamp.
    pub axis: Vec3,
    /// Half of its opening, in radians.
    pub half_angle: f32,
}

/// How a lamp sees the hair.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    origin: DVec3,
    /// Right, up and the axis of each image.
    frames: Vec<[DVec3; 3]>,
    /// Half the width of an image: at unit depth, or everywhere for parallel light.
    half: f64,
    base: f64,
    parallel: bool,
}

/// Where a point is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    pub image: usize,
    /// Place in the image, 0 to 1 from the upper left corner.
    pub at: DVec2,
    /// Depth, less the base.
    pub depth: f64,
}

fn frame(axis: DVec3) -> [DVec3; 3] {
    let right = axis.any_orthonormal_vector();
    [right, right.cross(axis), axis]
}

/// The middle of the hair's box, and the radius of a sphere around it that holds all hair.
fn ball(model: &HairModel) -> (DVec3, f64) {
    let (low, high) = model
        .points
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p.as_dvec3()), high.max(p.as_dvec3())));
    if low.x > high.x {
        return (DVec3::ZERO, 1.0);
    }
    let middle = 0.5 * (low + high);
    let far = model.points.iter().map(|p| p.as_dvec3().distance_squared(middle)).fold(0.0, f64::max).sqrt();
    let widest = model.width.iter().fold(0.0_f32, |a, &b| a.max(b));
    (middle, (far + f64::from(widest)).max(1e-12))
}

impl View {
    /// Of parallel light; `toward` is the unit direction to it.
    pub fn parallel(model: &HairModel, toward: Vec3) -> Self {
        let (middle, radius) = ball(model);
        let axis = -toward.as_dvec3().normalize();
        Self { origin: middle, frames: vec![frame(axis)], half: radius * (1.0 + MARGIN), base: 0.0, parallel: true }
    }

    /// From a point, in all directions or those of a cone. The narrower of hair and cone fills the image.
    pub fn from_point(model: &HairModel, position: Vec3, cone: Option<Cone>) -> Self {
        let origin = position.as_dvec3();
        let (middle, radius) = ball(model);
        let distance = middle.distance(origin);
        let around_hair = (distance > radius).then(|| ((middle - origin) / distance, (radius / distance).asin()));
        let around_cone = cone.map(|cone| (cone.axis.as_dvec3().normalize(), f64::from(cone.half_angle)));
        let narrowest = [around_hair, around_cone].into_iter().flatten().min_by(|a, b| a.1.total_cmp(&b.1));
        match narrowest.filter(|(_, half_angle)| *half_angle < WIDEST) {
            Some((axis, half_angle)) => {
                let half = half_angle.tan().max(1e-12) * (1.0 + MARGIN);
                let base = (middle - origin).dot(axis);
                Self { origin, frames: vec![frame(axis)], half, base, parallel: false }
            }
            None => {
                let axes = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
                Self { origin, frames: axes.map(frame).collect(), half: 1.0, base: 0.0, parallel: false }
            }
        }
    }

    /// How many images it has.
    pub fn images(&self) -> usize {
        self.frames.len()
    }

    fn in_frame(&self, image: usize, point: Vec3) -> DVec3 {
        let offset = point.as_dvec3() - self.origin;
        let [right, up, axis] = self.frames[image];
        DVec3::new(offset.dot(right), offset.dot(up), offset.dot(axis))
    }

    /// Where a point is seen; none where it is in no image, so that no hair is before it.
    pub fn see(&self, point: Vec3) -> Option<Seen> {
        let offset = point.as_dvec3() - self.origin;
        let image = match self.frames.len() {
            1 => 0,
            _ => {
                let size = offset.abs();
                let axis = if size.x >= size.y && size.x >= size.z {
                    0
                } else if size.y >= size.z {
                    1
                } else {
                    2
                };
                2 * axis + usize::from(offset[axis] < 0.0)
            }
        };
        let here = self.in_frame(image, point);
        let scale = if self.parallel { self.half } else { self.half * here.z };
        if !(self.parallel || here.z > NEAR) {
            return None;
        }
        let at = 0.5 + 0.5 * DVec2::new(here.x, -here.y) / scale;
        let inside = at.min_element() >= 0.0 && at.max_element() <= 1.0;
        inside.then_some(Seen { image, at, depth: here.z - self.base })
    }

    /// The point at a place and depth of an image.
    pub fn point(&self, image: usize, at: DVec2, depth: f64) -> Vec3 {
        let [right, up, axis] = self.frames[image];
        let z = depth + self.base;
        let scale = if self.parallel { self.half } else { self.half * z };
        let [x, y] = [(2.0 * at.x - 1.0) * scale, (1.0 - 2.0 * at.y) * scale];
        (self.origin + right * x + up * y + axis * z).as_vec3()
    }

    /// The projection on an image of `cells` cells a side, for the segments of [`Self::segment`].
    pub fn projection(&self, cells: u32) -> Projection {
        let middle = 0.5 * f64::from(cells);
        let depth = if self.parallel { FAR_AWAY } else { 1.0 };
        Projection { focal: middle / self.half * depth, center: DVec2::splat(middle), near: NEAR }
    }

    /// The ends of a segment in an image's frame: right, up, and depth less the base.
    pub(super) fn ends(&self, image: usize, model: &HairModel, index: u32) -> [DVec3; 2] {
        model.ends(index as usize).map(|end| self.in_frame(image, end) - DVec3::Z * self.base)
    }

    /// Where a place in an image's frame is seen, in pixels of a projection, and how many pixels a unit of length has there; none at the lamp and behind it.
    pub(super) fn place(&self, projection: &Projection, at: DVec3) -> Option<(DVec2, f64)> {
        let z = if self.parallel { FAR_AWAY } else { at.z + self.base };
        (z > NEAR).then(|| (projection.pixel(DVec3::new(at.x, at.y, z)), projection.focal / z))
    }

    /// A segment as an image sees it. Parallel light sees all of it at one depth, far away.
    pub fn segment(&self, image: usize, model: &HairModel, index: u32) -> HairSegment {
        let flat = |p: DVec3| if self.parallel { DVec3::new(p.x, p.y, FAR_AWAY) } else { p };
        let ends = model.ends(index as usize).map(|end| flat(self.in_frame(image, end)).as_vec3());
        HairSegment { ends, widths: model.widths(index as usize), index }
    }

    /// Depth, less the base, from which on a fragment of a segment is in the way of the ray through a place of the image: one width of it
    /// behind it, along the ray. No estimator counts hair nearer than its own width (see [`crate::hair::OnStrand`]).
    pub fn counted_from(&self, image: usize, model: &HairModel, fragment: &HairFragment, at: DVec2) -> f32 {
        let index = fragment.segment as usize;
        let [a, b] = model.ends(index).map(|end| self.in_frame(image, end));
        let mut u = f64::from(fragment.u);
        let mut cosine = 1.0;
        if !self.parallel {
            let ray = DVec3::new((2.0 * at.x - 1.0) * self.half, (1.0 - 2.0 * at.y) * self.half, 1.0).normalize();
            cosine = ray.z;
            // A ribbon faces the ray, not the image: where the ray is off the image's axis and passes beside the middle line, it is met
            // where the line comes nearest to the ray.
            let beside = |v: DVec3| v - ray * v.dot(ray);
            let (start, way) = (beside(a), beside(b - a));
            let nearest = -start.dot(way) / way.length_squared();
            if nearest.is_finite() {
                let half = 0.5 * f64::from(fragment.span);
                u = nearest.clamp(u - half, u + half);
            }
        }
        let [first, second] = model.widths(index).map(f64::from);
        let depth = a.z + (b.z - a.z) * u - self.base;
        (depth + (first + (second - first) * u) * cosine) as f32
    }

    /// Pixels a side for an image whose pixels are as wide as the hair, in the middle of it.
    pub fn natural_resolution(&self, mean_width: f64) -> f64 {
        let depth = if self.parallel || self.frames.len() > 1 { 1.0 } else { self.base.max(NEAR) };
        2.0 * self.half * depth / mean_width
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hair::{Attribute, Strands};
    use crate::hash::unit;

    fn model() -> HairModel {
        let points = vec![Vec3::new(-0.5, -0.4, 0.1), Vec3::new(0.3, 0.6, -0.2), Vec3::new(0.4, 0.5, 0.7)];
        let strands = Strands {
            points,
            first: vec![0, 3],
            width: Attribute::Uniform(0.01),
            color: Attribute::Uniform(Vec3::ONE),
            transparency: Attribute::Uniform(0.0),
        };
        let mut model = HairModel::default();
        model.add(&strands, 0);
        model
    }

    fn views(model: &HairModel) -> Vec<View> {
        let cone = Cone { axis: Vec3::NEG_Z, half_angle: 0.2 };
        vec![
            View::parallel(model, Vec3::new(0.48, 0.6, 0.64)),
            View::from_point(model, Vec3::new(1.0, 3.0, 2.0), None),
            View::from_point(model, Vec3::new(0.1, 0.0, 3e4), None),
            View::from_point(model, Vec3::new(0.1, 0.1, 0.0), None),
            View::from_point(model, Vec3::new(0.0, 0.0, 4.0), Some(cone)),
        ]
    }

    #[test]
    fn a_point_is_seen_where_the_image_puts_it() {
        let model = model();
        let images: Vec<usize> = views(&model).iter().map(View::images).collect();
        assert_eq!(images, [1, 1, 1, 6, 1]);
        for (n, view) in views(&model).iter().enumerate() {
            let mut count = 0;
            for i in 0..2000 {
                let p = Vec3::from_array([0, 1, 2].map(|axis| 1.4 * unit(&[n as u32, i, axis]) as f32 - 0.7));
                let Some(seen) = view.see(p) else { continue };
                count += 1;
                let back = view.point(seen.image, seen.at, seen.depth);
                let size = view.origin.length().max(1.0) as f32;
                assert!(back.distance(p) < 1e-6 * size, "view {n}: {p} {back}");
            }
            assert!(count > 500, "view {n} sees {count}");
        }
    }

    #[test]
    fn all_hair_is_in_the_image_and_segments_project_as_points_do() {
        let model = model();
        for (n, view) in views(&model).iter().enumerate() {
            let projection = view.projection(1000);
            for (image, index, u) in
                (0..view.images()).flat_map(|i| [(i, 0, 0.2), (i, 0, 1.0), (i, 1, 0.7), (i, 1, 1.0)])
            {
                let segment = view.segment(image, &model, index);
                let [a, b] = model.ends(index as usize);
                let Some(seen) = view.see(a + (b - a) * u) else {
                    assert_eq!(n, 4, "only a cone leaves hair out");
                    continue;
                };
                if seen.image == image {
                    let p = segment.ends[0] + (segment.ends[1] - segment.ends[0]) * u;
                    let pixel = projection.pixel(p.as_dvec3());
                    assert!((pixel - seen.at * 1000.0).length() < 0.01, "view {n}: {pixel} {}", seen.at);
                    let fragment = HairFragment { depth: 0.0, coverage: 1.0, segment: index, u, span: 0.1 };
                    let behind = f64::from(view.counted_from(image, &model, &fragment, seen.at)) - seen.depth;
                    let here = view.in_frame(image, a + (b - a) * u);
                    let cosine = if view.parallel { 1.0 } else { here.z / here.length() };
                    assert!((behind - 0.01 * cosine).abs() < 1e-5 * view.base.max(1.0), "view {n}: {behind}");
                }
            }
        }
    }
}
