//! A tree over segments: far hair is projected as lumps of optical depth, near hair segment by segment.
//!
//! The segments are ordered by a k-d partition at multiples of powers of 16, so the tree needs no pointers: node `i` of a level
//! has the children `16 i .. 16 i + 16` of the level below, and blocks of 16 segments are the lowest level. Node lanes and
//! block lanes are structures of arrays, 16 wide.
//!
//! A child is a lump where its extent is below the opening (an angle) times its distance; a bundle of parallel hair that is thin enough
//! is a row of lumps along its mean segment. τ is additive, so this is every segment by itself as the opening goes to 0.

use glam::Vec3;
use rayon::prelude::*;

use super::lanes::{self, Block, LANES, Lanes, NOWHERE, Node};
use super::layer::Transmittance;
use crate::hair::HairModel;
use crate::tally::{self, Work};

/// The tree.
#[derive(Debug)]
pub struct ClusterTree {
    pub(super) blocks: Vec<Block>,
    /// Levels of nodes, lowest first; the last has one node.
    pub(super) levels: Vec<Vec<Node>>,
}

impl ClusterTree {
    /// Builds the tree over all segments of a model.
    pub fn build(model: &HairModel, rule: Transmittance) -> Self {
        tally::add(Work::ClusterTrees, 1);
        let mut order: Vec<(Vec3, u32)> = (0..model.segments())
            .into_par_iter()
            .map(|s| {
                let [a, b] = model.ends(s);
                (0.5 * (a + b), s as u32)
            })
            .collect();
        partition(&mut order);
        let blocks: Vec<Block> = order.par_chunks(LANES).map(|chunk| block_of(model, rule, chunk)).collect();
        let mut levels = Vec::new();
        let mut summaries: Vec<Summary> = blocks.par_iter().map(summary).collect();
        while !summaries.is_empty() {
            let nodes: Vec<Node> = summaries.par_chunks(LANES).map(node_of).collect();
            summaries = summaries.par_chunks(LANES).map(Summary::join).collect();
            let top = nodes.len() == 1;
            levels.push(nodes);
            if top {
                break;
            }
        }
        Self { blocks, levels }
    }

    /// What a tree over this many segments holds, in bytes.
    pub fn bytes_for(segments: u64) -> u64 {
        let blocks = segments.div_ceil(LANES as u64);
        let (mut nodes, mut level) = (0, blocks);
        while level > 0 {
            level = level.div_ceil(LANES as u64);
            nodes += level;
            level = if level > 1 { level } else { 0 };
        }
        blocks * size_of::<Block>() as u64 + nodes * size_of::<Node>() as u64
    }

    /// Memory held, in bytes.
    pub fn bytes(&self) -> usize {
        let nodes: usize = self.levels.iter().map(Vec::len).sum();
        self.blocks.len() * size_of::<Block>() + nodes * size_of::<Node>()
    }
}

/// Orders segments so that every aligned run of 16^k of them is compact: recursive halving along the longest axis.
fn partition(order: &mut [(Vec3, u32)]) {
    if order.len() <= LANES {
        return;
    }
    let (low, high) =
        order.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), (p, _)| (low.min(*p), high.max(*p)));
    let axis = (high - low).max_position();
    // The largest power of 16 below the count is the children's size; the cut is the multiple of it nearest the middle.
    let mut size = LANES;
    while size * LANES < order.len() {
        size *= LANES;
    }
    let children = order.len().div_ceil(size);
    let cut = (children / 2) * size;
    // The index decides ties, so that the order does not depend on how the selection moves equal keys.
    order.select_nth_unstable_by(cut, |(p, i), (q, j)| p[axis].total_cmp(&q[axis]).then(i.cmp(j)));
    let (left, right) = order.split_at_mut(cut);
    rayon::join(|| partition(left), || partition(right));
}

/// What a cluster is known by.
#[derive(Clone, Copy, Debug)]
struct Summary {
    centroid: Vec3,
    radius: f32,
    /// Mean squared distance of the hair from the centroid.
    spread2: f32,
    /// Half the mean segment, and how far beside it the others run.
    half: Vec3,
    thickness: f32,
    mass: f32,
    tensor: [f32; 6],
}

impl Summary {
    fn join(parts: &[Self]) -> Self {
        let mass: f32 = parts.iter().map(|p| p.mass).sum();
        let weight = |p: &Self| if mass > 0.0 { p.mass / mass } else { 1.0 / parts.len() as f32 };
        let centroid: Vec3 = parts.iter().map(|p| p.centroid * weight(p)).sum();
        let radius = parts.iter().map(|p| p.centroid.distance(centroid) + p.radius).fold(0.0, f32::max);
        let spread2 = parts.iter().map(|p| weight(p) * (p.centroid.distance_squared(centroid) + p.spread2)).sum();
        let tensor: [f32; 6] = std::array::from_fn(|i| parts.iter().map(|p| p.tensor[i]).sum());
        // Segments have no sense of direction: all are turned to run with the tensor's column of the largest diagonal, roughly its
        // principal direction, whatever the order and sense in which they come.
        let [xx, yy, zz, xy, xz, yz] = tensor;
        let columns = [Vec3::new(xx, xy, xz), Vec3::new(xy, yy, yz), Vec3::new(xz, yz, zz)];
        let along = columns[Vec3::new(xx, yy, zz).max_position()];
        let turned = |p: &Self| if p.half.dot(along) < 0.0 { -p.half } else { p.half };
        let half: Vec3 = parts.iter().map(|p| turned(p) * weight(p)).sum();
        let beside = |p: &Self| {
            let (offset, lean) = (p.centroid - centroid, turned(p) - half);
            (offset + lean).length().max((offset - lean).length()) + p.thickness
        };
        let thickness = parts.iter().map(beside).fold(0.0, f32::max);
        Self { centroid, radius, spread2, half, thickness, mass, tensor }
    }
}

/// The lanes of up to 16 children.
fn node_of(children: &[Summary]) -> Node {
    let lanes = |value: &dyn Fn(&Summary) -> f32, empty: f32| -> Lanes {
        // Children that take no light are left out as if they were not there.
        std::array::from_fn(|lane| children.get(lane).filter(|c| c.mass > 0.0).map_or(empty, value))
    };
    let extent = |c: &Summary| (5.0 / 3.0 * c.spread2).sqrt();
    let stout2 = children.iter().filter(|c| c.mass > 0.0).map(|c| lanes::stout2(extent(c), c.radius, c.thickness));
    Node {
        stout2: stout2.fold(f32::INFINITY, f32::min),
        center: std::array::from_fn(|axis| lanes(&|c| c.centroid[axis], NOWHERE)),
        radius: lanes(&|c| c.radius, 0.0),
        extent: lanes(&extent, 0.0),
        half: std::array::from_fn(|axis| lanes(&|c| c.half[axis], 0.0)),
        inverse_half2: lanes(&|c| 1.0 / c.half.length_squared(), f32::INFINITY),
        thickness: lanes(&|c| c.thickness, f32::INFINITY),
        mass: lanes(&|c| c.mass * sine_factor(c.mass, |i| c.tensor[i]), 0.0),
        tensor: std::array::from_fn(|i| lanes(&|c| c.tensor[i] / c.mass, 0.0)),
    }
}

/// The lanes of up to 16 segments.
fn block_of(model: &HairModel, rule: Transmittance, chunk: &[(Vec3, u32)]) -> Block {
    let segment: [u32; LANES] = std::array::from_fn(|lane| chunk.get(lane).map_or(u32::MAX, |&(_, segment)| segment));
    let lanes = |value: &dyn Fn(usize) -> f32, empty: f32| -> Lanes {
        std::array::from_fn(|lane| chunk.get(lane).map_or(empty, |&(_, segment)| value(segment as usize)))
    };
    let length = |s: usize| model.ends(s)[0].distance(model.ends(s)[1]);
    Block {
        a: std::array::from_fn(|axis| lanes(&|s| model.ends(s)[0][axis], NOWHERE)),
        b: std::array::from_fn(|axis| lanes(&|s| model.ends(s)[1][axis], NOWHERE)),
        widths: std::array::from_fn(|end| lanes(&|s| model.widths(s)[end], 0.0)),
        opacity: lanes(&|s| rule.opacity(model.transparency[s], length(s)), 0.0),
        strand: std::array::from_fn(|lane| chunk.get(lane).map_or(u32::MAX, |&(_, s)| model.strand[s as usize])),
        segment,
    }
}

fn summary(block: &Block) -> Summary {
    let mut parts = [const { None }; LANES];
    for (lane, part) in parts.iter_mut().enumerate().filter(|(lane, _)| block.segment[*lane] != u32::MAX) {
        let [a, b] = block.ends(lane);
        let along = b - a;
        let length = along.length();
        let u = along / length;
        let width = 0.5 * (block.widths[0][lane] + block.widths[1][lane]);
        let mass = width * length * block.opacity[lane];
        *part = Some(Summary {
            centroid: 0.5 * (a + b),
            radius: 0.5 * length,
            spread2: length * length / 12.0,
            half: 0.5 * along,
            thickness: 0.0,
            mass,
            tensor: [u.x * u.x, u.y * u.y, u.z * u.z, u.x * u.y, u.x * u.z, u.y * u.z].map(|t| t * mass),
        });
    }
    let parts: Vec<Summary> = parts.into_iter().flatten().collect();
    Summary::join(&parts)
}

/// What makes Σ m sin θ of the root of Σ m sin² θ Σ m: exact for parallel hair, right in the mean over directions for other hair.
///
/// Between parallel hair (1) and hair in all directions (π/4 over √(2/3)), by how strongly the tensor prefers a direction.
#[inline]
fn sine_factor(mass: f32, t: impl Fn(usize) -> f32) -> f32 {
    let norm2 = t(0) * t(0) + t(1) * t(1) + t(2) * t(2) + 2.0 * (t(3) * t(3) + t(4) * t(4) + t(5) * t(5));
    // |T|² / m² runs from 1/3 (no preferred direction) to 1 (parallel).
    let spread = 1.5 * (1.0 - norm2 / (mass * mass));
    1.0 - 0.038 * spread.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests;
