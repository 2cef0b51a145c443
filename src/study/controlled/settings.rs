//! The settings that a picture to an error or a time may have, those of its reference, and the work of a pass.

use crate::render::Prepared;
use crate::scene::description::{Description, LayerChoice, OcclusionMode, ProjectionRule};

/// Faces of the reference, and layers of one of its rounds.
const FACES: u32 = 100;
const LAYERS: u32 = 16;

/// Work of a look from a face, of a shadow ray to an area light and of the sum over a face, in lanes of the projection's kernels.
const LOOK: f64 = 20.0;
const SHADOW: f64 = 40.0;
const FACE: f64 = 3.0;

/// The settings of a place of the knob. Hair occlusion by the estimator that takes less, unless the scene has it off.
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
}

/// The settings of the reference: what they err by falls with the number of rounds, but for the faces.
pub fn set_truth(description: &mut Description) {
    let occlusion = &mut description.occlusion;
    if occlusion.mode != OcclusionMode::None {
        occlusion.mode = OcclusionMode::Raytraced;
    }
    (occlusion.opening, occlusion.thinning) = (None, None);
    occlusion.projection = ProjectionRule::Sphere;
    occlusion.rays = Some(2 * FACES);
    occlusion.faces = Some(FACES);
    description.sampling.layers = LAYERS;
    description.sampling.layer_choice = LayerChoice::Drawn;
    description.sampling.area_light_samples = 64;
    description.sampling.surface_samples = 64;
}

/// Work of shading points, in lanes: counted, so that it is the same in every run.
pub fn work(prepared: &Prepared<'_>, hair_points: u64, surface_points: u64) -> f64 {
    let scene = prepared.scene();
    let description = scene.description();
    let faces = f64::from(description.occlusion.face_count());
    let look = if prepared.statistics().triangles > 0 { LOOK } else { 0.0 };
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
    hair_points as f64 * hair + surface_points as f64 * surface
}
