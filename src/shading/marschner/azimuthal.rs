//! N_p with the attenuation A_p: how a lobe spreads around the strand, averaged over the strand's width.
//!
//! A ray that meets a circular dielectric cylinder at the offset h (in radii) has γ_i = asin h, and inside γ_t = asin(h/η')
//! with η' = √(η² - sin² θ_d) / cos θ_d (Bravais). It leaves after p inner paths, turned by Φ_p = 2pγ_t - 2γ_i + pπ. A rough
//! strand spreads Φ_p by a logistic distribution cut off at ±π (Chiang et al. 2016):
//!
//! D_p(φ, θ_d) = 1/2 ∫ A_p(h, θ_d) L(φ - Φ_p(h, θ_d)) dh over [-1, 1],   Σ_p ∫ D_p dφ = 1 without absorption.
//!
//! A_0 = f, A_p = (1 - f)² f^(p-1) T^p with Fresnel's f at cos θ_d cos γ_i, T = e^(-σ l), l = 2 cos γ_t / cos θ_t the path in
//! radii and σ the absorption a radius; the last lobe holds all of p >= 3 and goes evenly around. θ_d = (θ_o - θ_i)/2 is the
//! same from either end of the path, so that D is reciprocal. D is tabulated without absorption. With it, D_p(σ) =
//! D_p(0) e^(-σ l_p) with a length l_p that makes it exact at a middling σ: l varies by a third at most in one crossing.

use std::f64::consts::PI;

use glam::Vec4;

use super::four::{Four, each, exp};

/// Rows of the table, over cos θ_d.
pub(super) const ROWS: usize = 24;
/// The absorption a radius at which the table's lengths are exact: that of a medium brown.
const MIDDLE: f64 = 0.15;

/// One entry: D without absorption, per radian of φ, and the length of the path through the strand, in radii.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub(super) struct Entry {
    pub white: Four,
    pub length: Four,
}

/// The table, for one ior and roughness.
#[derive(Clone, Debug)]
pub(super) struct Azimuthal {
    /// Cells over φ, 0 to π, at equal steps of [`pseudo_angle`].
    cells: usize,
    /// `ROWS` times `cells + 1` entries; φ runs fastest.
    table: Vec<Entry>,
    /// φ at the ends of the cells.
    nodes: Vec<f32>,
    /// ∫ of each node's hat function over φ from 0 to π.
    hats: Vec<f32>,
    /// ∫ D dφ over the whole turn, by row.
    albedo: Vec<Four>,
    /// The same with D constant in each cell, as it is sampled.
    stepped: Vec<Four>,
}

/// 0 to 2 for the angle 0 to π of a direction with this cosine and (positive) sine of any length: monotone, smooth, and cheap.
#[inline(always)]
pub(super) fn pseudo_angle(cos: f32, sin: f32) -> f32 {
    let t = sin / (cos.abs() + sin).max(f32::MIN_POSITIVE);
    // 1 - (1 - t) and 1 + (1 - t): no branch.
    1.0 - (1.0 - t).copysign(cos)
}

/// The angle of a pseudo-angle.
fn angle(t: f64) -> f64 {
    let quarter = |t: f64| t.atan2(1.0 - t);
    if t <= 1.0 { quarter(t) } else { PI - quarter(2.0 - t) }
}

/// One ray through the strand.
struct Ray {
    /// dh, of all that add up to 1.
    share: f64,
    turn: [f64; 3],
    white: [f64; 4],
    absorbed: [f64; 4],
}

impl Azimuthal {
    /// A table for a strand of this ior. `scale` gives the logistic's scale in radians by cos θ_d.
    pub fn new(ior: f64, scale: impl Fn(f64) -> f64) -> Self {
        let narrow = scale(1.0);
        let cells = (8.0 / narrow).clamp(48.0, 512.0) as usize;
        let angles: Vec<f64> = (0..=cells).map(|k| angle(2.0 * k as f64 / cells as f64)).collect();
        let mut table = Vec::with_capacity(ROWS * (cells + 1));
        for row in 0..ROWS {
            let cosine = (row as f64 / (ROWS - 1) as f64).max(1e-3);
            let logistic = Logistic::new(scale(cosine));
            let rays = rays(ior, cosine, (PI / narrow).clamp(96.0, 1024.0) as usize);
            table.extend(angles.iter().map(|&phi| entry(&rays, &logistic, phi)));
        }
        let hats = hats(cells);
        let sum = |row: &[Entry], weights: &[f64]| -> Four {
            each(|p| row.iter().zip(weights).map(|(e, w)| 2.0 * w * f64::from(e.white[p])).sum::<f64>() as f32)
        };
        let rows = || table.chunks_exact(cells + 1);
        let albedo = rows().map(|row| sum(row, &hats)).collect();
        let steps: Vec<f64> =
            (0..=cells).map(|k| 0.5 * (angles[(k + 1).min(cells)] - angles[k.saturating_sub(1)])).collect();
        let stepped = rows().map(|row| sum(row, &steps)).collect();
        let hats = hats.iter().map(|&hat| hat as f32).collect();
        Self { cells, hats, nodes: angles.iter().map(|&a| a as f32).collect(), albedo, stepped, table }
    }

    /// D at a cos θ_d and a pseudo-angle of φ.
    #[inline(always)]
    pub fn evaluate(&self, cos_d: f32, turn: f32) -> Entry {
        let (row, down) = split(cos_d.clamp(0.0, 1.0) * (ROWS - 1) as f32, ROWS - 1);
        let (cell, across) = split(turn * 0.5 * self.cells as f32, self.cells);
        let start = row * (self.cells + 1) + cell;
        let below = start + self.cells + 1;
        let (upper, lower) = (&self.table[start..][..2], &self.table[below..][..2]);
        let weights = [(1.0 - across) * (1.0 - down), across * (1.0 - down), (1.0 - across) * down, across * down];
        let corners = [&upper[0], &upper[1], &lower[0], &lower[1]];
        let mix = |of: fn(&Entry) -> Vec4| {
            let [a, b, c, d] = corners.map(of);
            (a * weights[0] + b * weights[1]) + (c * weights[2] + d * weights[3])
        };
        Entry { white: mix(|e| e.white.into()).into(), length: mix(|e| e.length.into()).into() }
    }

    /// ∫ D dφ of each lobe without absorption at a cos θ_d, as [`Self::evaluate`] has it.
    pub fn albedo(&self, cos_d: f32) -> Four {
        let (row, down) = split(cos_d.clamp(0.0, 1.0) * (ROWS - 1) as f32, ROWS - 1);
        each(|p| self.albedo[row][p] * (1.0 - down) + self.albedo[row + 1][p] * down)
    }

    /// Σ w_p ∫ D_p e^(-σ l_p) dφ over all rows and the lobes that enter the strand, for an absorption σ a radius.
    pub fn through(&self, weights: &[Four], sigma: f32) -> f64 {
        let rows = self.table.chunks_exact(self.cells + 1).zip(weights);
        let row = |(row, weights): (&[Entry], &Four)| -> f64 {
            let entry = |(entry, hat): (&Entry, &f32)| -> f32 {
                (1..4).map(|p| weights[p] * hat * entry.white[p] * exp(-sigma * entry.length[p])).sum()
            };
            row.iter().zip(&self.hats).map(|terms| f64::from(entry(terms))).sum()
        };
        2.0 * rows.map(row).sum::<f64>()
    }

    /// φ (0 to π) and its pseudo-angle's cell for lobe `p`: `pick` chooses the row, `random` the angle.
    pub fn sample(&self, p: usize, cos_d: f32, pick: f32, random: f32) -> f32 {
        let (row, down) = split(cos_d.clamp(0.0, 1.0) * (ROWS - 1) as f32, ROWS - 1);
        let row = if pick < down { row + 1 } else { row };
        let mut left = random * 0.5 * self.stepped[row][p];
        for cell in 0..self.cells {
            let width = self.nodes[cell + 1] - self.nodes[cell];
            let mass = width * self.step(row, cell, p);
            if left < mass || cell + 1 == self.cells {
                return self.nodes[cell] + width * (left / mass).min(1.0);
            }
            left -= mass;
        }
        0.0
    }

    /// The density of [`Self::sample`] for each lobe, per radian of the whole turn.
    pub fn density(&self, cos_d: f32, turn: f32) -> Four {
        let (row, down) = split(cos_d.clamp(0.0, 1.0) * (ROWS - 1) as f32, ROWS - 1);
        let (cell, _) = split(turn * 0.5 * self.cells as f32, self.cells);
        let of = |row: usize, p: usize| self.step(row, cell, p) / self.stepped[row][p];
        each(|p| of(row, p) * (1.0 - down) + of(row + 1, p) * down)
    }

    /// D over a cell as it is sampled.
    fn step(&self, row: usize, cell: usize, p: usize) -> f32 {
        let start = row * (self.cells + 1) + cell;
        0.5 * (self.table[start].white[p] + self.table[start + 1].white[p])
    }
}

/// The cell of a position and where in it, for `cells` cells of width 1.
#[inline(always)]
pub(super) fn split(position: f32, cells: usize) -> (usize, f32) {
    let cell = (position as usize).min(cells - 1);
    (cell, position - cell as f32)
}

/// ∫ of each node's hat function in the pseudo-angle over φ in [0, π].
fn hats(cells: usize) -> Vec<f64> {
    let mut hats = vec![0.0; cells + 1];
    let steps = 16;
    for cell in 0..cells {
        for step in 0..steps {
            let at = |s: i32| angle(2.0 * (cell as f64 + f64::from(s) / f64::from(steps)) / cells as f64);
            let width = at(step + 1) - at(step);
            let across = (f64::from(step) + 0.5) / f64::from(steps);
            hats[cell] += width * (1.0 - across);
            hats[cell + 1] += width * across;
        }
    }
    hats
}

/// Rays at equal steps of γ_i over half of the strand; the other half is its mirror image.
fn rays(ior: f64, cos_d: f64, count: usize) -> Vec<Ray> {
    let sin2 = 1.0 - cos_d * cos_d;
    let bravais = (ior * ior - sin2).sqrt() / cos_d;
    let cos_t = (1.0 - sin2 / (ior * ior)).sqrt();
    let step = 0.5 * PI / count as f64;
    let ray = |k: usize| {
        let gamma_i = (k as f64 + 0.5) * step;
        let sin_t = gamma_i.sin() / bravais;
        let gamma_t = sin_t.asin();
        let fresnel = fresnel(cos_d * gamma_i.cos(), ior);
        let length = 2.0 * gamma_t.cos() / cos_t;
        let attenuation = |sigma: f64| {
            let through = (-sigma * length).exp();
            let second = (1.0 - fresnel).powi(2) * through;
            let third = second * fresnel * through;
            [fresnel, second, third, third * fresnel * through / (1.0 - fresnel * through)]
        };
        Ray {
            // sin at the ends of the step: the shares add up to 1 exactly.
            share: ((k + 1) as f64 * step).sin() - (k as f64 * step).sin(),
            turn: [0.0, 1.0, 2.0].map(|p| 2.0 * p * gamma_t - 2.0 * gamma_i + p * PI),
            white: attenuation(0.0),
            absorbed: attenuation(MIDDLE),
        }
    };
    (0..count).map(ray).collect()
}

fn entry(rays: &[Ray], logistic: &Logistic, phi: f64) -> Entry {
    let (mut white, mut absorbed) = ([0.0; 4], [0.0; 4]);
    for ray in rays {
        for p in 0..4 {
            // Offsets h and -h turn the ray to opposite sides.
            let spread =
                ray.turn.get(p).map_or(0.5 / PI, |turn| 0.5 * (logistic.at(phi - turn) + logistic.at(phi + turn)));
            white[p] += ray.share * spread * ray.white[p];
            absorbed[p] += ray.share * spread * ray.absorbed[p];
        }
    }
    Entry {
        white: white.map(|w| w as f32),
        length: each(|p| {
            let share: f64 = absorbed[p] / white[p];
            // Where a narrow lobe has vanished any length will do.
            if share > 0.0 { (-share.ln() / MIDDLE) as f32 } else { 2.0 * p as f32 }
        }),
    }
}

/// The logistic distribution cut off at ±π.
struct Logistic {
    scale: f64,
    norm: f64,
}

impl Logistic {
    fn new(scale: f64) -> Self {
        // The distribution function at π less that at -π.
        Self { scale, norm: 1.0 / (0.5 * PI / scale).tanh() }
    }

    fn at(&self, angle: f64) -> f64 {
        let wrapped = angle - 2.0 * PI * (angle / (2.0 * PI)).round();
        let far = wrapped.abs() / self.scale;
        if far > 40.0 {
            return 0.0;
        }
        let e = (-far).exp();
        self.norm * e / (self.scale * (1.0 + e).powi(2))
    }
}

/// Reflectance of a dielectric for unpolarised light from outside.
fn fresnel(cosine: f64, ior: f64) -> f64 {
    let inside = (1.0 - (1.0 - cosine * cosine) / (ior * ior)).sqrt();
    let parallel = (ior * cosine - inside) / (ior * cosine + inside);
    let perpendicular = (cosine - ior * inside) / (cosine + ior * inside);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

#[cfg(test)]
mod tests;
