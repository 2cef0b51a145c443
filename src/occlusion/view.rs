//! Who looks at hair, how finely, and where on the map of directions what is seen falls.
//!
//! Part of the kernels (see `lanes`): all of it is inlined into one query, plain loops without branches.

use std::marker::PhantomData;

use glam::Vec3;

use super::depth_map::Grid;
use super::segment::MEAN_CHORD;
use super::{DepthMap, Receiver};

/// A kind of map and how it lies, known to the compiler: each kind has its own way to the square.
pub trait Directions: Copy {
    /// Directions around the igloo's z axis alone.
    const HEMISPHERE: bool;
    /// Whether the igloo's axes are other than render space's.
    const TURNED: bool;
}

/// All directions, in render space's axes: what hair asks for.
#[derive(Clone, Copy, Debug)]
pub enum Upright {}

/// All directions, in axes of their own.
#[derive(Clone, Copy, Debug)]
pub enum Turned {}

/// Directions above a surface.
#[derive(Clone, Copy, Debug)]
pub enum Above {}

impl Directions for Upright {
    const HEMISPHERE: bool = false;
    const TURNED: bool = false;
}

impl Directions for Turned {
    const HEMISPHERE: bool = false;
    const TURNED: bool = true;
}

impl Directions for Above {
    const HEMISPHERE: bool = true;
    const TURNED: bool = true;
}

/// Who looks, and how finely.
#[derive(Clone, Copy, Debug)]
pub struct View<D> {
    directions: PhantomData<D>,
    pub position: [f32; 3],
    /// Rows: the igloo's axes in render space.
    axes: [[f32; 3]; 3],
    grid: Grid,
    /// Square of the angular extent below which a child is a lump.
    pub limit2: f32,
    /// 1 / that, infinite where it is 0.
    pub inverse_limit2: f32,
    /// Square of the angular half length up to which a piece of hair is one lump.
    pub stride2: f32,
    /// Square of the angular width from which on a segment is a ribbon wider than its lumps.
    pub wide2: f32,
    /// Share of a cell that a strand of angular width 1 covers where it crosses the cell.
    pub crossing: f32,
}

/// A strand's piece is one lump up to this half length, in widths of a cell. Shorter pieces cost more, and the light between the
/// lumps makes up for what is lost of gaps finer than a cell: at two thirds of this the error is as large or larger on all hair measured.
const STRIDE: f32 = 1.5;

/// The longest half length of one lump, in radians: on coarse maps, what its middle says of the whole would be wrong.
const LONGEST: f32 = 0.4;

/// A strand from this width on is a ribbon of several lumps across, in widths of a cell.
pub const WIDE: f32 = 0.75;

/// What falls where: an amount for each of four cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat<const N: usize> {
    /// Index of the upper left cell.
    pub cell: [u32; N],
    /// For the upper left, upper right, lower left and lower right cell.
    pub amount: [[f32; 4]; N],
}

impl<D: Directions> View<D> {
    /// `opening` is the largest angular extent of a lump, in radians.
    pub fn new(receiver: &Receiver, map: &DepthMap, opening: f32) -> Self {
        let cell = map.cell_width();
        Self {
            directions: PhantomData,
            position: receiver.position.to_array(),
            axes: receiver.frame.to_cols_array_2d(),
            grid: map.grid(),
            limit2: opening * opening,
            inverse_limit2: 1.0 / (opening * opening),
            stride2: (STRIDE * cell).min(LONGEST).powi(2),
            wide2: (WIDE * cell).powi(2),
            crossing: MEAN_CHORD / cell,
        }
    }

    /// Share of a cell that a strand of this angular width covers where it crosses the cell.
    #[inline(always)]
    pub fn crossing(&self, apparent_width: f32) -> f32 {
        self.crossing * apparent_width
    }

    /// A vector in the igloo's axes.
    #[inline(always)]
    pub fn in_igloo(&self, v: Vec3) -> Vec3 {
        Vec3::from_array(self.axes.map(|axis| axis[0] * v.x + axis[1] * v.y + axis[2] * v.z))
    }

    /// Points of the square of directions of any length in render space's axes, in cells from the border's outer edge.
    ///
    /// Below a hemisphere's horizon they lie outside the square, and maybe outside the border.
    #[inline(always)]
    fn square(&self, toward: [f32; 3]) -> (f32, f32) {
        let [x, y, z] = toward;
        let [x, y, z] = if D::TURNED { self.axes.map(|axis| axis[0] * x + axis[1] * y + axis[2] * z) } else { toward };
        let (u, v) = if D::HEMISPHERE { hemisphere_square(x, y, z) } else { sphere_square(x, y, z) };
        let half = self.grid.half;
        (half + half * u + 1.0, half + half * v + 1.0)
    }

    /// The cells in which directions lie; cells of the border for what is below a hemisphere's horizon.
    #[inline(always)]
    pub fn cells<const N: usize>(&self, toward: &[[f32; N]; 3]) -> [u32; N] {
        let last = 2.0 * self.grid.half + 1.999;
        // On a sphere nothing lies in the border but what rounding puts there.
        let [low, high] = if D::HEMISPHERE { [0.0, last] } else { [1.0, last - 1.0] };
        let mut cells = [0; N];
        for lane in 0..N {
            let (x, y) = self.square([toward[0][lane], toward[1][lane], toward[2][lane]]);
            cells[lane] = self.cell(between(low, x, high), between(low, y, high));
        }
        cells
    }

    #[inline(always)]
    fn cell(&self, x: f32, y: f32) -> u32 {
        // SAFETY: `between` gave both; they are from 0 to less than the stride, which is below 2^16.
        let (column, row) = unsafe { (x.to_int_unchecked::<i32>(), y.to_int_unchecked::<i32>()) };
        row as u32 * self.grid.stride + column as u32
    }

    /// Spreads lumps in the given directions over four cells each: by a tent, or by one of steeper sides around a flat top.
    #[inline(always)]
    pub fn splat<const N: usize>(
        &self,
        toward: &[[f32; N]; 3],
        amount: &[f32; N],
        steepness: Option<&[f32; N]>,
    ) -> Splat<N> {
        let last = 2.0 * self.grid.half + 0.999;
        let mut splat = Splat { cell: [0; N], amount: [[0.0; 4]; N] };
        for lane in 0..N {
            let (x, y) = self.square([toward[0][lane], toward[1][lane], toward[2][lane]]);
            // From the middle of one cell to that of the next. The border is one cell wide: what falls beyond it is lost.
            let (x, y) = (x - 0.5, y - 0.5);
            // All of a sphere lies inside; what is not a direction, of no length or of too much, has no place in either coordinate.
            let inside = (x >= 0.0) & (x <= last) & (!D::HEMISPHERE | (y >= 0.0) & (y <= last));
            let (x, y) = (between(0.0, x, last), between(0.0, y, last));
            let (fx, fy) = (x - x.trunc(), y - y.trunc());
            let steep = |f: f32| steepness.map_or(f, |s| between(0.0, (f - 0.5) * s[lane] + 0.5, 1.0));
            let (fx, fy) = (steep(fx), steep(fy));
            let amount = if inside { amount[lane] } else { 0.0 };
            let (left, right) = (amount - amount * fx, amount * fx);
            splat.amount[lane] = [left - left * fy, right - right * fy, left * fy, right * fy];
            splat.cell[lane] = self.cell(x, y);
        }
        splat
    }
}

/// Adds what falls to cells.
#[inline(always)]
pub fn add(corners: &mut [f32; 4], amount: &[f32; 4]) {
    // As one value: the compiler then adds all four at once, whatever else it cannot tell apart.
    *corners = std::array::from_fn(|corner| corners[corner] + amount[corner]);
}

#[inline(always)]
fn sphere_square(x: f32, y: f32, z: f32) -> (f32, f32) {
    let scale = 1.0 / (x.abs() + y.abs() + z.abs());
    let (u, v) = (x * scale, y * scale);
    // Below the horizon the octahedron's corners are folded over.
    let (folded_u, folded_v) = ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v));
    let below = z < 0.0;
    (if below { folded_u } else { u }, if below { folded_v } else { v })
}

#[inline(always)]
fn hemisphere_square(x: f32, y: f32, z: f32) -> (f32, f32) {
    let sum = x.abs() + y.abs() + z;
    // Straight down there is nothing to map: it comes to lie outside.
    let scale = if sum > 0.0 { 1.0 / sum } else { f32::INFINITY };
    ((x + y) * scale, (x - y) * scale)
}

/// `x` between `low` and `high`; `low` for what is not a number.
#[inline(always)]
pub fn between(low: f32, x: f32, high: f32) -> f32 {
    let x = if x > low { x } else { low };
    if x < high { x } else { high }
}
