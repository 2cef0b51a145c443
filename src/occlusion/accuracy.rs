//! From an accuracy to the settings that reach it: cells of the map and the opening of the tree, refined together.
//!
//! Accuracy is the root mean square error of sky visibility, the mean of Γ over an igloo, over the points that are shaded. Two errors of
//! opposite sign make it up. Γ of a cell takes its hair for evenly spread, which loses the light of gaps and outlines; lumps wider than a
//! cell leave gaps that are not there. Smaller cells with lumps in proportion take both away; where they cancel depends on the hair,
//! so the settings are found on the scene itself ([`calibrate`]).

use rayon::prelude::*;

use super::{ClusterTree, DepthMap, HairRays, Igloo, RaySettings, Receiver, Scratch, Span};
use crate::hair::HairModel;
use crate::hash::hash;

/// How finely hair is projected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// Cells along a side of the map; even.
    pub side: u32,
    /// Largest extent of a lump, in widths of a cell.
    pub opening: f32,
}

/// Sides of maps that are tried, coarsest first. On a surface's hemisphere all of them, since outlines of hair need the finest and they
/// cost less; around hair [`SPHERE_SIDES`] of them: with 8 cells a few points are far off, which a calibration may not have among its own.
const SIDES: [u32; 19] = [8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 32, 40, 48, 56, 64, 80, 96, 128];
const SPHERE_SIDES: std::ops::Range<usize> = 1..16;

/// Openings that are tried, on the sphere around hair and on a surface's hemisphere. Outlines against the sky want larger lumps: there
/// the light lost at the outline is more.
const SPHERE_OPENINGS: [f32; 6] = [1.0, 1.1, 1.2, 1.35, 1.5, 1.75];
const HEMISPHERE_OPENINGS: [f32; 7] = [1.0, 1.15, 1.3, 1.5, 1.75, 2.1, 2.5];

/// Where none is given, in widths of a face: between those that suit hair and surfaces best.
pub const USUAL_OPENING: f32 = 0.85;

/// What is kept of the accuracy asked for against the chance in the points of a calibration.
const MARGIN: f64 = 0.75;

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
        let opening = opening.unwrap_or(USUAL_OPENING) * cells_per_face.sqrt();
        Self { side: side.clamp(4, super::depth_map::LARGEST_SIDE).div_ceil(2) * 2, opening }
    }
}

/// A point at which settings are judged.
#[derive(Clone, Debug)]
pub struct Site {
    pub receiver: Receiver,
    /// Distance of the first opaque surface in each face; none where there are no surfaces.
    pub far: Option<Vec<f32>>,
}

impl From<Receiver> for Site {
    /// With nothing behind the hair.
    fn from(receiver: Receiver) -> Self {
        Self { receiver, far: None }
    }
}

/// Mean of Γ over an igloo, in two parts: the faces that end in the sky, and those that end at a surface. Their light differs, so an
/// error of one is not made good by the other's.
#[derive(Clone, Copy, Debug, Default)]
struct Visibility {
    sky: f64,
    surfaces: f64,
}

impl Visibility {
    fn of(gamma: &[f32], far: Option<&[f32]>) -> Self {
        let mut sums = [0.0; 2];
        for (face, &gamma) in gamma.iter().enumerate() {
            sums[usize::from(far.is_some_and(|far| far[face] < f32::INFINITY))] += f64::from(gamma);
        }
        let [sky, surfaces] = sums.map(|sum| sum / gamma.len() as f64);
        Self { sky, surfaces }
    }

    fn middle(a: Self, b: Self) -> Self {
        Self { sky: 0.5 * (a.sky + b.sky), surfaces: 0.5 * (a.surfaces + b.surfaces) }
    }

    /// Squared difference of both parts.
    fn distance2(a: Self, b: Self) -> f64 {
        (a.sky - b.sky).powi(2) + (a.surfaces - b.surfaces).powi(2)
    }
}

/// Sky visibility by rays at some points of one kind, from two independent halves of the rays.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The mean of both halves, a point.
    visibility: Vec<Visibility>,
    /// Mean square of the noise in it.
    pub noise2: f64,
    /// Rays a point, both halves together.
    pub rays: u32,
    /// Crossings that such a ray meets, in the mean.
    pub crossings: f64,
}

/// Purpose of the random numbers of a reference.
const REFERENCE: u32 = 0x4341_4C49;

impl Reference {
    /// By enough rays to judge an accuracy: noise of a third of it where Γ is as rough as it gets (deviation 1/4 a ray). Nothing where
    /// `cancelled` says to stop.
    pub fn for_accuracy(
        rays: &HairRays,
        model: &HairModel,
        sites: &[Site],
        igloo: &Igloo,
        accuracy: f64,
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Option<Self> {
        // Rounded up to whole rays a face in each half.
        let count = 2.0 * (0.5 / accuracy).powi(2).clamp(512.0, 8192.0);
        let open = vec![f32::INFINITY; igloo.len()];
        let per_half = (count as u32).div_ceil(2).next_multiple_of(igloo.len() as u32);
        let settings = RaySettings::fastest(per_half);
        let value = |(index, site): (usize, &Site)| {
            let far = site.far.as_deref().unwrap_or(&open);
            let mut gamma = vec![0.0; igloo.len()];
            let halves = [0, 1].map(|half| {
                let key = hash(&[REFERENCE, index as u32, half]);
                rays.transmittances(model, &site.receiver, igloo, &settings, far, key, &mut gamma);
                Visibility::of(&gamma, site.far.as_deref())
            });
            (halves, rays.crossings_met(model, &site.receiver, igloo, far))
        };
        let value = |site| (!cancelled()).then(|| value(site));
        let values: Vec<([Visibility; 2], f64)> = sites.par_iter().enumerate().map(value).collect::<Option<_>>()?;
        let n = sites.len().max(1) as f64;
        Some(Self {
            visibility: values.iter().map(|&([a, b], _)| Visibility::middle(a, b)).collect(),
            noise2: values.iter().map(|&([a, b], _)| 0.25 * Visibility::distance2(a, b)).sum::<f64>() / n,
            rays: 2 * per_half,
            crossings: values.iter().map(|(_, crossings)| crossings).sum::<f64>() / n,
        })
    }

    /// Rays a point whose root mean square error is this accuracy.
    pub fn rays_for(&self, accuracy: f64) -> u32 {
        (f64::from(self.rays) * self.noise2 / accuracy.powi(2)).ceil().clamp(1.0, 1e7) as u32
    }
}

/// What a calibration found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    pub fineness: Fineness,
    /// Root mean square error of sky visibility at the points, the noise of the reference taken away.
    pub error: f64,
    /// Whether that is within the accuracy asked for, with a margin for the choice of points.
    pub reached: bool,
    /// Work of a query, in lanes of kernels.
    pub work: f64,
}

/// Finds the cheapest settings whose error at the reference's points is within `accuracy`; nothing where `cancelled` says to stop.
///
/// There is at least one point, all of the igloo's kind. What it finds depends on its arguments alone, not on threads or time.
pub fn calibrate(
    tree: &ClusterTree,
    model: &HairModel,
    sites: &[Site],
    igloo: &Igloo,
    reference: &Reference,
    accuracy: f64,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Option<Calibration> {
    let trial = Trial { tree, model, sites, igloo, reference, cancelled };
    let (sides, openings) = match igloo.span() {
        Span::Sphere => (&SIDES[SPHERE_SIDES], &SPHERE_OPENINGS[..]),
        Span::Hemisphere => (&SIDES[..], &HEMISPHERE_OPENINGS[..]),
    };
    let mut best: Option<Calibration> = None;
    for &side in sides {
        let map = DepthMap::new(igloo, side);
        for &opening in openings {
            let fineness = Fineness { side, opening };
            let (error, work) = trial.judge(&map, fineness)?;
            let found = Calibration { fineness, error, reached: error <= MARGIN * accuracy, work };
            let better = |than: &Calibration| match (found.reached, than.reached) {
                (true, true) => found.work < than.work,
                (false, false) => found.error < than.error,
                (reached, _) => reached,
            };
            if best.as_ref().is_none_or(better) {
                best = Some(found);
            }
        }
        // Finer maps cost more; only the next one's larger lumps may be cheaper yet.
        if best.as_ref().is_some_and(|best| best.reached && side > best.fineness.side) {
            break;
        }
    }
    best
}

/// What settings are tried on.
struct Trial<'a, C> {
    tree: &'a ClusterTree,
    model: &'a HairModel,
    sites: &'a [Site],
    igloo: &'a Igloo,
    reference: &'a Reference,
    cancelled: &'a C,
}

impl<C: Fn() -> bool + Sync> Trial<'_, C> {
    /// Root mean square error at the points, without the reference's noise, and work of a query.
    fn judge(&self, map: &DepthMap, fineness: Fineness) -> Option<(f64, f64)> {
        let value = |(scratch, gamma): &mut (Scratch, Vec<f32>), site: &Site| {
            if (self.cancelled)() {
                return None;
            }
            gamma.resize(self.igloo.len(), 0.0);
            let before = scratch.work;
            let (receiver, far) = (&site.receiver, site.far.as_deref());
            self.tree.transmittances(self.model, receiver, map, fineness.angle(map), far, gamma, scratch);
            Some((Visibility::of(gamma, far), scratch.work - before))
        };
        let values: Vec<(Visibility, u64)> =
            self.sites.par_iter().map_init(|| (Scratch::default(), Vec::new()), value).collect::<Option<_>>()?;
        let n = values.len().max(1) as f64;
        let truths = &self.reference.visibility;
        let square = values.iter().zip(truths).map(|(&(value, _), &truth)| Visibility::distance2(value, truth));
        let error = (square.sum::<f64>() / n - self.reference.noise2).max(0.0).sqrt();
        Some((error, values.iter().map(|(_, work)| *work as f64).sum::<f64>() / n))
    }
}
