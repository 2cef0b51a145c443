//! Arithmetic on the four lobes at once, written so that the compiler makes vector instructions of it.

/// One number a lobe: R, TT, TRT, and all beyond.
pub(super) type Four = [f32; 4];

/// One result a lobe.
#[inline(always)]
pub(super) fn each(mut f: impl FnMut(usize) -> f32) -> Four {
    // Not array::from_fn, whose closure is a call.
    [f(0), f(1), f(2), f(3)]
}

/// Σ a b.
#[inline(always)]
pub(super) fn dot(a: &Four, b: &Four) -> f32 {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3])
}

/// e^x for x <= 0, to 3 units in the last place; below -86 it is e^-86.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    /// 1.5 · 2^23: added to a small number it leaves its nearest integer in the low bits.
    const ROUND: f32 = 12_582_912.0;
    // Further down the result would not be a normal number.
    let x = x.max(-86.0);
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    // ln 2 in two parts, so that n ln 2 is exact where it counts.
    let r = (x - n * 0.693_359_4) - n * -2.121_944_4e-4;
    let p = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0))))));
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

/// e^-x I0(x) e^rest for x >= 0 and rest <= 0, I0 the modified Bessel function, to 3e-7 (Abramowitz and Stegun 9.8.1 and 9.8.2).
#[inline(always)]
pub(super) fn bessel(x: f32, rest: f32) -> f32 {
    let small = x < 3.75;
    let t = x * (1.0 / 3.75);
    let s = t * t;
    let low = 1.0
        + s * (3.515_622_9
            + s * (3.089_942_4 + s * (1.206_749_2 + s * (0.265_973_2 + s * (0.036_076_8 + s * 0.004_581_3)))));
    let x_high = x.max(3.75);
    let inverse = 1.0 / x_high;
    let s = 3.75 * inverse;
    let high = 0.398_942_3
        + s * (0.013_285_92
            + s * (0.002_253_19
                + s * (-0.001_575_65
                    + s * (0.009_162_81
                        + s * (-0.020_577_06 + s * (0.026_355_37 + s * (-0.016_476_33 + s * 0.003_923_77)))))));
    let high = high * inverse.sqrt();
    let (factor, exponent) = if small { (low, rest - x) } else { (high, rest) };
    factor * exp(exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_the_exponential() {
        for k in 0..86_000 {
            let x = -k as f32 * 1e-3;
            let exact = f64::from(x).exp();
            assert!((f64::from(exp(x)) / exact - 1.0).abs() < 4e-7, "{x}: {} against {exact}", exp(x));
        }
        assert!(exp(-1e30) < 5e-38);
    }

    #[test]
    fn the_bessel_function_is_its_integral() {
        // (1/π) ∫ e^(x (cos θ - 1)) dθ over [0, π]; the midpoint rule converges exponentially.
        let exact = |x: f64| {
            let n = 4000;
            let term = |k: i32| (x * ((f64::from(k) + 0.5) / f64::from(n) * std::f64::consts::PI).cos() - x).exp();
            (0..n).map(term).sum::<f64>() / f64::from(n)
        };
        for x in [0.0_f32, 1e-6, 0.1, 1.0, 3.0, 3.749, 3.75, 4.0, 10.0, 100.0, 1e4, 1e5] {
            let [ours, reference] = [f64::from(bessel(x, 0.0)), exact(f64::from(x))];
            assert!((ours / reference - 1.0).abs() < 1e-6, "{x}: {ours} against {reference}");
        }
    }
}
