//! The photons that a scene asks for, as its settings say. Neither map is made where its effect is off.

use super::costs::Built;
use super::progress::Progress;
use crate::effects::Effects;
use crate::hair::strands::bounds;
use crate::illumination::{Caustics, Illumination, PhotonMap, photon};
use crate::scene::Scene;

/// Photons that were traced once, for pictures of the same scene that differ in settings which photons do not know.
#[derive(Debug)]
pub struct Photons {
    pub(super) reflected: Option<PhotonMap>,
    pub(super) caustics: Option<Caustics>,
    /// What they took.
    pub(super) built: Vec<Built>,
    /// Their seed and, where light of the environment's faces is among it, the number of faces.
    pub(super) name: [u32; 2],
}

impl Photons {
    /// What tells one scene's photons apart.
    pub(super) fn name(scene: &Scene, effects: &Effects) -> [u32; 2] {
        let description = scene.description();
        [description.sampling.seed, if effects.environment { description.occlusion.face_count() } else { 0 }]
    }
}

/// Light that surfaces reflect more than once. `hair(origin, direction, far)` is what hair lets through.
pub(super) fn reflected(
    light: &Illumination,
    scene: &Scene,
    effects: &Effects,
    seed: u32,
    hair: &(impl Fn(glam::Vec3, glam::Vec3, f32) -> f32 + Sync),
    progress: &dyn Progress,
) -> Option<PhotonMap> {
    let description = scene.description();
    let settings = photon::Settings {
        photons: description.indirect.photons,
        max_bounces: description.indirect.max_bounces,
        neighbours: description.indirect.neighbours,
        seed,
    };
    effects.photons.then(|| light.photon_map(&settings, hair, &|| progress.cancelled())).flatten()
}

/// Light that mirrors and glass throw, after the map of reflected light is in place.
pub(super) fn caustics(
    light: &Illumination,
    scene: &Scene,
    effects: &Effects,
    seed: u32,
    hair: &(impl Fn(glam::Vec3, glam::Vec3, f32) -> f32 + Sync),
    progress: &dyn Progress,
) -> Option<Caustics> {
    let description = scene.description();
    let settings = photon::CausticSettings {
        photons: description.indirect.caustic_photons,
        depth: description.indirect.specular_depth,
        neighbours: description.indirect.neighbours,
        seed,
    };
    let trace = || light.caustic_map(&settings, bounds(&scene.hair.points), hair, &|| progress.cancelled());
    effects.caustics.then(trace).flatten()
}
