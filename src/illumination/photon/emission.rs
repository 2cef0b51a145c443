//! Photons as they leave the lights.
//!
//! Lights without a place shine through a disk that is as wide as the ball around all surfaces and stands square to their direction.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use crate::hash::{hash, to_unit, unit};
use crate::igloo::frame_around;
use crate::illumination::distribution::Distribution;
use crate::illumination::guide::cosine_sample;
use crate::illumination::lights::share_of_cone;
use crate::illumination::{DirectLight, Illumination};
use crate::surface::lifted;

/// Purposes of random numbers.
const PLACE: u32 = 0x504C_4143;
const WAY: u32 = 0x5741_5921;
const SPOT: u32 = 0x5350_4F54;

/// A photon at its light: where it starts, its unit direction, and its power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    pub origin: Vec3,
    pub direction: Vec3,
    pub power: Vec3,
}

/// One source of photons.
#[derive(Clone, Copy, Debug)]
enum Source {
    Direct(usize),
    Area(usize),
    /// A face of the environment's igloo.
    Sky(usize),
    /// A small bright source of the environment.
    Spot(usize),
}

/// All lights of a scene as sources of photons, each chosen by its share of the power.
#[derive(Debug)]
pub struct Emitter<'l> {
    light: &'l Illumination,
    sources: Vec<(Source, Vec3)>,
    by_power: Distribution,
    center: Vec3,
    radius: f32,
}

impl<'l> Emitter<'l> {
    /// The lights of a scene with surfaces; nothing where there are none, or no light.
    pub fn new(light: &'l Illumination) -> Option<Self> {
        let [low, high] = light.surfaces.as_ref()?.bounds()?;
        // A little wider: rounding must not put a surface outside.
        let (center, radius) = (0.5 * (low + high), 0.5 * low.distance(high) * 1.0001);
        let disk = PI * radius * radius;
        let mut sources = Vec::new();
        for (index, direct) in light.direct.iter().enumerate() {
            let power = match direct.light {
                DirectLight::Point { intensity, .. } => intensity * (2.0 * TAU),
                DirectLight::Spot { inner, outer, intensity, .. } => {
                    intensity * (TAU * (1.0 - outer) * mean_of_cone(inner, outer))
                }
                DirectLight::Directional { irradiance, .. } => irradiance * disk,
            };
            sources.push((Source::Direct(index), power));
        }
        sources
            .extend(light.area.iter().enumerate().map(|(i, area)| (Source::Area(i), area.radiance * area.area * PI)));
        let solid_angle = light.igloo().face_solid_angle();
        let sky = light.means().iter().enumerate();
        sources.extend(sky.map(|(face, &mean)| (Source::Sky(face), mean * (solid_angle * disk))));
        let spots = light.environment.sources().map_or(&[][..], |found| &found.list);
        sources.extend(spots.iter().enumerate().map(|(i, spot)| (Source::Spot(i), spot.energy * disk)));
        sources.retain(|(_, power)| power.max_element() > 0.0 && power.is_finite());
        let by_power = Distribution::new(sources.iter().map(|(_, power)| power.element_sum()));
        (!sources.is_empty()).then_some(Self { light, sources, by_power, center, radius })
    }

    /// Power of all lights: of lights without a place, what passes through the disk.
    pub fn power(&self) -> Vec3 {
        self.sources.iter().map(|(_, power)| *power).sum()
    }

    /// Photon `index` of `count`. The sources are shared out evenly, not by chance.
    pub fn emit(&self, index: u32, count: u32, seed: u32) -> Emission {
        // No source has no power, so there is one at any place but, by rounding, the very last.
        let place = self.by_power.choose((f64::from(index) + 0.5) / f64::from(count));
        let (source, power) = self.sources[place.map_or(self.sources.len() - 1, |(chosen, _)| chosen)];
        let chance = f64::from(power.element_sum()) / self.by_power.total();
        let power = power * (1.0 / (chance * f64::from(count))) as f32;
        let number = |purpose, axis| to_unit(hash(&[purpose, seed, index, axis]));
        let [place, way] = [PLACE, WAY].map(|purpose| [number(purpose, 0), number(purpose, 1)]);
        let (origin, direction) = match source {
            Source::Spot(spot) => return self.emit_from_spot(spot, power, place, hash(&[SPOT, seed, index])),
            Source::Direct(index) => match self.light.direct[index].light {
                DirectLight::Point { position, .. } => (position, uniform(way)),
                DirectLight::Spot { position, axis, inner, outer, .. } => {
                    let cosine = 1.0 - way[1] * (1.0 - outer);
                    let share = share_of_cone(cosine, inner, outer) / mean_of_cone(inner, outer);
                    let direction = frame_around(axis) * around(cosine, way[0]);
                    return Emission { origin: position, direction, power: power * share };
                }
                DirectLight::Directional { toward, .. } => (self.through_disk(toward, place), -toward),
            },
            Source::Area(index) => {
                let light = &self.light.area[index];
                let position = light.corner + light.edge_u * place[0] + light.edge_v * place[1];
                (lifted(position, light.normal), cosine_sample(light.normal, way))
            }
            Source::Sky(face) => {
                let toward = self.light.igloo().direction(face, way[0], way[1]);
                (self.through_disk(toward, place), -toward)
            }
        };
        Emission { origin, direction, power }
    }

    /// A photon of a small bright source that on average has this power.
    fn emit_from_spot(&self, index: usize, power: Vec3, place: [f32; 2], key: u32) -> Emission {
        let environment = &self.light.environment;
        let sampled = environment.sources().and_then(|found| {
            let spot = &found.list[index];
            Some((spot.sample(&found.rest, unit(&[WAY, key]), key)?, spot.energy))
        });
        // A source that gives no sample has no light.
        let Some(((toward, energy), mean)) = sampled else {
            return Emission { origin: self.center, direction: Vec3::Y, power: Vec3::ZERO };
        };
        let toward = environment.to_map().transpose() * toward;
        let share = energy.element_sum() / mean.element_sum();
        let color = energy / energy.element_sum() * power.element_sum();
        Emission { origin: self.through_disk(toward, place), direction: -toward, power: color * share }
    }

    /// A point of the disk on the side of `toward`.
    fn through_disk(&self, toward: Vec3, at: [f32; 2]) -> Vec3 {
        let (sin, cos) = (TAU * at[0]).sin_cos();
        let local = Vec3::new(cos, sin, 0.0) * (self.radius * at[1].sqrt());
        self.center + toward * self.radius + frame_around(toward) * local
    }
}

/// Mean of a spot's light over its cone: its edge is smooth and point-symmetric.
fn mean_of_cone(inner: f32, outer: f32) -> f32 {
    1.0 - 0.5 * (inner - outer).max(0.0) / (1.0 - outer)
}

/// The direction at a cosine to the z axis, `turn` of a circle around it.
pub(super) fn around(cosine: f32, turn: f32) -> Vec3 {
    let (sin, cos) = (TAU * turn).sin_cos();
    let radius = ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt();
    Vec3::new(radius * cos, radius * sin, cosine)
}

/// A direction of the whole sphere, all alike.
fn uniform([u, v]: [f32; 2]) -> Vec3 {
    around(1.0 - 2.0 * v, u)
}
