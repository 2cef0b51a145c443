//! Irradiance from photons, found beforehand at many places (Christensen 1999, "Faster Photon Map Global Illumination"), so that a gather ray
//! costs one search for the nearest place.
//!
//! The places are where other photons arrive than those that are counted: about as dense as the light, but independent of the counted ones. With
//! places at the counted photons themselves, thin spots of the cloud have the larger surroundings and are looked up more often: 1.5 to 2 % of
//! the light would be lost with 64 photons an estimate.

use std::f32::consts::{PI, TAU};
use std::num::NonZero;

use glam::{Mat3, Quat, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use super::{HotSpots, Photon};
use crate::igloo::frame_around;
use crate::surface::Surfaces;
use crate::tally::{self, Work};

/// Normals are alike below this angle's cosine: about 37 degrees.
const LIKE: f32 = 0.8;
/// Rays that measure how much of an estimate's disk lies on the surface.
const PROBES: u32 = 24;
/// How many nearest ones are asked for a like normal, before there is none.
const TRIES: [usize; 2] = [8, 64];

/// Irradiance on the surfaces of a scene.
#[derive(Debug)]
pub struct PhotonMap {
    tree: Tree,
    samples: Vec<Sample>,
    turn: Mat3,
    hot: Option<HotSpots>,
}

/// What a map knows of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Irradiance {
    /// From all light, W/m².
    pub total: Vec3,
    /// From light that was reflected at least once.
    pub indirect: Vec3,
    /// Radius of the disk over which `total` is a mean.
    pub radius: f32,
}

#[derive(Clone, Copy, Debug)]
struct Sample {
    normal: Vec3,
    irradiance: Irradiance,
}

type Tree = ImmutableKdTree<f32, 3>;

/// Axes that no wall of a box is square to: a tree over points with the same coordinate splits badly.
fn turn() -> Mat3 {
    Mat3::from_quat(Quat::from_euler(glam::EulerRot::XYZ, 0.37, 0.71, 1.13))
}

fn tree<'p>(photons: impl Iterator<Item = &'p Photon>, turn: &Mat3) -> Option<Tree> {
    let points: Vec<[f32; 3]> = photons.map(|photon| (*turn * photon.position).to_array()).collect();
    ImmutableKdTree::new_from_slice(&points).ok()
}

impl PhotonMap {
    /// The irradiance by `photons` at `places`, each estimate by the nearest `neighbours`; nothing where there are too few.
    pub fn new(
        photons: Vec<Photon>,
        places: &[Photon],
        surfaces: &Surfaces,
        neighbours: u32,
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Option<Self> {
        let turn = turn();
        let reflected: Vec<Photon> = photons.iter().filter(|photon| !photon.direct).copied().collect();
        let (all, reflected) = (Cloud::new(photons, turn, neighbours)?, Cloud::new(reflected, turn, neighbours)?);
        let samples = places
            .par_iter()
            .map(|at| {
                if cancelled() {
                    return None;
                }
                let (total, radius) = all.estimate(surfaces, at);
                let (indirect, _) = reflected.estimate(surfaces, at);
                Some(Sample { normal: at.normal, irradiance: Irradiance { total, indirect, radius } })
            })
            .collect::<Option<Vec<Sample>>>()?;
        let mut map = Self { tree: tree(places.iter(), &turn)?, samples, turn, hot: None };
        map.hot = HotSpots::find(&all.photons, |photon| map.irradiance(photon.position, photon.normal));
        Some(map)
    }

    /// What it holds, in bytes: the places, and of its tree their coordinates and numbers.
    pub fn bytes(&self) -> u64 {
        (self.samples.len() * (size_of::<Sample>() + size_of::<[f32; 3]>() + size_of::<u32>())) as u64
    }

    /// Where surfaces are so bright that gather rays count a part of it only.
    pub fn hot_spots(&self) -> Option<&HotSpots> {
        self.hot.as_ref()
    }

    /// Number of places at which the irradiance is known.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Never true: a map has places.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Irradiance at a point: that of the nearest place with a like normal, none where there is none near.
    pub fn irradiance(&self, position: Vec3, normal: Vec3) -> Option<Irradiance> {
        tally::add(Work::PhotonLookups, 1);
        let query = (self.turn * position).to_array();
        let like = |item: u32| {
            let sample = &self.samples[item as usize];
            (sample.normal.dot(normal) > LIKE).then_some(sample.irradiance)
        };
        let nearest = self.tree.query(&query).nearest_one::<SquaredEuclidean<f32>>().execute();
        like(nearest.item).or_else(|| {
            TRIES.into_iter().filter_map(NonZero::new).find_map(|tries| {
                let near = self.tree.query(&query).nearest_n::<SquaredEuclidean<f32>>(tries).execute();
                near.iter().find_map(|found| like(found.item))
            })
        })
    }
}

/// Photons to be counted.
struct Cloud {
    photons: Vec<Photon>,
    tree: Tree,
    turn: Mat3,
    neighbours: NonZero<usize>,
}

impl Cloud {
    fn new(photons: Vec<Photon>, turn: Mat3, neighbours: u32) -> Option<Self> {
        let neighbours = NonZero::new(neighbours as usize)?;
        if photons.len() <= neighbours.get() {
            return None;
        }
        Some(Self { tree: tree(photons.iter(), &turn)?, photons, turn, neighbours })
    }

    /// Power of the photons in a disk over the part of its area that lies on the surface, and the disk's radius.
    ///
    /// The furthest photon only says how large the disk is: counted, it would make the mean of the estimate too high by one photon.
    fn estimate(&self, surfaces: &Surfaces, at: &Photon) -> (Vec3, f32) {
        let query = (self.turn * at.position).to_array();
        let near = self.tree.query(&query).nearest_n::<SquaredEuclidean<f32>>(self.neighbours).execute();
        let radius2 = near.iter().map(|found| found.distance).fold(0.0, f32::max);
        if radius2 <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let mut nearest: Vec<u32> =
            near.iter().filter(|found| found.distance < radius2).map(|found| found.item).collect();
        // The order of the sum must not be that of the search.
        nearest.sort_unstable();
        let like = nearest.iter().map(|&item| &self.photons[item as usize]).filter(|p| p.normal.dot(at.normal) > LIKE);
        let power: Vec3 = like.map(|photon| photon.power).sum();
        let radius = radius2.sqrt();
        (power / (PI * radius2 * on_surface(surfaces, at, radius)), radius)
    }
}

/// The share of a disk around a place that lies on a surface of like normal: at an edge or in a corner a part of it lies outside,
/// where no photon arrives.
fn on_surface(surfaces: &Surfaces, at: &Photon, radius: f32) -> f32 {
    let frame = frame_around(at.normal);
    let height = 0.5 * radius;
    let probe = |i: u32| {
        // The golden angle: points of a disk, evenly spread.
        let (sin, cos) = (i as f32 * (TAU * 0.618_034)).sin_cos();
        let r = radius * ((i as f32 + 0.5) / PROBES as f32).sqrt();
        let from = at.position + frame * Vec3::new(r * cos, r * sin, height);
        let met = surfaces.closest(from, -at.normal, 0.0, 2.0 * height);
        met.is_some_and(|met| met.normal.dot(at.normal) > LIKE && met.position.distance(at.position) <= radius * 1.01)
    };
    let on = (0..PROBES).filter(|&i| probe(i)).count().max(1);
    on as f32 / PROBES as f32
}
