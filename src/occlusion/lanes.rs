//! Sixteen clusters or segments at a time: what of them is far, and how much of which face it covers.
//!
//! Plain loops over `[f32; 16]`, which the compiler turns into vector code: for AVX2 in functions that say so and are called only
//! where the processor has it, else for the baseline. Additions and multiplications are never fused, so both give the same bits. Loops have
//! no branches, only selections. Distances in the unit of render space; optical depths are those of a whole face.

use glam::{Mat3, Vec3};

use super::segment::MEAN_CHORD;
use crate::igloo::{Igloo, Span};

/// Lanes of a node and of a block.
pub const LANES: usize = 16;

pub type Lanes = [f32; LANES];

/// Coordinate of lanes that hold nothing: far away from everything, and its square is finite.
pub const NOWHERE: f32 = 1e15;

/// Half the length of a lump of a single strand, in face widths. Longer ones put the hair of several faces into one, which leaves
/// the others too free.
const STRIDE: f32 = 0.7;

/// Sixteen clusters, each standing for one child.
#[derive(Clone, Debug)]
pub struct Node {
    /// Centroids.
    pub center: [Lanes; 3],
    /// Radius around the centroid that holds all of the child's segments; -1 in a lane without child.
    pub radius: Lanes,
    /// The child as a bundle: half the mean segment, which runs through the centroid,
    pub half: [Lanes; 3],
    /// and the distance within which all of its segments run beside that one, from end to end.
    pub thickness: Lanes,
    /// Σ width · length · opacity, times what makes the sine of the mean angle that of the mean (see `clusters`).
    pub mass: Lanes,
    /// Σ width · length · opacity · u uᵀ / Σ width · length · opacity: xx, yy, zz, xy, xz, yz.
    pub tensor: [Lanes; 6],
    /// Smallest strand hash among the child's segments: a thinner selection passes the whole child by.
    pub least_hash: Lanes,
}

/// Sixteen segments.
#[derive(Clone, Debug)]
pub struct Block {
    pub a: [Lanes; 3],
    pub b: [Lanes; 3],
    pub widths: [Lanes; 2],
    /// Share of the light that one crossing takes.
    pub opacity: Lanes,
    pub hash: Lanes,
    /// u32::MAX in a lane without segment.
    pub segment: [u32; LANES],
}

impl Block {
    /// The ends of a lane's segment.
    #[inline]
    pub fn ends(&self, lane: usize) -> [Vec3; 2] {
        [&self.a, &self.b].map(|end| Vec3::new(end[0][lane], end[1][lane], end[2][lane]))
    }
}

/// Who looks, and how finely.
#[derive(Clone, Copy, Debug)]
pub struct View {
    position: [f32; 3],
    /// Rows: the igloo's axes in render space.
    axes: [[f32; 3]; 3],
    /// Square of the angular radius below which a lane is far.
    limit: f32,
    /// Square of the angular half length up to which a piece of hair is one lump of its face.
    stride2: f32,
    /// Square of the angular width from which on a segment is cut into slices.
    slice2: f32,
    /// 1 / solid angle of a face.
    face_weight: f32,
    /// Share of a face that a strand of angular width 1 covers where it crosses the face.
    crossing: f32,
    /// Half the side of the look-up table, and its last row and column.
    half_side: f32,
    last: f32,
    side: u32,
    /// Height below which nothing counts: 0 for a hemisphere.
    horizon: f32,
    wide: bool,
}

/// A segment by itself, relative to the viewer, in render space's axes.
#[derive(Clone, Copy, Debug)]
pub struct Thread {
    pub a: Vec3,
    pub along: Vec3,
    pub widths: [f32; 2],
    pub opacity: f32,
}

/// Parallel hair, relative to the viewer, in render space's axes; `mass` and `tensor` as in [`Node`].
#[derive(Clone, Copy, Debug)]
struct Bundle {
    a: Vec3,
    along: Vec3,
    mass: f32,
    tensor: [f32; 6],
}

/// What the lanes of a node or block give.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Far {
    /// Cell of the look-up table.
    pub cell: [u32; LANES],
    /// Optical depth; 0 in lanes that are not far.
    pub depth: Lanes,
    pub distance2: Lanes,
    /// Bit `i`: lane `i` is near and must be opened or projected by itself.
    pub near: u32,
    /// Near segments that are far when they are taken in two or in four lumps.
    pub in_two: u32,
    pub in_four: u32,
    /// Lanes that are in use, from the first.
    pub count: usize,
}

impl Far {
    /// Fewer lanes than there is room for.
    #[inline(always)]
    fn of<const N: usize>(cell: &[u32; N], depth: &[f32; N], distance2: &[f32; N]) -> Self {
        let mut far = Self {
            cell: [0; LANES],
            depth: [0.0; LANES],
            distance2: [0.0; LANES],
            near: 0,
            in_two: 0,
            in_four: 0,
            count: N,
        };
        far.cell[..N].copy_from_slice(cell);
        far.depth[..N].copy_from_slice(depth);
        far.distance2[..N].copy_from_slice(distance2);
        far
    }
}

impl View {
    /// `limit` is the square of the angular radius below which a lane is far, `slice` the angular width from which on a segment is cut into slices.
    pub fn new(position: Vec3, frame: Mat3, igloo: &Igloo, limit: f32, slice: f32) -> Self {
        let side = igloo.lookup().side();
        Self {
            position: position.to_array(),
            axes: frame.to_cols_array_2d(),
            limit,
            stride2: limit.min((STRIDE * igloo.face_width()).powi(2)),
            slice2: slice * slice,
            face_weight: 1.0 / igloo.face_solid_angle(),
            crossing: MEAN_CHORD / igloo.face_width(),
            half_side: 0.5 * side as f32,
            last: (side - 1) as f32,
            side: side as u32,
            horizon: if igloo.span() == Span::Hemisphere { 0.0 } else { f32::NEG_INFINITY },
            wide: has_avx2(),
        }
    }

    /// The same in baseline code.
    #[cfg(test)]
    pub fn narrow(self) -> Self {
        Self { wide: false, ..self }
    }

    /// Projects the far lanes of a node as lumps.
    #[inline]
    pub fn node(&self, node: &Node) -> Far {
        #[cfg(target_arch = "x86_64")]
        if self.wide {
            // SAFETY: `wide` is true only where the processor has AVX2.
            return unsafe { node_avx2(self, node) };
        }
        node_lanes(self, node)
    }

    /// Projects the far lanes of a block: segments smaller than a face, given to the face of their middle.
    #[inline]
    pub fn block(&self, block: &Block) -> Far {
        #[cfg(target_arch = "x86_64")]
        if self.wide {
            // SAFETY: `wide` is true only where the processor has AVX2.
            return unsafe { block_avx2(self, block) };
        }
        block_lanes(self, block)
    }

    /// Projects the `wanted` segments of a block in `count` lumps each, and hands on a lump of all of them at a time.
    #[inline]
    pub fn lumps_of(&self, block: &Block, count: u32, wanted: u32, mut take: impl FnMut(&Far)) {
        let share = 1.0 / count as f32;
        for i in 0..count {
            let s = (i as f32 + 0.5) * share;
            #[cfg(target_arch = "x86_64")]
            if self.wide {
                // SAFETY: `wide` is true only where the processor has AVX2.
                take(&unsafe { block_lumps_avx2(self, block, s, share, wanted) });
                continue;
            }
            take(&block_lumps(self, block, s, share, wanted));
        }
    }

    /// Projects a lane's child as a bundle of parallel hair, where it is thin: lumps along its mean segment.
    #[inline]
    pub fn bundle(&self, node: &Node, lane: usize) -> Option<Far> {
        let lane_of = |values: &[Lanes; 3]| Vec3::new(values[0][lane], values[1][lane], values[2][lane]);
        let half = lane_of(&node.half);
        let along = 2.0 * half;
        let a = lane_of(&node.center) - Vec3::from_array(self.position) - half;
        let nearest2 = nearest2(a, along);
        let thickness = node.thickness[lane];
        if thickness * thickness >= self.limit * nearest2 {
            return None;
        }
        let bundle = Bundle { a, along, mass: node.mass[lane], tensor: node.tensor.map(|t| t[lane]) };
        match self.lumps(along, nearest2)? {
            2 => Some(self.bundle_in::<2>(&bundle)),
            4 => Some(self.bundle_in::<4>(&bundle)),
            8 => Some(self.bundle_in::<8>(&bundle)),
            _ => Some(self.bundle_in::<16>(&bundle)),
        }
    }

    #[inline(always)]
    fn bundle_in<const N: usize>(&self, bundle: &Bundle) -> Far {
        #[cfg(target_arch = "x86_64")]
        if self.wide {
            // SAFETY: `wide` is true only where the processor has AVX2.
            return unsafe { bundle_avx2::<N>(self, bundle) };
        }
        bundle_lanes::<N>(self, bundle)
    }

    /// Projects a segment in lumps along it, where each is far and narrow.
    #[inline]
    pub fn segment(&self, thread: &Thread) -> Option<Far> {
        let Thread { a, along, widths, .. } = *thread;
        let nearest2 = nearest2(a, along);
        let width = widths[0].max(widths[1]);
        if width * width >= self.slice2 * nearest2 {
            return None;
        }
        match self.lumps(along, nearest2)? {
            2 => Some(self.segment_in::<2>(thread)),
            4 => Some(self.segment_in::<4>(thread)),
            8 => Some(self.segment_in::<8>(thread)),
            _ => Some(self.segment_in::<16>(thread)),
        }
    }

    #[inline(always)]
    fn segment_in<const N: usize>(&self, thread: &Thread) -> Far {
        #[cfg(target_arch = "x86_64")]
        if self.wide {
            // SAFETY: `wide` is true only where the processor has AVX2.
            return unsafe { segment_avx2::<N>(self, thread) };
        }
        segment_lanes::<N>(self, thread)
    }

    /// In how many lumps a segment must be taken so that each is far: 2, 4, 8 or 16, or more than that.
    #[inline]
    fn lumps(&self, along: Vec3, nearest2: f32) -> Option<usize> {
        let bound = 4.0 * self.stride2 * nearest2;
        let length2 = along.length_squared();
        [2, 4, 8, 16].into_iter().find(|&count| length2 < (count * count) as f32 * bound)
    }

    /// Cells of the look-up table for directions of any length; what is below the horizon loses its depth.
    #[inline(always)]
    fn cells<const N: usize>(&self, direction: &[[f32; N]; 3], depth: &mut [f32; N]) -> [u32; N] {
        let mut cell = [0; N];
        for lane in 0..N {
            let [x, y, z] = [direction[0][lane], direction[1][lane], direction[2][lane]];
            let local = self.axes.map(|axis| axis[0] * x + axis[1] * y + axis[2] * z);
            depth[lane] = if local[2] >= self.horizon { depth[lane] } else { 0.0 };
            let scale = 1.0 / (local[0].abs() + local[1].abs() + local[2].abs());
            let (u, v) = (local[0] * scale, local[1] * scale);
            // Below the horizon the octahedron's corners are folded over.
            let folded_u = (1.0 - v.abs()).copysign(u);
            let folded_v = (1.0 - u.abs()).copysign(v);
            let below = local[2] < 0.0;
            let u = if below { folded_u } else { u };
            let v = if below { folded_v } else { v };
            let column = at_most(self.half_side + self.half_side * u, self.last);
            let row = at_most(self.half_side + self.half_side * v, self.last);
            // SAFETY: `at_most` gives a number from 0 to `last`, also for what is not a number, and `last` is below 2^16.
            let (column, row) = unsafe { (column.to_int_unchecked::<i32>(), row.to_int_unchecked::<i32>()) };
            cell[lane] = row as u32 * self.side + column as u32;
        }
        cell
    }
}

/// Squared distance of the segment from `a` along `along` to the origin.
#[inline(always)]
fn nearest2(a: Vec3, along: Vec3) -> f32 {
    let s = (-a.dot(along) / along.length_squared()).clamp(0.0, 1.0);
    // Where the segment has no length, `s` is not a number.
    let s = if s > 0.0 { s } else { 0.0 };
    (a + along * s).length_squared()
}

/// `x` between 0 and `last`; 0 for what is not a number.
#[inline(always)]
fn at_most(x: f32, last: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < last { x } else { last }
}

fn has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::arch::is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn node_avx2(view: &View, node: &Node) -> Far {
    node_lanes(view, node)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn block_avx2(view: &View, block: &Block) -> Far {
    block_lanes(view, block)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn bundle_avx2<const N: usize>(view: &View, bundle: &Bundle) -> Far {
    bundle_lanes::<N>(view, bundle)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn segment_avx2<const N: usize>(view: &View, thread: &Thread) -> Far {
    segment_lanes::<N>(view, thread)
}

#[inline(always)]
fn node_lanes(view: &View, node: &Node) -> Far {
    let mut toward = [[0.0; LANES]; 3];
    let mut depth = [0.0; LANES];
    let mut distance2 = [0.0; LANES];
    let mut near = [0_u32; LANES];
    for lane in 0..LANES {
        let x = node.center[0][lane] - view.position[0];
        let y = node.center[1][lane] - view.position[1];
        let z = node.center[2][lane] - view.position[2];
        let d2 = x * x + y * y + z * z;
        let radius = node.radius[lane];
        let far = radius * radius.abs() < view.limit * d2;
        let lump = node.mass[lane] * sine(&node.tensor.map(|t| t[lane]), x, y, z, d2) / d2 * view.face_weight;
        depth[lane] = if far { lump } else { 0.0 };
        distance2[lane] = d2;
        near[lane] = u32::from(!far);
        toward[0][lane] = x;
        toward[1][lane] = y;
        toward[2][lane] = z;
    }
    let cell = view.cells(&toward, &mut depth);
    Far { cell, depth, distance2, near: mask(&near), in_two: 0, in_four: 0, count: LANES }
}

/// Root of the mean squared sine between the hair of a cluster and the direction (x, y, z) of squared length `d2`.
#[inline(always)]
fn sine(tensor: &[f32; 6], x: f32, y: f32, z: f32, d2: f32) -> f32 {
    let [xx, yy, zz, xy, xz, yz] = *tensor;
    let along = x * x * xx + y * y * yy + z * z * zz + 2.0 * (x * y * xy + x * z * xz + y * z * yz);
    // Rounding may take it below zero where all hair points at the viewer.
    let sine2 = 1.0 - along / d2;
    (if sine2 > 0.0 { sine2 } else { 0.0 }).sqrt()
}

#[inline(always)]
fn bundle_lanes<const N: usize>(view: &View, bundle: &Bundle) -> Far {
    let Bundle { a, along, mass, tensor } = *bundle;
    let mut toward = [[0.0; N]; 3];
    let mut depth = [0.0; N];
    let mut distance2 = [0.0; N];
    for lane in 0..N {
        let s = (lane as f32 + 0.5) * (1.0 / N as f32);
        let [x, y, z] = [a.x + s * along.x, a.y + s * along.y, a.z + s * along.z];
        let d2 = x * x + y * y + z * z;
        depth[lane] = mass * (1.0 / N as f32) * sine(&tensor, x, y, z, d2) / d2 * view.face_weight;
        distance2[lane] = d2;
        toward[0][lane] = x;
        toward[1][lane] = y;
        toward[2][lane] = z;
    }
    let cell = view.cells(&toward, &mut depth);
    Far::of(&cell, &depth, &distance2)
}

#[inline(always)]
fn block_lanes(view: &View, block: &Block) -> Far {
    let mut far = block_lumps(view, block, 0.5, 1.0, u32::MAX);
    let [mut near, mut in_two, mut in_four] = [[0_u32; LANES]; 3];
    for lane in 0..LANES {
        let (u, v, w) = (
            block.b[0][lane] - block.a[0][lane],
            block.b[1][lane] - block.a[1][lane],
            block.b[2][lane] - block.a[2][lane],
        );
        let length2 = u * u + v * v + w * w;
        let d2 = far.distance2[lane];
        let width = 0.5 * (block.widths[0][lane] + block.widths[1][lane]);
        let narrow = width * width < view.slice2 * d2;
        let one = (0.25 * length2 < view.stride2 * d2) & narrow;
        // No point of the segment is nearer than its middle less half its length.
        let gap = d2.sqrt() - 0.5 * length2.sqrt();
        let gap2 = gap * gap.abs();
        let narrow = width * width < view.slice2 * gap2;
        near[lane] = u32::from(!one);
        in_two[lane] = u32::from(!one & narrow & (length2 < 16.0 * view.stride2 * gap2));
        in_four[lane] = u32::from(!one & narrow & (length2 < 64.0 * view.stride2 * gap2));
        far.depth[lane] = if one { far.depth[lane] } else { 0.0 };
    }
    (far.near, far.in_two) = (mask(&near), mask(&in_two));
    far.in_four = mask(&in_four) & !far.in_two;
    far
}

/// One lump of each segment of a block: the part of length `share` around the parameter `s`. Lanes outside `wanted` get no depth.
#[inline(always)]
fn block_lumps(view: &View, block: &Block, s: f32, share: f32, wanted: u32) -> Far {
    let mut toward = [[0.0; LANES]; 3];
    let mut depth = [0.0; LANES];
    let mut distance2 = [0.0; LANES];
    for lane in 0..LANES {
        let (u, v, w) = (
            block.b[0][lane] - block.a[0][lane],
            block.b[1][lane] - block.a[1][lane],
            block.b[2][lane] - block.a[2][lane],
        );
        let x = block.a[0][lane] - view.position[0] + s * u;
        let y = block.a[1][lane] - view.position[1] + s * v;
        let z = block.a[2][lane] - view.position[2] + s * w;
        let d2 = x * x + y * y + z * z;
        let (p, q, r) = (v * z - w * y, w * x - u * z, u * y - v * x);
        let width = block.widths[0][lane] + s * (block.widths[1][lane] - block.widths[0][lane]);
        let distance = d2.sqrt();
        let solid_angle = width * share * (p * p + q * q + r * r).sqrt() / (d2 * distance);
        let opacity = block.opacity[lane];
        let saturation = saturation(opacity * view.crossing * width / distance);
        let lump = solid_angle * view.face_weight * opacity * saturation;
        depth[lane] = if wanted >> lane & 1 == 1 { lump } else { 0.0 };
        distance2[lane] = d2;
        toward[0][lane] = x;
        toward[1][lane] = y;
        toward[2][lane] = z;
    }
    let cell = view.cells(&toward, &mut depth);
    Far { cell, depth, distance2, near: 0, in_two: 0, in_four: 0, count: LANES }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn block_lumps_avx2(view: &View, block: &Block, s: f32, share: f32, wanted: u32) -> Far {
    block_lumps(view, block, s, share, wanted)
}

/// -ln(1 - x) / x, to 1e-6 for x up to 1/2 and to 2e-3 for x up to 0.8, where a strand is as wide as a part of a face.
///
/// A segment's layer is not alone in its face: the strand goes on. With x the share that the strand takes where it crosses the
/// face, and a segment's optical depth in proportion to its length, it does not matter how finely the strand is cut.
#[inline(always)]
fn saturation(x: f32) -> f32 {
    // -ln(1 - x) = 2 artanh(x / (2 - x)).
    let k = x / (2.0 - x);
    let k2 = k * k;
    2.0 / (2.0 - x) * (1.0 + k2 * (1.0 / 3.0 + k2 * (1.0 / 5.0 + k2 * (1.0 / 7.0 + k2 * (1.0 / 9.0)))))
}

#[inline(always)]
fn segment_lanes<const N: usize>(view: &View, thread: &Thread) -> Far {
    let Thread { a, along, widths, opacity } = *thread;
    let mut toward = [[0.0; N]; 3];
    let mut depth = [0.0; N];
    let mut distance2 = [0.0; N];
    // Twice the area between the viewer and a part of the segment, wherever that lies.
    let area = along.cross(a).length() * (1.0 / N as f32);
    for lane in 0..N {
        let s = (lane as f32 + 0.5) * (1.0 / N as f32);
        let [x, y, z] = [a.x + s * along.x, a.y + s * along.y, a.z + s * along.z];
        let d2 = x * x + y * y + z * z;
        let distance = d2.sqrt();
        let width = widths[0] + (widths[1] - widths[0]) * s;
        let saturation = saturation(opacity * view.crossing * width / distance);
        depth[lane] = width * area / (d2 * distance) * view.face_weight * opacity * saturation;
        distance2[lane] = d2;
        toward[0][lane] = x;
        toward[1][lane] = y;
        toward[2][lane] = z;
    }
    let cell = view.cells(&toward, &mut depth);
    Far::of(&cell, &depth, &distance2)
}

#[inline(always)]
fn mask(near: &[u32; LANES]) -> u32 {
    near.iter().enumerate().fold(0, |bits, (lane, near)| bits | near << lane)
}

/// The bits that are set, lowest first.
#[inline]
pub fn bits(mut mask: u32) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then(|| mask.trailing_zeros());
        mask &= mask.wrapping_sub(1);
        bit
    })
}

/// Asks for what will be read soon: a walk through a large tree mostly waits for memory.
#[inline]
pub fn prefetch<T>(wanted: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let start = std::ptr::from_ref(wanted).cast::<i8>();
        for offset in (0..size_of::<T>()).step_by(64) {
            // SAFETY: the address lies inside `wanted`, and a prefetch reads nothing that the program could see.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(start.add(offset)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = wanted;
}

/// exp(-x) of each depth, in place, with a relative error below 1e-5; exactly 0 from x = 87 on.
pub fn exponentials(depths: &mut [f32]) {
    #[cfg(target_arch = "x86_64")]
    if has_avx2() {
        // SAFETY: the processor has AVX2.
        return unsafe { exponentials_avx2(depths) };
    }
    exponentials_lanes(depths);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn exponentials_avx2(depths: &mut [f32]) {
    exponentials_lanes(depths);
}

#[inline(always)]
fn exponentials_lanes(depths: &mut [f32]) {
    for depth in depths {
        let x = at_most(*depth, 87.0) * std::f32::consts::LOG2_E;
        // SAFETY: x is from 0 to 126.
        let whole = unsafe { (x + 0.5).to_int_unchecked::<i32>() };
        // 2^-f for f in [-1/2, 1/2] by Taylor's series.
        let f = (whole as f32 - x) * std::f32::consts::LN_2;
        let part = 1.0 + f * (1.0 + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f / 720.0)))));
        let power = f32::from_bits(((127 - whole) as u32) << 23);
        *depth = if *depth < 87.0 { part * power } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::{hash, to_unit};
    use crate::occlusion::frame_around;

    fn lanes(key: u32, low: f32, high: f32) -> Lanes {
        std::array::from_fn(|lane| low + (high - low) * to_unit(hash(&[key, lane as u32])))
    }

    fn node(key: u32) -> Node {
        let key = 100 * key;
        let diagonal = lanes(key + 5, 0.0, 1.0);
        let mut radius = lanes(key + 3, 0.0, 0.5);
        radius[15] = -1.0;
        Node {
            center: std::array::from_fn(|axis| lanes(key + axis as u32, -1.0, 1.0)),
            radius,
            half: std::array::from_fn(|axis| lanes(key + 10 + axis as u32, -0.3, 0.3)),
            thickness: lanes(key + 13, 0.0, 0.1),
            mass: lanes(key + 4, 0.0, 1e-3),
            tensor: [diagonal, diagonal.map(|t| 1.0 - t), [0.0; LANES], [0.1; LANES], [0.0; LANES], [0.0; LANES]],
            least_hash: [0.0; LANES],
        }
    }

    fn block(key: u32) -> Block {
        let key = 100 * key + 50;
        let a: [Lanes; 3] = std::array::from_fn(|axis| lanes(key + axis as u32, -1.0, 1.0));
        let step: [Lanes; 3] = std::array::from_fn(|axis| lanes(key + 3 + axis as u32, -0.05, 0.05));
        Block {
            a,
            b: std::array::from_fn(|axis| std::array::from_fn(|lane| a[axis][lane] + step[axis][lane])),
            widths: [lanes(key + 6, 0.0, 0.01), lanes(key + 7, 0.0, 0.01)],
            opacity: lanes(key + 8, 0.0, 1.0),
            hash: [0.0; LANES],
            segment: [0; LANES],
        }
    }

    #[test]
    fn wide_and_baseline_code_give_the_same_bits() {
        if !has_avx2() {
            eprintln!("skipped: this processor has no AVX2");
            return;
        }
        let igloo = Igloo::new(Span::Hemisphere, 100);
        for key in 0..500 {
            let position = Vec3::from_array(std::array::from_fn(|i| lanes(key, -1.0, 1.0)[i]));
            let view = View::new(position, frame_around(position.normalize()), &igloo, 0.05, 0.05);
            assert_eq!(view.node(&node(key)), view.narrow().node(&node(key)));
            let block = block(key);
            assert_eq!(view.block(&block), view.narrow().block(&block));
            for lane in 0..LANES {
                let [a, b] = block.ends(lane).map(|end| end - position);
                let thread = Thread { a, along: b - a, widths: [0.001, 0.002], opacity: block.opacity[lane] };
                assert_eq!(view.segment(&thread), view.narrow().segment(&thread));
            }
        }
        let mut wide: Vec<f32> = (0..10_000).map(|i| 0.01 * i as f32).collect();
        let mut baseline = wide.clone();
        exponentials(&mut wide);
        exponentials_lanes(&mut baseline);
        assert_eq!(wide, baseline);
    }

    #[test]
    fn far_lanes_are_the_formulas_in_f64() {
        let igloo = Igloo::new(Span::Sphere, 100);
        let (mut far_lanes, mut same_face) = (0, 0);
        for key in 0..200 {
            let (node, position) = (node(key), Vec3::new(0.2, -0.1, 0.3));
            let view = View::new(position, Mat3::IDENTITY, &igloo, 0.09, 0.05);
            let far = view.node(&node);
            for lane in 0..LANES {
                let toward = Vec3::from_array(node.center.map(|c| c[lane])).as_dvec3() - position.as_dvec3();
                let is_far = node.radius[lane] < 0.0 || f64::from(node.radius[lane]) < 0.3 * toward.length();
                assert_eq!(far.near >> lane & 1 == 0, is_far);
                if !is_far {
                    assert_eq!(far.depth[lane], 0.0);
                    continue;
                }
                let d = toward.normalize();
                let t = node.tensor.map(|t| f64::from(t[lane]));
                let along = d.x * d.x * t[0] + d.y * d.y * t[1] + 2.0 * d.x * d.y * t[3];
                let want = f64::from(node.mass[lane]) * (1.0 - along).sqrt()
                    / toward.length_squared()
                    / f64::from(igloo.face_solid_angle());
                assert!((f64::from(far.depth[lane]) / want - 1.0).abs() < 1e-5);
                far_lanes += 1;
                let face = igloo.lookup().faces()[far.cell[lane] as usize] as usize;
                same_face += usize::from(face == igloo.face_of(d.as_vec3()));
                // The neighbour at most, across a border.
                assert!(igloo.center(face).dot(d.as_vec3()) > (1.2 * igloo.face_width()).cos());
            }
        }
        assert!(far_lanes > 1000 && same_face * 100 > far_lanes * 80, "{same_face} of {far_lanes}");
    }

    #[test]
    fn a_segment_in_lumps_is_the_closed_form() {
        let igloo = Igloo::new(Span::Sphere, 100);
        let view = View::new(Vec3::ZERO, Mat3::IDENTITY, &igloo, 0.01, 0.05);
        let mut tried = 0;
        for key in 0..300 {
            let [a, along] = [key, key + 1000].map(|key| Vec3::from_slice(&lanes(key, -1.0, 1.0)[..3]));
            let thread = Thread { a, along, widths: [1e-4; 2], opacity: 1.0 };
            let Some(far) = view.segment(&thread).filter(|_| a.length() > 0.3) else { continue };
            let (a, b) = (a.as_dvec3(), (a + along).as_dvec3());
            let u = (b - a).normalize();
            let h = (a - u * a.dot(u)).length();
            let want = 1e-4 / h * (b.dot(u) / b.length() - a.dot(u) / a.length()) / f64::from(igloo.face_solid_angle());
            let sum: f64 = far.depth.iter().map(|&depth| f64::from(depth)).sum();
            assert!((sum / want - 1.0).abs() < 0.02, "{thread:?}: {sum} against {want}");
            tried += 1;
        }
        assert!(tried > 100, "{tried}");
    }

    #[test]
    fn saturation_is_the_logarithm() {
        for i in 1..500 {
            let x = 0.001 * i as f32;
            let want = -(1.0 - f64::from(x)).ln() / f64::from(x);
            assert!((f64::from(saturation(x)) / want - 1.0).abs() < 2e-6, "{x}");
        }
    }

    #[test]
    fn exponentials_are_those_of_f64() {
        for i in 0..86_000 {
            let x = 0.001 * i as f32;
            let mut value = [x];
            exponentials(&mut value);
            assert!((f64::from(value[0]) / (-f64::from(x)).exp() - 1.0).abs() < 1e-5, "{x}: {}", value[0]);
        }
        let mut ends = [0.0, f32::INFINITY, 1e30];
        exponentials(&mut ends);
        assert_eq!(ends, [1.0, 0.0, 0.0]);
    }
}
