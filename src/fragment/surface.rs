//! Opaque surfaces in a pixel: sub-pixel samples, and the few points of them that are shaded.

use crate::camera::Camera;
use crate::hash::hash;
use crate::sequence::Sequence;
use glam::{DVec3, Vec3};

/// The group of a sample that meets no surface.
pub const NO_SURFACE: u32 = u32::MAX;

/// Samples of one object belong to one shading point while their normals differ by less than about 20 degrees,
const SAME_NORMAL: f32 = 0.94;
/// while each lies near the plane through the first one, as a share of its depth (a plane seen at a grazing angle spans many depths),
const SAME_PLANE: f32 = 0.01;
/// and while their depths are alike, as a share: a floor seen up to the horizon has several points.
const SAME_DEPTH: f32 = 0.25;

/// Keeps these random numbers apart from those of other purposes.
const PURPOSE: u32 = 0x5355_5246;

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// Depth (camera z), not distance.
    pub depth: f32,
    /// Which object and material; hits that differ in it are never shaded as one.
    pub group: u32,
    /// The caller's own number of the hit, passed through.
    pub index: u32,
    /// The point.
    pub position: Vec3,
    /// Unit shading normal.
    pub normal: Vec3,
}

/// One sub-pixel sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// Depth (camera z) of the first surface; infinite if there is none.
    pub depth: f32,
    /// Index of the shading point in [`SurfacePixel::groups`], or [`NO_SURFACE`].
    pub group: u32,
}

impl SurfaceSample {
    /// A sample that meets no surface.
    pub const EMPTY: Self = Self { depth: f32::INFINITY, group: NO_SURFACE };
}

/// Samples of a pixel that are shaded as one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceGroup {
    /// The hit to shade: the one nearest to the mean position of the group.
    pub hit: SurfaceHit,
    /// How many samples it stands for.
    pub samples: u32,
    first: SurfaceHit,
    sum: DVec3,
    distance: f64,
}

/// The surfaces of one pixel. Kept from pixel to pixel, it allocates nothing.
#[derive(Clone, Debug, Default)]
pub struct SurfacePixel {
    /// All samples, by rows of the sub-pixel grid.
    pub samples: Vec<SurfaceSample>,
    /// The shading points.
    pub groups: Vec<SurfaceGroup>,
    hits: Vec<SurfaceHit>,
}

impl SurfacePixel {
    /// Samples a pixel at `per_side` x `per_side` jittered positions, 1 to 1024 a side. `hit` gets origin and unit direction of a ray and gives the first surface
    /// at or behind the near plane, if there is one. Positions depend on pixel, sample and sequence only.
    pub fn gather(
        &mut self,
        camera: &Camera,
        pixel: [u32; 2],
        per_side: u32,
        sequence: Sequence,
        mut hit: impl FnMut(Vec3, Vec3) -> Option<SurfaceHit>,
    ) {
        self.samples.clear();
        self.groups.clear();
        self.hits.clear();
        let per_side = per_side.clamp(1, 1024);
        let cell = 1.0 / f64::from(per_side);
        for sample in 0..per_side * per_side {
            let place = [sample % per_side, sample / per_side];
            let key = |axis| hash(&[PURPOSE, sequence.seed, pixel[0], pixel[1], sample, axis]);
            let jitter = sequence.pair([key(0), key(1)]);
            let position =
                [0, 1].map(|axis| f64::from(pixel[axis]) + (f64::from(place[axis]) + f64::from(jitter[axis])) * cell);
            let (origin, direction) = camera.ray(position[0], position[1]);
            let found = hit(origin, direction);
            self.add(found);
        }
        self.choose();
    }

    /// Puts a sample into the first group that it agrees with, or into a new one.
    fn add(&mut self, hit: Option<SurfaceHit>) {
        let Some(hit) = hit else { return self.samples.push(SurfaceSample::EMPTY) };
        let group = self.groups.iter().position(|group| agree(&group.first, &hit)).unwrap_or_else(|| {
            self.groups.push(SurfaceGroup { hit, samples: 0, first: hit, sum: DVec3::ZERO, distance: f64::INFINITY });
            self.groups.len() - 1
        });
        self.groups[group].samples += 1;
        self.groups[group].sum += hit.position.as_dvec3();
        self.samples.push(SurfaceSample { depth: hit.depth, group: group as u32 });
        self.hits.push(hit);
    }

    /// Chooses each group's shading point: the hit nearest to its mean position, the first of equals.
    fn choose(&mut self) {
        let groups = self.samples.iter().map(|sample| sample.group).filter(|&group| group != NO_SURFACE);
        for (group, hit) in groups.zip(&self.hits) {
            let group = &mut self.groups[group as usize];
            let distance = hit.position.as_dvec3().distance_squared(group.sum / f64::from(group.samples));
            if distance < group.distance {
                group.distance = distance;
                group.hit = *hit;
            }
        }
    }
}

/// Whether two hits can be shaded as one.
fn agree(a: &SurfaceHit, b: &SurfaceHit) -> bool {
    a.group == b.group
        && a.normal.dot(b.normal) > SAME_NORMAL
        && (a.depth - b.depth).abs() <= SAME_DEPTH * a.depth
        && (b.position - a.position).dot(a.normal).abs() <= SAME_PLANE * a.depth
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::new(DVec3::new(0.0, 1.0, 0.0), DVec3::new(0.0, 1.0, -1.0), DVec3::Y, 60.0, [64, 48], 0.01).unwrap()
    }

    fn hit(group: u32, depth: f32, normal: Vec3, position: Vec3) -> SurfaceHit {
        SurfaceHit { depth, group, index: 0, position, normal }
    }

    #[test]
    fn there_is_one_sample_in_each_cell() {
        let camera = camera();
        let mut pixel = SurfacePixel::default();
        let mut seen = Vec::new();
        pixel.gather(&camera, [11, 7], 5, Sequence::start(3), |origin, direction| {
            seen.push(camera.project(camera.to_camera(origin + direction)).unwrap());
            None
        });
        for (sample, place) in seen.iter().enumerate() {
            let cell = (*place - glam::DVec2::new(11.0, 7.0)) * 5.0;
            // Single precision of the ray moves a sample by a few 1e-5 cells.
            assert!((cell.x - (sample % 5) as f64 - 0.5).abs() < 0.501, "{cell}");
            assert!((cell.y - (sample / 5) as f64 - 0.5).abs() < 0.501, "{cell}");
        }
        assert_eq!(pixel.samples, vec![SurfaceSample::EMPTY; 25]);
        assert!(pixel.groups.is_empty());
        let first = seen.clone();
        seen.clear();
        let mut record = |seed| {
            pixel.gather(&camera, [11, 7], 5, Sequence::start(seed), |origin, direction| {
                seen.push(camera.project(camera.to_camera(origin + direction)).unwrap());
                None
            });
            std::mem::take(&mut seen)
        };
        assert_eq!(record(3), first);
        assert_ne!(record(4), first);
    }

    #[test]
    fn what_differs_is_shaded_apart() {
        let normal = |degrees: f32| Vec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
        let at = |x: f32, z: f32| Vec3::new(x, 0.0, z);
        let hits = [
            Some(hit(0, 2.0, normal(0.0), at(0.0, -2.0))),
            Some(hit(0, 2.0, normal(15.0), at(0.001, -2.0))), // the same
            None,
            Some(hit(1, 2.0, normal(0.0), at(0.0, -2.0))), // another object
            Some(hit(0, 2.0, normal(25.0), at(0.0, -2.0))), // another side
            Some(hit(0, 2.1, normal(0.0), at(0.0, -2.1))), // a layer behind it
            Some(hit(0, 2.0, normal(0.0), at(0.003, -2.0))), // the first again
        ];
        let mut pixel = SurfacePixel::default();
        hits.iter().for_each(|&hit| pixel.add(hit));
        pixel.choose();
        let groups: Vec<_> = pixel.samples.iter().map(|sample| sample.group).collect();
        assert_eq!(groups, [0, 0, NO_SURFACE, 1, 2, 3, 0]);
        assert_eq!(pixel.groups.iter().map(|group| group.samples).collect::<Vec<_>>(), [3, 1, 1, 1]);
        // Means x = 0.00133: the second hit is nearest.
        assert_eq!(pixel.groups[0].hit, hits[1].unwrap());
        assert_eq!(pixel.samples[2].depth, f32::INFINITY);
    }

    #[test]
    fn a_floor_has_one_point_a_pixel_and_few_at_the_horizon() {
        let camera = camera();
        let mut pixel = SurfacePixel::default();
        for y in 24..48 {
            pixel.gather(&camera, [20, y], 4, Sequence::start(0), |origin, direction| {
                let distance = -origin.y / direction.y;
                let position = origin + distance * direction;
                (direction.y < 0.0).then(|| hit(0, camera.to_camera(position).z, Vec3::Y, position))
            });
            let limit = if y > 26 { 2 } else { 8 };
            assert!((1..=limit).contains(&pixel.groups.len()), "row {y}: {} points", pixel.groups.len());
            assert_eq!(pixel.groups.iter().map(|group| group.samples).sum::<u32>(), 16);
        }
    }
}
