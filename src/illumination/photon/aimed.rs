//! Photons of caustics as they leave the lamps: towards the mirrors and the glass of a scene only (Jensen's projection maps, with balls for the
//! objects).
//!
//! A photon aimed at an object counts only if it is the first surface that it meets. Each way of light has one first surface, so that it is counted
//! once, however much the balls overlap. Beside the lamps hot spots of surfaces shine, with what gather rays do not count of them. Light of the sky
//! without its small bright sources is left out: it is smooth, and rays find it.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use super::emission::{Emission, around};
use super::{HotSpots, PhotonMap};
use crate::hash::{hash, to_unit, unit};
use crate::igloo::frame_around;
use crate::illumination::distribution::Distribution;
use crate::illumination::lights::share_of_cone;
use crate::illumination::{DirectLight, Illumination, RectLight};
use crate::surface::{SurfacePoint, lifted};

/// Purposes of random numbers.
const PLACE: u32 = 0x4149_4D50;
const WAY: u32 = 0x4149_4D57;

/// More objects than this are aimed at as one.
const MOST_BALLS: usize = 64;
/// Places along a side of an area light that tell how much of its light goes towards a ball; as many in all of the hot spots.
const GRID: u32 = 4;

/// A ball around what photons are aimed at.
#[derive(Clone, Copy, Debug)]
struct Ball {
    center: Vec3,
    radius: f32,
    /// The only finish that counts; any mirror or glass where none.
    finish: Option<u32>,
}

#[derive(Clone, Copy, Debug)]
enum Lamp {
    Direct(usize),
    Area(usize),
    /// A small bright source of the environment.
    Spot(usize),
    /// The hot spots of all surfaces.
    Hot,
}

/// One lamp and one ball.
#[derive(Clone, Copy, Debug)]
struct Pair {
    lamp: Lamp,
    ball: Ball,
}

/// All lamps and mirrors of a scene, each pair chosen by its share of the power.
#[derive(Debug)]
pub struct Aimed<'l> {
    light: &'l Illumination,
    pairs: Vec<Pair>,
    by_power: Distribution,
    /// Centre and radius of a ball around all surfaces and all hair.
    all: (Vec3, f32),
}

/// Directions from a point to a ball.
struct Cone {
    axis: Vec3,
    /// 1 less the cosine of half its opening: small cones keep their digits.
    versine: f32,
}

impl Cone {
    fn toward(ball: &Ball, from: Vec3) -> Self {
        let to = ball.center - from;
        let distance2 = to.length_squared();
        let sine2 = ball.radius * ball.radius / distance2;
        if sine2 >= 1.0 || sine2.is_nan() {
            return Self { axis: Vec3::Z, versine: 2.0 };
        }
        Self { axis: to / distance2.sqrt(), versine: sine2 / (1.0 + (1.0 - sine2).sqrt()) }
    }

    fn solid_angle(&self) -> f32 {
        TAU * self.versine
    }

    /// All directions alike.
    fn direction(&self, [u, v]: [f32; 2]) -> Vec3 {
        frame_around(self.axis) * around(1.0 - self.versine * v, u)
    }
}

impl<'l> Aimed<'l> {
    /// The lamps of a scene with mirrors or glass; nothing where there are none, or no lamp that may shine on them.
    pub fn new(light: &'l Illumination) -> Option<Self> {
        let surfaces = light.surfaces.as_ref()?;
        let [low, high] = surfaces.bounds()?;
        // All hair lies within the unit ball of render space.
        let all = (0.5 * (low + high), 0.5 * low.distance(high) + 0.5 * (low + high).length() + 1.0);
        let found = surfaces.specular_balls();
        let mut balls: Vec<Ball> =
            found.into_iter().map(|(finish, center, radius)| Ball { center, radius, finish: Some(finish) }).collect();
        if balls.len() > MOST_BALLS {
            balls = vec![around_all(&balls)];
        }
        let sources = light.environment.sources().map_or(0, |found| found.list.len());
        let lamps = (0..light.direct.len()).map(Lamp::Direct);
        let lamps = lamps.chain((0..light.area.len()).map(Lamp::Area)).chain((0..sources).map(Lamp::Spot));
        let lamps = lamps.chain(hot_spots(light).map(|_| Lamp::Hot));
        let (mut pairs, mut powers) = (Vec::new(), Vec::new());
        for lamp in lamps {
            for &ball in &balls {
                let power = worth(light, lamp, &ball);
                if power > 0.0 && power.is_finite() {
                    pairs.push(Pair { lamp, ball });
                    powers.push(power);
                }
            }
        }
        let by_power = Distribution::new(powers.into_iter());
        (!pairs.is_empty()).then_some(Self { light, pairs, by_power, all })
    }

    /// Photon `index` of `count`, and whether it counts at the first surface that it meets. None where a lamp has no light that way.
    pub fn emit(&self, index: u32, count: u32, seed: u32) -> Option<(Emission, impl Fn(&SurfacePoint) -> bool)> {
        let (chosen, _) = self.by_power.choose((f64::from(index) + 0.5) / f64::from(count))?;
        let Pair { lamp, ball } = self.pairs[chosen];
        // Photons that this pair gets.
        let share = self.by_power.share(chosen) * f64::from(count);
        let number = |purpose, axis| to_unit(hash(&[purpose, seed, index, axis]));
        let [place, way] = [PLACE, WAY].map(|purpose| [number(purpose, 0), number(purpose, 1)]);
        let mut emission = match lamp {
            Lamp::Direct(index) => self.shine(&self.light.direct[index].light, &ball, way)?,
            Lamp::Area(index) => from_area(&self.light.area[index], &ball, place, way)?,
            Lamp::Spot(source) => {
                let environment = &self.light.environment;
                let found = environment.sources()?;
                let key = hash(&[WAY, seed, index]);
                let (toward, energy) = found.list[source].sample(&found.rest, unit(&[WAY, key]), key)?;
                self.parallel(environment.to_map().transpose() * toward, energy, &ball, way)
            }
            Lamp::Hot => {
                let (position, normal, power) = hot_spots(self.light)?.choose(unit(&[PLACE, seed, index]))?;
                from_plane(lifted(position, normal), normal, power / PI, &ball, way)?
            }
        };
        emission.power /= share as f32;
        let counts =
            move |hit: &SurfacePoint| hit.optics.is_some() && ball.finish.is_none_or(|finish| finish == hit.finish);
        Some((emission, counts))
    }

    /// A photon with the power of all photons of its pair.
    fn shine(&self, light: &DirectLight, ball: &Ball, way: [f32; 2]) -> Option<Emission> {
        match *light {
            DirectLight::Point { position, intensity } => {
                let cone = Cone::toward(ball, position);
                let power = intensity * cone.solid_angle();
                Some(Emission { origin: position, direction: cone.direction(way), power })
            }
            DirectLight::Spot { position, axis, inner, outer, intensity } => {
                let cone = Cone::toward(ball, position);
                let direction = cone.direction(way);
                let inside = share_of_cone(direction.dot(axis), inner, outer);
                let power = intensity * (cone.solid_angle() * inside);
                (inside > 0.0).then_some(Emission { origin: position, direction, power })
            }
            DirectLight::Directional { toward, irradiance } => Some(self.parallel(toward, irradiance, ball, way)),
        }
    }

    /// Parallel light through a disk as wide as the ball, from before all that may be in its way.
    fn parallel(&self, toward: Vec3, irradiance: Vec3, ball: &Ball, at: [f32; 2]) -> Emission {
        let (sin, cos) = (TAU * at[0]).sin_cos();
        let across = frame_around(toward) * Vec3::new(cos, sin, 0.0) * (ball.radius * at[1].sqrt());
        let (center, radius) = self.all;
        Emission {
            origin: ball.center + toward * (ball.center.distance(center) + radius) + across,
            direction: -toward,
            power: irradiance * (PI * ball.radius * ball.radius),
        }
    }
}

fn around_all(balls: &[Ball]) -> Ball {
    let corners = balls.iter().flat_map(|ball| [-1.0, 1.0].map(|side| ball.center + side * ball.radius));
    let (low, high) = corners.fold((Vec3::MAX, Vec3::MIN), |(low, high), p| (low.min(p), high.max(p)));
    Ball { center: 0.5 * (low + high), radius: 0.5 * low.distance(high) * 1.0001, finish: None }
}

/// Power of a lamp towards a ball, mean of the channels, or about that: above zero wherever there is any.
fn worth(light: &Illumination, lamp: Lamp, ball: &Ball) -> f32 {
    let brightness = |color: Vec3| color.element_sum() / 3.0;
    match lamp {
        Lamp::Direct(index) => match light.direct[index].light {
            DirectLight::Point { position, intensity } => {
                brightness(intensity) * Cone::toward(ball, position).solid_angle()
            }
            DirectLight::Spot { position, axis, outer, intensity, .. } => {
                let cone = Cone::toward(ball, position);
                let apart = cone.axis.dot(axis).clamp(-1.0, 1.0).acos();
                let reach = (1.0 - cone.versine).acos() + outer.clamp(-1.0, 1.0).acos() + 1e-3;
                if cone.versine < 2.0 && apart > reach { 0.0 } else { brightness(intensity) * cone.solid_angle() }
            }
            DirectLight::Directional { irradiance, .. } => brightness(irradiance) * PI * ball.radius * ball.radius,
        },
        Lamp::Area(index) => {
            let area = &light.area[index];
            let place = |i: u32| [(i % GRID) as f32 + 0.5, (i / GRID) as f32 + 0.5].map(|x| x / GRID as f32);
            let toward = |i: u32| projected(on_light(area, place(i)), area.normal, ball);
            let mean = (0..GRID * GRID).map(toward).sum::<f32>() / (GRID * GRID) as f32;
            // A light in whose plane the ball lies for all of these places may shine on it from others.
            brightness(area.radiance) * area.area * mean.max(1e-6)
        }
        Lamp::Hot => hot_spots(light).map_or(0.0, |hot| {
            let places = (0..GRID * GRID).filter_map(|i| hot.choose((f64::from(i) + 0.5) / f64::from(GRID * GRID)));
            let toward: f32 = places.map(|(position, normal, _)| projected(position, normal, ball)).sum();
            hot.power() / PI * (toward / (GRID * GRID) as f32).max(1e-3)
        }),
        Lamp::Spot(index) => {
            let energy = light.environment.sources().map_or(Vec3::ZERO, |found| found.list[index].energy);
            brightness(energy) * PI * ball.radius * ball.radius
        }
    }
}

fn hot_spots(light: &Illumination) -> Option<&HotSpots> {
    light.photons().and_then(PhotonMap::hot_spots)
}

/// About the solid angle of a ball times its cosine above a plane: no less than its parts have.
fn projected(from: Vec3, normal: Vec3, ball: &Ball) -> f32 {
    let cone = Cone::toward(ball, from);
    // As high as the ball's upper edge stands above the plane.
    let upper = cone.axis.dot(normal) + (cone.versine * (2.0 - cone.versine)).max(0.0).sqrt();
    let cosine = if cone.versine < 2.0 { upper.clamp(0.0, 1.0) } else { 0.5 };
    cone.solid_angle() * cosine
}

fn on_light(light: &RectLight, [u, v]: [f32; 2]) -> Vec3 {
    light.corner + light.edge_u * u + light.edge_v * v
}

fn from_area(light: &RectLight, ball: &Ball, place: [f32; 2], way: [f32; 2]) -> Option<Emission> {
    let from = lifted(on_light(light, place), light.normal);
    from_plane(from, light.normal, light.radiance * light.area, ball, way)
}

/// From a point of a plane that shines the same in all directions; `per_cosine` is its intensity straight on.
fn from_plane(origin: Vec3, normal: Vec3, per_cosine: Vec3, ball: &Ball, way: [f32; 2]) -> Option<Emission> {
    let cone = Cone::toward(ball, origin);
    let direction = cone.direction(way);
    let cosine = direction.dot(normal);
    let power = per_cosine * (cosine * cone.solid_angle());
    (cosine > 0.0).then_some(Emission { origin, direction, power })
}
