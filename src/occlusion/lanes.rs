//! Sixteen clusters or segments at a time: what of them is far, and where on the map how much of it falls.
//!
//! Plain loops over `[f32; 16]`, which the compiler turns into vector code. All of it is inlined into one query (see `walk`), which is
//! compiled for AVX-512, for AVX2 and for the baseline. Additions and multiplications are never fused, so all give the same bits.
//! Loops have no branches, only selections. Distances in the unit of render space; amounts are solid angles times opacity.

use glam::Vec3;

use super::view::{Directions, Splat, View, between};

/// Lanes of a node and of a block.
pub const LANES: usize = 16;

/// All lanes, as bits.
pub const ALL: u32 = (1 << LANES) - 1;

pub type Lanes = [f32; LANES];

/// Coordinate of lanes that hold nothing: far away from everything, and its square is finite.
pub const NOWHERE: f32 = 1e15;

/// Sixteen clusters, each standing for one child.
///
/// Aligned to cache lines, as what follows: a read of sixteen lanes then touches one line, not two.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Node {
    /// Centroids.
    pub center: [Lanes; 3],
    /// Radius around the centroid that holds all of the child's segments; 0 in a lane without child.
    pub radius: Lanes,
    /// Radius of the even ball whose hair is as far from the centroid in the mean square.
    pub extent: Lanes,
    /// The child as a rod: half the mean segment, which runs through the centroid,
    pub half: [Lanes; 3],
    /// 1 / its square, infinite where it has no length,
    pub inverse_half2: Lanes,
    /// and the distance within which all of its segments run beside that one, from end to end.
    pub thickness: Lanes,
    /// Square of an opening: up to it no child is a thin rod that is not a lump already.
    pub stout2: f32,
    /// Σ width · length · opacity, times what makes the sine of the mean angle that of the mean (see `clusters`).
    pub mass: Lanes,
    /// Σ width · length · opacity · u uᵀ / Σ width · length · opacity: xx, yy, zz, xy, xz, yz.
    pub tensor: [Lanes; 6],
}

/// Sixteen segments.
#[derive(Clone, Debug, Default)]
#[repr(align(64))]
pub struct Block {
    pub a: [Lanes; 3],
    pub b: [Lanes; 3],
    pub widths: [Lanes; 2],
    /// Share of the light that one crossing takes.
    pub opacity: Lanes,
    pub strand: [u32; LANES],
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

/// How much steeper the sides of the tent are for a lump of no extent than for the largest; the tent blurs small ones more than need
/// be. It was chosen on an even ball of hair; clumps would have it steeper yet.
const STEEPER: f32 = 0.75;

/// The share of its distance that a child's radius must stay below for a lump, whatever its extent: no hair near the viewer is taken so.
const CLEAR: f32 = 0.9;

/// In how many lumps lanes are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Division {
    /// Bits of lanes: one lump, and nearer or wider than lumps are for. The others are taken in
    pub one: u32,
    pub near: u32,
    /// Bits of lanes that hold anything.
    pub used: u32,
    /// this many lumps: 2, 4 or 8.
    pub lumps: [u32; LANES],
}

/// Root of the mean squared sine between a lane's hair and a direction; `inverse` is 1 over the direction's squared length.
#[inline(always)]
fn sine(tensor: &[Lanes; 6], lane: usize, [x, y, z]: [f32; 3], inverse: f32) -> f32 {
    let [xx, yy, zz, xy, xz, yz] = tensor;
    let along = x * x * xx[lane]
        + y * y * yy[lane]
        + z * z * zz[lane]
        + 2.0 * (x * y * xy[lane] + x * z * xz[lane] + y * z * yz[lane]);
    // Rounding may take it below zero.
    let sine2 = 1.0 - along * inverse;
    (if sine2 > 0.0 { sine2 } else { 0.0 }).sqrt()
}

/// The lanes of a node: its far children as lumps, and how the others are taken.
#[inline(always)]
pub fn node<D: Directions>(view: &View<D>, node: &Node) -> ((Splat<LANES>, Lanes), Division) {
    let mut toward = [[0.0; LANES]; 3];
    let [mut amount, mut distance2] = [[0.0; LANES]; 2];
    let mut steepness = [1.0; LANES];
    let mut lumps = [0_u32; LANES];
    for lane in 0..LANES {
        let x = node.center[0][lane] - view.position[0];
        let y = node.center[1][lane] - view.position[1];
        let z = node.center[2][lane] - view.position[2];
        let d2 = x * x + y * y + z * z;
        let r2 = node.extent[lane] * node.extent[lane];
        let clear = node.radius[lane] * node.radius[lane] < CLEAR * CLEAR * d2;
        let inverse = 1.0 / d2;
        let sine = sine(&node.tensor, lane, [x, y, z], inverse);
        amount[lane] = node.mass[lane] * sine * inverse;
        distance2[lane] = d2;
        lumps[lane] = if (r2 < view.limit2 * d2) & clear { 1 } else { NEAR };
        toward[0][lane] = x;
        toward[1][lane] = y;
        toward[2][lane] = z;
        let steep = 1.0 + STEEPER * (1.0 - r2 * inverse * view.inverse_limit2);
        steepness[lane] = if steep > 1.0 { steep } else { 1.0 };
    }
    if view.limit2 > node.stout2 {
        rods(view, node, &toward, &mut lumps);
    }
    keep(&mut amount, &lumps);
    ((view.splat(&toward, &amount, Some(&steepness)), distance2), division(lumps, ALL))
}

/// Of the children that are not lumps, the thin ones as rods.
#[inline(always)]
fn rods<D: Directions>(view: &View<D>, node: &Node, toward: &[Lanes; 3], lumps: &mut [u32; LANES]) {
    for lane in 0..LANES {
        let half = [node.half[0][lane], node.half[1][lane], node.half[2][lane]];
        let center = [toward[0][lane], toward[1][lane], toward[2][lane]];
        let (length2, nearest2) = rod(center, half, node.inverse_half2[lane]);
        let thickness = node.thickness[lane];
        let thin = thickness * thickness < view.limit2 * nearest2;
        let split = pieces(length2, view.limit2 * nearest2);
        lumps[lane] = if (lumps[lane] == NEAR) & thin { split } else { lumps[lane] };
    }
}

/// The square of an opening up to which a child is no thin rod that is not a lump already.
///
/// A rod that is thin has thickness < opening · distance; with thickness >= extent its extent is below that, too, and with
/// opening · radius <= `CLEAR` · thickness the child is far enough away.
pub fn stout2(extent: f32, radius: f32, thickness: f32) -> f32 {
    if thickness >= extent { (CLEAR * thickness / radius).powi(2) } else { 0.0 }
}

/// Squared half length of a rod, and squared distance from the origin to it; `center` relative to the origin.
#[inline(always)]
fn rod(center: [f32; 3], half: [f32; 3], inverse_half2: f32) -> (f32, f32) {
    let [x, y, z] = center;
    let [u, v, w] = half;
    let length2 = u * u + v * v + w * w;
    let s = -(x * u + y * v + z * w) * inverse_half2;
    // Where the rod has no length, `s` is not a number.
    let s = if s > -1.0 { s } else { -1.0 };
    let s = if s < 1.0 { s } else { 1.0 };
    let (x, y, z) = (x + s * u, y + s * v, z + s * w);
    (length2, x * x + y * y + z * z)
}

/// What stands for "near" among numbers of lumps.
pub const NEAR: u32 = 16;

/// Added to a segment's number of lumps where it is of the receiver's own strand.
pub const OWN: u32 = 32;

/// In how many lumps a rod is taken, so that the half length of each is below the bound; both squared.
#[inline(always)]
fn pieces(half_length2: f32, bound2: f32) -> u32 {
    let count = if half_length2 < 64.0 * bound2 { 8 } else { NEAR };
    let count = if half_length2 < 16.0 * bound2 { 4 } else { count };
    let count = if half_length2 < 4.0 * bound2 { 2 } else { count };
    if half_length2 < bound2 { 1 } else { count }
}

/// Leaves nothing of the lanes that have no 1.
#[inline(always)]
fn keep(amount: &mut Lanes, wanted: &[u32; LANES]) {
    for lane in 0..LANES {
        amount[lane] = if wanted[lane] == 1 { amount[lane] } else { 0.0 };
    }
}

#[inline(always)]
fn division(lumps: [u32; LANES], used: u32) -> Division {
    Division { one: mask(&lumps, 1) & used, near: mask(&lumps, NEAR) & used, used, lumps }
}

/// The lanes of a block: its far segments as lumps, and how the others are taken; those of the strand `own` are all among the others.
#[inline(always)]
pub fn block<D: Directions>(view: &View<D>, block: &Block, own: u32) -> ((Splat<LANES>, Lanes), Division) {
    let mut toward = [[0.0; LANES]; 3];
    let [mut amount, mut distance2] = [[0.0; LANES]; 2];
    let mut lumps = [0_u32; LANES];
    for lane in 0..LANES {
        let place = place(view, block, lane, 0.5);
        let (half2, nearest2) = place.nearest();
        // Both sides times the squared half length: nothing is divided.
        let narrow = place.width * place.width * half2 < view.wide2 * nearest2;
        let split = pieces(half2 * half2, view.stride2 * nearest2);
        lumps[lane] = if narrow { split } else { NEAR } + if block.strand[lane] == own { OWN } else { 0 };
        (amount[lane], distance2[lane]) = place.lump(view, block.opacity[lane], 1.0);
        toward[0][lane] = place.toward[0];
        toward[1][lane] = place.toward[1];
        toward[2][lane] = place.toward[2];
    }
    keep(&mut amount, &lumps);
    ((view.splat(&toward, &amount, None), distance2), division(lumps, ALL & !mask(&block.segment, u32::MAX)))
}

/// A place on a segment.
struct Place {
    /// From the viewer.
    toward: [f32; 3],
    /// From one end of the segment to the other.
    along: [f32; 3],
    width: f32,
}

/// The place `s`, from 0 to 1, along a lane's segment.
#[inline(always)]
fn place<D: Directions>(view: &View<D>, block: &Block, lane: usize, s: f32) -> Place {
    let (u, v, w) =
        (block.b[0][lane] - block.a[0][lane], block.b[1][lane] - block.a[1][lane], block.b[2][lane] - block.a[2][lane]);
    let x = block.a[0][lane] - view.position[0] + s * u;
    let y = block.a[1][lane] - view.position[1] + s * v;
    let z = block.a[2][lane] - view.position[2] + s * w;
    let width = block.widths[0][lane] + s * (block.widths[1][lane] - block.widths[0][lane]);
    Place { toward: [x, y, z], along: [u, v, w], width }
}

impl Place {
    /// Squared half length of the segment, and that times its squared distance from the viewer; the place is its middle.
    ///
    /// At the parameter s of half lengths h from the middle m, |m + s h|² h² = m² h² + t (2 m·h + t) with t = s h², which lies from -h² to h². What cancels
    /// where the viewer is near the line is rounding of m² h², as much as a distance of 1e-3 of the larger of both: such a segment is no lump.
    #[inline(always)]
    fn nearest(&self) -> (f32, f32) {
        let ([x, y, z], [u, v, w]) = (self.toward, self.along.map(|u| 0.5 * u));
        let half2 = u * u + v * v + w * w;
        let along = x * u + y * v + z * w;
        let t = between(-half2, -along, half2);
        (half2, (x * x + y * y + z * z) * half2 + t * (2.0 * along + t))
    }

    /// Amount and squared distance of the lump there of the part `share` of the segment.
    #[inline(always)]
    fn lump<D: Directions>(&self, view: &View<D>, opacity: f32, share: f32) -> (f32, f32) {
        let ([x, y, z], [u, v, w]) = (self.toward, self.along);
        let d2 = x * x + y * y + z * z;
        let (p, q, r) = (v * z - w * y, w * x - u * z, u * y - v * x);
        let inverse = 1.0 / d2;
        let inverse_root = inverse.sqrt();
        let solid_angle = self.width * share * (p * p + q * q + r * r).sqrt() * inverse * inverse_root;
        (solid_angle * opacity * saturation(opacity * view.crossing * self.width * inverse_root), d2)
    }
}

/// Sixteen rods of parallel hair, gathered from nodes.
#[derive(Clone, Debug, Default)]
#[repr(align(64))]
pub struct Rods {
    pub center: [Lanes; 3],
    pub half: [Lanes; 3],
    pub mass: Lanes,
    pub tensor: [Lanes; 6],
}

/// One lump of each rod: its share `share` around the parameter `s`, from -1 to 1 along it.
#[inline(always)]
pub fn rod_lumps<D: Directions>(
    view: &View<D>,
    rods: &Rods,
    s: f32,
    share: f32,
    wanted: &[u32; LANES],
) -> (Splat<LANES>, Lanes) {
    let mut toward = [[0.0; LANES]; 3];
    let [mut amount, mut distance2] = [[0.0; LANES]; 2];
    for lane in 0..LANES {
        let x = rods.center[0][lane] - view.position[0] + s * rods.half[0][lane];
        let y = rods.center[1][lane] - view.position[1] + s * rods.half[1][lane];
        let z = rods.center[2][lane] - view.position[2] + s * rods.half[2][lane];
        let d2 = x * x + y * y + z * z;
        let inverse = 1.0 / d2;
        let sine = sine(&rods.tensor, lane, [x, y, z], inverse);
        amount[lane] = rods.mass[lane] * share * sine * inverse;
        distance2[lane] = d2;
        toward[0][lane] = x;
        toward[1][lane] = y;
        toward[2][lane] = z;
    }
    keep(&mut amount, wanted);
    (view.splat(&toward, &amount, None), distance2)
}

/// One lump of each segment of a block: the part of length `share` around the parameter `s`, from 0 to 1 along it.
#[inline(always)]
pub fn block_lumps<D: Directions>(
    view: &View<D>,
    block: &Block,
    s: f32,
    share: f32,
    wanted: &[u32; LANES],
) -> (Splat<LANES>, Lanes) {
    let mut toward = [[0.0; LANES]; 3];
    let [mut amount, mut distance2] = [[0.0; LANES]; 2];
    for lane in 0..LANES {
        let place = place(view, block, lane, s);
        (amount[lane], distance2[lane]) = place.lump(view, block.opacity[lane], share);
        toward[0][lane] = place.toward[0];
        toward[1][lane] = place.toward[1];
        toward[2][lane] = place.toward[2];
    }
    keep(&mut amount, wanted);
    (view.splat(&toward, &amount, None), distance2)
}

/// -ln(1 - x) / x, to 1e-6 for x up to 1/2 and to 2e-3 for x up to 0.8, where a strand is nearly as wide as a cell.
///
/// A segment's layer is not alone in its cell: the strand goes on. With x the share that the strand takes where it crosses the
/// cell, and a segment's optical depth in proportion to its length, it does not matter how finely the strand is cut.
#[inline(always)]
pub fn saturation(x: f32) -> f32 {
    // -ln(1 - x) = 2 artanh(x / (2 - x)).
    let k = x / (2.0 - x);
    let k2 = k * k;
    2.0 / (2.0 - x) * (1.0 + k2 * (1.0 / 3.0 + k2 * (1.0 / 5.0 + k2 * (1.0 / 7.0 + k2 * (1.0 / 9.0)))))
}

/// Bits of the lanes that hold this value.
#[inline(always)]
fn mask(lanes: &[u32; LANES], value: u32) -> u32 {
    let mut set = [0_u8; LANES];
    for lane in 0..LANES {
        set[lane] = if lanes[lane] == value { 0xff } else { 0 };
    }
    // Compilers do not find the one instruction that gathers bits: they take the lanes one by one.
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_mm_loadu_si128, _mm_movemask_epi8};
        // SAFETY: SSE2 is part of x86-64, and `set` has 16 bytes; the load need not be aligned.
        unsafe { _mm_movemask_epi8(_mm_loadu_si128(set.as_ptr().cast())) as u32 }
    }
    #[cfg(not(target_arch = "x86_64"))]
    set.iter().enumerate().fold(0, |bits, (lane, set)| bits | u32::from(set & 1) << lane)
}

/// The bits that are set, lowest first.
#[inline(always)]
pub fn bits(mut mask: u32) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then(|| mask.trailing_zeros());
        mask &= mask.wrapping_sub(1);
        bit
    })
}

/// Asks for what will be read soon: a walk through a large tree mostly waits for memory.
#[inline(always)]
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
#[inline(always)]
pub fn exponentials(depths: &mut [f32]) {
    for depth in depths {
        let x = between(0.0, *depth, 87.0) * std::f32::consts::LOG2_E;
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
mod tests;
