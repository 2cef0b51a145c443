//! What mirrors and glass did not show.

/// How much of what rays saw in mirrors and glass is missing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reflections {
    /// Rays that met mirrors or glass, by their weights.
    pub rays: f64,
    /// Those of them that were still under way when they had met the most that they may.
    pub cut: f64,
}

impl Reflections {
    /// Adds others.
    pub fn add(&mut self, other: &Self) {
        self.rays += other.rays;
        self.cut += other.cut;
    }
}
