//! The cross-check: both estimators of Γ at the same shading points of a scene.
//!
//! What is compared is sky visibility, the mean of Γ̄ over the faces of the igloo: the whole sphere around a point on hair, the
//! hemisphere around the normal on a surface. Both estimators get the points, the igloo and the distance of the first opaque
//! surface in each face that a render gives them, down to the random numbers, so that they differ by Γ alone. The projection
//! is that of the scene's settings whatever its `occlusion.mode`; rays are followed to their end (`residual` 0), for a
//! reference without bias. Deep shadow maps that the scene has are compared at the same points (`shadow_check`).

use glam::Vec3;
use rayon::prelude::*;

use super::report::{Compared, Population, Report, Site};
use super::shadow_check::{self, Shadow};
use crate::effects::Effects;
use crate::fragment::PixelRect;
use crate::hash::{hash, to_unit};
use crate::occlusion::raytraced::Ray;
use crate::occlusion::{HairRays, Igloo, RaySettings, Receiver};
use crate::render::progress::Progress;
use crate::render::{
    Around, Lighting, Place, RenderError, ShadingPoint, ShadowMaps, Workspace, draw, settle, with_threads,
};
use crate::scene::Scene;
use crate::scene::description::OcclusionMode;

/// Purposes of random numbers.
const REFERENCE: u32 = 0x5245_4621;
const DISTANCE: u32 = 0x4449_5354;

/// Rays between two looks at whether the work is cancelled.
const BATCH: u32 = 1 << 14;

/// Bounds of the number of rays a point that is chosen for an accuracy.
const RAYS: [f64; 2] = [1000.0, 65_536.0];

/// What a cross-check is to do, beside what the scene says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How many points, at least 2; half on hair, half on surfaces.
    pub points: usize,
    /// Reference rays a point, rounded up to whole rays a face for each of two halves; by the accuracy where none.
    pub rays: Option<u32>,
    /// RMS difference of sky visibility that is allowed, above 0; the scene's where none.
    pub accuracy: Option<f64>,
    /// Only these pixels; all where none.
    pub window: Option<PixelRect>,
    /// Number of threads; one a processor where none. The result does not depend on it.
    pub threads: Option<usize>,
}

/// Rays for a standard error of half the accuracy where Γ varies most, a variance of 1/4 a ray: strata and calmer places bring the usual
/// standard error well below that, and what noise is left is measured and taken out of the RMS.
fn enough_rays(accuracy: f64) -> u32 {
    (0.25 / (0.5 * accuracy).powi(2)).clamp(RAYS[0], RAYS[1]).ceil() as u32
}

/// Compares the estimators of Γ on a scene. As after a render, the scene comes back without its surfaces, unless it has no hair.
///
/// # Errors
/// As [`crate::render::render`].
pub fn crosscheck(scene: &mut Scene, settings: &Settings, progress: &dyn Progress) -> Result<Report, RenderError> {
    let accuracy = settings.accuracy.unwrap_or(scene.description().occlusion.accuracy);
    let rays = settings.rays.unwrap_or_else(|| enough_rays(accuracy));
    let seed = scene.description().sampling.seed;
    let mut report = Report::new(scene.document.path.display().to_string(), accuracy, seed, rays);
    if scene.hair.is_empty() {
        report.has_hair = false;
        return Ok(report);
    }
    let mode = std::mem::replace(&mut scene.document.description.occlusion.mode, OcclusionMode::Igloo);
    let compared = with_threads(settings.threads, || compare(scene, settings, rays, progress));
    scene.document.description.occlusion.mode = mode;
    let (population, points, shadows) = compared??;
    report.judge(population, points, shadows);
    Ok(report)
}

fn compare(
    scene: &mut Scene,
    settings: &Settings,
    rays: u32,
    progress: &dyn Progress,
) -> Result<(Population, Vec<Compared>, Vec<Shadow>), RenderError> {
    progress.stage("building", 0);
    // Whether or not any light arrives for which the picture would ask.
    let effects = Effects { hair_rays: true, projected_occlusion: true, ..Effects::of(scene) };
    let mut lighting = Lighting::new(scene, effects, &mut ShadowMaps::default(), progress)?;
    settle(&mut lighting, progress)?;
    let drawn = draw(&lighting, settings.window, settings.points, progress)?;
    progress.stage("comparing", drawn.points.len() as u64);
    let Some(hair) = lighting.hair_rays() else { return Ok(Default::default()) };
    let bench = Bench { lighting: &lighting, hair, rays };
    let points: Option<Vec<Compared>> = drawn
        .points
        .par_iter()
        .map_init(Workspace::default, |space, point| {
            let compared = bench.point(point, space, progress);
            progress.advance(1);
            compared
        })
        .collect();
    let shadows = shadow_check::shadows(&lighting, hair, &drawn.points, progress);
    let [hair, surface] = drawn.population;
    let (points, shadows) = points.zip(shadows).ok_or(RenderError::Cancelled)?;
    Ok((Population { hair, surface }, points, shadows))
}

/// What every comparison needs.
struct Bench<'a> {
    lighting: &'a Lighting<'a>,
    hair: &'a HairRays,
    rays: u32,
}

impl Bench<'_> {
    /// Both estimators at a point; none if the work was cancelled.
    fn point(&self, point: &ShadingPoint, space: &mut Workspace, progress: &dyn Progress) -> Option<Compared> {
        let receiver = &point.receiver;
        let around = self.lighting.around(receiver, point.key, space);
        let projection = mean(around.gamma);
        let mut halves = [0.0; 2];
        for (half, value) in halves.iter_mut().enumerate() {
            *value = self.traced(receiver, &around, hash(&[REFERENCE, point.key, half as u32]), progress)?;
        }
        let rays = 0.5 * (halves[0] + halves[1]);
        Some(Compared {
            pixel: point.pixel,
            site: self.site(point.place),
            projection,
            rays,
            halves,
            difference: projection - rays,
            hair_distance: self.hair_distance(receiver, around.igloo, around.far, point.key),
        })
    }

    /// Sky visibility by half of the rays.
    fn traced(&self, receiver: &Receiver, around: &Around<'_>, key: u32, progress: &dyn Progress) -> Option<f64> {
        let model = &self.lighting.scene().hair;
        let rays = self.rays.div_ceil(2);
        let batches = rays.div_ceil(BATCH);
        let mut gamma = vec![0.0; around.igloo.len()];
        let mut sum = 0.0;
        for batch in 0..batches {
            if progress.cancelled() {
                return None;
            }
            let (count, key) = (rays.div_ceil(batches), hash(&[key, batch]));
            self.hair.transmittances(
                model,
                receiver,
                around.igloo,
                &RaySettings::exact(count),
                around.far,
                key,
                &mut gamma,
            );
            sum += mean(&gamma);
        }
        Some(sum / f64::from(batches))
    }

    /// Mean distance of the first hair, over one ray a face of those that meet any; in scene units.
    fn hair_distance(&self, receiver: &Receiver, igloo: &Igloo, far: &[f32], key: u32) -> Option<f64> {
        let scene = self.lighting.scene();
        let (mut sum, mut met) = (0.0, 0_u32);
        for (face, &far) in far.iter().enumerate() {
            let jitter = |axis| to_unit(hash(&[DISTANCE, key, face as u32, axis]));
            let direction: Vec3 = receiver.frame * igloo.direction(face, jitter(0), jitter(1));
            let ray = Ray { origin: receiver.position, direction, far, on: receiver.on };
            if let Some(distance) = self.hair.first_crossing(&scene.hair, &ray) {
                sum += f64::from(distance);
                met += 1;
            }
        }
        (met > 0).then(|| scene.space.scene_length(sum / f64::from(met)))
    }

    fn site(&self, place: Place) -> Site {
        match place {
            Place::Hair { strand, segment } => {
                let scene = self.lighting.scene();
                let object = &scene.hair_objects[usize::from(scene.hair.object[strand as usize])];
                Site::Hair { object: object.name.clone(), strand, segment }
            }
            Place::Surface { triangle } => Site::Surface { triangle },
        }
    }
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64
}
