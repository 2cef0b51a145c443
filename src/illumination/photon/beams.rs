//! Caustics on hair: the ways of photons behind mirrors and glass, where they pass through the box around all hair.
//!
//! A photon of power P that goes the length s through a volume V adds P s / V to the irradiance on what faces it (the mean over the volume). So
//! points are dealt out along all ways, one every so many units of length; the nearest of them to a point of hair say how much light there is and
//! from where. What hair is between it and the mirror is for the point itself to find out, by rays. Power in W, lengths in render units.

use std::f32::consts::PI;
use std::num::NonZero;

use glam::{Mat3, Vec3};

use super::caustic::{largest, nearest};
use super::map::{Tree, tree, turn};
use crate::hash::unit;
use crate::igloo::{Igloo, Span};
use crate::illumination::distribution::Distribution;
use crate::illumination::lights::Incident;
use crate::surface::Surfaces;

/// Purpose of random numbers.
const SAMPLE: u32 = 0x4245_414D;

/// Points a way, on the average, and points in all at the most: 28 bytes each, and as much again for the tree over them.
const EACH: usize = 8;
pub const MOST: usize = 2_000_000;
/// Directions in which an estimate looks how much of its ball a surface cuts off.
const PROBES: u32 = 8;

/// A way of a photon.
#[derive(Clone, Copy, Debug)]
pub struct Beam {
    /// On the mirror or glass that it comes from.
    origin: Vec3,
    direction: Vec3,
    /// Where it enters and leaves the box around the hair.
    span: [f32; 2],
    pub power: Vec3,
}

impl Beam {
    /// The part of a way that lies in a box; none where there is none.
    pub fn inside([low, high]: [Vec3; 2], origin: Vec3, direction: Vec3, far: f32, power: Vec3) -> Option<Self> {
        let (to_low, to_high) = ((low - origin) / direction, (high - origin) / direction);
        let enter = to_low.min(to_high).max_element().max(0.0);
        let leave = to_low.max(to_high).min_element().min(far);
        // Written so that a way within a side of the box, which divides zero by zero, is none.
        (leave > enter && leave.is_finite()).then_some(Self { origin, direction, span: [enter, leave], power })
    }

    fn length(&self) -> f32 {
        self.span[1] - self.span[0]
    }
}

/// A point on a way.
#[derive(Clone, Copy, Debug)]
struct Mark {
    position: Vec3,
    beam: u32,
}

/// The light of photons in the box around all hair.
#[derive(Debug)]
pub struct Beams {
    marks: Vec<Mark>,
    beams: Vec<Beam>,
    /// The length that each mark stands for.
    step: f32,
    tree: Tree,
    turn: Mat3,
    neighbours: NonZero<usize>,
    largest2: f32,
    around: Igloo,
}

impl Beams {
    /// Memory, in bytes: each mark is also a place of the tree.
    pub(super) fn bytes(&self) -> u64 {
        let marks = self.marks.len() * (size_of::<Mark>() + size_of::<[f32; 3]>() + size_of::<u32>());
        (marks + size_of_val(&self.beams[..])) as u64
    }

    /// Marks on the ways; nothing where there are too few.
    pub(super) fn new(beams: Vec<Beam>, neighbours: u32, key: u32) -> Option<Self> {
        let total: f64 = beams.iter().map(|beam| f64::from(beam.length())).sum();
        let wanted = (EACH * beams.len()).min(MOST);
        if wanted < 8 || total <= 0.0 {
            return None;
        }
        let step = total / wanted as f64;
        let mut marks = Vec::with_capacity(wanted + 1);
        // One row of marks along all ways, laid end to end: as many on each as its length says.
        let mut next = unit(&[SAMPLE, key]) * step;
        for (index, beam) in beams.iter().enumerate() {
            while next < f64::from(beam.length()) {
                let along = beam.span[0] + next as f32;
                marks.push(Mark { position: beam.origin + beam.direction * along, beam: index as u32 });
                next += step;
            }
            next -= f64::from(beam.length());
        }
        let neighbours = NonZero::new((neighbours as usize).min(marks.len().checked_sub(1)?))?;
        let turn = turn();
        let tree = tree(marks.iter().map(|mark| mark.position), &turn)?;
        let largest2 = largest(&tree, marks.len(), neighbours, |index| turn * marks[index].position)?;
        let (step, around) = (step as f32, Igloo::new(Span::Sphere, PROBES / 2));
        Some(Self { marks, beams, step, tree, turn, neighbours, largest2, around })
    }

    /// Light at a point as `count` samples, whether or not something is in its way. What is nearer to the mirror than the estimate is wide is
    /// not known to be in the way.
    pub(super) fn light(
        &self,
        surfaces: &Surfaces,
        position: Vec3,
        count: u32,
        key: u32,
        mut take: impl FnMut(&Incident),
    ) {
        let (items, radius2) = nearest(&self.tree, self.turn * position, self.neighbours, self.largest2);
        let brightness = |beam: u32| self.beams[beam as usize].power.element_sum() / 3.0;
        // Epanechnikov's kernel in space, 5/2 (1 - d²/r²); for surfaces see `Caustics`.
        let counts = |(item, distance2): &(u32, f32)| {
            brightness(self.marks[*item as usize].beam) * (2.5 * (1.0 - distance2 / radius2)).max(0.0)
        };
        let by_power = Distribution::new(items.iter().map(counts));
        if items.is_empty() || by_power.total() <= 0.0 {
            return;
        }
        let radius = radius2.sqrt();
        let volume = 4.0 / 3.0 * PI * radius * radius2 * self.free_share(surfaces, position, radius);
        let count = count.min(items.len() as u32).max(1);
        for sample in 0..count {
            let u = (f64::from(sample) + unit(&[SAMPLE, key, sample])) / f64::from(count);
            let Some((index, _)) = by_power.choose(u) else { return };
            let Mark { position: mark, beam: number } = self.marks[items[index].0 as usize];
            let beam = &self.beams[number as usize];
            // Chosen in proportion to what it counts: what it stands for has the power of all.
            let all = beam.power * (by_power.total() as f32 / (brightness(number) * count as f32));
            let distance = (mark.distance(beam.origin) - 2.0 * radius).max(0.0);
            take(&Incident { toward: -beam.direction, distance, irradiance: all * (self.step / volume) });
        }
    }

    /// The share of a ball that no surface cuts off, seen from its middle.
    fn free_share(&self, surfaces: &Surfaces, position: Vec3, radius: f32) -> f32 {
        let probes = self.around.len();
        let free = |face: usize| {
            let hit = surfaces.closest(position, self.around.center(face), 0.0, radius);
            hit.map_or(1.0, |hit| (hit.distance / radius).powi(3))
        };
        // Of a hair in a crack something is left.
        ((0..probes).map(free).sum::<f32>() / probes as f32).max(0.05)
    }
}
