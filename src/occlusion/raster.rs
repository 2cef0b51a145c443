//! A ribbon so near that it covers many cells: looked at from the cells, not along the ribbon.
//!
//! For the direction d of a cell's middle, with u the ribbon's axis, q its foot, h = |q|: the half-plane of d about the axis meets the axis at
//! s = (d·q)(d·u) / (1 - (d·u)²) and lies at the angle α from the foot, sin α = d·(q × u) / (h √(1 - (d·u)²)). The cell is covered where
//! |sin α| <= width / 2h and s is within the segment; across an edge the coverage falls from 1 to 0 over the cell's own width. Time does
//! not grow with the ribbon's size.

use glam::Vec3;

use super::DepthMap;
use super::depth_map::Corners;
use super::lanes::LANES;
use super::query::Far;

/// A segment in the igloo's frame, relative to the viewer.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    /// The foot of the perpendicular on the segment's line, not at the viewer itself.
    pub foot: Vec3,
    /// Unit vector along the segment.
    pub axis: Vec3,
    /// Where on the line it begins and ends, from the foot.
    pub from: f32,
    pub to: f32,
    /// Width at the foot, and its change along the axis.
    pub width: f32,
    pub taper: f32,
    /// Share of the light that a crossing takes.
    pub opacity: f32,
}

/// The least share of the light that is told from none.
const LEAST: f32 = 1e-38;

/// Adds the ribbon's layer to all cells that it covers.
#[inline(always)]
pub fn cover(near: &Near, map: &DepthMap, far: Option<Far>, depth: &mut [Corners]) {
    let side = near.foot.cross(near.axis);
    let h2 = near.foot.length_squared();
    let inverse_h = 1.0 / h2.sqrt();
    for (chunk, cells) in map.middles().iter().enumerate() {
        let [x, y, z] = &cells.direction;
        let [mut covered, mut distance2] = [[0.0; LANES]; 2];
        for lane in 0..LANES {
            let (x, y, z, cell) = (x[lane], y[lane], z[lane], cells.width[lane]);
            let along = x * near.axis.x + y * near.axis.y + z * near.axis.z;
            let ahead = x * near.foot.x + y * near.foot.y + z * near.foot.z;
            let beside = x * side.x + y * side.y + z * side.z;
            let across2 = 1.0 - along * along;
            let across2 = if across2 > 1e-12 { across2 } else { 1e-12 };
            let across = across2.sqrt();
            let s = ahead * along / across2;
            // Distance of the axis in the half-plane of the direction.
            let h = ahead / across;
            let r2 = h * h + s * s;
            let width = near.width + near.taper * s;
            let inverse_cell = 1.0 / cell;
            let gap = 0.5 * width * inverse_h * across - (beside * inverse_h).abs();
            let turn = h / r2 * inverse_cell;
            let share = ramp(gap * inverse_cell) * ramp((s - near.from) * turn) * ramp((near.to - s) * turn);
            // Nothing behind the viewer, nothing nearer than a width, nothing in the border.
            let seen = (ahead > 0.0) & (r2 > width * width) & (cell > 0.0);
            covered[lane] = if seen { share } else { 0.0 };
            distance2[lane] = r2;
        }
        if covered == [0.0; LANES] {
            continue;
        }
        let mut amount = [0.0; LANES];
        for lane in 0..LANES {
            let cell = cells.width[lane];
            amount[lane] = -logarithm(1.0 - covered[lane] * near.opacity) * cell * cell;
        }
        for lane in 0..LANES {
            let cell = chunk * LANES + lane;
            if covered[lane] > 0.0 && far.is_none_or(|far| distance2[lane] < far.cells[cell]) {
                depth[cell][0] += amount[lane];
            }
        }
    }
}

/// From 0 half a cell outside an edge to 1 half a cell inside.
#[inline(always)]
fn ramp(x: f32) -> f32 {
    let x = x + 0.5;
    let x = if x > 0.0 { x } else { 0.0 };
    if x < 1.0 { x } else { 1.0 }
}

/// Natural logarithm of a number from 0 to 1, to 2e-6; -87 for less than [`LEAST`].
#[inline(always)]
fn logarithm(x: f32) -> f32 {
    let x = if x > LEAST { x } else { LEAST };
    let bits = x.to_bits();
    // x = 2^e m with m from √½ to √2, so that 1 gives 0 exactly.
    let shifted = bits.wrapping_sub(0x3F35_04F3);
    let exponent = (shifted as i32) >> 23;
    let m = f32::from_bits(bits.wrapping_sub((exponent as u32) << 23));
    // ln m = 2 artanh((m - 1) / (m + 1)).
    let k = (m - 1.0) / (m + 1.0);
    let k2 = k * k;
    let series = 2.0 * k * (1.0 + k2 * (1.0 / 3.0 + k2 * (1.0 / 5.0 + k2 * (1.0 / 7.0 + k2 * (1.0 / 9.0)))));
    exponent as f32 * std::f32::consts::LN_2 + series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_is_that_of_f64() {
        for i in 1..=100_000 {
            let x = i as f32 / 100_000.0;
            let want = f64::from(x).ln();
            assert!((f64::from(logarithm(x)) - want).abs() < 2e-6 * (1.0 + want.abs()), "{x}");
        }
        assert_eq!(logarithm(1.0), 0.0);
        assert!((-88.0..-87.0).contains(&logarithm(0.0)));
        assert!(logarithm(f32::NAN) < -87.0);
    }
}
