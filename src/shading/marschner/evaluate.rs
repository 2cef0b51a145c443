//! F of several directions at once.
//!
//! Step by step over all of them, lobe by lobe, in plain loops that the compiler makes vector instructions of: faces come in
//! blocks of [`BLOCK`], a direction alone is a block of one and gets the same bits.

use glam::Vec3;

use super::azimuthal::pseudo_angle;
use super::four::exp;
use super::{Incoming, View};

/// Faces at a time.
pub(super) const BLOCK: usize = 16;

/// F by channel, and F without absorption.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reflected<const N: usize> {
    pub color: [[f32; N]; 3],
    pub white: [f32; N],
}

impl View<'_> {
    #[inline(always)]
    pub(super) fn incoming(&self, direction: Vec3) -> Incoming {
        let [along, across, aside] = self.frame;
        let sin = along.dot(direction).clamp(-1.0, 1.0);
        let (x, y) = (across.dot(direction), aside.dot(direction));
        let cos = (x * x + y * y).sqrt().min(1.0);
        let cos_d = (0.5 * (1.0 + cos * self.cos + sin * self.sin)).max(0.0).sqrt();
        Incoming { sin, cos, turn: pseudo_angle(x, y.abs()), cos_d }
    }

    /// F, and F without absorption.
    #[inline]
    pub(super) fn evaluate<const N: usize>(&self, directions: &[Vec3; N]) -> Reflected<N> {
        let lobes = self.lobes;
        let (mut sin, mut cos, mut cos_d, mut turn) = ([0.0; N], [0.0; N], [0.0; N], [0.0; N]);
        let (mut position, mut scale) = ([0.0; N], [0.0; N]);
        let (mut x, mut y, mut z) = ([0.0; N], [0.0; N], [0.0; N]);
        for k in 0..N {
            (x[k], y[k], z[k]) = (directions[k].x, directions[k].y, directions[k].z);
        }
        for k in 0..N {
            let at = self.incoming(Vec3::new(x[k], y[k], z[k]));
            (sin[k], cos[k], cos_d[k], turn[k]) = (at.sin, at.cos, at.cos_d, at.turn);
        }
        for k in 0..N {
            position[k] = lobes.balance.position(sin[k], cos[k]);
            scale[k] = self.balance[0] * cos[k] / cos[k].max(self.cos).max(1e-20);
        }
        let (mut white, mut length, mut given_back) = ([[0.0; N]; 4], [[0.0; N]; 4], [0.0; N]);
        for k in 0..N {
            let around = lobes.azimuthal.evaluate(cos_d[k], turn[k]);
            for p in 0..4 {
                white[p][k] = around.white[p];
                length[p][k] = around.length[p];
            }
            let [b, e] = lobes.balance.at(position[k]);
            scale[k] *= b;
            given_back[k] = self.balance[1] * e * cos[k];
        }
        for (p, white) in white.iter_mut().enumerate() {
            let spread = lobes.longitudinal.spread(p, &sin, &cos, &self.turned);
            for k in 0..N {
                white[k] *= spread[k] * scale[k];
            }
        }
        for k in 0..N {
            // What is given back has mostly gone straight through.
            white[1][k] += given_back[k];
        }
        let through = |sigma: f32| {
            // R does not enter.
            let mut sum = white[0];
            for p in 1..4 {
                for k in 0..N {
                    sum[k] += white[p][k] * exp(-sigma * length[p][k]);
                }
            }
            sum
        };
        let color = self.absorption.to_array().map(through);
        let mut sum = white[0];
        for k in 0..N {
            sum[k] += white[1][k] + white[2][k] + white[3][k];
        }
        Reflected { color, white: sum }
    }

    /// F of one direction.
    pub(super) fn reflect(&self, direction: Vec3) -> Vec3 {
        let [[r], [g], [b]] = self.evaluate(&[direction]).color;
        Vec3::new(r, g, b)
    }
}
