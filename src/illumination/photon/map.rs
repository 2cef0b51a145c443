//! Irradiance from photons, found once at every fourth of them (Christensen 1999, "Faster Photon Map Global Illumination"), so that
//! a gather ray costs one search for the nearest.

use std::f32::consts::{PI, TAU};
use std::num::NonZero;

use glam::{Mat3, Quat, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use super::Photon;
use crate::igloo::frame_around;
use crate::surface::Surfaces;

/// Normals are alike below this angle's cosine: about 37 degrees.
const LIKE: f32 = 0.8;
/// One photon in so many has its irradiance found.
const STRIDE: usize = 4;
/// Rays that measure how much of an estimate's disk lies on the surface.
const PROBES: u32 = 24;
/// How many nearest ones are asked for a like normal, before there is none.
const TRIES: [usize; 3] = [1, 8, 64];

/// Irradiance on the surfaces of a scene by light reflected at least once before.
#[derive(Debug)]
pub struct PhotonMap {
    tree: ImmutableKdTree<f32, 3>,
    samples: Vec<Sample>,
    turn: Mat3,
}

#[derive(Clone, Copy, Debug)]
struct Sample {
    normal: Vec3,
    irradiance: Vec3,
}

/// Axes that no wall of a box is square to: a tree over points with the same coordinate splits badly.
fn turn() -> Mat3 {
    Mat3::from_quat(Quat::from_euler(glam::EulerRot::XYZ, 0.37, 0.71, 1.13))
}

fn tree(photons: &[Photon], turn: &Mat3) -> Option<ImmutableKdTree<f32, 3>> {
    let points: Vec<[f32; 3]> = photons.iter().map(|photon| (*turn * photon.position).to_array()).collect();
    ImmutableKdTree::new_from_slice(&points).ok()
}

impl PhotonMap {
    /// The map of these photons; nothing where there are too few for one estimate.
    pub fn new(photons: &[Photon], surfaces: &Surfaces, neighbours: u32) -> Option<Self> {
        let count = NonZero::new(neighbours as usize + 1)?;
        if photons.len() <= count.get() {
            return None;
        }
        let turn = turn();
        let all = tree(photons, &turn)?;
        let chosen: Vec<Photon> = photons.iter().step_by(STRIDE).copied().collect();
        let samples = chosen
            .par_iter()
            .enumerate()
            .map(|(index, at)| {
                let query = (turn * at.position).to_array();
                let near = all.query(&query).nearest_n::<SquaredEuclidean<f32>>(count).execute();
                let near: Vec<(f32, usize)> = near.iter().map(|found| (found.distance, found.item as usize)).collect();
                let irradiance = estimate(photons, surfaces, at, index * STRIDE, &near);
                Sample { normal: at.normal, irradiance }
            })
            .collect();
        Some(Self { tree: tree(&chosen, &turn)?, samples, turn })
    }

    /// Number of points at which the irradiance is known.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Never true: a map has points.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Irradiance at a point: that of the nearest sample with a like normal, none where there is none near.
    pub fn irradiance(&self, position: Vec3, normal: Vec3) -> Vec3 {
        let query = (self.turn * position).to_array();
        let like = |item: u32| {
            let sample = &self.samples[item as usize];
            (sample.normal.dot(normal) > LIKE).then_some(sample.irradiance)
        };
        let nearest = self.tree.query(&query).nearest_one::<SquaredEuclidean<f32>>().execute();
        if let Some(irradiance) = like(nearest.item) {
            return irradiance;
        }
        for tries in TRIES.into_iter().skip(1).filter_map(NonZero::new) {
            let near = self.tree.query(&query).nearest_n::<SquaredEuclidean<f32>>(tries).execute();
            if let Some(irradiance) = near.iter().find_map(|found| like(found.item)) {
                return irradiance;
            }
        }
        Vec3::ZERO
    }
}

/// Power of the photons in a disk over the part of its area that lies on the surface.
///
/// `near` holds squared distance and index of photons around the photon `own`. It does not count itself, and the furthest only
/// says how large the disk is: with either the estimate would be too high by one photon in all.
fn estimate(photons: &[Photon], surfaces: &Surfaces, at: &Photon, own: usize, near: &[(f32, usize)]) -> Vec3 {
    let radius2 = near.iter().map(|(distance2, _)| *distance2).fold(0.0, f32::max);
    if radius2 <= 0.0 {
        return Vec3::ZERO;
    }
    let mut nearest: Vec<usize> = near
        .iter()
        .filter(|(distance2, index)| *distance2 < radius2 && *index != own)
        .map(|(_, index)| *index)
        .collect();
    nearest.sort_unstable();
    let power: Vec3 = nearest
        .iter()
        .map(|&index| &photons[index])
        .filter(|photon| photon.normal.dot(at.normal) > LIKE)
        .map(|photon| photon.power)
        .sum();
    let share = on_surface(surfaces, at, radius2.sqrt());
    power / (PI * radius2 * share)
}

/// The share of a disk around a photon that lies on a surface of like normal: at an edge or in a corner a part of it lies outside,
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
