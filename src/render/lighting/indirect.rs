//! Light that surfaces reflect, the environment over a surface's igloo, and what the user forces on.

use glam::{Mat3, Vec3};

use super::{Lighting, MET, Seen};
use crate::hash::hash;
use crate::illumination::{Caustics, PhotonMap};
use crate::render::RenderError;
use crate::render::costs::Built;
use crate::render::cpu;
use crate::render::estimator::Estimator;
use crate::render::faces::{Arriving, Roulette};
use crate::render::photons::{self, Photons};
use crate::render::progress::Progress;
use crate::render::reflections::Reflections;
use crate::scene::description::EffectName;

impl Lighting<'_> {
    /// What the surfaces that the faces' rays met send back, where the roulette says so, and how much it counts.
    pub(super) fn light_surfaces(
        &self,
        free: impl Fn(usize) -> Vec3,
        key: u32,
        seen: &[Seen],
        gamma: &[f32],
        light: &mut Arriving,
        specular: &mut Reflections,
    ) {
        let roulette = Roulette::new(key, &free, gamma);
        light.counts.resize(gamma.len(), [1.0; 2]);
        let hair = |origin, direction, far| self.between_surfaces(origin, direction, far);
        for (face, seen) in seen.iter().enumerate() {
            let Seen::Surface(hit, direction) = seen else { continue };
            let [occluded, unoccluded] = roulette.counts(face, free(face), gamma[face]);
            light.counts[face] = [occluded, unoccluded];
            if occluded != 0.0 || self.effects.unoccluded_layer && unoccluded != 0.0 {
                let key = hash(&[MET, key, face as u32]);
                let sent = if hit.optics.is_some() {
                    let seen = self.light.seen_in(hit, *direction, self.specular_depth, key, &hair);
                    let weight = f64::from((free(face) * gamma[face] * occluded).element_sum());
                    specular.add(&Reflections { rays: weight, cut: weight * f64::from(seen.cut) });
                    seen.radiance
                } else {
                    self.light.reflected(hit, *direction, key, &hair)
                };
                light.radiance[face] = if self.called_for.reflection { sent } else { Vec3::ZERO };
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
    pub fn trace_photons(&mut self, seed: u32, progress: &dyn Progress) -> Result<(), RenderError> {
        let hair = |origin, direction, far| self.between_surfaces(origin, direction, far);
        let taken = |begun| cpu::process().saturating_sub(begun).as_secs_f64();
        let begun = cpu::process();
        let map = photons::reflected(&self.light, self.scene, &self.effects, seed, &hair, progress);
        if progress.cancelled() {
            return Err(RenderError::Cancelled);
        }
        // Those that are only forced on light nothing.
        let kept = map.filter(|_| self.called_for.photons);
        let bytes = kept.as_ref().map_or(0, PhotonMap::bytes);
        let reflected = Built { effect: EffectName::MoreThanOneReflection, cpu_seconds: taken(begun), bytes };
        self.light.set_photons(kept);
        let hair = |origin, direction, far| self.between_surfaces(origin, direction, far);
        let begun = cpu::process();
        let caustics = photons::caustics(&self.light, self.scene, &self.effects, seed, &hair, progress);
        if progress.cancelled() {
            return Err(RenderError::Cancelled);
        }
        let kept = caustics.filter(|_| self.called_for.caustics);
        let bytes = kept.as_ref().map_or(0, Caustics::bytes);
        let thrown = Built { effect: EffectName::Caustics, cpu_seconds: taken(begun), bytes };
        self.light.set_caustics(kept);
        self.built.extend([reflected, thrown]);
        Ok(())
    }

    /// Takes out the photons that were traced.
    pub(in crate::render) fn take_photons(&mut self) -> Photons {
        let (reflected, caustics) = self.light.take_maps();
        let of_photons =
            |built: &Built| matches!(built.effect, EffectName::MoreThanOneReflection | EffectName::Caustics);
        let built = self.built.iter().filter(|built| of_photons(built)).copied().collect();
        Photons { reflected, caustics, built, name: Photons::name(self.scene, &self.effects) }
    }

    /// Takes photons in place of those that it has, or traces some with a seed where there are none, and gives those back. What all of them took stays counted.
    pub(in crate::render) fn exchange_photons(
        &mut self,
        photons: Option<Photons>,
        seed: u32,
        progress: &dyn Progress,
    ) -> Result<Photons, RenderError> {
        let taken = Photons { built: Vec::new(), ..self.take_photons() };
        match photons {
            Some(photons) => self.set_photons(photons),
            None => self.trace_photons(seed, progress)?,
        }
        Ok(taken)
    }

    /// Counts photons that were traced before.
    pub(in crate::render) fn set_photons(&mut self, photons: Photons) {
        self.light.set_photons(photons.reflected);
        self.light.set_caustics(photons.caustics);
        self.built.extend(photons.built);
    }

    /// Adds the estimators of Γ that are only forced on. After [`settle`](crate::render::settle), whose business they are not.
    pub(in crate::render) fn force_estimators(&mut self) {
        let igloos = [&self.sphere, &self.hemisphere];
        let counts = std::mem::replace(&mut self.estimator, Estimator::Free);
        self.estimator = counts.and_forced(self.scene, &self.called_for, &self.effects, igloos);
    }
}
