//! Caustics: light of lamps that mirrors and glass throw on other things, by photons aimed at them (Jensen's second photon map).
//!
//! Photons are stored where they first meet a diffuse surface, and each is spread over a disk. An unlit place costs next to nothing. For hair see
//! [`super::beams`]. Power in W, in render units.

use std::f32::consts::PI;
use std::num::NonZero;

use glam::{Mat3, Vec3};
use kiddo::SquaredEuclidean;
use rayon::prelude::*;

use super::beams::{self, Beam, Beams};
use super::map::{LIKE, Tree, on_surface, tree, turn};
use super::trace::{BATCH, MOST, Photon, survivor};
use super::{Aimed, CausticSettings};
use crate::hash::{hash, to_unit};
use crate::illumination::lights::Incident;
use crate::surface::Surfaces;
use crate::tally::{self, Work};

/// Purposes of random numbers.
const HAIR: u32 = 0x4341_4841;
const LIVES: u32 = 0x4341_4C49;
const WAY_ON: u32 = 0x4341_5741;
const BEAMS: u32 = 0x4341_4245;

/// Fewer photons tell nothing.
const LEAST: usize = 8;
/// Classes of radii; the narrowest disk has 2^-24 of the area of the widest.
const CLASSES: usize = 24;
/// Estimates of which the largest radius is found, and the share of them that it suffices for.
const PROBES: usize = 1024;
const SUFFICES: f64 = 0.9;

/// The caustics of a scene.
#[derive(Debug)]
pub struct Caustics {
    surface: Option<Cloud>,
    hair: Option<Beams>,
    /// Share of the power towards mirrors and glass that was still under way when it had met the most of them that it may.
    pub cut: f32,
}

/// What becomes of a photon.
#[derive(Default)]
struct Path {
    arrived: Option<Photon>,
    beams: Vec<Beam>,
    met: f32,
    cut: f32,
}

impl Caustics {
    /// Traces photons; nothing where too few arrive anywhere, or soon after `cancelled` says to stop.
    pub(in crate::illumination) fn trace(
        emitter: &Aimed<'_>,
        surfaces: &Surfaces,
        settings: &CausticSettings,
        hair_box: Option<[Vec3; 2]>,
        hair: &(impl Fn(Vec3, Vec3, f32) -> f32 + Sync),
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Option<Self> {
        let (mut photons, mut beams, mut met, mut cut) = (Vec::new(), Vec::new(), 0.0_f64, 0.0_f64);
        let (count, batches) = (settings.photons, settings.photons.div_ceil(BATCH));
        let mut traced = 0;
        for first in 0..batches {
            let indices: Vec<u32> = (first..count).step_by(batches as usize).collect();
            let path = |&index: &u32| (!cancelled()).then(|| path(emitter, surfaces, settings, hair_box, hair, index));
            let paths: Vec<Path> = indices.par_iter().map(path).collect::<Option<_>>()?;
            for mut path in paths {
                photons.extend(path.arrived);
                beams.append(&mut path.beams);
                met += f64::from(path.met);
                cut += f64::from(path.cut);
            }
            tally::add(Work::CausticPhotons, indices.len() as u64);
            traced += indices.len();
            if photons.len() > MOST || beams.len() > beams::MOST {
                break;
            }
        }
        let scale = (f64::from(count) / traced as f64) as f32;
        photons.iter_mut().for_each(|photon: &mut Photon| photon.power *= scale);
        beams.iter_mut().for_each(|beam: &mut Beam| beam.power *= scale);
        let surface = Cloud::new(photons, settings.neighbours, surfaces);
        let hair = Beams::new(beams, settings.neighbours, hash(&[BEAMS, settings.seed]));
        let cut = if met > 0.0 { (cut / met) as f32 } else { 0.0 };
        (surface.is_some() || hair.is_some()).then_some(Self { surface, hair, cut })
    }

    /// Memory, in bytes.
    pub fn bytes(&self) -> u64 {
        let surface = self.surface.as_ref().map_or(0, Cloud::bytes);
        surface + self.hair.as_ref().map_or(0, Beams::bytes)
    }

    /// Photons that arrived at surfaces.
    pub fn photons(&self) -> &[Photon] {
        self.surface.as_ref().map_or(&[], |cloud| &cloud.photons)
    }

    /// Irradiance at a point of a surface with this unit normal.
    pub fn irradiance(&self, position: Vec3, normal: Vec3) -> Vec3 {
        self.surface.as_ref().map_or(Vec3::ZERO, |cloud| cloud.irradiance(position, normal))
    }

    /// Light at a point of hair, as [`crate::illumination::Illumination::caustic_light`] gives it.
    pub(in crate::illumination) fn light(
        &self,
        surfaces: &Surfaces,
        position: Vec3,
        count: u32,
        key: u32,
        take: impl FnMut(&Incident),
    ) {
        if let Some(beams) = &self.hair {
            beams.light(surfaces, position, count, key, take);
        }
    }
}

/// A photon from its lamp to the first diffuse surface. Hair ends it by chance on all legs; on those behind a mirror or glass hair gets its light
/// as beams, which a point of hair follows back itself.
fn path(
    emitter: &Aimed<'_>,
    surfaces: &Surfaces,
    settings: &CausticSettings,
    hair_box: Option<[Vec3; 2]>,
    hair: &impl Fn(Vec3, Vec3, f32) -> f32,
    index: u32,
) -> Path {
    let mut path = Path::default();
    let Some((start, counts)) = emitter.emit(index, settings.photons, settings.seed) else { return path };
    let (mut origin, mut direction, mut power) = (start.origin, start.direction, start.power);
    for met in 0..=settings.depth {
        let number = |purpose| to_unit(hash(&[purpose, settings.seed, index, met]));
        let hit = surfaces.closest(origin, direction, 0.0, f32::INFINITY);
        if met > 0
            && let Some(hair_box) = hair_box
        {
            let far = hit.as_ref().map_or(f32::INFINITY, |hit| hit.distance);
            path.beams.extend(Beam::inside(hair_box, origin, direction, far, power));
        }
        let Some(hit) = hit else { break };
        if met == 0 && !counts(&hit) || number(HAIR) >= hair(origin, direction, hit.distance) {
            break;
        }
        if met == 0 {
            path.met = power.element_sum();
        }
        let Some(optics) = hit.optics else {
            let (position, normal, albedo) = (hit.position, hit.normal, hit.albedo);
            // What reflects nothing shows no caustic.
            let arrives = albedo != Vec3::ZERO;
            path.arrived = arrives.then_some(Photon { position, normal, power, albedo, direct: false });
            break;
        };
        if met == settings.depth {
            path.cut = power.element_sum();
            break;
        }
        let way = optics.ways(&hit, direction).choose(number(WAY_ON));
        let Some(left) = survivor(power, way.share, number(LIVES)) else { break };
        (origin, direction, power) = (way.origin, way.direction, left);
    }
    path
}

/// Photons on surfaces, each spread over a disk of its own, as wide as its neighbours are far away (Epanechnikov's kernel 2 (1 - d²/r²) / π r²).
///
/// So each keeps its power. An estimate from the photons nearest to a place, as for light that is spread evenly, would count a bright spot all
/// around it as well, where its disk is wide enough to reach the spot: some 4 % too much light behind a glass ball, with any number of photons.
#[derive(Debug)]
struct Cloud {
    photons: Vec<Photon>,
    /// Squared radius of each, and its irradiance in the middle.
    spread: Vec<(f32, Vec3)>,
    classes: Vec<Class>,
    turn: Mat3,
}

/// Photons of like radii: a search takes all within the largest of them.
#[derive(Debug)]
struct Class {
    largest2: f32,
    tree: Tree,
    items: Vec<u32>,
}

impl Cloud {
    /// Memory, in bytes: each photon is also a place of its class's tree.
    fn bytes(&self) -> u64 {
        (self.photons.len()
            * (size_of::<Photon>() + size_of::<(f32, Vec3)>() + size_of::<[f32; 3]>() + size_of::<u32>()))
            as u64
    }

    fn new(photons: Vec<Photon>, neighbours: u32, surfaces: &Surfaces) -> Option<Self> {
        if photons.len() < LEAST {
            return None;
        }
        let neighbours = NonZero::new((neighbours as usize).min(photons.len() - 1))?;
        let turn = turn();
        let all = tree(photons.iter().map(|photon| photon.position), &turn)?;
        let radii2: Vec<f32> = photons.par_iter().map(|at| radius2(&all, turn * at.position, neighbours)).collect();
        let widest2 = radii2.iter().copied().fold(0.0, f32::max);
        if widest2 <= 0.0 || !widest2.is_finite() {
            return None;
        }
        // Each class has half the area of the one before; in the last are all that are narrower.
        let class = |radius2: f32| ((widest2 / radius2).log2().max(0.0) as usize).min(CLASSES - 1);
        let narrowest2 = widest2 * 0.5_f32.powi(CLASSES as i32);
        let spread = (photons.par_iter().zip(&radii2))
            .map(|(at, radius2)| {
                let radius2 = radius2.max(narrowest2);
                // The weight within r is 2 r² - r⁴.
                let within2 = |u: f32| 1.0 - (1.0 - u).sqrt();
                let area = PI * radius2 * on_surface(surfaces, at.position, at.normal, radius2.sqrt(), within2);
                (radius2, at.power * (2.0 / area))
            })
            .collect::<Vec<_>>();
        let mut members = vec![Vec::new(); CLASSES];
        spread.iter().enumerate().for_each(|(index, (radius2, _))| members[class(*radius2)].push(index as u32));
        let classes = members.into_iter().filter(|items| !items.is_empty());
        let classes = classes.map(|items| {
            let largest2 = items.iter().map(|&item| spread[item as usize].0).fold(0.0, f32::max);
            let tree = tree(items.iter().map(|&item| photons[item as usize].position), &turn)?;
            Some(Class { largest2, tree, items })
        });
        let classes = classes.collect::<Option<Vec<_>>>()?;
        Some(Self { photons, spread, classes, turn })
    }

    fn irradiance(&self, position: Vec3, normal: Vec3) -> Vec3 {
        let query = (self.turn * position).to_array();
        let mut near: Vec<(u32, f32)> = Vec::new();
        for class in &self.classes {
            let found = class.tree.query(&query).within::<SquaredEuclidean<f32>>(class.largest2).unsorted().execute();
            near.extend(found.iter().map(|found| (class.items[found.item as usize], found.distance)));
        }
        // The order of the sum must not be that of the search.
        near.sort_unstable_by_key(|(item, _)| *item);
        let mut sum = Vec3::ZERO;
        for (item, distance2) in near {
            let (radius2, middle) = self.spread[item as usize];
            if distance2 < radius2 && self.photons[item as usize].normal.dot(normal) > LIKE {
                sum += middle * (1.0 - distance2 / radius2);
            }
        }
        sum
    }
}

/// Squared distance of a place from the furthest of its neighbours.
fn radius2(tree: &Tree, place: Vec3, neighbours: NonZero<usize>) -> f32 {
    let near = tree.query(&place.to_array()).nearest_n::<SquaredEuclidean<f32>>(neighbours).execute();
    near.iter().map(|found| found.distance).fold(0.0, f32::max)
}

/// The squared radius within which most of a cloud's points have as many neighbours as an estimate counts.
pub(super) fn largest(
    tree: &Tree,
    count: usize,
    neighbours: NonZero<usize>,
    place: impl Fn(usize) -> Vec3 + Sync,
) -> Option<f32> {
    let step = count.div_ceil(PROBES);
    let mut radii: Vec<f32> =
        (0..count).into_par_iter().step_by(step).map(|index| radius2(tree, place(index), neighbours)).collect();
    radii.sort_unstable_by(f32::total_cmp);
    let chosen = radii[((radii.len() - 1) as f64 * SUFFICES) as usize];
    (chosen > 0.0 && chosen.is_finite()).then_some(chosen)
}

/// The points of a cloud that an estimate counts with their squared distances, in their own order, and the squared radius of the ball that they
/// are counted in. Where there are enough of them the furthest says how large the ball is.
pub(super) fn nearest(tree: &Tree, place: Vec3, neighbours: NonZero<usize>, largest2: f32) -> (Vec<(u32, f32)>, f32) {
    let query = place.to_array();
    let near = tree.query(&query).nearest_n::<SquaredEuclidean<f32>>(neighbours).within(largest2).execute();
    let furthest = near.iter().map(|found| found.distance).fold(0.0, f32::max);
    let full = near.len() == neighbours.get() && furthest > 0.0;
    let mut items: Vec<(u32, f32)> = near.iter().map(|found| (found.item, found.distance)).collect();
    // The order of the sum must not be that of the search.
    items.sort_unstable_by_key(|(item, _)| *item);
    (items, if full { furthest } else { largest2 })
}
