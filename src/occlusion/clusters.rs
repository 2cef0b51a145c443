//! A tree over segments: far hair is projected as lumps of optical depth, near hair segment by segment.
//!
//! The segments are ordered by a k-d partition at multiples of powers of 16, so the tree needs no pointers: node `i` of a level
//! has the children `16 i .. 16 i + 16` of the level below, and blocks of 16 segments are the lowest level. Node lanes and
//! block lanes are structures of arrays, 16 wide.
//!
//! A lane is far when its radius is below κ · face width · distance (κ: `Selection::Clusters::opening`); it then gives its whole
//! optical depth to the face of its centroid. τ is additive, so this is exact as κ -> 0 but for the saturation of one layer.

use glam::Vec3;
use rayon::prelude::*;

use super::Receiver;
use super::igloo::Igloo;
use super::layer::{Transmittance, optical_depth};
use super::projection::{Piece, SLICE_WIDTH, Segment, project};
use crate::hair::HairModel;

/// Lanes of a node and of a block.
const LANES: usize = 16;

type Lanes = [f32; LANES];

/// Which hair is projected, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Selection {
    /// Every segment by itself.
    All,
    /// Far hair in lumps: those of a radius below `opening` face widths.
    Clusters { opening: f32 },
    /// The paper's thinning: a share `fraction` of the strands (5.1), and at n times `distance_unit` one in n of those (5.2).
    Thinned { fraction: f32, distance_unit: f32 },
}

/// Sixteen clusters, each standing for one child.
#[derive(Clone, Debug)]
struct Node {
    x: Lanes,
    y: Lanes,
    z: Lanes,
    /// Radius around the centroid that holds all of the child's segments.
    radius: Lanes,
    /// Σ width · length · opacity.
    mass: Lanes,
    /// Σ width · length · opacity · u uᵀ: xx, yy, zz, xy, xz, yz.
    tensor: [Lanes; 6],
    /// Smallest strand hash among the child's segments: a thinner selection passes the whole child by.
    least_hash: Lanes,
}

/// Sixteen segments.
#[derive(Clone, Debug)]
struct Block {
    a: [Lanes; 3],
    b: [Lanes; 3],
    widths: [Lanes; 2],
    transparency: Lanes,
    hash: Lanes,
    segment: [u32; LANES],
}

/// The tree.
#[derive(Debug)]
pub struct ClusterTree {
    blocks: Vec<Block>,
    /// Levels of nodes, lowest first; the last has one node.
    levels: Vec<Vec<Node>>,
    rule: Transmittance,
}

/// Buffers that one thread keeps from point to point.
#[derive(Debug, Default)]
pub struct Scratch {
    pieces: Vec<Piece>,
    stack: Vec<(u32, u32)>,
}

impl ClusterTree {
    /// Builds the tree over all segments of a model.
    pub fn build(model: &HairModel, rule: Transmittance) -> Self {
        let mut order: Vec<(Vec3, u32)> = (0..model.segments())
            .into_par_iter()
            .map(|s| {
                let [a, b] = model.ends(s);
                (0.5 * (a + b), s as u32)
            })
            .collect();
        partition(&mut order);
        let blocks: Vec<Block> = order.par_chunks(LANES).map(|chunk| Block::new(model, chunk)).collect();
        let mut levels = Vec::new();
        let mut summaries: Vec<Summary> = blocks.par_iter().map(|block| block.summary(rule)).collect();
        while !summaries.is_empty() {
            let nodes: Vec<Node> = summaries.par_chunks(LANES).map(Node::new).collect();
            summaries = summaries.par_chunks(LANES).map(Summary::join).collect();
            let top = nodes.len() == 1;
            levels.push(nodes);
            if top {
                break;
            }
        }
        Self { blocks, levels, rule }
    }

    /// Memory held, in bytes.
    pub fn bytes(&self) -> usize {
        let nodes: usize = self.levels.iter().map(Vec::len).sum();
        self.blocks.len() * size_of::<Block>() + nodes * size_of::<Node>()
    }

    /// Adds the optical depth of the hair in each face to `depth`. `far[face]` is the distance of the first opaque surface.
    pub fn optical_depths(
        &self,
        receiver: &Receiver,
        igloo: &Igloo,
        selection: Selection,
        far: &[f32],
        depth: &mut [f32],
        model: &HairModel,
        scratch: &mut Scratch,
    ) {
        let Some(top) = self.levels.len().checked_sub(1) else { return };
        let Scratch { pieces, stack } = scratch;
        let limit = match selection {
            // Half a radian at most: nearer than twice its radius no cluster is a lump.
            Selection::Clusters { opening } => (opening * igloo.face_width()).min(0.5).powi(2),
            _ => 0.0,
        };
        let mut walk = Walk {
            rule: self.rule,
            receiver,
            igloo,
            selection,
            limit,
            far,
            depth,
            model,
            pieces,
            face_weight: 1.0 / igloo.face_solid_angle(),
        };
        stack.clear();
        stack.push((top as u32, 0));
        while let Some((level, index)) = stack.pop() {
            let node = &self.levels[level as usize][index as usize];
            let open = walk.node(node);
            for lane in 0..LANES as u32 {
                if open & (1 << lane) == 0 {
                    continue;
                }
                let child = index * LANES as u32 + lane;
                if level == 0 {
                    walk.block(&self.blocks[child as usize]);
                } else {
                    stack.push((level - 1, child));
                }
            }
        }
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
    mass: f32,
    tensor: [f32; 6],
    least_hash: f32,
}

impl Summary {
    fn join(parts: &[Self]) -> Self {
        let mass: f32 = parts.iter().map(|p| p.mass).sum();
        let weight = |p: &Self| if mass > 0.0 { p.mass / mass } else { 1.0 / parts.len() as f32 };
        let centroid: Vec3 = parts.iter().map(|p| p.centroid * weight(p)).sum();
        let radius = parts.iter().map(|p| p.centroid.distance(centroid) + p.radius).fold(0.0, f32::max);
        Self {
            centroid,
            radius,
            mass,
            tensor: std::array::from_fn(|i| parts.iter().map(|p| p.tensor[i]).sum()),
            least_hash: parts.iter().map(|p| p.least_hash).fold(f32::INFINITY, f32::min),
        }
    }
}

impl Node {
    fn new(children: &[Summary]) -> Self {
        let lanes = |value: &dyn Fn(&Summary) -> f32, empty: f32| -> Lanes {
            std::array::from_fn(|lane| children.get(lane).map_or(empty, value))
        };
        Self {
            x: lanes(&|c| c.centroid.x, 0.0),
            y: lanes(&|c| c.centroid.y, 0.0),
            z: lanes(&|c| c.centroid.z, 0.0),
            radius: lanes(&|c| c.radius, 0.0),
            // A lane without child has no mass, which is what shuts it out.
            mass: lanes(&|c| c.mass, 0.0),
            tensor: std::array::from_fn(|i| lanes(&|c| c.tensor[i], 0.0)),
            least_hash: lanes(&|c| c.least_hash, f32::INFINITY),
        }
    }
}

impl Block {
    fn new(model: &HairModel, chunk: &[(Vec3, u32)]) -> Self {
        let segment: [u32; LANES] =
            std::array::from_fn(|lane| chunk.get(lane).map_or(u32::MAX, |&(_, segment)| segment));
        let lanes = |value: &dyn Fn(usize) -> f32, empty: f32| -> Lanes {
            std::array::from_fn(|lane| chunk.get(lane).map_or(empty, |&(_, segment)| value(segment as usize)))
        };
        Self {
            a: std::array::from_fn(|axis| lanes(&|s| model.ends(s)[0][axis], 0.0)),
            b: std::array::from_fn(|axis| lanes(&|s| model.ends(s)[1][axis], 0.0)),
            widths: std::array::from_fn(|end| lanes(&|s| model.widths(s)[end], 0.0)),
            transparency: lanes(&|s| model.transparency[s], 1.0),
            hash: lanes(&|s| strand_hash(model.strand[s]), f32::INFINITY),
            segment,
        }
    }

    fn ends(&self, lane: usize) -> [Vec3; 2] {
        [&self.a, &self.b].map(|end| Vec3::new(end[0][lane], end[1][lane], end[2][lane]))
    }

    fn summary(&self, rule: Transmittance) -> Summary {
        let mut parts = [const { None }; LANES];
        for (lane, part) in parts.iter_mut().enumerate().filter(|(lane, _)| self.segment[*lane] != u32::MAX) {
            let [a, b] = self.ends(lane);
            let along = b - a;
            let length = along.length();
            let u = along / length;
            let width = 0.5 * (self.widths[0][lane] + self.widths[1][lane]);
            let mass = width * length * rule.opacity(self.transparency[lane], length);
            *part = Some(Summary {
                centroid: 0.5 * (a + b),
                radius: 0.5 * length,
                mass,
                tensor: [u.x * u.x, u.y * u.y, u.z * u.z, u.x * u.y, u.x * u.z, u.y * u.z].map(|t| t * mass),
                least_hash: self.hash[lane],
            });
        }
        let parts: Vec<Summary> = parts.into_iter().flatten().collect();
        Summary::join(&parts)
    }
}

/// A uniform number in [0, 1) for each strand: thinning keeps strands below a bound, so a thinner set lies in a denser one.
fn strand_hash(strand: u32) -> f32 {
    let mut x = strand.wrapping_mul(0x9E37_79B9) ^ 0x85EB_CA6B;
    x = (x ^ (x >> 16)).wrapping_mul(0x21F0_AAAD);
    x = (x ^ (x >> 15)).wrapping_mul(0x735A_2D97);
    ((x ^ (x >> 15)) >> 8) as f32 / (1 << 24) as f32
}

/// One receiver's way through the tree.
struct Walk<'a> {
    rule: Transmittance,
    receiver: &'a Receiver,
    igloo: &'a Igloo,
    selection: Selection,
    /// Square of the angular radius below which a lane is far.
    limit: f32,
    far: &'a [f32],
    depth: &'a mut [f32],
    model: &'a HairModel,
    pieces: &'a mut Vec<Piece>,
    /// 1 / solid angle of a face.
    face_weight: f32,
}

impl Walk<'_> {
    /// Projects the far lanes of a node; gives a mask of the lanes to open.
    fn node(&mut self, node: &Node) -> u32 {
        let x = self.receiver.position;
        let mut distance2 = [0.0; LANES];
        let mut radius2 = [0.0; LANES];
        for lane in 0..LANES {
            let (dx, dy, dz) = (node.x[lane] - x.x, node.y[lane] - x.y, node.z[lane] - x.z);
            distance2[lane] = dx * dx + dy * dy + dz * dz;
            radius2[lane] = node.radius[lane] * node.radius[lane];
        }
        let mut open = 0;
        for lane in 0..LANES {
            if node.mass[lane] <= 0.0 {
                continue;
            }
            if radius2[lane] < self.limit * distance2[lane] {
                self.lump(node, lane, distance2[lane]);
            } else if !self.passes_by(node, lane, distance2[lane].sqrt()) {
                open |= 1 << lane;
            }
        }
        open
    }

    /// Whether thinning leaves out everything in a lane: it keeps most where the hair is nearest.
    fn passes_by(&self, node: &Node, lane: usize, distance: f32) -> bool {
        match self.selection {
            Selection::Thinned { fraction, distance_unit } => {
                let nearest = (distance - node.radius[lane]).max(0.0);
                node.least_hash[lane] >= kept_share(fraction, distance_unit, nearest)
            }
            _ => false,
        }
    }

    /// Gives a far cluster's optical depth to the face of its centroid.
    fn lump(&mut self, node: &Node, lane: usize, distance2: f32) {
        let toward = Vec3::new(node.x[lane], node.y[lane], node.z[lane]) - self.receiver.position;
        let d = toward / distance2.sqrt();
        let face = self.igloo_face(d);
        let Some(face) = face.filter(|&face| distance2 < self.far[face] * self.far[face]) else { return };
        let t = |i: usize| node.tensor[i][lane];
        let along = d.x * d.x * t(0)
            + d.y * d.y * t(1)
            + d.z * d.z * t(2)
            + 2.0 * (d.x * d.y * t(3) + d.x * d.z * t(4) + d.y * d.z * t(5));
        let mass = node.mass[lane];
        // Σ m sin θ from Σ m sin² θ: exact for parallel hair; for other hair `sine_factor` takes the mean over directions right.
        let projected = (mass * (mass - along).max(0.0)).sqrt() * sine_factor(mass, t);
        self.depth[face] += projected * self.face_weight / distance2;
    }

    /// The face of a unit direction in render space; none below a surface's horizon.
    #[inline]
    fn igloo_face(&self, direction: Vec3) -> Option<usize> {
        let local = self.receiver.frame.transpose() * direction;
        (self.igloo.span() == super::Span::Sphere || local.z >= 0.0).then(|| self.igloo.face_of(local))
    }

    fn block(&mut self, block: &Block) {
        for lane in 0..LANES {
            if block.segment[lane] == u32::MAX {
                break;
            }
            let [a, b] = block.ends(lane).map(|end| end - self.receiver.position);
            let middle = 0.5 * (a + b);
            let distance2 = middle.length_squared();
            let weight = match self.selection {
                Selection::Thinned { fraction, distance_unit } => {
                    let share = kept_share(fraction, distance_unit, distance2.sqrt());
                    if block.hash[lane] >= share {
                        continue;
                    }
                    1.0 / share
                }
                _ => 1.0,
            };
            let radius2 = 0.25 * (b - a).length_squared();
            if radius2 < self.limit * distance2 {
                self.far_segment(block, lane, b - a, middle, distance2);
            } else {
                self.near_segment(block, lane, a, b, weight);
            }
        }
    }

    /// A segment smaller than a face lies in the face of its middle.
    fn far_segment(&mut self, block: &Block, lane: usize, along: Vec3, middle: Vec3, distance2: f32) {
        let distance = distance2.sqrt();
        let Some(face) = self.igloo_face(middle / distance) else { return };
        if distance >= self.far[face] {
            return;
        }
        let width = 0.5 * (block.widths[0][lane] + block.widths[1][lane]);
        if distance <= width {
            return;
        }
        let solid_angle = width * along.cross(middle).length() / (distance2 * distance);
        let opacity = self.rule.opacity(block.transparency[lane], along.length());
        self.depth[face] += optical_depth(solid_angle * self.face_weight, opacity);
    }

    fn near_segment(&mut self, block: &Block, lane: usize, a: Vec3, b: Vec3, weight: f32) {
        let widths = [block.widths[0][lane], block.widths[1][lane]];
        let whole = [0.0, 1.0];
        let mut parts = [Some(whole), None];
        if let Some(on) = self.receiver.on {
            let segment = block.segment[lane] as usize;
            if self.model.strand[segment] == on.strand {
                let p = self.model.segment_point[segment] as usize;
                parts = outside(on.excluded(), [self.model.arc[p], self.model.arc[p + 1]]);
            }
        }
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
            let rotate = self.receiver.frame.transpose();
            let part = Segment { a: rotate * at(from), b: rotate * at(to), widths: [width(from), width(to)] };
            project(self.igloo, &part, SLICE_WIDTH, &|face| self.far[face], self.pieces);
            for piece in self.pieces.iter() {
                let opacity = self.rule.opacity(block.transparency[lane], piece.length);
                self.depth[piece.face as usize] +=
                    weight * optical_depth(piece.solid_angle * self.face_weight, opacity);
            }
        }
    }
}

/// The share of the strands that thinning keeps at a distance: `fraction` / n with n = ⌊z / unit + 1/2⌋ (5.2).
fn kept_share(fraction: f32, distance_unit: f32, distance: f32) -> f32 {
    fraction / (distance / distance_unit + 0.5).floor().max(1.0)
}

/// Between parallel hair (1) and hair in all directions (π/4 over √(2/3)), by how strongly the tensor prefers a direction.
#[inline]
fn sine_factor(mass: f32, t: impl Fn(usize) -> f32) -> f32 {
    let norm2 = t(0) * t(0) + t(1) * t(1) + t(2) * t(2) + 2.0 * (t(3) * t(3) + t(4) * t(4) + t(5) * t(5));
    // |T|² / m² runs from 1/3 (no preferred direction) to 1 (parallel).
    let spread = 1.5 * (1.0 - norm2 / (mass * mass));
    1.0 - 0.038 * spread.clamp(0.0, 1.0)
}

/// The parts of the arc range `arcs` outside `excluded`, as parameters 0 to 1 along it.
fn outside(excluded: [f32; 2], arcs: [f32; 2]) -> [Option<[f32; 2]>; 2] {
    let length = arcs[1] - arcs[0];
    let before = ((excluded[0] - arcs[0]) / length).min(1.0);
    let after = ((excluded[1] - arcs[0]) / length).max(0.0);
    [(before > 0.0).then_some([0.0, before]), (after < 1.0).then_some([after, 1.0])]
}
