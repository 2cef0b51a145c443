//! One receiver's way through the tree of clusters.

use super::clusters::ClusterTree;
use super::depth_map::Corners;
use super::lanes::{self, ALL, Block, LANES, Lanes, Node, Rods, Splat, View, bits, prefetch};
use super::query::Scratch;
use super::ribbon::{self, Ribbon};
use super::segment::counted;
use super::{DepthMap, Receiver};
use crate::hair::HairModel;

/// One query: what is the same on the whole way.
pub struct Walk<'a> {
    pub tree: &'a ClusterTree,
    pub receiver: &'a Receiver,
    pub map: &'a DepthMap,
    pub view: View,
    /// Distance of the first opaque surface in each cell of the map; none where there are no surfaces.
    pub far: Option<&'a [f32]>,
    pub model: &'a HairModel,
}

/// Rods and segments that are taken in 2, 4 and 8 lumps wait until there are sixteen of a kind.
#[derive(Debug, Default)]
pub struct Queues {
    rods: [(usize, Rods); 3],
    segments: [(usize, Block); 3],
}

/// Numbers of lumps, one a queue.
const COUNTS: [u32; 3] = [2, 4, 8];

/// The queue of a number of lumps.
fn kind(lumps: u32) -> usize {
    lumps.trailing_zeros() as usize - 1
}

impl Walk<'_> {
    /// Gathers all hair in `scratch.depth`.
    #[inline(always)]
    pub fn run(&self, scratch: &mut Scratch) {
        let tree = self.tree;
        let Some(top) = tree.levels.len().checked_sub(1) else { return };
        let mut queues = std::mem::take(&mut scratch.queues);
        scratch.stack.clear();
        scratch.stack.push((top as u32, 0));
        let own = self.receiver.on.map_or(u32::MAX, |on| on.strand);
        while let Some((level, index)) = scratch.stack.pop() {
            let node = &tree.levels[level as usize][index as usize];
            let (splat, distance2, division) = lanes::node(&self.view, node);
            for lane in bits(division.near) {
                let child = (index * LANES as u32 + lane) as usize;
                if level == 0 {
                    prefetch(&tree.blocks[child]);
                } else {
                    prefetch(&tree.levels[level as usize - 1][child]);
                }
            }
            scratch.work += LANES as u64;
            self.give(&splat, &distance2, division.one, &mut scratch.depth);
            for lane in bits(ALL & !(division.one | division.near)) {
                let lane = lane as usize;
                let kind = kind(division.lumps[lane]);
                scratch.work += u64::from(division.lumps[lane]);
                self.queue_rod(node, lane, kind, &mut queues, &mut scratch.depth);
            }
            for lane in bits(division.near) {
                let child = index * LANES as u32 + lane;
                if level == 0 {
                    self.block(&tree.blocks[child as usize], own, &mut queues, scratch);
                } else {
                    scratch.stack.push((level - 1, child));
                }
            }
        }
        for (kind, &count) in COUNTS.iter().enumerate() {
            let (waiting, rods) = &mut queues.rods[kind];
            self.give_rods(rods, count, std::mem::take(waiting), &mut scratch.depth);
            let (waiting, segments) = &mut queues.segments[kind];
            self.give_segments(segments, count, (1 << std::mem::take(waiting)) - 1, &mut scratch.depth);
        }
        scratch.queues = queues;
    }

    /// Adds lumps to their cells.
    #[inline(always)]
    fn give(&self, splat: &Splat<LANES>, distance2: &Lanes, wanted: u32, depth: &mut [Corners]) {
        for lane in bits(wanted) {
            let lane = lane as usize;
            let cell = splat.cell[lane] as usize;
            if let Some(far) = self.far {
                let far = far[cell];
                if distance2[lane] >= far * far {
                    continue;
                }
            }
            lanes::add(&mut depth[cell][lane & 1], &splat.amount[lane]);
        }
    }

    #[inline(always)]
    fn queue_rod(&self, node: &Node, lane: usize, kind: usize, queues: &mut Queues, depth: &mut [Corners]) {
        let (waiting, rods) = &mut queues.rods[kind];
        let at = *waiting;
        for axis in 0..3 {
            rods.center[axis][at] = node.center[axis][lane];
            rods.half[axis][at] = node.half[axis][lane];
        }
        rods.mass[at] = node.mass[lane];
        for i in 0..6 {
            rods.tensor[i][at] = node.tensor[i][lane];
        }
        *waiting += 1;
        if *waiting == LANES {
            *waiting = 0;
            self.give_rods(rods, COUNTS[kind], LANES, depth);
        }
    }

    #[inline(always)]
    fn give_rods(&self, rods: &Rods, count: u32, waiting: usize, depth: &mut [Corners]) {
        let share = 1.0 / count as f32;
        for i in 0..if waiting > 0 { count } else { 0 } {
            let s = (2 * i + 1) as f32 * share - 1.0;
            let (splat, distance2) = lanes::rod_lumps(&self.view, rods, s, share);
            self.give(&splat, &distance2, (1 << waiting) - 1, depth);
        }
    }

    #[inline(always)]
    fn give_segments(&self, block: &Block, count: u32, wanted: u32, depth: &mut [Corners]) {
        let share = 1.0 / count as f32;
        for i in 0..if wanted != 0 { count } else { 0 } {
            let (splat, distance2) = lanes::block_lumps(&self.view, block, (i as f32 + 0.5) * share, share);
            self.give(&splat, &distance2, wanted, depth);
        }
    }

    #[inline(always)]
    fn block(&self, block: &Block, own: u32, queues: &mut Queues, scratch: &mut Scratch) {
        let division = lanes::divide(&self.view, block, own);
        // Two passes, and three for each near segment.
        scratch.work += LANES as u64 * u64::from(2 + 3 * division.near.count_ones());
        self.give_segments(block, 1, division.one, &mut scratch.depth);
        for lane in bits(ALL & !(division.one | division.near)) {
            let lane = lane as usize;
            if block.segment[lane] != u32::MAX {
                scratch.work += u64::from(division.lumps[lane]);
                self.queue_segment(block, lane, kind(division.lumps[lane]), queues, &mut scratch.depth);
            }
        }
        for lane in bits(division.near) {
            self.near_segment(block, lane as usize, scratch);
        }
    }

    #[inline(always)]
    fn queue_segment(&self, block: &Block, lane: usize, kind: usize, queues: &mut Queues, depth: &mut [Corners]) {
        let (waiting, queue) = &mut queues.segments[kind];
        let at = *waiting;
        for axis in 0..3 {
            queue.a[axis][at] = block.a[axis][lane];
            queue.b[axis][at] = block.b[axis][lane];
        }
        for end in 0..2 {
            queue.widths[end][at] = block.widths[end][lane];
        }
        queue.opacity[at] = block.opacity[lane];
        *waiting += 1;
        if *waiting == LANES {
            *waiting = 0;
            self.give_segments(queue, COUNTS[kind], ALL, depth);
        }
    }

    #[inline(always)]
    fn near_segment(&self, block: &Block, lane: usize, scratch: &mut Scratch) {
        let [a, b] = block.ends(lane).map(|end| end - self.receiver.position);
        let widths = [block.widths[0][lane], block.widths[1][lane]];
        let parts = counted(self.model, self.receiver, block.segment[lane] as usize);
        for [from, to] in parts.into_iter().flatten() {
            let ribbon = Ribbon::new(a, b, widths, [from, to], block.opacity[lane]);
            if let Some(ribbon) = ribbon {
                ribbon::gather(&ribbon, &self.view, self.map, self.far, scratch);
            }
        }
    }
}
