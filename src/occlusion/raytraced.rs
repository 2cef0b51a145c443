//! Γ by rays: Embree's flat curves, every crossing multiplied (the estimator that the projection is held against).

use std::ops::ControlFlow;

use glam::{Vec3, Vec4};

use super::{Igloo, Receiver, Transmittance, sobol};
use crate::embree::{Crossing, CurveScene, Device, Error, PACKET};
use crate::hair::{HairModel, OnStrand};
use crate::hash::{GOLDEN_32, hash};

/// Hair that rays can cross.
///
/// A ray's optical depth is a sum of whole numbers of `DEPTH_STEP`: Embree visits crossings in an order of its own, which may change
/// with the number of threads that built its tree, and only such a sum does not depend on it.
#[derive(Debug)]
pub struct HairRays {
    scene: CurveScene,
    depths: Depths,
    /// First segment of each strand, and the number of segments.
    first_segment: Vec<u32>,
}

/// Optical depth of a crossing of each segment, in steps; `OPAQUE` where nothing gets through.
#[derive(Debug)]
enum Depths {
    /// Saves a look-up, and with it a cache miss, a crossing.
    Uniform(u32),
    PerSegment(Vec<u32>),
}

/// The unit of optical depth, 2^-20: it puts an error of at most 5e-7 a crossing on the transmittance.
const DEPTH_STEP: f64 = 1.0 / 1_048_576.0;
const OPAQUE: u32 = u32::MAX;

/// Keeps these random numbers apart from those of other purposes.
const PURPOSE: u32 = 0x4741_4D41;

/// A receiver's crossings of hair along a ray.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Where it ends: at the first opaque surface, or a light.
    pub far: f32,
    /// Where on which strand it begins.
    pub on: Option<OnStrand>,
}

/// Where a ray crosses hair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    pub segment: u32,
    /// Where along the segment, between 0 and 1.
    pub u: f32,
    pub distance: f32,
    /// The share of the light that it takes.
    pub opacity: f32,
}

/// When a ray ends in the hair, and what it is worth then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Crossings {
    /// All are multiplied, until less than `residual` is left; then nothing is. Too dark by less than `residual`; 0 is exact.
    Multiply { residual: f32 },
    /// Below the share `roulette` of its light a ray goes on by chance (Russian roulette): with the chance T / `roulette` it is
    /// worth `roulette`, else it ends. Unbiased, and cheaper for its noise. With 1 each crossing absorbs the whole ray or nothing of it.
    Stochastic { roulette: f32 },
}

/// How finely Γ is traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RaySettings {
    /// Rays a point, rounded up to whole rays a face.
    pub rays: u32,
    pub crossings: Crossings,
    /// Trace eight neighbouring rays together. The result is the same to the bit, and so is the time, measured to 3 %.
    pub packets: bool,
}

impl RaySettings {
    /// The threshold of least time at a given error: some 55 % of the time of exact rays, at 3 to 6 % more noise.
    pub const ROULETTE: f32 = 0.25;

    /// The least time for a given error.
    pub fn fastest(rays: u32) -> Self {
        Self { rays, crossings: Crossings::Stochastic { roulette: Self::ROULETTE }, packets: false }
    }

    /// Every crossing of every ray counts, with no random number but the rays' directions.
    pub fn exact(rays: u32) -> Self {
        Self { rays, crossings: Crossings::Multiply { residual: 0.0 }, packets: false }
    }
}

/// What of a receiver's own strand does not count.
struct Exclusion<'m> {
    model: &'m HairModel,
    /// The strand's segments.
    first: u32,
    count: u32,
    arc: [f32; 2],
}

impl Exclusion<'_> {
    /// The segments of a strand are numbered in a row: to tell others needs no look-up.
    #[inline]
    fn holds(&self, crossing: &Crossing) -> bool {
        if crossing.segment.wrapping_sub(self.first) >= self.count {
            return false;
        }
        let [from, to] = self.model.arcs(crossing.segment as usize);
        let arc = from + (to - from) * crossing.u;
        arc > self.arc[0] && arc < self.arc[1]
    }
}

/// The largest depth, in steps, at which more than `share` of the light is left; below `OPAQUE` even for a share of 0.
fn limit(share: f64) -> u64 {
    ((-share.ln() / DEPTH_STEP) as u64).min(u64::from(OPAQUE) - 1)
}

/// What a depth, in steps, leaves of the light.
fn left(depth: u64) -> f32 {
    (-(depth as f64) * DEPTH_STEP).exp() as f32
}

impl HairRays {
    /// Builds what rays need from a model in render space.
    ///
    /// # Errors
    /// Embree's own.
    pub fn build(device: &Device, model: &HairModel, rule: Transmittance) -> Result<Self, Error> {
        let vertices: Vec<Vec4> = model.points.iter().zip(&model.width).map(|(p, w)| p.extend(0.5 * w)).collect();
        let depth = |segment: usize| {
            let [from, to] = model.arcs(segment);
            let opacity = f64::from(rule.opacity(model.transparency[segment], to - from));
            // The conversion saturates: a depth beyond 4095 is opaque.
            (-(-opacity).ln_1p() / DEPTH_STEP).round() as u32
        };
        let depths: Vec<u32> = (0..model.segments()).map(depth).collect();
        let depths = match depths.first() {
            Some(&first) if depths.iter().all(|&depth| depth == first) => Depths::Uniform(first),
            _ => Depths::PerSegment(depths),
        };
        let mut first_segment = Vec::with_capacity(model.object.len() + 1);
        for (segment, &strand) in model.strand.iter().enumerate() {
            let missing = (strand as usize + 1).saturating_sub(first_segment.len());
            first_segment.extend(std::iter::repeat_n(segment as u32, missing));
        }
        first_segment.resize(model.object.len() + 1, model.segments() as u32);
        let scene = CurveScene::build(device, vertices, model.segment_point.clone())?;
        Ok(Self { scene, depths, first_segment })
    }

    /// What it holds, in bytes; Embree's own tree comes on top.
    pub fn bytes(&self) -> u64 {
        let depths = if let Depths::PerSegment(depths) = &self.depths { size_of_val(&depths[..]) } else { 0 };
        let scene = size_of_val(self.scene.vertices()) + size_of_val(self.scene.segments());
        (depths + scene + size_of_val(&self.first_segment[..])) as u64
    }

    #[inline]
    fn depth(&self, segment: u32) -> u64 {
        u64::from(match &self.depths {
            Depths::Uniform(depth) => *depth,
            Depths::PerSegment(depths) => depths[segment as usize],
        })
    }

    fn exclusion<'m>(&self, model: &'m HairModel, on: Option<OnStrand>) -> Exclusion<'m> {
        let own = on.and_then(|on| {
            let bounds = self.first_segment.get(on.strand as usize..on.strand as usize + 2)?;
            Some((bounds[0], bounds[1] - bounds[0], on.excluded()))
        });
        let (first, count, arc) = own.unwrap_or((0, 0, [0.0; 2]));
        Exclusion { model, first, count, arc }
    }

    /// What is left of the light along a ray; 0 as soon as it is below `residual`.
    ///
    /// The rule "nothing nearer than a strand's width" is Embree's own (distance > 2 radius); "nothing of its own strand within
    /// `SELF_WIDTHS`" is checked here, by strand and arc length.
    pub fn transmittance(&self, model: &HairModel, ray: &Ray, residual: f32) -> f32 {
        let excluded = self.exclusion(model, ray.on);
        self.single(&excluded, ray, limit(f64::from(residual))).map_or(0.0, left)
    }

    /// What is left of the light along a ray by the rule of `crossings`, whose chance is decided by `chance` in (0, 1].
    pub fn transmittance_by(&self, model: &HairModel, ray: &Ray, crossings: Crossings, chance: f64) -> f32 {
        match crossings {
            Crossings::Multiply { residual } => self.transmittance(model, ray, residual),
            Crossings::Stochastic { roulette } => {
                let excluded = self.exclusion(model, ray.on);
                let limit = limit(f64::from(roulette) * chance);
                self.single(&excluded, ray, limit).map_or(0.0, |depth| left(depth).max(roulette))
            }
        }
    }

    /// Depth of a ray; none where it is beyond `limit`.
    fn single(&self, excluded: &Exclusion, ray: &Ray, limit: u64) -> Option<u64> {
        let mut depth = 0;
        let ended = self.scene.crossings(ray.origin, ray.direction, 0.0, ray.far, |crossing| {
            if excluded.holds(&crossing) {
                return ControlFlow::Continue(());
            }
            depth += self.depth(crossing.segment);
            if depth > limit { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        (!ended).then_some(depth)
    }

    /// Every crossing of hair along a ray, front to back.
    pub fn along(&self, ray: &Ray, met: &mut Vec<Met>) {
        met.clear();
        self.scene.crossings(ray.origin, ray.direction, 0.0, ray.far, |crossing| {
            let Crossing { segment, u, distance } = crossing;
            met.push(Met { segment, u, distance, opacity: 1.0 - left(self.depth(segment)) });
            ControlFlow::Continue(())
        });
        met.sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance).then(a.segment.cmp(&b.segment)));
    }

    /// Distance, in render space, of the first crossing that counts along a ray; none where no hair is met before `ray.far`.
    pub fn first_crossing(&self, model: &HairModel, ray: &Ray) -> Option<f32> {
        let excluded = self.exclusion(model, ray.on);
        let mut nearest: Option<f32> = None;
        self.scene.crossings(ray.origin, ray.direction, 0.0, ray.far, |crossing| {
            if !excluded.holds(&crossing) {
                nearest = Some(nearest.map_or(crossing.distance, |distance| distance.min(crossing.distance)));
            }
            ControlFlow::Continue(())
        });
        nearest
    }

    /// How many crossings a ray meets before it ends, in the mean over one ray a face with roulette's threshold: what its time goes with.
    pub fn crossings_met(&self, model: &HairModel, receiver: &Receiver, igloo: &Igloo, far: &[f32]) -> f64 {
        let excluded = self.exclusion(model, receiver.on);
        // The threshold times the mean of the numbers that decide.
        let limit = limit(0.5 * f64::from(RaySettings::ROULETTE));
        let mut met = 0_u64;
        for (face, &far) in far.iter().enumerate().take(igloo.len()) {
            let direction = receiver.frame * igloo.direction(face, 0.5, 0.5);
            let mut depth = 0;
            self.scene.crossings(receiver.position, direction, 0.0, far, |crossing| {
                met += 1;
                depth += if excluded.holds(&crossing) { 0 } else { self.depth(crossing.segment) };
                if depth > limit { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
        }
        met as f64 / igloo.len() as f64
    }

    /// Γ̄ of each face from at least `settings.rays` rays over the whole igloo, the same number in each face, evenly spread inside it.
    ///
    /// `far[face]` is the distance of the first opaque surface in the face; `key` names the random numbers.
    #[expect(clippy::too_many_arguments, reason = "one query in full: where, over what, how finely")]
    pub fn transmittances(
        &self,
        model: &HairModel,
        receiver: &Receiver,
        igloo: &Igloo,
        settings: &RaySettings,
        far: &[f32],
        key: u32,
        gamma: &mut [f32],
    ) {
        let per_face = settings.rays.div_ceil(igloo.len() as u32).max(1);
        let excluded = self.exclusion(model, receiver.on);
        let shift = hash(&[PURPOSE, key]);
        // Golden steps through all rays in the order of the faces: neighbours get numbers far apart.
        let chance = |ray: u32| (f64::from(ray.wrapping_mul(GOLDEN_32).wrapping_add(shift)) + 1.0) / 4_294_967_296.0;
        let (share, least) = match settings.crossings {
            Crossings::Multiply { residual } => (f64::from(residual), 0.0),
            Crossings::Stochastic { roulette } => (f64::from(roulette), roulette),
        };
        let limit = |ray: u32| limit(if least > 0.0 { share * chance(ray) } else { share });

        gamma.fill(0.0);
        let mut batch = Batch::default();
        let mut ray = 0;
        for (face, &far) in far.iter().enumerate().take(gamma.len()) {
            let seeds = [0, 1].map(|axis| hash(&[PURPOSE, key, face as u32, axis]));
            for index in 0..per_face {
                let [across, down] = sobol::point(index, seeds);
                batch.push(face, receiver.frame * igloo.direction(face, across, down), far, limit(ray));
                ray = ray.wrapping_add(1);
                if batch.count == PACKET {
                    self.trace(&excluded, receiver, settings.packets, &mut batch, least, gamma);
                }
            }
        }
        self.trace(&excluded, receiver, settings.packets, &mut batch, least, gamma);
        let weight = 1.0 / per_face as f32;
        gamma.iter_mut().for_each(|gamma| *gamma *= weight);
    }

    /// Adds what a batch's rays are worth to their faces, ray by ray, and empties it.
    fn trace(
        &self,
        excluded: &Exclusion,
        receiver: &Receiver,
        packets: bool,
        batch: &mut Batch,
        least: f32,
        gamma: &mut [f32],
    ) {
        let count = std::mem::take(&mut batch.count);
        let mut depths = [Some(0_u64); PACKET];
        let (origin, on) = (receiver.position, receiver.on);
        if packets && count > 1 {
            let mut sums = [0; PACKET];
            let (directions, far) = (&batch.direction[..count], &batch.far[..count]);
            let ended = self.scene.packet_crossings(origin, directions, far, |ray, crossing| {
                if excluded.holds(&crossing) {
                    return ControlFlow::Continue(());
                }
                sums[ray] += self.depth(crossing.segment);
                if sums[ray] > batch.limit[ray] { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            depths = std::array::from_fn(|ray| (!ended[ray]).then_some(sums[ray]));
        } else {
            for (ray, depth) in depths.iter_mut().enumerate().take(count) {
                let (direction, far) = (batch.direction[ray], batch.far[ray]);
                *depth = self.single(excluded, &Ray { origin, direction, far, on }, batch.limit[ray]);
            }
        }
        for (&face, depth) in batch.face[..count].iter().zip(depths) {
            gamma[face] += depth.map_or(0.0, |depth| left(depth).max(least));
        }
    }
}

/// Rays of one receiver that are traced together.
#[derive(Default)]
struct Batch {
    count: usize,
    face: [usize; PACKET],
    direction: [Vec3; PACKET],
    far: [f32; PACKET],
    limit: [u64; PACKET],
}

impl Batch {
    fn push(&mut self, face: usize, direction: Vec3, far: f32, limit: u64) {
        let i = self.count;
        (self.face[i], self.direction[i], self.far[i], self.limit[i]) = (face, direction, far, limit);
        self.count += 1;
    }
}
