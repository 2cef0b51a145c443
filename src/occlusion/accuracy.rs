//! From an accuracy to the settings that reach it: cells of the map and the opening of the tree, refined together.
//!
//! Accuracy is the root mean square error of sky visibility, the mean of Γ over an igloo, over the points that are shaded. Two errors of
//! opposite sign make it up. Γ of a cell takes its hair for evenly spread, which loses the light of gaps and outlines; lumps wider than a
//! cell leave gaps that are not there. Smaller cells with lumps in proportion take both away; where they cancel depends on the hair,
//! so the settings are found on the scene itself ([`calibrate`]), or taken from a table that holds for any ([`Fineness::for_accuracy`]).

use rayon::prelude::*;

use super::{ClusterTree, DepthMap, HairRays, Igloo, RaySettings, Receiver, Scratch, Span};
use crate::hair::HairModel;

/// How finely hair is projected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// Cells along a side of the map; even.
    pub side: u32,
    /// Largest extent of a lump, in widths of a cell.
    pub opening: f32,
}

/// Sides of maps that are tried, coarsest first.
const SIDES: [u32; 14] = [8, 10, 12, 14, 16, 18, 20, 24, 28, 32, 40, 48, 56, 64];

/// Openings that are tried, on the sphere around hair and on a surface's hemisphere. Outlines against the sky want larger lumps: there
/// the light lost at the outline is more.
const SPHERE_OPENINGS: [f32; 5] = [1.0, 1.1, 1.2, 1.35, 1.5];
const HEMISPHERE_OPENINGS: [f32; 5] = [1.15, 1.3, 1.5, 1.75, 2.1];

/// What is kept of the accuracy asked for against the chance in the points of a calibration.
const MARGIN: f64 = 0.85;

impl Fineness {
    /// The map for an igloo.
    pub fn map(self, igloo: &Igloo) -> DepthMap {
        DepthMap::new(igloo, self.side)
    }

    /// The opening in radians.
    pub fn angle(self, map: &DepthMap) -> f32 {
        self.opening * map.cell_width()
    }

    /// The settings that go with a number of faces a hemisphere and an opening in widths of a face; the usual one where none.
    ///
    /// A face of a sphere is two cells, one of a hemisphere four.
    pub fn for_faces(span: Span, per_hemisphere: u32, opening: Option<f32>) -> Self {
        let side = (2.0 * f64::from(per_hemisphere).sqrt()).ceil() as u32;
        let cells_per_face = if span == Span::Sphere { 2.0_f32 } else { 4.0 };
        let opening = opening.unwrap_or(0.75) * cells_per_face.sqrt();
        Self { side: side.clamp(4, super::depth_map::LARGEST_SIDE).div_ceil(2) * 2, opening }
    }
}

/// What a calibration found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    pub fineness: Fineness,
    /// Root mean square error of sky visibility at the points, the noise of the reference taken away.
    pub error: f64,
    /// Whether that is within the accuracy asked for.
    pub reached: bool,
    /// Rays a point that have this accuracy, by the noise of the reference.
    pub rays: u32,
    /// Work of a query, in lanes of kernels.
    pub work: f64,
}

/// Sky visibility by rays at some points, from two independent halves of the rays.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The mean of both halves.
    pub visibility: Vec<f64>,
    /// Mean square of the noise in `visibility`.
    pub noise2: f64,
    /// Rays a point, both halves together.
    pub rays: u32,
}

impl Reference {
    /// By `rays` rays a point, with nothing behind the hair. Points that share `span`.
    pub fn trace(rays: &HairRays, model: &HairModel, receivers: &[Receiver], igloo: &Igloo, count: u32) -> Self {
        let far = vec![f32::INFINITY; igloo.len()];
        let settings = RaySettings::fastest(count.div_ceil(2));
        let half = |key: u32, receiver: &Receiver| {
            let mut gamma = vec![0.0; igloo.len()];
            rays.transmittances(model, receiver, igloo, &settings, &far, key, &mut gamma);
            mean(&gamma)
        };
        let halves: Vec<[f64; 2]> = receivers
            .par_iter()
            .enumerate()
            .map(|(i, receiver)| [0, 1].map(|k| half(0x4341_4C49 ^ (2 * i as u32 + k), receiver)))
            .collect();
        let noise2 = halves.iter().map(|[a, b]| 0.25 * (a - b).powi(2)).sum::<f64>() / halves.len().max(1) as f64;
        Self { visibility: halves.iter().map(|[a, b]| 0.5 * (a + b)).collect(), noise2, rays: count }
    }
}

/// Rays a point of a reference that judges an accuracy: noise of half of it where Γ is as rough as it gets (deviation 1/4 a ray).
fn reference_rays(accuracy: f64) -> u32 {
    (0.25 / accuracy).powi(2).clamp(128.0, 8192.0) as u32 * 2
}

/// Finds the cheapest settings whose error at the given points is within `accuracy`.
///
/// `igloo` is that of the points, which are at least one. What it finds depends on its arguments alone, not on threads or time.
pub fn calibrate(
    tree: &ClusterTree,
    rays: &HairRays,
    model: &HairModel,
    receivers: &[Receiver],
    igloo: &Igloo,
    accuracy: f64,
) -> Calibration {
    let reference = Reference::trace(rays, model, receivers, igloo, reference_rays(accuracy));
    let openings = if igloo.span() == Span::Sphere { SPHERE_OPENINGS } else { HEMISPHERE_OPENINGS };
    let mut best: Option<Calibration> = None;
    for side in SIDES {
        let map = DepthMap::new(igloo, side);
        for opening in openings {
            let fineness = Fineness { side, opening };
            let found = judge(tree, model, receivers, igloo, &map, fineness, &reference, accuracy);
            let better = |than: &Calibration| match (found.reached, than.reached) {
                (true, true) => found.work < than.work,
                (false, false) => found.error < than.error,
                (reached, _) => reached,
            };
            if best.as_ref().is_none_or(better) {
                best = Some(found);
            }
        }
        // Finer maps cost more: two more sides after the first that is enough, whose larger lumps may be cheaper yet.
        if best.as_ref().is_some_and(|best| best.reached && side > best.fineness.side) {
            break;
        }
    }
    best.expect("there are settings to try")
}

#[expect(clippy::too_many_arguments, reason = "one measurement in full")]
fn judge(
    tree: &ClusterTree,
    model: &HairModel,
    receivers: &[Receiver],
    igloo: &Igloo,
    map: &DepthMap,
    fineness: Fineness,
    reference: &Reference,
    accuracy: f64,
) -> Calibration {
    let value = |(scratch, gamma): &mut (Scratch, Vec<f32>), receiver: &Receiver| {
        gamma.resize(igloo.len(), 0.0);
        let before = scratch.work;
        tree.transmittances(model, receiver, map, fineness.angle(map), None, gamma, scratch);
        (mean(gamma), scratch.work - before)
    };
    let values: Vec<(f64, u64)> = receivers.par_iter().map_init(|| (Scratch::default(), Vec::new()), value).collect();
    let n = values.len() as f64;
    let square = values.iter().zip(&reference.visibility).map(|((value, _), truth)| (value - truth).powi(2));
    let error = (square.sum::<f64>() / n - reference.noise2).max(0.0).sqrt();
    Calibration {
        fineness,
        error,
        reached: error <= MARGIN * accuracy,
        rays: (f64::from(reference.rays) * reference.noise2 / accuracy.powi(2)).ceil().max(1.0) as u32,
        work: values.iter().map(|(_, work)| *work as f64).sum::<f64>() / n,
    }
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
}
