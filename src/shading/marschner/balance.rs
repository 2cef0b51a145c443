//! What makes the lobes together reciprocal and free of loss: S = g(θ_i) g(θ_o) Σ_p D_p M_p.
//!
//! M_p and D_p alone give one or the other: divided by cos θ_i (d'Eon et al. 2011) they keep the energy where A depends on θ_o
//! alone, but light that goes the other way meets another S. Here M and D are the same from both ends, and g is the one positive
//! function with which a strand that absorbs nothing sends on all that it receives:
//!
//! g(θ_o) Σ_j [Σ_p ∫D_p dφ M_p](θ_j, θ_o) g(θ_j) cos² θ_j Δθ_j = 1   for every θ_o,
//!
//! found by symmetric Sinkhorn iteration. Away from the poles g is 1 / √cos θ, which gives d'Eon's form, and within a
//! lobe's width of them it levels off; so the table holds g (cos² θ + δ²)^(1/4), which is nearly constant.

use super::azimuthal::Azimuthal;
use super::longitudinal::{Inclination, Longitudinal};

/// The residual of any row at which the iteration ends, and the most iterations it takes.
const RESIDUAL: f64 = 1e-5;
const MOST: usize = 3000;

/// g over the inclination.
#[derive(Clone, Debug)]
pub(super) struct Balance {
    /// δ², δ about the width of the narrowest lobe.
    soft: f32,
    /// g (cos² θ + δ²)^(1/4) at the middles of equal steps of the diamond angle from -1 to 1.
    table: Vec<f32>,
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
    pub fn new(longitudinal: &Longitudinal, azimuthal: &Azimuthal, narrowest: f64) -> Self {
        // Half a standard deviation at most between neighbours: sums over a Gaussian are then exact to 1e-17.
        let count = (4.0 / narrowest).clamp(128.0, 2048.0) as usize;
        let nodes: Vec<Node> = (0..count).map(|k| node(longitudinal, k, count)).collect();
        let rows: Vec<(usize, Vec<f32>)> = nodes.iter().map(|out| row(longitudinal, azimuthal, &nodes, out)).collect();
        let soft = narrowest * narrowest;
        let shape = |cos: f64| (cos * cos + soft).sqrt().sqrt();
        let mut g: Vec<f64> = nodes.iter().map(|node| 1.0 / shape(node.cos)).collect();
        let mut most = 1.0_f64;
        for _ in 0..MOST {
            let sums: Vec<f64> = (rows.iter().zip(&g))
                .map(|((first, row), own)| {
                    let terms = row.iter().zip(&nodes[*first..]).zip(&g[*first..]);
                    own * terms.map(|((&w, node), g)| f64::from(w) * node.weight * g).sum::<f64>()
                })
                .collect();
            most = sums.iter().map(|sum| sum.sqrt()).fold(1.0, f64::max);
            let worst = sums.iter().map(|sum| (sum - 1.0).abs()).fold(0.0, f64::max);
            for (g, sum) in g.iter_mut().zip(&sums) {
                *g /= sum.sqrt();
            }
            if worst < RESIDUAL {
                break;
            }
        }
        // What the iteration has left over is lost, never gained.
        let table = (g.iter().zip(&nodes)).map(|(g, node)| (g / most.sqrt() * shape(node.cos)) as f32).collect();
        Self { soft: soft as f32, table }
    }

    /// g at an inclination.
    #[inline(always)]
    pub fn evaluate(&self, sin: f32, cos: f32) -> f32 {
        let last = self.table.len() - 1;
        // Half a step beyond the first and last middle the line goes on.
        let position = 0.5 * (diamond(sin, cos) + 1.0) * self.table.len() as f32 - 0.5;
        let step = (position.max(0.0) as usize).min(last - 1);
        let [here, next] = [self.table[step], self.table[step + 1]];
        (here + (next - here) * (position - step as f32)) / (cos * cos + self.soft).sqrt().sqrt()
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

/// Σ_p ∫D_p dφ M_p for one θ_o, without the nodes at both ends that it does not reach.
fn row(longitudinal: &Longitudinal, azimuthal: &Azimuthal, nodes: &[Node], out: &Node) -> (usize, Vec<f32>) {
    let terms = nodes.iter().map(|node| {
        let spread = longitudinal.evaluate(&node.turned, &out.turned);
        let cos_d = (0.5 * (1.0 + node.cos * out.cos + node.sin * out.sin)).max(0.0).sqrt();
        super::four::dot(&azimuthal.albedo(cos_d as f32), &spread)
    });
    let all: Vec<f32> = terms.collect();
    let counts = |w: &f32| *w > 1e-12;
    let first = all.iter().position(counts).unwrap_or(0);
    let end = all.iter().rposition(counts).map_or(first, |last| last + 1);
    (first, all[first..end].to_vec())
}
