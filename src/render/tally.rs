//! What a thread counts while it lights points: times, and what mirrors and glass did not show.

use std::time::Duration;

/// Time of stage 2 by part.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    pub gamma: Duration,
    pub lambda: Duration,
    pub direct: Duration,
}

impl Clock {
    /// Adds another clock's times.
    pub fn add(&mut self, other: &Self) {
        self.gamma += other.gamma;
        self.lambda += other.lambda;
        self.direct += other.direct;
    }

    /// Multiplies all times.
    pub(super) fn scale(&mut self, factor: f64) {
        for time in [&mut self.gamma, &mut self.lambda, &mut self.direct] {
            *time = time.mul_f64(factor);
        }
    }
}

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
