//! M_p: how a lobe spreads along the strand, as the convolution of a ring with the von Mises-Fisher distribution on the
//! sphere (d'Eon et al. 2011, Eq. 7).
//!
//! With s = sin θ, c = cos θ of both inclinations and the variance v (in rad², while it is small),
//!
//! M = I0(c_i c_o / v) e^(-s_i s_o / v) / (2 v sinh(1/v)),   ∫ M cos θ_i dθ_i = 1.
//!
//! I0 and sinh overflow for small v. But 2 (1 - cos(θ_i + θ_o)) = (c_i - c_o)² + (s_i + s_o)², so that
//!
//! M = [e^-a I0(a)] e^(-((c_i - c_o)² + (s_i + s_o)²) / 2v) / (v (1 - e^(-2/v))),   a = c_i c_o / v,
//!
//! in which nothing overflows and nothing cancels, for any v.

use super::four::{Four, bessel, each, exp};

/// Sine and cosine of an inclination, as each lobe sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inclination {
    pub sin: Four,
    pub cos: Four,
}

/// The four lobes' spread and shift.
#[derive(Clone, Debug)]
pub(super) struct Longitudinal {
    variance: Four,
    inverse: Four,
    /// 1 / (v (1 - e^(-2/v))).
    scale: Four,
    /// Half of the lobe's shift: its centre is θ_i + θ_o = 2a.
    half: [[f32; 2]; 4],
    whole: [[f32; 2]; 4],
}

impl Longitudinal {
    /// Lobes with these variances and these shifts of θ_i + θ_o, in radians, positive towards the tip.
    pub fn new(variance: [f64; 4], shift: [f64; 4]) -> Self {
        let sine = |angle: f64| [angle.sin() as f32, angle.cos() as f32];
        Self {
            variance: variance.map(|v| v as f32),
            inverse: variance.map(|v| (1.0 / v) as f32),
            scale: variance.map(|v| (1.0 / (-v * (-2.0 / v).exp_m1())) as f32),
            half: shift.map(|s| sine(0.5 * s)),
            whole: shift.map(sine),
        }
    }

    /// An inclination less half of each lobe's shift: with it the shifted lobe is the same from either end of the path.
    ///
    /// Past the pole the cosine is taken as positive, the direction there being the same seen from the other side.
    #[inline(always)]
    pub fn turned(&self, sin: f32, cos: f32) -> Inclination {
        turn_all(&self.half, sin, cos)
    }

    /// M of each lobe between two turned inclinations.
    #[inline(always)]
    pub fn evaluate(&self, incoming: &Inclination, outgoing: &Inclination) -> Four {
        each(|p| self.between(p, [incoming.sin[p], incoming.cos[p]], [outgoing.sin[p], outgoing.cos[p]]))
    }

    /// M of lobe `p` between inclinations as they are and one that is turned.
    #[inline(always)]
    pub fn spread<const N: usize>(&self, p: usize, sin: &[f32; N], cos: &[f32; N], outgoing: &Inclination) -> [f32; N] {
        let mut spread = [0.0; N];
        for k in 0..N {
            let incoming = turn(self.half[p], sin[k], cos[k]);
            spread[k] = self.between(p, incoming, [outgoing.sin[p], outgoing.cos[p]]);
        }
        spread
    }

    #[inline(always)]
    fn between(&self, p: usize, [sin_i, cos_i]: [f32; 2], [sin_o, cos_o]: [f32; 2]) -> f32 {
        let (c, s) = (cos_i - cos_o, sin_i + sin_o);
        self.scale[p] * bessel(cos_i * cos_o * self.inverse[p], -0.5 * (c * c + s * s) * self.inverse[p])
    }

    /// The density of [`Self::sample`] in θ_i of each lobe, over cos θ_i.
    pub fn density(&self, [sin_i, cos_i]: [f32; 2], [sin_o, cos_o]: [f32; 2]) -> Four {
        let incoming = Inclination { sin: [sin_i; 4], cos: [cos_i; 4] };
        self.evaluate(&incoming, &turn_all(&self.whole, sin_o, cos_o))
    }

    /// Sine and cosine of an inclination for light that leaves by lobe `p`, with the lobe's whole shift in θ_o (d'Eon et al. 2013).
    pub fn sample(&self, p: usize, [sin_o, cos_o]: [f32; 2], random: [f32; 2]) -> [f32; 2] {
        let v = self.variance[p];
        let outgoing = turn_all(&self.whole, sin_o, cos_o);
        // 1 - cos of the angle on the sphere: v ln(1 / (ξ + (1 - ξ) e^(-2/v))).
        let from_one = (-v * (random[0] + (1.0 - random[0]) * exp(-2.0 / v)).max(1e-30).ln()).clamp(0.0, 2.0);
        let (cos, sin) = (1.0 - from_one, (from_one * (2.0 - from_one)).sqrt());
        let around = (std::f32::consts::TAU * random[1]).cos();
        let sin_i = (sin * around * outgoing.cos[p] - cos * outgoing.sin[p]).clamp(-1.0, 1.0);
        [sin_i, ((1.0 - sin_i) * (1.0 + sin_i)).sqrt()]
    }
}

/// Sine and cosine of an inclination less an angle, given by its own.
#[inline(always)]
fn turn([sin_a, cos_a]: [f32; 2], sin: f32, cos: f32) -> [f32; 2] {
    [sin * cos_a - cos * sin_a, (cos * cos_a + sin * sin_a).abs()]
}

fn turn_all(angle: &[[f32; 2]; 4], sin: f32, cos: f32) -> Inclination {
    Inclination { sin: each(|p| turn(angle[p], sin, cos)[0]), cos: each(|p| turn(angle[p], sin, cos)[1]) }
}
