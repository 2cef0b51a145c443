//! The photons that a scene asks for, as its settings say. Neither map is made where its effect is off.

use super::progress::Progress;
use crate::effects::Effects;
use crate::hair::strands::bounds;
use crate::illumination::{Caustics, Illumination, PhotonMap, photon};
use crate::scene::Scene;

/// Light that surfaces reflect more than once. `hair(origin, direction, far)` is what hair lets through.
pub(super) fn reflected(
    light: &Illumination,
    scene: &Scene,
    effects: &Effects,
    hair: &(impl Fn(glam::Vec3, glam::Vec3, f32) -> f32 + Sync),
    progress: &dyn Progress,
) -> Option<PhotonMap> {
    let description = scene.description();
    let settings = photon::Settings {
        photons: description.indirect.photons,
        max_bounces: description.indirect.max_bounces,
        neighbours: description.indirect.neighbours,
        seed: description.sampling.seed,
    };
    effects.photons.then(|| light.photon_map(&settings, hair, &|| progress.cancelled())).flatten()
}

/// Light that mirrors and glass throw, after the map of reflected light is in place.
pub(super) fn caustics(
    light: &Illumination,
    scene: &Scene,
    effects: &Effects,
    hair: &(impl Fn(glam::Vec3, glam::Vec3, f32) -> f32 + Sync),
    progress: &dyn Progress,
) -> Option<Caustics> {
    let description = scene.description();
    let settings = photon::CausticSettings {
        photons: description.indirect.caustic_photons,
        depth: description.indirect.specular_depth,
        neighbours: description.indirect.neighbours,
        seed: description.sampling.seed,
    };
    let trace = || light.caustic_map(&settings, bounds(&scene.hair.points), hair, &|| progress.cancelled());
    effects.caustics.then(trace).flatten()
}
