//! The settings that a picture to an error or a time may have, those of its reference, and the work of a pass.

use crate::render::{Pixels, Prepared};
use crate::scene::description::{Description, IndirectMode, LayerChoice, OcclusionMode, ProjectionRule};

/// Faces of the reference where no error is asked for; where one is, so many over it, within bounds: what faces err by falls with their number.
const FACES: u32 = 100;
const FACES_FOR: f64 = 2.0;
const LEAST_FACES: f64 = 36.0;
const MOST_FACES: f64 = 256.0;
/// Layers of one of its rounds.
const LAYERS: u32 = 8;

/// Work of a look from a face, of lighting the surface that it meets, of a shadow ray to an area light, of the sum over a face, of a fragment of hair and of a
/// camera ray, in lanes of the projection's kernels: by the CPU times of parts of `scenes/cornell.toml` at 64x64 pixels, where a lane took some 15 ns.
const LOOK: f64 = 20.0;
const REFLECTED: f64 = 60.0;
const FRAGMENT: f64 = 12.0;
const CAMERA_RAY: f64 = 50.0;
const SHADOW: f64 = 40.0;
const FACE: f64 = 3.0;

/// The settings of a place of the knob. Points share no light: pixels rendered alone must tell what the picture errs by. Hair occlusion by the estimator that takes less, unless the scene has it off.
pub fn set(description: &mut Description, values: &[&str; 5]) {
    let number = |index: usize| values[index].parse::<f64>().unwrap_or(1.0);
    let occlusion = &mut description.occlusion;
    if occlusion.mode != OcclusionMode::None {
        occlusion.mode = OcclusionMode::Auto;
    }
    (occlusion.opening, occlusion.rays, occlusion.thinning) = (None, None, None);
    occlusion.projection = ProjectionRule::Sphere;
    occlusion.accuracy = number(0);
    occlusion.faces = Some(number(1) as u32);
    description.sampling.layers = number(2) as u32;
    // More passes take the noise away; the error of the layers that are seen most would stay.
    description.sampling.layer_choice = LayerChoice::Drawn;
    description.sampling.area_light_samples = number(3) as u32;
    description.sampling.surface_samples = number(4) as u32;
    description.indirect.sharing = 0.0;
}

/// The settings of the reference: what they err by falls with the number of rounds, but for the faces.
pub fn set_truth(description: &mut Description, error: Option<f64>) {
    let faces = error.map_or(FACES, |error| (FACES_FOR / error).clamp(LEAST_FACES, MOST_FACES) as u32);
    let occlusion = &mut description.occlusion;
    if occlusion.mode != OcclusionMode::None {
        occlusion.mode = OcclusionMode::Raytraced;
    }
    (occlusion.opening, occlusion.thinning) = (None, None);
    occlusion.projection = ProjectionRule::Sphere;
    occlusion.rays = Some(2 * faces);
    occlusion.faces = Some(faces);
    description.sampling.layers = LAYERS;
    description.sampling.layer_choice = LayerChoice::Drawn;
    description.sampling.area_light_samples = 64;
    description.sampling.surface_samples = 64;
    description.indirect.sharing = 0.0;
}

/// Work of pixels, in lanes: counted, so that it is the same in every run.
pub fn work(prepared: &Prepared<'_>, pixels: &Pixels) -> f64 {
    let scene = prepared.scene();
    let description = scene.description();
    let faces = f64::from(description.occlusion.face_count());
    let surfaces = prepared.statistics().triangles > 0;
    let reflected = if description.indirect.mode == IndirectMode::None { 0.0 } else { REFLECTED };
    let look = if surfaces { LOOK + reflected } else { 0.0 };
    let lights = scene.area.len() as f64 * f64::from(description.sampling.area_light_samples) * SHADOW;
    let settled = prepared.statistics().occlusion.as_ref();
    let fixed = f64::from(description.occlusion.rays.unwrap_or(0)) * 4.0 * LOOK;
    let gamma = |hair: bool| {
        let found = settled.and_then(|settled| if hair { settled.hair } else { settled.surface });
        let projected = settled.is_some_and(|settled| settled.estimator == "igloo");
        found.map_or(fixed, |found| match found.projection {
            Some(projection) if projected => projection.work,
            _ => found.ray_work,
        })
    };
    let hair = gamma(true) + 2.0 * faces * (look + FACE) + lights;
    let surface = gamma(false) + faces * (look + FACE) + lights;
    let samples = if surfaces { f64::from(description.sampling.surface_samples) } else { 0.0 };
    pixels.hair_points as f64 * hair
        + pixels.surface_points as f64 * surface
        + pixels.fragments as f64 * FRAGMENT
        + pixels.pixels.len() as f64 * samples * CAMERA_RAY
}
