//! What makes the lobes together reciprocal and free of loss: S = b(θ_i) b(θ_o) Σ_p M_p D_p / max(cos θ_i, cos θ_o) + e(θ_i) e(θ_o).
//!
//! M_p and D_p alone give one or the other: divided by cos θ_i (d'Eon et al. 2011) they keep the energy where A depends on θ_o
//! alone, but light that goes the other way meets another S. No factor g(θ_i) g(θ_o) can mend it: a narrow lobe at θ_i = s - θ_o
//! that is the same both ways sends on cos² θ_i / cos² θ_o as much of a uniform sky from one end as from the other, and a g
//! that still adds up to 1 must trade one lobe for another, R for TRT, by any factor. So the lobes keep what both ends allow,
//! the larger cosine, and what is lost of the order of s tan θ is given back spread over all directions, as Kulla and Conty (2017)
//! do for rough surfaces:
//!
//! E(θ_o) = b(θ_o) Σ_j [Σ_p ∫D_p dφ M_p](θ_j, θ_o) b(θ_j) cos² θ_j Δθ_j / max(cos θ_j, cos θ_o),   b = 1 / max(1, E of b = 1),
//!
//! e = (1 - E) / √(2π ∫ (1 - E) cos² θ dθ),   so that E(θ_o) + e(θ_o) 2π ∫ e cos² θ dθ = 1 for every θ_o.

use std::f64::consts::TAU;

use super::azimuthal::{Azimuthal, ROWS, split};
use super::four::{Four, dot};
use super::longitudinal::{Inclination, Longitudinal};

/// b and e over the inclination.
#[derive(Clone, Debug)]
pub(super) struct Balance {
    /// At the middles of equal steps of the diamond angle from -1 to 1.
    table: Vec<[f32; 2]>,
    /// 1 - E, the share that is spread, in the same places.
    spread: Vec<f32>,
}

/// -1 to 1 for an inclination from -π/2 to π/2, by its sine and (positive) cosine.
#[inline(always)]
fn diamond(sin: f32, cos: f32) -> f32 {
    sin / (sin.abs() + cos)
}

/// A sum's terms: the inclination and its weight cos² θ Δθ.
struct Node {
    sin: f64,
    cos: f64,
    weight: f64,
    turned: Inclination,
}

impl Balance {
    /// Balances lobes of which the narrowest has this standard deviation, in radians.
    ///
    /// Besides, how much of each lobe meets each row of the azimuthal table: ∫∫ M_p cos² θ_i cos² θ_o / max(cos θ) by row.
    pub fn new(longitudinal: &Longitudinal, azimuthal: &Azimuthal, narrowest: f64) -> (Self, Vec<Four>) {
        // Two thirds of a standard deviation at most between neighbours: sums over a Gaussian are then exact to 1e-17.
        let count = (6.0 / narrowest).clamp(256.0, 2048.0) as usize;
        let nodes: Vec<Node> = (0..count).map(|k| node(longitudinal, k, count)).collect();
        let mut met = vec![[0.0; 4]; ROWS];
        let rows: Vec<(usize, Vec<f32>)> =
            nodes.iter().map(|out| row(longitudinal, azimuthal, &nodes, out, &mut met)).collect();
        let sums = |b: &[f64]| -> Vec<f64> {
            let sum = |(first, row): &(usize, Vec<f32>)| {
                let terms = row.iter().zip(&nodes[*first..]).zip(&b[*first..]);
                terms.map(|((&w, node), b)| f64::from(w) * node.weight * b).sum::<f64>()
            };
            rows.iter().map(sum).collect()
        };
        let b: Vec<f64> = sums(&vec![1.0; count]).iter().map(|sum| 1.0 / sum.max(1.0)).collect();
        let lost: Vec<f64> = sums(&b).iter().zip(&b).map(|(sum, b)| (1.0 - sum * b).max(0.0)).collect();
        let all = TAU * lost.iter().zip(&nodes).map(|(lost, node)| lost * node.weight).sum::<f64>();
        let scale = if all > 0.0 { 1.0 / all.sqrt() } else { 0.0 };
        let table = b.iter().zip(&lost).map(|(&b, lost)| [b as f32, (lost * scale) as f32]).collect();
        (Self { table, spread: lost.iter().map(|&lost| lost as f32).collect() }, met)
    }

    /// b and e at an inclination.
    pub fn evaluate(&self, sin: f32, cos: f32) -> [f32; 2] {
        self.at(self.position(sin, cos))
    }

    /// Where in the table an inclination is.
    #[inline(always)]
    pub fn position(&self, sin: f32, cos: f32) -> f32 {
        // Half a step beyond the first and last middle the line stays level.
        0.5 * (diamond(sin, cos) + 1.0) * self.table.len() as f32 - 0.5
    }

    /// b and e at a place in the table.
    #[inline(always)]
    pub fn at(&self, position: f32) -> [f32; 2] {
        let (step, across) = split(position.max(0.0), self.table.len() - 1);
        let [here, next] = [self.table[step], self.table[step + 1]];
        [here[0] + (next[0] - here[0]) * across, (here[1] + (next[1] - here[1]) * across).max(0.0)]
    }

    /// 1 - E at an inclination: the share of the light that is spread.
    pub fn spread(&self, sin: f32, cos: f32) -> f32 {
        let (step, across) = split(self.position(sin, cos).max(0.0), self.spread.len() - 1);
        (self.spread[step] + (self.spread[step + 1] - self.spread[step]) * across).max(0.0)
    }
}

fn node(longitudinal: &Longitudinal, k: usize, count: usize) -> Node {
    let step = 2.0 / count as f64;
    let t = (k as f64 + 0.5) * step - 1.0;
    let length = t.hypot(1.0 - t.abs());
    let (sin, cos) = (t / length, (1.0 - t.abs()) / length);
    // dθ/dt = 1 / (t² + (1 - |t|)²).
    let weight = cos * cos * step / (length * length);
    Node { sin, cos, weight, turned: longitudinal.turned(sin as f32, cos as f32) }
}

/// Σ_p ∫D_p dφ M_p / max(cos θ) for one θ_o, without the nodes at both ends that it does not reach; adds what meets each row.
fn row(
    longitudinal: &Longitudinal,
    azimuthal: &Azimuthal,
    nodes: &[Node],
    out: &Node,
    met: &mut [Four],
) -> (usize, Vec<f32>) {
    let terms = nodes.iter().map(|node| {
        let cos_d = (0.5 * (1.0 + node.cos * out.cos + node.sin * out.sin)).max(0.0).sqrt() as f32;
        let larger = node.cos.max(out.cos) as f32;
        let spread = longitudinal.evaluate(&node.turned, &out.turned).map(|m| m / larger);
        let (row, down) = split(cos_d.clamp(0.0, 1.0) * (ROWS - 1) as f32, ROWS - 1);
        let weight = (node.weight * out.weight) as f32;
        for p in 0..4 {
            met[row][p] += spread[p] * (weight * (1.0 - down));
            met[row + 1][p] += spread[p] * (weight * down);
        }
        dot(&azimuthal.albedo(cos_d), &spread)
    });
    let all: Vec<f32> = terms.collect();
    let counts = |w: &f32| *w > 1e-12;
    let first = all.iter().position(counts).unwrap_or(0);
    let end = all.iter().rposition(counts).map_or(first, |last| last + 1);
    (first, all[first..end].to_vec())
}
