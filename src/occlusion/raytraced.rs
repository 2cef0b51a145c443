//! Γ by rays: Embree's flat curves, every crossing multiplied (the estimator that the projection is held against).

use std::ops::ControlFlow;

use glam::{Vec3, Vec4};

use super::{Igloo, Receiver, Transmittance};
use crate::embree::{Crossing, CurveScene, Device, Error};
use crate::hair::{HairModel, OnStrand};
use crate::hash::{hash, to_unit};

/// Hair that rays can cross.
///
/// A ray's optical depth is a sum of whole numbers of `DEPTH_STEP`: Embree visits crossings in an order of its own, which may change
/// with the number of threads that built its tree, and only such a sum does not depend on it.
#[derive(Debug)]
pub struct HairRays {
    scene: CurveScene,
    /// Optical depth of a crossing of each segment, in steps; `OPAQUE` where nothing gets through.
    depths: Vec<u32>,
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

impl HairRays {
    /// Builds what rays need from a model in render space.
    ///
    /// # Errors
    /// Embree's own.
    pub fn build(device: &Device, model: &HairModel, rule: Transmittance) -> Result<Self, Error> {
        let vertices: Vec<Vec4> = model.points.iter().zip(&model.width).map(|(p, w)| p.extend(0.5 * w)).collect();
        let depth = |segment: usize| {
            let p = model.segment_point[segment] as usize;
            let opacity = f64::from(rule.opacity(model.transparency[segment], model.arc[p + 1] - model.arc[p]));
            // The conversion saturates: a depth beyond 4095 is opaque.
            (-(-opacity).ln_1p() / DEPTH_STEP).round() as u32
        };
        let depths = (0..model.segments()).map(depth).collect();
        Ok(Self { scene: CurveScene::build(device, vertices, model.segment_point.clone())?, depths })
    }

    /// What is left of the light along a ray; 0 as soon as it is below `residual`.
    ///
    /// The rule "nothing nearer than a strand's width" is Embree's own (distance > 2 radius); "nothing of its own strand within
    /// `SELF_WIDTHS`" is checked here, by strand and arc length.
    pub fn transmittance(&self, model: &HairModel, ray: &Ray, residual: f32) -> f32 {
        let excluded = ray.on.map(|on| (on.strand, on.excluded()));
        let limit = if residual > 0.0 { (-f64::from(residual).ln() / DEPTH_STEP) as u64 } else { u64::MAX };
        let mut depth = 0_u64;
        let ended = self.scene.crossings(ray.origin, ray.direction, 0.0, ray.far, |crossing| {
            let segment = crossing.segment as usize;
            if own(model, excluded, &crossing) {
                return ControlFlow::Continue(());
            }
            depth += u64::from(self.depths[segment]);
            if depth > limit || self.depths[segment] == OPAQUE {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        if ended { 0.0 } else { (-(depth as f64) * DEPTH_STEP).exp() as f32 }
    }

    /// Distance of the first hair that a ray crosses, by the rules of [`transmittance`](Self::transmittance); none where it crosses none.
    pub fn first_crossing(&self, model: &HairModel, ray: &Ray) -> Option<f32> {
        let excluded = ray.on.map(|on| (on.strand, on.excluded()));
        let mut first = None;
        // Embree visits crossings in no order, so all have to be seen.
        self.scene.crossings(ray.origin, ray.direction, 0.0, ray.far, |crossing| {
            if !own(model, excluded, &crossing) && first.is_none_or(|distance| crossing.distance < distance) {
                first = Some(crossing.distance);
            }
            ControlFlow::Continue(())
        });
        first
    }

    /// Γ̄ of each face from at least `rays` rays over the whole igloo, the same number in each face, stratified inside it.
    ///
    /// `far[face]` is the distance of the first opaque surface in the face; `key` names the random numbers.
    #[expect(clippy::too_many_arguments, reason = "one query in full: where, over what, how finely")]
    pub fn transmittances(
        &self,
        model: &HairModel,
        receiver: &Receiver,
        igloo: &Igloo,
        rays: u32,
        residual: f32,
        far: &[f32],
        key: u32,
        gamma: &mut [f32],
    ) {
        let [columns, rows] = strata(rays.div_ceil(igloo.len() as u32).max(1));
        let weight = 1.0 / (columns * rows) as f32;
        for (face, gamma) in gamma.iter_mut().enumerate() {
            let mut sum = 0.0;
            for stratum in 0..columns * rows {
                let jitter = |axis: u32| to_unit(hash(&[PURPOSE, key, face as u32, stratum, axis]));
                let across = ((stratum % columns) as f32 + jitter(0)) / columns as f32;
                let down = ((stratum / columns) as f32 + jitter(1)) / rows as f32;
                let direction = receiver.frame * igloo.direction(face, across, down);
                let ray = Ray { origin: receiver.position, direction, far: far[face], on: receiver.on };
                sum += self.transmittance(model, &ray, residual);
            }
            *gamma = sum * weight;
        }
    }
}

/// Whether a crossing lies on the part of the receiver's own strand that does not count.
fn own(model: &HairModel, excluded: Option<(u32, [f32; 2])>, crossing: &Crossing) -> bool {
    let Some((strand, [from, to])) = excluded else { return false };
    let segment = crossing.segment as usize;
    if model.strand[segment] != strand {
        return false;
    }
    let p = model.segment_point[segment] as usize;
    let arc = model.arc[p] + (model.arc[p + 1] - model.arc[p]) * crossing.u;
    arc > from && arc < to
}

/// The most even grid of at least `count` cells.
fn strata(count: u32) -> [u32; 2] {
    let rows = f64::from(count).sqrt().floor() as u32;
    [count.div_ceil(rows), rows]
}
