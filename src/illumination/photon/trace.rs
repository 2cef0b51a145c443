//! A photon's way from surface to surface.

use glam::Vec3;
use rayon::prelude::*;

use super::Settings;
use super::emission::{Emitter, by_cosine};
use crate::hash::{hash, to_unit};
use crate::igloo::frame_around;
use crate::surface::Surfaces;

/// Purposes of random numbers.
const HAIR: u32 = 0x4841_4952;
const LIVES: u32 = 0x4C49_5645;
const TURN: u32 = 0x5455_524E;

/// Light that arrives at a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    pub position: Vec3,
    /// Unit shading normal on the side that the photon came to.
    pub normal: Vec3,
    pub power: Vec3,
}

/// Photons that arrive after one reflection or more, in the order of their number and way, whatever the number of threads.
///
/// `hair(origin, direction, far)` is what hair lets through: the chance with which a photon gets through, so that those that do keep their power.
pub fn trace(
    emitter: &Emitter<'_>,
    surfaces: &Surfaces,
    settings: &Settings,
    hair: &(impl Fn(Vec3, Vec3, f32) -> f32 + Sync),
) -> Vec<Photon> {
    let ways: Vec<Vec<Photon>> =
        (0..settings.photons).into_par_iter().map(|index| way(emitter, surfaces, settings, hair, index)).collect();
    ways.concat()
}

fn way(
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
        if bounce > 0 {
            stored.push(Photon { position: hit.position, normal: hit.normal, power });
        }
        // Russian roulette by the brightest channel: no photon gains power.
        let lives = hit.albedo.max_element().min(1.0);
        if number(LIVES, 0) >= lives {
            break;
        }
        power *= hit.albedo / lives;
        origin = hit.leaving();
        direction = frame_around(hit.normal) * by_cosine([number(TURN, 0), number(TURN, 1)]);
        // An interpolated normal may lead into the triangle: that light is lost in `Illumination::reflected`, too.
        if direction.dot(hit.flat_normal) <= 0.0 {
            break;
        }
    }
    stored
}
