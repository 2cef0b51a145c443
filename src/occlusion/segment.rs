//! One segment by itself: what of it counts for a receiver, and the layers that it puts over the faces (paper, Eq. 7).
//!
//! Positions are relative to the receiver, along render space's axes. Every selection of segments ends here, whether it is a tree's
//! near hair, a thinned set or all of them.

use super::layer::optical_depth;
use super::projection::{Piece, SLICE_WIDTH, Segment, project};
use super::{Projection, Receiver, tangent};
use crate::hair::HairModel;
use crate::igloo::Igloo;

/// Mean chord of a square of side 1 under random lines, each weighted by its length: what a point of a strand lies on.
pub const MEAN_CHORD: f32 = 0.9463;

/// Up to two parts of a segment, as parameters from 0 to 1 along it.
pub type Parts = [Option<[f32; 2]>; 2];

/// The whole segment.
pub const WHOLE: Parts = [Some([0.0, 1.0]), None];

/// What of a segment counts: of the receiver's own strand what lies outside `OnStrand::excluded`, of others all.
#[inline]
pub fn counted(model: &HairModel, receiver: &Receiver, segment: usize) -> Parts {
    match receiver.on {
        Some(on) if model.strand[segment] == on.strand => outside(on.excluded(), model.arcs(segment)),
        _ => WHOLE,
    }
}

/// The parts of the arc range `arcs` outside `excluded`, as parameters 0 to 1 along it.
fn outside(excluded: [f32; 2], arcs: [f32; 2]) -> Parts {
    let length = arcs[1] - arcs[0];
    let before = ((excluded[0] - arcs[0]) / length).min(1.0);
    let after = ((excluded[1] - arcs[0]) / length).max(0.0);
    [(before > 0.0).then_some([0.0, before]), (after < 1.0).then_some([after, 1.0])]
}

/// The faces that segments are projected on, and how: the same for all segments of a query.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    pub receiver: &'a Receiver,
    pub igloo: &'a Igloo,
    /// Distance of the first opaque surface in each face.
    pub far: &'a [f32],
    projection: Projection,
    /// 1 / solid angle of a face.
    face_weight: f32,
    /// Share of a face that a strand of angular width 1 covers where it crosses the face.
    crossing: f32,
}

impl<'a> Target<'a> {
    /// The target for one receiver.
    pub fn new(receiver: &'a Receiver, igloo: &'a Igloo, far: &'a [f32], projection: Projection) -> Self {
        Self {
            receiver,
            igloo,
            far,
            projection,
            face_weight: 1.0 / igloo.face_solid_angle(),
            crossing: MEAN_CHORD / igloo.face_width(),
        }
    }

    /// Adds the layers of the `parts` of a segment to the faces' optical depths, times `weight`.
    ///
    /// `opacity` is the share of the light that is lost where a given length of the segment is seen.
    pub fn add(
        &self,
        segment: &Segment,
        parts: Parts,
        opacity: impl Fn(f32) -> f32,
        weight: f32,
        depth: &mut [f32],
        pieces: &mut Vec<Piece>,
    ) {
        let Segment { a, b, widths } = *segment;
        let rotate = self.receiver.frame.transpose();
        for [from, to] in parts.into_iter().flatten() {
            let at = |u: f32| {
                if u == 0.0 {
                    a
                } else if u == 1.0 {
                    b
                } else {
                    a + (b - a) * u
                }
            };
            let width = |u: f32| widths[0] + (widths[1] - widths[0]) * u;
            let part = Segment { a: rotate * at(from), b: rotate * at(to), widths: [width(from), width(to)] };
            let far_of = |face: usize| self.far[face];
            match self.projection {
                Projection::Sphere => project(self.igloo, &part, SLICE_WIDTH, &far_of, pieces),
                Projection::TangentPlane => tangent::project(self.igloo, &part, &far_of, pieces),
            }
            for piece in pieces.iter() {
                let opacity = opacity(piece.length);
                let covered = piece.solid_angle * self.face_weight;
                // A narrow strand goes on where the segment ends: its layer is the strand's (see `lanes`), in proportion. Pieces
                // without an apparent width are layers by themselves.
                let crossing = self.crossing * piece.apparent_width;
                let layer = if crossing > 0.0 {
                    optical_depth(crossing, opacity) * (covered / crossing)
                } else {
                    optical_depth(covered, opacity)
                };
                depth[piece.face as usize] += weight * layer;
            }
        }
    }
}
