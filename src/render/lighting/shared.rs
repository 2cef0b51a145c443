//! Λ̄ shared between neighbouring points on hair (after irradiance caching, Ward et al. 1988; here of single faces, so that Γ̄ stays each point's own).
//!
//! The corners of a lattice over the hair each look around once, with [`LOOKS`] rays a face, and light what these rays meet. A point on
//! hair takes one of its cell's eight corners by chance, trilinearly, so that in the mean Λ̄ is linear between corners, and of each face one
//! of the corner's rays, with its radiance and distance. Faces in which one of them ends too near for that are the point's own to look into:
//! seen from the point, what a shared ray met lies at an angle of at most the cell's diagonal over its distance. Own rays have random
//! numbers of their own; in the corner's directions, near things would be seen by all points around it with the same noise.

use std::sync::OnceLock;

use glam::Vec3;

use super::{FACE, Lap, Lighting, Part, Seen, Workspace};
use crate::effects::{ABSENT, Effects};
use crate::hair::strands::bounds;
use crate::hash::{hash, to_unit};
use crate::occlusion::{Igloo, Receiver};
use crate::render::costs::Built;
use crate::render::pass::PointKey;
use crate::scene::description::EffectName;
use crate::surface::SurfacePoint;
use crate::tally::{self, Work};

/// Purpose of the random numbers that choose a corner and its rays.
const SHARE: u32 = 0x5348_4152;
/// Rays of a corner in each face, one in each quarter.
const LOOKS: u32 = 4;
/// Cells of the lattice at the most, and pixels of the picture for each: few points would not pay for their corners.
const MOST_CELLS: f32 = 8192.0;
const PIXELS_A_CELL: f32 = 4.0;
/// Points at which the distances of surfaces are measured.
const PROBES: usize = 64;

/// The lattice, its corners filled when they are first asked for. Corners know nothing of the points that ask: pictures do not depend on their order.
#[derive(Debug)]
pub struct SharedLight {
    low: Vec3,
    spacing: f32,
    corners_a_side: [u32; 3],
    /// What is nearer to a corner than this is not shared.
    nearest: f32,
    /// Whose random numbers its rays have.
    seed: u32,
    corners: Vec<OnceLock<Vec<Ray>>>,
}

/// One of a corner's rays in a face.
#[derive(Clone, Copy, Debug)]
struct Ray {
    /// Distance of what it met, infinite where that is the sky; none where points have to look themselves.
    far: Option<f32>,
    radiance: Vec3,
}

impl SharedLight {
    /// A lattice over the box of all hair for a picture of `pixels`: as fine as surfaces at the `typical` distance ask for if what is met may be
    /// off by the `angle`, in radians.
    fn new([low, high]: [Vec3; 2], typical: f32, angle: f32, pixels: f32, seed: u32) -> Self {
        let size = (high - low).max(Vec3::splat(1e-6 * (high - low).max_element().max(f32::MIN_POSITIVE)));
        let cells = (pixels / PIXELS_A_CELL).clamp(1.0, MOST_CELLS);
        let diagonal = 3.0_f32.sqrt();
        let (longest, shortest) = (size.max_element(), size.min_element());
        let middle = size.element_sum() - longest - shortest;
        // A flat box, or a rod, has one cell along its short sides: the others alone must not have more cells either.
        let least = [longest / cells, (longest * middle / cells).sqrt(), (longest * middle * shortest / cells).cbrt()];
        let spacing = least.into_iter().fold(typical * angle / diagonal, f32::max);
        let corners_a_side = (size / spacing).to_array().map(|cells| cells.ceil() as u32 + 1);
        let count = corners_a_side.iter().map(|&n| n as usize).product();
        let corners = (0..count).map(|_| OnceLock::new()).collect();
        Self { low, spacing, corners_a_side, nearest: diagonal * spacing / angle, seed, corners }
    }

    /// One of the eight corners around a position, by chance: the mean over `key`s of what is linear is its value there.
    fn choose(&self, position: Vec3, key: u32) -> [u32; 3] {
        let place = (position - self.low) / self.spacing;
        std::array::from_fn(|axis| {
            let random = to_unit(hash(&[SHARE, key, axis as u32]));
            ((place[axis] + random).max(0.0) as u32).min(self.corners_a_side[axis] - 1)
        })
    }

    fn position(&self, corner: [u32; 3]) -> Vec3 {
        self.low + self.spacing * Vec3::from_array(corner.map(|i| i as f32))
    }

    fn index(&self, corner: [u32; 3]) -> usize {
        let [nx, ny, _] = self.corners_a_side.map(|n| n as usize);
        let [x, y, z] = corner.map(|i| i as usize);
        (z * ny + y) * nx + x
    }

    /// The direction of one of a corner's rays: each quarter of a face has one.
    fn direction(&self, igloo: &Igloo, corner: usize, face: usize, look: u32) -> Vec3 {
        let jitter = |axis| to_unit(hash(&[FACE, self.seed, corner as u32, face as u32, look, axis]));
        let [u, v] = [look % 2, look / 2].map(|half| 0.5 * half as f32);
        igloo.direction(face, u + 0.5 * jitter(0), v + 0.5 * jitter(1))
    }

    /// What a lattice for a picture of `pixels` will hold, in bytes, where points have `faces` faces: as a rule a quarter of the corners are asked.
    pub fn bytes_for(pixels: f64, faces: u32) -> u64 {
        let cells = (pixels / f64::from(PIXELS_A_CELL)).min(f64::from(MOST_CELLS));
        (0.25 * cells * f64::from(faces * LOOKS)) as u64 * size_of::<Ray>() as u64
    }

    /// Bytes held so far.
    fn bytes(&self) -> u64 {
        let filled: usize = self.corners.iter().filter_map(OnceLock::get).map(Vec::len).sum();
        (filled * size_of::<Ray>() + self.corners.len() * size_of::<OnceLock<Vec<Ray>>>()) as u64
    }
}

impl Lighting<'_> {
    /// Begins to share Λ̄ for a pass with this seed, where the scene asks for it and surfaces reflect light on hair.
    pub(in crate::render) fn begin_sharing(&mut self, seed: u32) {
        let sharing = self.scene.description().indirect.sharing as f32;
        let Effects { reflection, surfaces, .. } = self.called_for;
        let gathers = self.scene.hair_objects.iter().any(|object| object.gather);
        if ABSENT || sharing == 0.0 || !(reflection && surfaces && gathers) {
            return;
        }
        let Some(bounds) = bounds(&self.scene.hair.points) else { return };
        let [width, height] = self.scene.camera.resolution();
        let angle = sharing * self.sphere.face_width();
        let typical = self.typical_distance(bounds);
        self.shared = Some(SharedLight::new(bounds, typical, angle, width as f32 * height as f32, seed));
    }

    /// Ends it.
    pub(in crate::render) fn end_sharing(&mut self) {
        let Some(shared) = self.shared.take() else { return };
        let effect = EffectName::LightReflectedBySurfaces;
        let built = Built { effect, cpu_seconds: 0.0, bytes: shared.bytes() };
        // Passes have one after the other.
        match self.built.iter_mut().find(|built| built.effect == effect) {
            Some(most) => most.bytes = most.bytes.max(built.bytes),
            None => self.built.push(built),
        }
    }

    /// The median distance from the hair to what is around it, at most the size of the hair itself.
    fn typical_distance(&self, [low, high]: [Vec3; 2]) -> f32 {
        let points = &self.scene.hair.points;
        let mut distances = Vec::new();
        for point in points.iter().step_by(points.len().div_ceil(PROBES)) {
            self.light.nearest(*point, &self.centers, |_, hit| {
                distances.push(hit.map_or(f32::INFINITY, |hit| hit.distance));
            });
        }
        let middle = distances.len() / 2;
        let (_, median, _) = distances.select_nth_unstable_by(middle, f32::total_cmp);
        median.min(low.distance(high))
    }

    /// As [`Self::look`] from a point on hair, with what its neighbours share.
    pub(super) fn look_shared(&self, shared: &SharedLight, receiver: &Receiver, key: PointKey, space: &mut Workspace) {
        let mut lap = Lap::start();
        let PointKey { own: key, sequence } = key;
        let corner = shared.choose(receiver.position, key);
        let place = shared.position(corner);
        let way = place - receiver.position;
        let distance = way.length();
        let hidden = distance > 0.0 && !self.light.sees(receiver.position, way / distance, distance);
        lap.ends(Part::Gather, &mut space.clock);
        if hidden {
            return self.look(receiver, &self.sphere, sequence, space);
        }
        let index = shared.index(corner);
        let rays = shared.corners[index].get_or_init(|| self.rays_of(shared, index, place));
        lap.ends(Part::Reflection, &mut space.clock);
        let Workspace { far, seen, directions, own, .. } = space;
        far.clear();
        seen.clear();
        directions.clear();
        own.clear();
        for face in 0..self.sphere.len() {
            let look = hash(&[SHARE, key, 3, face as u32]) % LOOKS;
            let ray = &rays[face * LOOKS as usize + look as usize];
            far.push(ray.far.unwrap_or(f32::INFINITY));
            seen.push(match ray.far {
                Some(f32::INFINITY) => Seen::Sky,
                Some(_) => Seen::Lit(ray.radiance),
                None => {
                    directions.push(Self::jittered(receiver, &self.sphere, face, sequence));
                    own.push(face as u32);
                    Seen::Sky
                }
            });
        }
        self.light.nearest(receiver.position, directions, |ray, hit| {
            let face = own[ray] as usize;
            if let Some(hit) = hit {
                far[face] = hit.distance;
                seen[face] = Seen::Surface(hit, directions[ray]);
            }
        });
        lap.ends(Part::Gather, &mut space.clock);
    }

    /// All rays of a corner, those of a face after each other.
    fn rays_of(&self, shared: &SharedLight, corner: usize, place: Vec3) -> Vec<Ray> {
        tally::add(Work::SharedCorners, 1);
        let looks = |face| (0..LOOKS).map(move |look| shared.direction(&self.sphere, corner, face, look));
        let directions: Vec<Vec3> = (0..self.sphere.len()).flat_map(looks).collect();
        let mut hits = Vec::with_capacity(directions.len());
        self.light.nearest(place, &directions, |_, hit| hits.push(hit));
        // What a mirror shows depends on where one looks from.
        let far = |hit: &SurfacePoint| hit.distance >= shared.nearest && hit.optics.is_none();
        let hair = |origin, direction, far| self.between_surfaces(origin, direction, far);
        let ray = |ray: usize, hit: &Option<SurfacePoint>| match hit {
            None => Ray { far: Some(f32::INFINITY), radiance: Vec3::ZERO },
            Some(hit) => {
                let key = hash(&[SHARE, shared.seed, corner as u32, ray as u32]);
                Ray { far: Some(hit.distance), radiance: self.light.reflected(hit, directions[ray], key, &hair) }
            }
        };
        let mut rays = Vec::with_capacity(hits.len());
        for (face, hits) in hits.chunks(LOOKS as usize).enumerate() {
            if hits.iter().flatten().all(far) {
                rays.extend(hits.iter().enumerate().map(|(look, hit)| ray(face * LOOKS as usize + look, hit)));
            } else {
                rays.extend([const { Ray { far: None, radiance: Vec3::ZERO } }; LOOKS as usize]);
            }
        }
        rays
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice(seed: u32) -> SharedLight {
        SharedLight::new([Vec3::new(-1.0, 2.0, 3.0), Vec3::new(1.0, 2.5, 7.0)], 0.7, 0.3, 1e5, seed)
    }

    /// Positions in the box of [`lattice`].
    fn positions() -> impl Iterator<Item = Vec3> {
        (0..200).map(|i| {
            let [x, y, z] = [0, 1, 2].map(|axis| to_unit(hash(&[7, i, axis])));
            Vec3::new(2.0 * x - 1.0, 2.0 + 0.5 * y, 3.0 + 4.0 * z)
        })
    }

    #[test]
    fn corners_are_chosen_so_that_their_mean_is_the_position() {
        let shared = lattice(1);
        for position in positions().take(20) {
            let n = 4000;
            let mean = (0..n).map(|key| shared.position(shared.choose(position, key)).as_dvec3()).sum::<glam::DVec3>();
            // A coin between two corners has a deviation of half the spacing at the most; four standard errors.
            let bound = 4.0 * 0.5 * f64::from(shared.spacing) / f64::from(n).sqrt();
            let error = (mean / f64::from(n) - position.as_dvec3()).abs().max_element();
            assert!(error < bound, "{position}: off by {error}, bound {bound}");
        }
    }

    #[test]
    fn what_is_shared_is_seen_within_the_angle() {
        let shared = lattice(1);
        let mut largest = 0.0_f32;
        for (key, position) in positions().enumerate() {
            let corner = shared.position(shared.choose(position, key as u32));
            for way in positions().map(|p| (p - Vec3::new(0.0, 2.25, 5.0)).normalize()) {
                let met = corner + shared.nearest * way;
                largest = largest.max((met - position).angle_between(way));
            }
        }
        // An angle's sine is the offset over the distance; at .3 it is 1.5 % less than the angle.
        assert!((0.15..=0.3_f32.asin()).contains(&largest), "{largest}");
    }

    #[test]
    fn every_corner_has_its_place() {
        let corners = [Vec3::ONE, Vec3::new(1.0, 1e-6, 1.0), Vec3::new(1.0, 0.0, 1e-20), Vec3::ZERO];
        for bounds in corners.map(|high| [Vec3::ZERO, high]) {
            let shared = SharedLight::new(bounds, 0.1, 0.2, 1e9, 1);
            let [nx, ny, nz] = shared.corners_a_side;
            let all = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
            let indices: Vec<usize> = all.map(|corner| shared.index(corner)).collect();
            assert_eq!(indices, (0..shared.corners.len()).collect::<Vec<_>>());
            assert!(indices.len() < 3 * MOST_CELLS as usize, "{}", indices.len());
            for position in [bounds[0], bounds[1], 0.5 * (bounds[0] + bounds[1])] {
                let corner = shared.choose(position, 5);
                let away = shared.position(corner).distance(position);
                assert!(away <= 1.8 * shared.spacing, "{away} for {}", shared.spacing);
            }
        }
    }
}
