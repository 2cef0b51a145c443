//! One receiver's way through the tree of clusters.

use super::clusters::ClusterTree;
use super::depth_map::Corners;
use super::lanes::{self, ALL, Block, LANES, Lanes, NEAR, Node, OWN, Rods, bits, prefetch};
use super::query::{Far, Scratch};
use super::ribbon::{self, Ribbon};
use super::segment::{Parts, WHOLE, counted};
use super::view::{self, Directions, Splat, View};
use super::{DepthMap, Receiver};
use crate::hair::HairModel;

/// One query: what is the same on the whole way. `OPEN`: there are no surfaces.
pub struct Walk<'a, D, const OPEN: bool> {
    pub tree: &'a ClusterTree,
    pub receiver: &'a Receiver,
    pub map: &'a DepthMap,
    pub view: View<D>,
    /// None where there are no surfaces, and there only.
    pub far: Option<Far<'a>>,
    pub model: &'a HairModel,
}

/// What waits.
#[derive(Debug, Default)]
pub struct Queues {
    lumps: Waiting,
    /// Rods and segments that are taken in 2, 4 and 8 lumps, until there are sixteen of a kind.
    rods: [(usize, Rods); 3],
    segments: [(usize, Block); 3],
}

/// Lumps that were worked out and wait for their turn to be added to their cells.
///
/// Lumps side by side in space fall into the same few cells, and each addition there has to wait for the one before. So sixteen are
/// added while the next sixteen are worked out: the processor does both at once (a fifth less time on a floor).
#[derive(Debug)]
#[repr(align(64))]
pub struct Waiting {
    /// Each with its squared distances; one in two waits.
    lumps: [(Splat<LANES>, Lanes); 2],
    free: usize,
}

impl Default for Waiting {
    /// Lumps of nothing.
    fn default() -> Self {
        let nothing = || (Splat { cell: [0; LANES], amount: [[0.0; 4]; LANES] }, [0.0; LANES]);
        Self { lumps: [nothing(), nothing()], free: 0 }
    }
}

/// What is left to do of a query.
#[derive(Debug, Default)]
pub struct Lists {
    /// Nodes of a level that are looked at, and those of the level below or blocks.
    here: List<u32>,
    below: List<u32>,
    /// Segments that are more than one lump, each with its number of lumps; numbered as lanes of blocks.
    pieces: List<(u32, u32)>,
}

/// Things in a row, to which lanes are appended without a branch for each.
#[derive(Debug, Default)]
struct List<T> {
    /// `len` things, then room.
    room: Vec<T>,
    len: usize,
}

impl<T: Copy + Default> List<T> {
    fn clear(&mut self) {
        self.len = 0;
    }

    fn items(&self) -> &[T] {
        &self.room[..self.len]
    }

    /// Appends what `item` gives for the lanes of a mask.
    #[inline(always)]
    fn append(&mut self, mask: u32, item: impl Fn(usize) -> T) {
        if self.room.len() < self.len + LANES {
            self.room.resize(2 * self.len + LANES, T::default());
        }
        let room = &mut self.room[self.len..self.len + LANES];
        let mut next = 0;
        for lane in 0..LANES {
            // Written in any case, and kept or written over.
            room[next % LANES] = item(lane);
            next += (mask >> lane & 1) as usize;
        }
        self.len += next;
    }
}

/// A 1 for each of the first lanes.
#[inline(always)]
fn first(lanes: usize) -> [u32; LANES] {
    std::array::from_fn(|lane| u32::from(lane < lanes))
}

/// How many nodes or blocks ahead memory is asked for.
const AHEAD: usize = 4;

/// Numbers of lumps, one a queue.
const COUNTS: [u32; 3] = [2, 4, 8];

/// The queue of a number of lumps.
fn kind(lumps: u32) -> usize {
    lumps.trailing_zeros() as usize - 1
}

impl<'a, D: Directions, const OPEN: bool> Walk<'a, D, OPEN> {
    /// From one receiver through a model's tree.
    pub fn new(
        (tree, model): (&'a ClusterTree, &'a HairModel),
        receiver: &'a Receiver,
        map: &'a DepthMap,
        opening: f32,
        far: Option<Far<'a>>,
    ) -> Self {
        Self { tree, receiver, map, view: View::new(receiver, map, opening), far, model }
    }

    /// Where surfaces end what counts: known to be nowhere when it is compiled, where there are none.
    #[inline(always)]
    pub fn far(&self) -> Option<Far<'_>> {
        if OPEN { None } else { self.far }
    }

    /// Gathers all hair in `scratch.depth`.
    ///
    /// Level by level: what comes next is then known long before, so that the processor can read it and begin with it while it still
    /// works on what comes first. For the same reason no branch depends on what a node turns out to hold.
    #[inline(always)]
    pub fn run(&self, scratch: &mut Scratch) {
        let tree = self.tree;
        if tree.levels.is_empty() {
            return;
        }
        let mut lists = std::mem::take(&mut scratch.lists);
        let mut queues = std::mem::take(&mut scratch.queues);
        let Lists { here, below, pieces } = &mut *lists;
        here.clear();
        here.append(1, |_| 0);
        for (level, nodes) in tree.levels.iter().enumerate().rev() {
            below.clear();
            let children = if level > 0 { tree.levels[level - 1].len() } else { tree.blocks.len() };
            self.level(nodes, children, here.items(), below, &mut queues, scratch);
            std::mem::swap(here, below);
        }
        pieces.clear();
        self.blocks(here.items(), pieces, &mut queues, scratch);
        self.pieces(pieces.items(), &mut queues, scratch);
        for (kind, &count) in COUNTS.iter().enumerate() {
            let (filled, rods) = &mut queues.rods[kind];
            self.give_rods(rods, count, std::mem::take(filled), &mut queues.lumps, &mut scratch.depth);
            let (filled, segments) = &mut queues.segments[kind];
            if *filled > 0 {
                let filled = first(std::mem::take(filled));
                self.give_segments(segments, count, &filled, &mut queues.lumps, &mut scratch.depth);
            }
        }
        // The last ones; nothing waits then.
        self.give(Waiting::default().lumps[0], &mut queues.lumps, &mut scratch.depth);
        scratch.queues = queues;
        scratch.lists = lists;
    }

    /// Nodes of one level: far children as lumps, the others to `below`. There are `children` in the level below.
    #[inline(always)]
    fn level(
        &self,
        nodes: &[Node],
        children: usize,
        list: &[u32],
        below: &mut List<u32>,
        queues: &mut Queues,
        scratch: &mut Scratch,
    ) {
        scratch.work += (LANES * list.len()) as u64;
        for &soon in &list[..AHEAD.min(list.len())] {
            prefetch(&nodes[soon as usize]);
        }
        for (i, &index) in list.iter().enumerate() {
            if let Some(&soon) = list.get(i + AHEAD) {
                prefetch(&nodes[soon as usize]);
            }
            let node = &nodes[index as usize];
            let (lumps, division) = lanes::node(&self.view, node);
            self.give(lumps, &mut queues.lumps, &mut scratch.depth);
            // Lanes without child are far away, but not from every viewer, and not for an opening of 0.
            let there = ALL >> LANES.saturating_sub(children - index as usize * LANES);
            below.append(division.near & there, |lane| index * LANES as u32 + lane as u32);
            for lane in bits(there & !(division.one | division.near)) {
                let lane = lane as usize;
                scratch.work += u64::from(division.lumps[lane]);
                self.queue_rod(node, lane, kind(division.lumps[lane]), queues, &mut scratch.depth);
            }
        }
    }

    /// Adds those lumps to their cells that wait, and lets these wait.
    #[inline(always)]
    fn give(&self, lumps: (Splat<LANES>, Lanes), waiting: &mut Waiting, depth: &mut [Corners]) {
        waiting.lumps[waiting.free & 1] = lumps;
        waiting.free += 1;
        let (splat, distance2) = &waiting.lumps[waiting.free & 1];
        let lumps = splat.cell.iter().zip(&splat.amount);
        let Some(far) = self.far() else {
            for (&cell, amount) in lumps {
                view::add(&mut depth[cell as usize], amount);
            }
            return;
        };
        for ((&cell, amount), &distance2) in lumps.zip(distance2) {
            view::add(&mut depth[cell as usize], &far.cut(cell as usize, amount, distance2));
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
            self.give_rods(rods, COUNTS[kind], LANES, &mut queues.lumps, depth);
        }
    }

    #[inline(always)]
    fn give_rods(&self, rods: &Rods, count: u32, filled: usize, waiting: &mut Waiting, depth: &mut [Corners]) {
        let share = 1.0 / count as f32;
        let wanted = first(filled);
        for i in 0..if filled > 0 { count } else { 0 } {
            let s = (2 * i + 1) as f32 * share - 1.0;
            self.give(lanes::rod_lumps(&self.view, rods, s, share, &wanted), waiting, depth);
        }
    }

    /// The lanes of a block that `wanted` has a 1 for, each in `count` lumps.
    #[inline(always)]
    fn give_segments(
        &self,
        block: &Block,
        count: u32,
        wanted: &[u32; LANES],
        waiting: &mut Waiting,
        depth: &mut [Corners],
    ) {
        let share = 1.0 / count as f32;
        for i in 0..count {
            let s = (i as f32 + 0.5) * share;
            self.give(lanes::block_lumps(&self.view, block, s, share, wanted), waiting, depth);
        }
    }

    /// Blocks: the segments that are one lump, the others to `pieces`.
    #[inline(always)]
    fn blocks(&self, list: &[u32], pieces: &mut List<(u32, u32)>, queues: &mut Queues, scratch: &mut Scratch) {
        let blocks = &self.tree.blocks;
        let own = self.receiver.on.map_or(u32::MAX, |on| on.strand);
        // One long pass.
        scratch.work += (3 * LANES / 2 * list.len()) as u64;
        for &soon in &list[..AHEAD.min(list.len())] {
            prefetch(&blocks[soon as usize]);
        }
        for (i, &index) in list.iter().enumerate() {
            if let Some(&soon) = list.get(i + AHEAD) {
                prefetch(&blocks[soon as usize]);
            }
            let block = &blocks[index as usize];
            let (lumps, division) = lanes::block(&self.view, block, own);
            self.give(lumps, &mut queues.lumps, &mut scratch.depth);
            let rest = !division.one & division.used;
            pieces.append(rest, |lane| (index * LANES as u32 + lane as u32, division.lumps[lane]));
        }
    }

    /// Segments that are more than one lump.
    #[inline(always)]
    fn pieces(&self, list: &[(u32, u32)], queues: &mut Queues, scratch: &mut Scratch) {
        for &(place, lumps) in list {
            let block = &self.tree.blocks[(place / LANES as u32) as usize];
            let lane = (place % LANES as u32) as usize;
            // Of its own strand the model has to be asked what counts, and its next segments are seen nearly end-on, where lumps are wrong.
            let (own, lumps) = (lumps & OWN != 0, lumps & !OWN);
            let parts = if own { counted(self.model, self.receiver, block.segment[lane] as usize) } else { WHOLE };
            let near = lumps == NEAR || own && lumps > 1;
            let lumps = lumps.max(COUNTS[0]);
            if near || parts != WHOLE {
                scratch.work += 3 * LANES as u64;
                self.near_segment(block, lane, parts, scratch);
            } else {
                scratch.work += u64::from(lumps);
                self.queue_segment(block, lane, kind(lumps), queues, &mut scratch.depth);
            }
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
            self.give_segments(queue, COUNTS[kind], &first(LANES), &mut queues.lumps, depth);
        }
    }

    #[inline(always)]
    fn near_segment(&self, block: &Block, lane: usize, parts: Parts, scratch: &mut Scratch) {
        let [a, b] = block.ends(lane).map(|end| end - self.receiver.position);
        let widths = [block.widths[0][lane], block.widths[1][lane]];
        for [from, to] in parts.into_iter().flatten() {
            let ribbon = Ribbon::new(a, b, widths, [from, to], block.opacity[lane]);
            if let Some(ribbon) = ribbon {
                ribbon::gather(&ribbon, &self.view, self.map, self.far(), scratch);
            }
        }
    }
}
