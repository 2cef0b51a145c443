//! The estimators of Γ on every hard case against brute force in `f64`: the mean of Γ over an igloo.
//!
//! What is bounded is the method's error at fine settings, not only rounding: faces and cells are wider than strands, and hair counts as
//! evenly spread in them. The truth is 40,000 directions of Fibonacci's lattice, good to some 1e-3 on these models.

use std::sync::LazyLock;

use rayon::prelude::*;

use super::hard::{self, Hard};
use super::{Error, Measured, Outcome, truth};
use crate::embree::Device;
use crate::hair::HairModel;
use crate::occlusion::{
    ClusterTree, DepthMap, HairRays, Igloo, Instructions, Projection, RaySettings, Receiver, Scratch, Span,
    ThinnedSegments, Thinning, Transmittance, layer,
};

/// A way to find Γ. Deep shadow maps are in `maps`: they know one lamp's light, not an igloo's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Every segment by itself on an igloo's faces.
    Segments,
    /// A share of the strands (5.2), all of them near the point.
    Thinned,
    /// The tree of clusters.
    Clusters,
    /// Rays.
    Rays,
}

impl Way {
    pub const ALL: [Self; 4] = [Self::Segments, Self::Thinned, Self::Clusters, Self::Rays];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Segments => "all segments",
            Self::Thinned => "thinned",
            Self::Clusters => "clusters",
            Self::Rays => "rays",
        }
    }

    /// The largest error of Γ̄ on any hard case.
    ///
    /// Rays are unbiased: 6,400 of them, of deviation .5 at most, would err by .006 if they were independent; strata make it less, the lattice of the
    /// truth errs as much; two deviations. The others have the error of their faces and cells, largest where ribbons are as wide as their
    /// distance, and at a surface's horizon, where a ribbon counts whole or not at all as its middle line is above or below. Thinning takes one
    /// strand in n for all: with a few strands as wide as their distance that says little.
    pub fn bound(self) -> f64 {
        match self {
            Self::Segments => 0.05,
            Self::Thinned => 0.1,
            Self::Clusters => 0.03,
            Self::Rays => 0.012,
        }
    }
}

/// All ways for one model.
pub struct Ways<'m> {
    model: &'m HairModel,
    segments: ThinnedSegments,
    tree: ClusterTree,
    rays: HairRays,
}

const FACES: u32 = 400;
const SIDE: u32 = 64;

/// Igloos of a sphere and of a hemisphere, with the clusters' maps of them.
static IGLOOS: LazyLock<[(Igloo, DepthMap); 2]> = LazyLock::new(|| {
    [Span::Sphere, Span::Hemisphere].map(|span| {
        let igloo = Igloo::new(span, FACES);
        let map = DepthMap::new(&igloo, SIDE);
        (igloo, map)
    })
});

impl<'m> Ways<'m> {
    /// # Errors
    /// Embree's own.
    pub fn new(model: &'m HairModel) -> Result<Self, Error> {
        let rule = Transmittance::Crossing;
        let rays = HairRays::build(&Device::with_threads(1)?, model, rule)?;
        Ok(Self { model, segments: ThinnedSegments::build(model, rule), tree: ClusterTree::build(model, rule), rays })
    }

    /// Γ̄ of each face.
    pub fn faces(&self, way: Way, receiver: &Receiver, span: Span, instructions: Option<Instructions>) -> Vec<f32> {
        let (igloo, map) = &IGLOOS[usize::from(span == Span::Hemisphere)];
        let far = vec![f32::INFINITY; igloo.len()];
        let mut gamma = vec![0.0; igloo.len()];
        match way {
            Way::Segments | Way::Thinned => {
                let thinning = match way {
                    Way::Segments => Thinning::NONE,
                    _ => Thinning { fraction: 1.0, distance_unit: 0.5 },
                };
                let (on, mut pieces) = (Projection::Sphere, Vec::new());
                self.segments.optical_depths(receiver, igloo, &thinning, on, &far, &mut gamma, self.model, &mut pieces);
                layer::transmittances(&mut gamma);
            }
            Way::Clusters => {
                let best = Instructions::available()[0];
                let mut scratch = Scratch::with_instructions(instructions.unwrap_or(best));
                let opening = 1.2 * map.cell_width();
                self.tree.transmittances(self.model, receiver, map, opening, None, &mut gamma, &mut scratch);
            }
            Way::Rays => {
                let settings = RaySettings::exact(8 * igloo.len() as u32);
                self.rays.transmittances(self.model, receiver, igloo, &settings, &far, 7, &mut gamma);
            }
        }
        gamma
    }

    /// Γ̄ over the igloo, and whether each face's lies from 0 to 1.
    pub fn mean(&self, way: Way, receiver: &Receiver, span: Span) -> (f64, bool) {
        let gamma = self.faces(way, receiver, span, None);
        let mean = gamma.iter().map(|&g| f64::from(g)).sum::<f64>() / gamma.len() as f64;
        (mean, gamma.iter().all(|g| (0.0..=1.0 + 4.0 * f32::EPSILON).contains(g)))
    }
}

/// The igloos that a receiver is looked at with: surfaces have a normal, and then both; hair has a sphere.
fn spans(receiver: &Receiver) -> &'static [Span] {
    if receiver.on.is_some() { &[Span::Sphere] } else { &[Span::Sphere, Span::Hemisphere] }
}

/// One hard case by every way: the largest error over its receivers.
///
/// # Errors
/// Embree's own.
pub fn case(hard: &Hard, directions: u32) -> Result<Vec<(Way, Measured)>, Error> {
    let ways = Ways::new(&hard.model)?;
    let mut worst = Way::ALL.map(|way| (way, Measured { error: 0.0, bound: way.bound() }));
    for receiver in &hard.receivers {
        for &span in spans(receiver) {
            let want = truth::mean_transmittance(&hard.model, receiver, span == Span::Hemisphere, directions);
            for (way, measured) in &mut worst {
                let (got, sane) = ways.mean(*way, receiver, span);
                let error = if sane { (got - want).abs() } else { f64::INFINITY };
                *measured = measured.worse(Measured { error, bound: way.bound() });
            }
        }
    }
    Ok(worst.to_vec())
}

/// Every hard case by every way.
///
/// # Errors
/// Embree's own.
pub fn against_truth(directions: u32) -> Result<Vec<Outcome>, Error> {
    let of_case = |hard: Hard| -> Result<Vec<Outcome>, Error> {
        let outcome = |(way, measured): (Way, Measured)| {
            let name = format!("Γ, {}: {}", hard.name, way.name());
            Outcome { cases: hard.receivers.len() as u32, ..Outcome::one(name, measured) }
        };
        Ok(case(&hard, directions)?.into_iter().map(outcome).collect())
    };
    let outcomes: Vec<Vec<Outcome>> = hard::all().into_par_iter().map(of_case).collect::<Result<_, _>>()?;
    Ok(outcomes.concat())
}

/// The cases of `tress selftest`.
///
/// # Errors
/// Embree's own.
pub fn quick() -> Result<Vec<Outcome>, Error> {
    let mut all = against_truth(8_000)?;
    all.push(Outcome::one("Γ: a hair more never brightens", brighter()?));
    Ok(all)
}

/// By how much one strand more brightens a face.
///
/// Segment by segment, thinned or not (`thinned` says why), and by rays it takes away or does nothing: beyond rounding (of the sum of depths) Γ of no face may rise. In the tree other
/// lumps may form: there the bound is on the mean over the igloo, the lumps' own error.
///
/// # Errors
/// Embree's own.
pub fn brighter() -> Result<Measured, Error> {
    let of_case = |(key, hard): (usize, &Hard)| -> Result<Measured, Error> {
        let mut worst = Measured { error: 0.0, bound: super::U32 };
        // Thousands of layers are summed in another order by no estimator but the tree.
        let more = hard::with_another(hard, key as u32);
        let (before, after) = (Ways::new(&hard.model)?, Ways::new(&more)?);
        for receiver in &hard.receivers {
            for way in [Way::Segments, Way::Thinned, Way::Rays, Way::Clusters] {
                let [a, b] = [&before, &after].map(|ways| ways.faces(way, receiver, Span::Sphere, None));
                let rise = a.iter().zip(&b).map(|(a, b)| f64::from(b - a)).fold(0.0, f64::max);
                let mean = |g: &[f32]| g.iter().map(|&g| f64::from(g)).sum::<f64>() / g.len() as f64;
                worst = worst.worse(match way {
                    Way::Clusters => Measured { error: (mean(&b) - mean(&a)).max(0.0), bound: 2e-3 },
                    // Γ = exp(-τ): n terms of a sum err by n roundoffs of τ e^-τ (at most 1/e).
                    _ => Measured { error: rise, bound: (hard.model.segments() as f64 + 8.0) * super::U32 },
                });
            }
        }
        Ok(worst)
    };
    let of_cases = hard::all().par_iter().enumerate().map(of_case).collect::<Result<Vec<_>, _>>()?;
    Ok(of_cases.into_iter().fold(Measured { error: 0.0, bound: super::U32 }, Measured::worse))
}
