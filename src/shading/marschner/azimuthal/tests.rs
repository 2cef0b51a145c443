use super::*;

/// D_p by the definition: 4,000 offsets h of equal width, absorption in each path.
fn brute(ior: f64, cos_d: f64, scale: f64, sigma: f64, phi: f64) -> [f64; 4] {
    let sin2 = 1.0 - cos_d * cos_d;
    let bravais = (ior * ior - sin2).sqrt() / cos_d;
    let cos_t = (1.0 - sin2 / (ior * ior)).sqrt();
    let logistic = |x: f64| {
        let x = (x + PI).rem_euclid(2.0 * PI) - PI;
        let density = 1.0 / (4.0 * scale * (0.5 * x / scale).cosh().powi(2));
        let distribution = |x: f64| 1.0 / (1.0 + (-x / scale).exp());
        density / (distribution(PI) - distribution(-PI))
    };
    let count = 4_000;
    let mut sums = [0.0; 4];
    for k in 0..count {
        let h = -1.0 + 2.0 * (f64::from(k) + 0.5) / f64::from(count);
        let (gamma_i, gamma_t) = (h.asin(), (h / bravais).asin());
        let cosine = cos_d * gamma_i.cos();
        // Fresnel by the angles' own form.
        let (i, t) = (cosine.acos(), (cosine.acos().sin() / ior).asin());
        let f = 0.5 * (((i - t).sin() / (i + t).sin()).powi(2) + ((i - t).tan() / (i + t).tan()).powi(2));
        let through = (-sigma * 2.0 * gamma_t.cos() / cos_t).exp();
        let turn = |p: f64| 2.0 * p * gamma_t - 2.0 * gamma_i + p * PI;
        let two = (1.0 - f) * (1.0 - f) * through;
        // The rest as a series, not by its sum.
        let (mut rest, mut term) = (0.0, two * f * through);
        for _ in 3..200 {
            term *= f * through;
            rest += term;
        }
        let terms = [
            f * logistic(phi - turn(0.0)),
            two * logistic(phi - turn(1.0)),
            two * f * through * logistic(phi - turn(2.0)),
            rest / (2.0 * PI),
        ];
        for (sum, term) in sums.iter_mut().zip(terms) {
            *sum += term / f64::from(count);
        }
    }
    sums
}

#[test]
fn the_table_is_the_integral_over_the_width() {
    for (scale, bound) in [(0.06, 0.02), (0.117, 0.01), (0.5, 0.01)] {
        let table = Azimuthal::new(1.55, |_| scale);
        for cos_d in [0.95, 0.6, 0.25] {
            let angles: Vec<f64> = (0..=12).map(|k| PI * f64::from(k) / 12.0).collect();
            for sigma in [0.0, 0.05, 0.6, 1.5] {
                let exact: Vec<[f64; 4]> = angles.iter().map(|&phi| brute(1.55, cos_d, scale, sigma, phi)).collect();
                let white: Vec<[f64; 4]> = angles.iter().map(|&phi| brute(1.55, cos_d, scale, 0.0, phi)).collect();
                for p in 0..4 {
                    // Against the lobe's own peak without absorption, and where all lobes together are brightest.
                    let peak = white.iter().map(|w| w[p]).fold(0.0, f64::max);
                    for (phi, exact) in angles.iter().zip(&exact) {
                        let entry = table.evaluate(cos_d as f32, pseudo_angle(phi.cos() as f32, phi.sin() as f32));
                        let ours = f64::from(entry.white[p]) * (-sigma * f64::from(entry.length[p])).exp();
                        let error = (ours - exact[p]).abs() / peak;
                        let bound = if p == 3 { 0.1 } else { bound };
                        assert!(
                            error < bound,
                            "scale {scale}, cos {cos_d}, sigma {sigma}, p {p}, phi {phi}: {ours} {}",
                            exact[p]
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn without_absorption_nothing_is_lost_around_the_strand() {
    for ior in [1.1, 1.55, 2.5] {
        for scale in [0.01, 0.1, 1.0, 4.0] {
            let table = Azimuthal::new(ior, |_| scale);
            for cos_d in [0.0, 0.05, 0.3, 0.77, 1.0] {
                let sum: f32 = table.albedo(cos_d).iter().sum();
                assert!((sum - 1.0).abs() < 4e-3, "ior {ior}, scale {scale}, cos {cos_d}: {sum}");
            }
        }
    }
}

#[test]
fn a_pseudo_angle_is_an_angle() {
    for k in 0..=200 {
        let phi = PI * f64::from(k) / 200.0;
        let t = f64::from(pseudo_angle(phi.cos() as f32 * 3.0, phi.sin().abs() as f32 * 3.0));
        assert!((angle(t) - phi).abs() < 1e-6, "{phi}: {t}");
    }
}
