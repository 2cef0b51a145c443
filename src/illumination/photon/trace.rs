//! A photon's way from surface to surface.

use glam::Vec3;
use rayon::prelude::*;

use super::Settings;
use super::emission::Emitter;
use crate::hash::{hash, to_unit};
use crate::illumination::guide::cosine_sample;
use crate::surface::Surfaces;
use crate::tally::{self, Work};

/// Purposes of random numbers.
const HAIR: u32 = 0x4841_4952;
const LIVES: u32 = 0x4C49_5645;
const TURN: u32 = 0x5455_524E;

/// Most photons that are kept: 52 bytes each, and as much again for the trees over them.
pub const MOST: usize = 8_000_000;

/// Paths that tell whether any light is reflected more than once at all.
const PILOT: u32 = 4096;

/// Paths between two looks at how many photons there are.
const BATCH: u32 = 1 << 16;

/// Light that arrives at a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    pub position: Vec3,
    /// Unit shading normal on the side that the photon came to.
    pub normal: Vec3,
    pub power: Vec3,
    /// Reflectance of the surface there.
    pub albedo: Vec3,
    /// Straight from its light.
    pub direct: bool,
}

/// Whether any light is reflected more than once, by the first few paths.
pub fn reflects(
    emitter: &Emitter<'_>,
    surfaces: &Surfaces,
    settings: &Settings,
    hair: &(impl Fn(Vec3, Vec3, f32) -> f32 + Sync),
    cancelled: &(impl Fn() -> bool + Sync),
) -> bool {
    tally::add(Work::Photons, settings.photons.min(PILOT).into());
    let pilot = Settings { photons: settings.photons.min(PILOT), ..*settings };
    batch(emitter, surfaces, &pilot, hair, cancelled, &(0..pilot.photons).collect::<Vec<_>>())
        .iter()
        .any(|photon| !photon.direct)
}

/// Photons where they arrive, in the order of their number and way, whatever the number of threads.
///
/// `hair(origin, direction, far)` is what hair lets through: the chance with which a photon gets through, so that those that do keep their power.
pub fn trace(
    emitter: &Emitter<'_>,
    surfaces: &Surfaces,
    settings: &Settings,
    hair: &(impl Fn(Vec3, Vec3, f32) -> f32 + Sync),
    cancelled: &(impl Fn() -> bool + Sync),
) -> Vec<Photon> {
    let mut photons = Vec::new();
    let count = settings.photons;
    // The lights follow each other in the numbers of the photons: batches of every so many-th photon hold all of them.
    let batches = count.div_ceil(BATCH);
    let mut traced = 0;
    for first in 0..batches {
        let indices: Vec<u32> = (first..count).step_by(batches as usize).collect();
        photons.append(&mut batch(emitter, surfaces, settings, hair, cancelled, &indices));
        traced += indices.len();
        tally::add(Work::Photons, indices.len() as u64);
        if photons.len() > MOST {
            break;
        }
    }
    if traced < count as usize {
        photons.iter_mut().for_each(|photon| photon.power *= (f64::from(count) / traced as f64) as f32);
    }
    photons
}

fn batch(
    emitter: &Emitter<'_>,
    surfaces: &Surfaces,
    settings: &Settings,
    hair: &(impl Fn(Vec3, Vec3, f32) -> f32 + Sync),
    cancelled: &(impl Fn() -> bool + Sync),
    indices: &[u32],
) -> Vec<Photon> {
    let path = |&index| (!cancelled()).then(|| path(emitter, surfaces, settings, hair, index));
    // None ends the work of all threads.
    let paths: Option<Vec<Vec<Photon>>> = indices.par_iter().map(path).collect();
    paths.unwrap_or_default().concat()
}

fn path(
    emitter: &Emitter<'_>,
    surfaces: &Surfaces,
    settings: &Settings,
    hair: &impl Fn(Vec3, Vec3, f32) -> f32,
    index: u32,
) -> Vec<Photon> {
    let mut stored = Vec::new();
    let start = emitter.emit(index, settings.photons, settings.seed);
    let (mut origin, mut direction, mut power) = (start.origin, start.direction, start.power);
    for bounce in 0..=settings.max_bounces {
        let number = |purpose, axis| to_unit(hash(&[purpose, settings.seed, index, bounce, axis]));
        let Some(hit) = surfaces.closest(origin, direction, 0.0, f32::INFINITY) else { break };
        if number(HAIR, 0) >= hair(origin, direction, hit.distance) || hit.albedo == Vec3::ZERO {
            break;
        }
        stored.push(Photon {
            position: hit.position,
            normal: hit.normal,
            power,
            albedo: hit.albedo,
            direct: bounce == 0,
        });
        // Russian roulette by the brightest channel: no photon gains power.
        let lives = hit.albedo.max_element().min(1.0);
        if number(LIVES, 0) >= lives {
            break;
        }
        power *= hit.albedo / lives;
        origin = hit.leaving();
        direction = cosine_sample(hit.normal, [number(TURN, 0), number(TURN, 1)]);
        // An interpolated normal may lead into the triangle: that light is lost in `Illumination::reflected`, too.
        if direction.dot(hit.flat_normal) <= 0.0 {
            break;
        }
    }
    stored
}
