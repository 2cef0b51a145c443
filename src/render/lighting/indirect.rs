//! Light that surfaces reflect, the environment over a surface's igloo, and what the user forces on.

use glam::{Mat3, Vec3};

use super::{Lighting, MET};
use crate::hash::hash;
use crate::illumination::{PhotonMap, photon};
use crate::render::RenderError;
use crate::render::costs::Built;
use crate::render::estimator::Estimator;
use crate::render::faces;
use crate::render::progress::Progress;
use crate::scene::description::EffectName;
use crate::surface::SurfacePoint;

impl Lighting<'_> {
    /// What the surfaces that the faces' rays met send back, where it is worth it.
    pub(super) fn light_surfaces(
        &self,
        free: impl Fn(usize) -> Vec3,
        key: u32,
        hits: &[Option<SurfacePoint>],
        gamma: &[f32],
        light: &mut [Vec3],
    ) {
        let hair = |origin, direction, far| self.between_surfaces(origin, direction, far);
        for (face, hit) in hits.iter().enumerate() {
            let Some(hit) = hit else { continue };
            let wanted = free(face) * if self.effects.unoccluded_layer { 1.0 } else { gamma[face] };
            if faces::worth_a_look(wanted) {
                let sent = self.light.reflected(hit, hash(&[MET, key, face as u32]), &hair);
                light[face] = if self.called_for.reflection { sent } else { Vec3::ZERO };
            }
        }
    }

    /// Means of the environment over the hemisphere turned by `frame`; black without asking it where it is off.
    pub(super) fn turned_means(&self, frame: &Mat3, means: &mut Vec<Vec3>) {
        if self.effects.environment {
            self.light.environment.turned_averages(&self.hemisphere, frame, means);
        } else {
            means.clear();
            means.resize(self.hemisphere.len(), Vec3::ZERO);
        }
    }

    /// Traces the photons that the scene asks for. After [`settle`](crate::render::settle): whether hair dims them is the estimator's to say.
    ///
    /// # Errors
    /// Cancelled work.
    pub fn trace_photons(&mut self, progress: &dyn Progress) -> Result<(), RenderError> {
        let description = self.scene.description();
        let settings = photon::Settings {
            photons: description.indirect.photons,
            max_bounces: description.indirect.max_bounces,
            neighbours: description.indirect.neighbours,
            seed: description.sampling.seed,
        };
        let hair = |origin, direction, far| self.between_surfaces(origin, direction, far);
        let map = self.light.photon_map(&settings, &hair, &|| progress.cancelled());
        if progress.cancelled() {
            return Err(RenderError::Cancelled);
        }
        // Those that are only forced on light nothing.
        let kept = map.filter(|_| self.called_for.photons);
        let bytes = kept.as_ref().map_or(0, PhotonMap::bytes);
        self.built.push(Built { effect: EffectName::MoreThanOneReflection, cpu_seconds: 0.0, bytes });
        self.light.set_photons(kept);
        Ok(())
    }

    /// Adds the estimators of Γ that are only forced on. After [`settle`](crate::render::settle), whose business they are not.
    pub(in crate::render) fn force_estimators(&mut self) {
        let igloos = [&self.sphere, &self.hemisphere];
        let counts = std::mem::replace(&mut self.estimator, Estimator::Free);
        self.estimator = counts.and_forced(self.scene, &self.called_for, &self.effects, igloos);
    }
}
