//! Directions by chance, about in proportion to F.
//!
//! A lobe by its share, θ_i by its M with the whole shift in θ_o, φ by its D, constant in each cell of the table. F has the
//! shift in both angles, b, e and D's slope within a cell besides; the density is exactly that of what is done here.

use glam::Vec3;

use super::four::{Four, dot, each, exp};
use super::{Incoming, View};

impl View<'_> {
    /// A direction towards the light.
    pub(super) fn sample(&self, random: [f32; 4]) -> Vec3 {
        let (shares, even) = self.shares();
        let mut left = random[0];
        if left < even {
            let z = 1.0 - 2.0 * random[1];
            let (y, x) = (std::f32::consts::TAU * random[2]).sin_cos();
            let across = ((1.0 - z) * (1.0 + z)).sqrt();
            return Vec3::new(across * x, across * y, z);
        }
        left -= even;
        let mut p = 0;
        while p < 3 && left >= shares[p] {
            left -= shares[p];
            p += 1;
        }
        // What is left of the number is as good as a new one.
        let pick = (left / shares[p]).min(1.0);
        let [sin, cos] = self.lobes.longitudinal.sample(p, [self.sin, self.cos], [random[1], random[2]]);
        let cos_d = (0.5 * (1.0 + cos * self.cos + sin * self.sin)).max(0.0).sqrt();
        let (side, random) = if random[3] < 0.5 { (1.0, 2.0 * random[3]) } else { (-1.0, 2.0 * random[3] - 1.0) };
        let (sin_phi, cos_phi) = self.lobes.azimuthal.sample(p, cos_d, pick, random).sin_cos();
        let [along, across, aside] = self.frame;
        (along * sin + (across * cos_phi + aside * (side * sin_phi)) * cos).normalize()
    }

    /// The density of [`Self::sample`], per steradian.
    pub(super) fn density(&self, incoming: &Incoming) -> f32 {
        let along = self.lobes.longitudinal.density([incoming.sin, incoming.cos], [self.sin, self.cos]);
        let around = self.lobes.azimuthal.density(incoming.cos_d, incoming.turn);
        let (shares, even) = self.shares();
        // dω = cos θ dθ dφ, and M has its cosine outside.
        dot(&shares, &each(|p| along[p] * around[p])) + even * (0.25 / std::f32::consts::PI)
    }

    /// The chance of each lobe: its albedo at this view, dimmed by the absorption where the lobe is strongest; and of a
    /// direction out of all.
    fn shares(&self) -> (Four, f32) {
        let azimuthal = &self.lobes.azimuthal;
        let albedo = azimuthal.albedo(self.cos);
        let shares = each(|p| {
            // TT leaves on the far side, the others mostly on the near one.
            let length = azimuthal.evaluate(self.cos, if p == 1 { 2.0 } else { 0.0 }).length[p];
            let through = self.absorption.to_array().map(|sigma| exp(-sigma * length)).iter().sum::<f32>() / 3.0;
            albedo[p] * through
        });
        let sum: f32 = shares.iter().sum();
        let even = self.lobes.balance.spread(self.sin, self.cos) * shares[1] / albedo[1].max(f32::MIN_POSITIVE);
        let even = even / (sum + even);
        // No lobe is wholly forgotten.
        (each(|p| (shares[p] / sum + 0.01) / 1.04 * (1.0 - even)), even)
    }
}
