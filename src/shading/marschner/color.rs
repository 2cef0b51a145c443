//! The absorption for a colour.
//!
//! A colour is the share of the light that entered a strand which leaves it again, under a uniform sky and over all views
//! that show it alike (in proportion to cos² θ_o, its width and the solid angle):
//!
//! c(σ) = T(σ) / T(0),   T(σ) = ∫∫ cos² θ_o Σ_{p>0} ∫ S_p dφ cos² θ_i dθ_i dθ_o.
//!
//! R, which never entered, comes on top of it, white, as Kajiya and Kay's highlight on their diffuse term; so white is white, black leaves
//! the highlight alone, and every colour has its absorption. ln c is nearly proportional to σ. The table has the mean length
//! -ln c / σ, which is between one and two diameters for every colour.
//!
//! What `balance` gives back is left out of T, and so is its b, the same few percent in T(σ) and T(0).

use glam::Vec3;

use super::azimuthal::{Azimuthal, split};
use super::four::Four;

/// The darkest colour that is told from black: beyond, nothing gets through.
const BLACK: f32 = 1e-6;
/// Cells of the table.
const CELLS: usize = 64;
/// The least absorption that is tried, in 1 / radius, and the factor from one to the next.
const LEAST: f32 = 1e-3;
const FACTOR: f32 = 1.4;

/// Mean lengths of the path by colour, in radii.
#[derive(Clone, Debug)]
pub(super) struct Lengths {
    /// At equal steps of √c from 0 to 1.
    table: Vec<f32>,
}

impl Lengths {
    /// The lengths of a strand whose lobes meet the rows of the azimuthal table with these weights.
    pub fn new(azimuthal: &Azimuthal, rows: &[Four]) -> Self {
        let entered = azimuthal.through(rows, 0.0);
        let mut known: Vec<[f64; 2]> = Vec::new();
        let mut sigma = LEAST;
        loop {
            let share = azimuthal.through(rows, sigma) / entered;
            known.push([share.sqrt(), -share.ln() / f64::from(sigma)]);
            if share < f64::from(BLACK) || known.len() > 60 {
                break;
            }
            sigma *= FACTOR;
        }
        let at = |root: f64| {
            // The roots fall from 1.
            let below = known.iter().position(|&[r, _]| r < root).unwrap_or(known.len());
            let (Some(before), Some([low, low_length])) = (below.checked_sub(1), known.get(below)) else {
                return known[below.min(known.len() - 1)][1];
            };
            let [high, high_length] = known[before];
            low_length + (high_length - low_length) * (root - low) / (high - low)
        };
        Self { table: (0..=CELLS).map(|k| at(k as f64 / CELLS as f64) as f32).collect() }
    }

    /// The absorption a radius for a colour.
    pub fn absorption(&self, color: Vec3) -> Vec3 {
        let one = |c: f32| {
            let c = c.clamp(BLACK, 1.0);
            let (cell, across) = split(c.sqrt() * CELLS as f32, CELLS);
            -c.ln() / (self.table[cell] + (self.table[cell + 1] - self.table[cell]) * across)
        };
        Vec3::new(one(color.x), one(color.y), one(color.z))
    }
}

/// The absorption a radius with which dense hair has a colour after all scattering (Chiang et al. 2016, Eq. 9).
pub(super) fn of_dense_hair(color: Vec3, azimuthal: f32) -> Vec3 {
    let b = azimuthal;
    let fit = 5.969 + b * (-0.215 + b * (2.532 + b * (-10.73 + b * (5.574 + b * 0.245))));
    let one = |c: f32| (c.clamp(BLACK, 1.0).ln() / fit).powi(2);
    Vec3::new(one(color.x), one(color.y), one(color.z))
}
