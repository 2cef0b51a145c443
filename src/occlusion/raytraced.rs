//! Γ by rays: Embree's flat curves, every crossing multiplied (the estimator that the projection is held against).

use std::ops::ControlFlow;

use glam::{Vec3, Vec4};

use super::{Igloo, Receiver, Transmittance};
use crate::embree::{CurveScene, Device, Error};
use crate::hair::{HairModel, OnStrand};
use crate::hash::{hash, to_unit};

/// Hair that rays can cross.
#[derive(Debug)]
pub struct HairRays {
    scene: CurveScene,
    rule: Transmittance,
}

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
        Ok(Self { scene: CurveScene::build(device, vertices, model.segment_point.clone())?, rule })
    }

    /// What is left of the light along a ray; 0 as soon as it is below `residual`.
    ///
    /// The rule "nothing nearer than a strand's width" is Embree's own (distance > 2 radius); "nothing of its own strand within
    /// `SELF_WIDTHS`" is checked here, by strand and arc length.
    pub fn transmittance(&self, model: &HairModel, ray: &Ray, residual: f32) -> f32 {
        let excluded = ray.on.map(|on| (on.strand, on.excluded()));
        let mut transmittance = 1.0_f32;
        self.scene.crossings(ray.origin, ray.direction, 0.0, ray.far, |crossing| {
            let segment = crossing.segment as usize;
            let p = model.segment_point[segment] as usize;
            if let Some((strand, [from, to])) = excluded
                && model.strand[segment] == strand
            {
                let arc = model.arc[p] + (model.arc[p + 1] - model.arc[p]) * crossing.u;
                if arc > from && arc < to {
                    return ControlFlow::Continue(());
                }
            }
            let length = match self.rule {
                Transmittance::Crossing => 0.0,
                Transmittance::SegmentLength { .. } => model.arc[p + 1] - model.arc[p],
            };
            transmittance *= 1.0 - self.rule.opacity(model.transparency[segment], length);
            if transmittance < residual {
                transmittance = 0.0;
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        transmittance
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

/// The most even grid of at least `count` cells.
fn strata(count: u32) -> [u32; 2] {
    let rows = f64::from(count).sqrt().floor() as u32;
    [count.div_ceil(rows), rows]
}
