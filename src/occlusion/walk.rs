//! One receiver's way through the tree of clusters.

use super::Receiver;
use super::clusters::{ClusterTree, Scratch, Selection};
use super::lanes::{Block, Far, LANES, Node, Thread, View, bits, prefetch};
use super::layer::Transmittance;
use super::projection::{Piece, SLICE_WIDTH, Segment};
use super::segment::{Target, WHOLE, counted};
use super::{Projection, Thinning};
use crate::hair::HairModel;
use crate::igloo::{Igloo, Span};

/// Lumps of a smaller angular radius than this many face widths are given to one face of a cut.
const PART: f32 = 0.7;

/// From a surface, hair has an outline, which lumps blur: they must be smaller by this factor there.
const OUTLINE_CAUTION: f32 = 0.5;

/// What is the same on the whole way.
pub struct Walk<'a> {
    tree: &'a ClusterTree,
    receiver: &'a Receiver,
    igloo: &'a Igloo,
    selection: Selection,
    view: View,
    far: &'a [f32],
    depth: &'a mut [f32],
    model: &'a HairModel,
    /// Where segments by themselves go.
    target: Target<'a>,
    /// Square of the angular radius (`PART`) below which a lump is given to one face of `igloo`.
    part2: f32,
    /// Where `igloo` is a cut seen from hair: the whole faces, which wider lumps go to.
    whole: Option<Whole<'a>>,
}

/// The faces that an igloo's faces are parts of. A lump wider than a part is spread over the whole face: put into one part it would
/// leave the others too free.
pub struct Whole<'a> {
    pub face: &'a [u32],
    /// Share of a face that a part is.
    pub share: f32,
    /// Optical depths of the faces; added to.
    pub depth: &'a mut [f32],
}

impl<'a> Walk<'a> {
    /// `depth` is added to; lumps are opened and ribbons sliced by `width`, the face width that is asked for, of which `igloo` may hold a finer cut.
    #[expect(clippy::too_many_arguments, reason = "one query in full: where, over what, how finely")]
    pub fn new(
        tree: &'a ClusterTree,
        receiver: &'a Receiver,
        igloo: &'a Igloo,
        width: f32,
        selection: Selection,
        far: &'a [f32],
        depth: &'a mut [f32],
        model: &'a HairModel,
        whole: Option<Whole<'a>>,
    ) -> Self {
        let caution = if igloo.span() == Span::Hemisphere { OUTLINE_CAUTION } else { 1.0 };
        let limit = match selection {
            // Half a radian at most: nearer than twice its radius no cluster is a lump.
            Selection::Clusters { opening } => (opening * caution * width).min(0.5).powi(2),
            _ => 0.0,
        };
        let slice = SLICE_WIDTH * width;
        let part2 = (PART * igloo.face_width()).powi(2);
        let view = View::new(receiver.position, receiver.frame, igloo, limit, slice);
        let target = Target::new(receiver, igloo, far, Projection::Sphere).sliced(slice / igloo.face_width());
        Self { tree, receiver, igloo, selection, view, far, depth, model, target, part2, whole }
    }

    /// Goes from the root to all that is near.
    pub fn run(mut self, scratch: &mut Scratch) {
        let tree = self.tree;
        let Some(top) = tree.levels.len().checked_sub(1) else { return };
        let Scratch { pieces, stack, .. } = scratch;
        stack.clear();
        stack.push((top as u32, 0));
        while let Some((level, index)) = stack.pop() {
            let node = &tree.levels[level as usize][index as usize];
            let far = self.view.node(node);
            for lane in bits(far.near) {
                if level == 0 {
                    prefetch(&tree.blocks[(index * LANES as u32 + lane) as usize]);
                } else {
                    prefetch(&tree.levels[level as usize - 1][(index * LANES as u32 + lane) as usize]);
                }
            }
            self.give_lumps(&far, |lane| node.radius[lane]);
            for lane in bits(far.near) {
                if self.passes_by(node, lane as usize, far.distance2[lane as usize]) {
                    continue;
                }
                if let Some(bundle) = self.bundle(node, lane as usize) {
                    let thickness = node.thickness[lane as usize];
                    self.give_lumps(&bundle, |_| thickness);
                    continue;
                }
                let child = index * LANES as u32 + lane;
                if level == 0 {
                    self.block(&tree.blocks[child as usize], pieces);
                } else {
                    stack.push((level - 1, child));
                }
            }
        }
    }

    /// Gives clusters' optical depths to their faces: where the igloo holds parts, those that are wider than a part to whole faces.
    #[inline]
    fn give_lumps(&mut self, lanes: &Far, radius: impl Fn(usize) -> f32) {
        let Some(whole) = &mut self.whole else { return self.give(lanes) };
        let faces = self.igloo.lookup().faces();
        for lane in 0..lanes.count {
            let part = faces[lanes.cell[lane] as usize] as usize;
            let (far, distance2, radius) = (self.far[part], lanes.distance2[lane], radius(lane));
            let depth = if distance2 < far * far { lanes.depth[lane] } else { 0.0 };
            if radius * radius < self.part2 * distance2 {
                self.depth[part] += depth;
            } else {
                whole.depth[whole.face[part] as usize] += depth * whole.share;
            }
        }
    }

    /// Gives the far lanes' optical depths to their faces.
    #[inline]
    fn give(&mut self, lanes: &Far) {
        let faces = self.igloo.lookup().faces();
        for lane in 0..lanes.count {
            let face = faces[lanes.cell[lane] as usize] as usize;
            let far = self.far[face];
            self.depth[face] += if lanes.distance2[lane] < far * far { lanes.depth[lane] } else { 0.0 };
        }
    }

    /// A lane that is too large for one lump may still be a thin bundle.
    #[inline]
    fn bundle(&self, node: &Node, lane: usize) -> Option<Far> {
        matches!(self.selection, Selection::Clusters { .. }).then(|| self.view.bundle(node, lane)).flatten()
    }

    /// Whether thinning leaves out everything in a lane: it keeps most where the hair is nearest.
    fn passes_by(&self, node: &Node, lane: usize, distance2: f32) -> bool {
        match self.selection {
            Selection::Thinned { fraction, distance_unit } => {
                let nearest = (distance2.sqrt() - node.radius[lane]).max(0.0);
                node.least_hash[lane] >= Thinning { fraction, distance_unit }.share(nearest)
            }
            _ => false,
        }
    }

    fn block(&mut self, block: &Block, pieces: &mut Vec<Piece>) {
        let mut far = self.view.block(block);
        if !matches!(self.selection, Selection::Thinned { .. }) {
            self.give(&far);
        }
        if matches!(self.selection, Selection::Clusters { .. }) && self.tree.rule == Transmittance::Crossing {
            let view = self.view;
            // As many segments at once as pay for the lanes that stay idle.
            for (count, lanes) in [(2, far.in_two), (4, far.in_four)] {
                let lanes = lanes & !self.own(block, lanes);
                if lanes.count_ones() > 2 {
                    view.lumps_of(block, count, lanes, |lumps| self.give(lumps));
                    far.near &= !lanes;
                }
            }
        }
        for lane in bits(far.near) {
            let lane = lane as usize;
            if block.segment[lane] == u32::MAX {
                break;
            }
            let weight = match self.selection {
                Selection::Thinned { fraction, distance_unit } => {
                    let share = Thinning { fraction, distance_unit }.share(far.distance2[lane].sqrt());
                    if block.hash[lane] >= share {
                        continue;
                    }
                    1.0 / share
                }
                _ => 1.0,
            };
            self.near_segment(block, lane, weight, pieces);
        }
    }

    /// Those of a block's lanes that are of the receiver's own strand.
    fn own(&self, block: &Block, lanes: u32) -> u32 {
        let Some(on) = self.receiver.on else { return 0 };
        let own = bits(lanes).filter(|&lane| self.model.strand[block.segment[lane as usize] as usize] == on.strand);
        own.fold(0, |mask, lane| mask | 1 << lane)
    }

    fn near_segment(&mut self, block: &Block, lane: usize, weight: f32, pieces: &mut Vec<Piece>) {
        let [a, b] = block.ends(lane).map(|end| end - self.receiver.position);
        let widths = [block.widths[0][lane], block.widths[1][lane]];
        let segment = block.segment[lane] as usize;
        let parts = counted(self.model, self.receiver, segment);
        // Where the opacity depends on the length in a face, pieces must be whole.
        if parts == WHOLE && self.tree.rule == Transmittance::Crossing {
            let thread = Thread { a, along: b - a, widths, opacity: block.opacity[lane] };
            if let Some(far) = self.view.segment(&thread) {
                self.give(&far);
                return;
            }
        }
        let opacity = |length| match self.tree.rule {
            Transmittance::Crossing => block.opacity[lane],
            rule => rule.opacity(self.model.transparency[segment], length),
        };
        self.target.add(&Segment { a, b, widths }, parts, opacity, weight, self.depth, pieces);
    }
}
