//! Γ from strands one by one: all of them, or the paper's thinned sets (5.1, 5.2), without a tree.
//!
//! Strands are ordered by a hash, so that 5.1's share of them is the start of the order, and a smaller share the start of a larger
//! one. View-dependent thinning keeps a strand up to the distance where its share falls below the strand's hash; a run of segments
//! that is farther away as a whole is passed by at the cost of one distance. The optical depth of what is kept is scaled up by as
//! much as was left out (Eq. 13), which is right in the mean over strands.
//!
//! Layers lie over whole faces, as in the paper: the faces' parts (`Igloo::parts`) are not used.

use glam::Vec3;

use super::layer::Transmittance;
use super::projection::{Piece, Segment};
use super::segment::{Target, counted};
use super::{Projection, Receiver};
use crate::hair::HairModel;
use crate::igloo::Igloo;

/// Segments of a run at most.
const RUN: usize = 16;

/// Rounding of a run's distance and radius, as a share of either; a run is passed by only beyond it.
const ROUNDING: f32 = 1e-5;

/// How much of the hair is used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thinning {
    /// Share of the strands that is used everywhere (5.1), above 0 to 1.
    pub fraction: f32,
    /// At n times this distance one in n of those is used (5.2); infinite for no view-dependent thinning. In render space.
    pub distance_unit: f32,
}

impl Thinning {
    /// All hair.
    pub const NONE: Self = Self { fraction: 1.0, distance_unit: f32::INFINITY };

    /// The share of the strands that is kept at a distance: `fraction` / n with n = ⌊z / unit + 1/2⌋, at least 1.
    #[inline]
    pub fn share(&self, distance: f32) -> f32 {
        self.fraction / (distance / self.distance_unit + 0.5).floor().max(1.0)
    }
}

/// Successive segments of one strand.
#[derive(Clone, Copy, Debug)]
struct Run {
    hash: f32,
    first: u32,
    count: u32,
    /// A ball that holds the middles of the segments.
    center: Vec3,
    radius: f32,
}

/// The strands of a model by hash.
#[derive(Debug)]
pub struct ThinnedSegments {
    runs: Vec<Run>,
    rule: Transmittance,
}

impl ThinnedSegments {
    /// Orders the strands of a model.
    pub fn build(model: &HairModel, rule: Transmittance) -> Self {
        let mut runs = Vec::with_capacity(model.segments() / RUN + model.object.len());
        let mut first = 0;
        while first < model.segments() {
            let strand = model.strand[first];
            let end = model.segments().min(first + RUN);
            let count = model.strand[first..end].iter().take_while(|&&s| s == strand).count();
            let middles = || (first..first + count).map(|segment| middle(model, segment));
            let center = middles().sum::<Vec3>() / count as f32;
            let radius = middles().map(|middle| middle.distance(center)).fold(0.0, f32::max);
            runs.push(Run { hash: strand_hash(strand), first: first as u32, count: count as u32, center, radius });
            first += count;
        }
        // The index decides between equal hashes: sums do not depend on the sort.
        runs.sort_unstable_by(|a, b| a.hash.total_cmp(&b.hash).then(a.first.cmp(&b.first)));
        Self { runs, rule }
    }

    /// Memory held, in bytes.
    pub fn bytes(&self) -> usize {
        self.runs.len() * size_of::<Run>()
    }

    /// Visits the segments that are used for a point, each with the factor that stands for the others.
    pub fn selected(&self, model: &HairModel, position: Vec3, thinning: &Thinning, mut visit: impl FnMut(usize, f32)) {
        let end = self.runs.partition_point(|run| run.hash < thinning.fraction);
        let everywhere = thinning.distance_unit == f32::INFINITY;
        for run in &self.runs[..end] {
            if everywhere {
                for segment in run.first..run.first + run.count {
                    visit(segment as usize, 1.0 / thinning.fraction);
                }
                continue;
            }
            let nearest = position.distance(run.center) * (1.0 - ROUNDING) - run.radius * (1.0 + ROUNDING);
            if run.hash >= thinning.share(nearest.max(0.0)) {
                continue;
            }
            for segment in run.first..run.first + run.count {
                let share = thinning.share(position.distance(middle(model, segment as usize)));
                if run.hash < share {
                    visit(segment as usize, 1.0 / share);
                }
            }
        }
    }

    /// Adds the optical depth of the hair in each face to `depth`. `far[face]` is the distance of the first opaque surface.
    #[expect(clippy::too_many_arguments, reason = "one query in full: where, over what, how finely")]
    pub fn optical_depths(
        &self,
        receiver: &Receiver,
        igloo: &Igloo,
        thinning: &Thinning,
        projection: Projection,
        far: &[f32],
        depth: &mut [f32],
        model: &HairModel,
        scratch: &mut Vec<Piece>,
    ) {
        let target = Target::new(receiver, igloo, far, projection);
        self.selected(model, receiver.position, thinning, |index, weight| {
            let [a, b] = model.ends(index).map(|end| end - receiver.position);
            let segment = Segment { a, b, widths: model.widths(index) };
            let opacity = |length| self.rule.opacity(model.transparency[index], length);
            target.add(&segment, counted(model, receiver, index), opacity, weight, depth, scratch);
        });
    }
}

fn middle(model: &HairModel, segment: usize) -> Vec3 {
    let [a, b] = model.ends(segment);
    a + 0.5 * (b - a)
}

/// A uniform number in [0, 1) for each strand: thinning keeps strands below a bound, so a thinner set lies in a denser one.
pub(super) fn strand_hash(strand: u32) -> f32 {
    let mut x = strand.wrapping_mul(0x9E37_79B9) ^ 0x85EB_CA6B;
    x = (x ^ (x >> 16)).wrapping_mul(0x21F0_AAAD);
    x = (x ^ (x >> 15)).wrapping_mul(0x735A_2D97);
    ((x ^ (x >> 15)) >> 8) as f32 / (1 << 24) as f32
}
