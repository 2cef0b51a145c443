//! One layer: what a segment that covers part of a region lets through (paper, Eq. 7), as an optical depth.
//!
//! Γ is the product over layers (Eq. 10). Work is done with τ = -Σ ln(1 - a (1 - t)): additive and never negative, where the
//! linear form of the paper (Eq. 12, 13) can go below zero. Scaling a layer by k means k τ.

/// What one crossing of a strand lets through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transmittance {
    /// The strand's transparency.
    Crossing,
    /// The transparency to the power of the visible length in units of `unit` (Eq. 7's σ^L), in render space.
    SegmentLength { unit: f32 },
}

impl Transmittance {
    /// Share of the light that is lost in a crossing where `length` of the strand is visible.
    #[inline]
    pub fn opacity(self, transparency: f32, length: f32) -> f32 {
        match self {
            Self::Crossing => 1.0 - transparency,
            // 1 - t^x as -(e^(x ln t) - 1): of a short length 1 - t^x would leave no digit. A length of 0 hides nothing, even with t = 0.
            Self::SegmentLength { .. } if length <= 0.0 => 0.0,
            Self::SegmentLength { unit } => -(length / unit * transparency.ln()).exp_m1(),
        }
    }
}

/// Optical depth of a layer that covers the share `coverage` of a region (clamped to 1) with this opacity; infinite for 1 and 1.
#[inline]
pub fn optical_depth(coverage: f32, opacity: f32) -> f32 {
    let x = coverage.clamp(0.0, 1.0) * opacity;
    if x < 0.03 {
        // Taylor series of -ln(1 - x): the first left-out term is below 2e-7 of the sum.
        x * (1.0 + x * (0.5 + x * (1.0 / 3.0 + x * 0.25)))
    } else {
        -(-x).ln_1p()
    }
}

/// Γ from optical depths, in place.
pub fn transmittances(depths: &mut [f32]) {
    for depth in depths {
        *depth = (-*depth).exp();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn optical_depth_is_the_logarithm_in_f64() {
        for i in 0..=10_000 {
            let x = i as f32 / 10_000.0 * 0.999;
            let want = -(1.0 - f64::from(x)).ln();
            let got = f64::from(optical_depth(x, 1.0));
            assert!((got - want).abs() <= 1e-6 * want, "{x}: {got} against {want}");
        }
        assert_eq!(optical_depth(5.0, 1.0), f32::INFINITY);
        assert_eq!(optical_depth(0.5, 0.0), 0.0);
    }

    #[test]
    fn an_opaque_layer_lets_nothing_through() {
        let mut depths = [0.0, f32::INFINITY, std::f32::consts::LN_2];
        transmittances(&mut depths);
        assert_eq!(depths[..2], [1.0, 0.0]);
        assert!((depths[2] - 0.5).abs() < 1e-7);
    }

    #[test]
    fn segment_length_follows_the_power_law() {
        let rule = Transmittance::SegmentLength { unit: 2.0 };
        assert!((rule.opacity(0.25, 1.0) - 0.5).abs() < 1e-7);
        assert_eq!(rule.opacity(0.0, 1.0), 1.0);
        assert_eq!(rule.opacity(1.0, 1.0), 0.0);
    }
}
