use std::f64::consts::{FRAC_PI_2, PI};

use super::*;
use crate::igloo::{Igloo, Span};
use crate::shading::fibre::testing::*;
use proptest::prelude::*;

const HAIR: Parameters =
    Parameters { longitudinal: 0.3, azimuthal: 0.3, tilt: 2.0, ior: 1.55, color_is: ColorIs::Strand };

fn hair(longitudinal: f32, azimuthal: f32) -> Parameters {
    Parameters { longitudinal, azimuthal, ..HAIR }
}

/// F in all directions, by a quadrature that resolves the lobes.
fn albedo(fibre: &Marschner, at: &StrandPoint) -> Vec3 {
    let view = fibre.view(fibre.narrow(), at);
    let rough = |r: f32, least: f32| (r * 0.36).max(least);
    let rows = (12.0 / rough(fibre.parameters.longitudinal, 0.003)).clamp(200.0, 4000.0) as u32;
    let columns = if fibre.parameters.azimuthal < 0.1 { 1200 } else { 240 };
    integral(rows, columns, |incoming| view.reflect(incoming))
}

#[test]
fn white_hair_in_a_furnace_is_white() {
    let mut worst = [1.0_f32; 2];
    for (m, n) in [(0.0, 0.3), (0.05, 0.05), (0.1, 0.3), (0.3, 0.3), (0.3, 1.0), (0.6, 0.1), (1.0, 0.3), (1.0, 1.0)] {
        for (tilt, ior) in [(2.0, 1.55), (10.0, 1.3)] {
            let fibre = Marschner::new(Parameters { tilt, ior, ..hair(m, n) }, 0.0);
            for angle in [0.0_f64, 0.2, -0.5, 0.8, 1.1, -1.3, 1.45, 1.53, -1.55, 1.5706, FRAC_PI_2] {
                let energy = albedo(&fibre, &seen(angle, Vec3::ONE)).x;
                worst = [worst[0].min(energy), worst[1].max(energy)];
                let what = format!("roughness {m} and {n}, tilt {tilt}, ior {ior}, angle {angle}");
                assert!((0.998..=1.001).contains(&energy), "{what}: {energy}");
            }
        }
    }
    println!("{worst:?}");
    assert!(worst[0] < worst[1]);
}

#[test]
fn no_lobe_pays_for_another() {
    // Black hair has nothing but R: Fresnel's share, less the few percent that the tilt takes.
    for (m, n) in [(0.02, 0.3), (0.05, 0.05), (0.1, 0.3)] {
        let fibre = Marschner::new(hair(m, n), 0.0);
        for angle in [0.0, 0.4, -0.7, 0.9] {
            let energy = albedo(&fibre, &seen(angle, Vec3::ZERO)).x;
            // Over the lobe the light comes from θ_i = -θ_o, where θ_d = θ_o.
            let fresnel = fibre.narrow().azimuthal.albedo(angle.cos() as f32)[0];
            assert!((energy / fresnel - 1.0).abs() < 0.15, "{m} {n} {angle}: {energy} against {fresnel}");
        }
    }
}

#[test]
fn a_strand_under_a_uniform_sky_has_its_color() {
    let igloo = Igloo::new(Span::Sphere, 64);
    let centers: Vec<Vec3> = (0..igloo.len()).map(|face| igloo.center(face)).collect();
    let faces = Faces { centers: &centers, solid_angle: igloo.face_solid_angle() };
    let mut worst = [0.0_f32; 2];
    for (m, n) in [(0.1, 0.1), (0.3, 0.3), (0.25, 0.6), (0.8, 0.9)] {
        let fibre = Marschner::new(hair(m, n), igloo.face_width());
        for color in [Vec3::new(0.8, 0.62, 0.36), Vec3::new(0.3, 0.15, 0.06), Vec3::new(0.95, 0.5, 0.01)] {
            // Over views in proportion to cos² θ: in single directions, and on faces, whose own R is another by a little.
            let (mut sums, mut whole) = ([[Vec3::ZERO; 2]; 2], 0.0);
            for k in 0..18 {
                let angle = (f64::from(k) - 8.5) * (PI / 18.0);
                let weight = angle.cos().powi(2) as f32;
                whole += weight;
                for (column, color) in [color, Vec3::ZERO].into_iter().enumerate() {
                    let at = seen(angle, color);
                    let mut reflected = Vec::new();
                    fibre.reflect_faces(&at, &faces, &mut reflected);
                    sums[0][column] += albedo(&fibre, &at) * weight;
                    sums[1][column] += reflected.iter().sum::<Vec3>() * faces.solid_angle * weight;
                }
            }
            for (how, [all, highlight]) in sums.into_iter().enumerate() {
                let (all, highlight) = (all / whole, highlight / whole);
                let expected = highlight + (Vec3::ONE - highlight) * color;
                let error = ((all - expected) / expected).abs().max_element();
                worst[how] = worst[how].max(error);
                println!("{m} {n} {color} {how}: {all}, of which highlight {highlight}, off {error}");
                assert!(error < 0.02, "{m} {n} {color} {how}: {all}, of which highlight {highlight}, not {expected}");
            }
        }
    }
    println!("off by {worst:?} at most");
}

#[test]
fn a_block_of_directions_is_each_of_them() {
    let fibre = Marschner::new(hair(0.2, 0.4), 0.0);
    for angle in [0.0, -0.8, 1.5, FRAC_PI_2] {
        let view = fibre.view(fibre.narrow(), &seen(angle, Vec3::new(0.8, 0.4, 0.0)));
        let directions: [Vec3; BLOCK] = std::array::from_fn(|k| direction(0.2 * k as f64 - 1.5, 0.7 * k as f64));
        let [r, g, b] = view.evaluate(&directions).color;
        for (k, &direction) in directions.iter().enumerate() {
            assert_eq!(view.reflect(direction), Vec3::new(r[k], g[k], b[k]), "{angle} {k}");
        }
    }
}

#[test]
fn dense_hair_absorbs_by_the_fit() {
    // (ln 0.8 / 5.8883)², the denominator by hand for β_n = .3.
    let dense = color::of_dense_hair(Vec3::new(0.8, 1.0, 0.0), 0.3);
    assert!((dense.x - 1.4362e-3).abs() < 2e-6 && dense.y == 0.0 && dense.z.is_finite(), "{dense}");
    // A strand of it shows next to nothing of the colour; one whose own colour it is absorbs some eighty times as much.
    let strand = Marschner::new(HAIR, 0.0).narrow().lengths.absorption(Vec3::splat(0.8)).x;
    assert!(strand > 50.0 * dense.x, "{strand}");
}

#[test]
fn light_takes_the_same_way_back() {
    for parameters in [HAIR, hair(0.05, 0.1), hair(0.8, 0.9), Parameters { tilt: -9.0, ..HAIR }] {
        let fibre = Marschner::new(parameters, 0.0);
        let color = Vec3::new(0.9, 0.5, 0.1);
        for (a, b) in [(0.1, -0.3), (0.7, -0.6), (-1.2, 1.3), (0.0, 1.0), (1.4, 0.2)] {
            for azimuth in [0.0, 0.4, 1.5, 2.6, 3.1] {
                let [one, two] = [direction(a, 0.5), direction(b, 0.5 + azimuth)];
                let s = |view: Vec3, incoming: Vec3| {
                    let at = StrandPoint { tangent: Vec3::X, view, color };
                    fibre.reflect(&at, incoming) / (1.0 - incoming.x * incoming.x).sqrt()
                };
                let [there, back] = [s(one, two), s(two, one)];
                let size = there.max_element().max(1e-6);
                assert!((there - back).abs().max_element() < 2e-3 * size, "{a} {b} {azimuth}: {there} {back}");
            }
        }
    }
}

#[test]
fn samples_fall_as_they_should_and_find_the_albedo() {
    let brown = Vec3::new(0.6, 0.3, 0.1);
    for (parameters, color) in [
        (HAIR, Vec3::ONE),
        (HAIR, brown),
        (hair(0.15, 0.2), Vec3::new(0.9, 0.8, 0.5)),
        (hair(0.7, 0.9), brown),
        (Parameters { tilt: 8.0, ior: 1.4, ..hair(0.4, 0.4) }, brown),
    ] {
        let fibre = Marschner::new(parameters, 0.0);
        for angle in [0.0, 0.6, -1.2, 1.5] {
            let at = seen(angle, color);
            samples_follow_their_density(&fibre, &at);
            samples_find_the_albedo(&fibre, &at, albedo(&fibre, &at));
        }
    }
}

#[test]
fn the_spread_along_the_strand_is_the_formula() {
    // The formula as d'Eon et al. print it, where it does not overflow, I0 by its integral.
    let bessel =
        |x: f64| (0..2000).map(|k| (x * ((f64::from(k) + 0.5) / 2000.0 * PI).cos()).exp()).sum::<f64>() / 2000.0;
    for v in [0.02, 0.1, 0.5, 3.0] {
        let lobes = Longitudinal::new([v; 4], [0.0; 4]);
        for out in [-1.5_f64, -0.7, 0.0, 0.3, 1.2] {
            let [sin_o, cos_o] = [out.sin(), out.cos()];
            let at = |theta: f64| {
                let [sin, cos] = [theta.sin() as f32, theta.cos() as f32];
                f64::from(lobes.evaluate(&lobes.turned(sin, cos), &lobes.turned(sin_o as f32, cos_o as f32))[0])
            };
            let mut energy = 0.0;
            for k in 0..2000 {
                let theta = ((f64::from(k) + 0.5) / 2000.0 - 0.5) * PI;
                energy += at(theta) * theta.cos() * PI / 2000.0;
                let exact =
                    bessel(theta.cos() * cos_o / v) * (-theta.sin() * sin_o / v).exp() / (2.0 * v * (1.0 / v).sinh());
                assert!((at(theta) - exact).abs() < 1e-4 * exact + 1e-6, "v {v}, {theta} {out}: {} {exact}", at(theta));
            }
            assert!((energy - 1.0).abs() < 1e-5, "v {v}, {out}: {energy}");
        }
    }
}

#[test]
fn the_smoothest_hair_is_finite() {
    for (m, n) in [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1e-3, 1e-3)] {
        let fibre = Marschner::new(hair(m, n), 0.0);
        for out in [0.0, 1.0, FRAC_PI_2, -FRAC_PI_2] {
            for color in [Vec3::ZERO, Vec3::new(0.5, 0.2, 0.0), Vec3::ONE] {
                let at = seen(out, color);
                for k in 0..400 {
                    let incoming = direction(-out + 1e-4 * f64::from(k % 20), 0.05 * f64::from(k / 20));
                    let f = fibre.reflect(&at, incoming);
                    assert!(f.is_finite() && f.min_element() >= 0.0, "{m} {n} {out} {k}: {f}");
                    assert!(fibre.density(&at, incoming).is_finite());
                }
                for k in 0..50 {
                    let random = [0, 1, 2, 3].map(|a| crate::hash::to_unit(crate::hash::hash(&[k, a])));
                    if let Some(sampled) = fibre.sample(&at, random) {
                        assert!(sampled.incoming.is_finite() && (sampled.reflected / sampled.density).is_finite());
                    }
                }
            }
        }
    }
}

#[test]
fn faces_however_coarse_keep_the_energy() {
    let tangents = [Vec3::X, Vec3::Z, Vec3::new(0.3, -0.5, 0.7), Vec3::new(-0.6, 0.7, 0.1)].map(Vec3::normalize);
    for per_hemisphere in [36, 64, 100, 400] {
        let igloo = Igloo::new(Span::Sphere, per_hemisphere);
        let centers: Vec<Vec3> = (0..igloo.len()).map(|face| igloo.center(face)).collect();
        let faces = Faces { centers: &centers, solid_angle: igloo.face_solid_angle() };
        let (mut count, mut squares, mut worst) = (0, 0.0, 0.0_f32);
        for (m, n) in [(0.05, 0.05), (0.1, 0.3), (0.3, 0.3), (0.6, 0.6)] {
            let fibre = Marschner::new(hair(m, n), igloo.face_width());
            let mut reflected = Vec::new();
            for tangent in tangents {
                let side = tangent.any_orthonormal_vector();
                for angle in [0.0_f32, 0.4, -0.8, 1.1, 1.3, -1.5] {
                    let view = tangent * angle.sin() + side * angle.cos();
                    let at = StrandPoint { tangent, view, color: Vec3::ONE };
                    let energy = fibre.raw_faces(&at, &faces, &mut reflected);
                    // Near the tangent the cone of light is smaller than a face.
                    if angle.abs() < 1.4 {
                        squares += (energy - 1.0).powi(2);
                        count += 1;
                        worst = worst.max((energy - 1.0).abs());
                    }
                    fibre.reflect_faces(&at, &faces, &mut reflected);
                    let sum = reflected.iter().map(|f| f.x).sum::<f32>() * faces.solid_angle;
                    assert!((sum - 1.0).abs() < 1e-4, "{per_hemisphere} faces, {m} {n}, {tangent} {angle}: {sum}");
                }
            }
        }
        let rms = (squares / count as f32).sqrt();
        println!("{per_hemisphere} faces: RMS {rms}, worst {worst}");
        assert!(rms < 0.15, "{per_hemisphere} faces: RMS {rms}, worst {worst}");
    }
}

#[test]
fn faces_see_the_mean_of_what_directions_see() {
    // In dark hair, where the faces' sum is not fixed by the energy: the share of each face against 64 directions in it.
    let igloo = Igloo::new(Span::Sphere, 64);
    let centers: Vec<Vec3> = (0..igloo.len()).map(|face| igloo.center(face)).collect();
    let faces = Faces { centers: &centers, solid_angle: igloo.face_solid_angle() };
    let tangent = Vec3::new(0.3, -0.5, 0.7).normalize();
    for (m, n) in [(0.1, 0.1), (0.3, 0.3), (0.6, 0.6)] {
        let fibre = Marschner::new(hair(m, n), igloo.face_width());
        for (angle, color) in [(0.2_f32, Vec3::splat(0.1)), (-0.9, Vec3::splat(0.6)), (1.2, Vec3::splat(0.9))] {
            let view = tangent * angle.sin() + tangent.any_orthonormal_vector() * angle.cos();
            let at = StrandPoint { tangent, view, color };
            let mut reflected = Vec::new();
            fibre.reflect_faces(&at, &faces, &mut reflected);
            let (mut off, mut all, mut sum) = (0.0, 0.0, 0.0);
            for (face, ours) in reflected.iter().enumerate() {
                let inside = |k: u32| igloo.direction(face, ((k % 8) as f32 + 0.5) / 8.0, ((k / 8) as f32 + 0.5) / 8.0);
                let mean = (0..64).map(|k| fibre.reflect(&at, inside(k)).x).sum::<f32>() / 64.0;
                off += (ours.x - mean).abs();
                sum += ours.x;
                all += mean;
            }
            println!("{m} {n} {angle}: {} off, {} in all", off / all, sum / all);
            assert!(off < 0.4 * all, "{m} {n} {angle}: {}", off / all);
            assert!((sum / all - 1.0).abs() < 0.05, "{m} {n} {angle}: {}", sum / all);
        }
    }
}

#[test]
fn the_scales_turn_the_highlight_to_the_root_and_the_glint_to_the_tip() {
    let fibre = Marschner::new(Parameters { tilt: 3.0, ..hair(0.02, 0.3) }, 0.0);
    let brightest = |color: Vec3, azimuth: f64| {
        let at = StrandPoint { tangent: Vec3::X, view: direction(0.4, 0.0), color };
        let f = |k: i32| fibre.reflect(&at, direction(f64::from(k) * 1e-3, azimuth)).x;
        let most = (-1500..1500).max_by(|&a, &b| f(a).total_cmp(&f(b))).expect("angles");
        f64::from(most) * 1e-3
    };
    let tilt = 3.0_f64.to_radians();
    // Black hair has nothing but R; through white hair nearly all goes straight on, TT.
    assert!((brightest(Vec3::ZERO, 0.5) - (-0.4 - 2.0 * tilt)).abs() < 0.02, "{}", brightest(Vec3::ZERO, 0.5));
    assert!((brightest(Vec3::ONE, PI) - (-0.4 + tilt)).abs() < 0.02, "{}", brightest(Vec3::ONE, PI));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]
    #[test]
    fn darker_hair_is_nowhere_brighter(
        color in 0.0_f32..1.0, less in 0.0_f32..1.0, out in -1.5_f64..1.5, inward in -1.5_f64..1.5, azimuth in 0.0_f64..6.3,
    ) {
        static FIBRE: std::sync::LazyLock<Marschner> = std::sync::LazyLock::new(|| Marschner::new(HAIR, 0.0));
        let f = |color: f32| FIBRE.reflect(&seen(out, Vec3::splat(color)), direction(inward, azimuth)).x;
        prop_assert!(f(color * less) <= f(color) * (1.0 + 1e-6));
        prop_assert!(f(color) <= f(1.0) * (1.0 + 1e-6));
    }
}

#[test]
#[ignore = "slow: a measurement"]
fn what_a_point_costs() {
    for per_hemisphere in [36, 64, 100] {
        let igloo = Igloo::new(Span::Sphere, per_hemisphere);
        let centers: Vec<Vec3> = (0..igloo.len()).map(|face| igloo.center(face)).collect();
        let faces = Faces { centers: &centers, solid_angle: igloo.face_solid_angle() };
        let begin = std::time::Instant::now();
        let fibre = Marschner::new(HAIR, igloo.face_width());
        fibre.broad();
        let (made, begin) = (begin.elapsed(), std::time::Instant::now());
        fibre.narrow();
        let narrow = begin.elapsed();
        let kajiya = crate::shading::KajiyaKayFibre::new(Vec3::splat(0.1), 60.0, igloo.face_width());
        let mut times = [f64::INFINITY; 2];
        let mut reflected = Vec::new();
        // The least of many short runs: on a busy machine a long one is never undisturbed.
        for _ in 0..400 {
            for (fibre, time) in [&fibre as &dyn Fibre, &kajiya].into_iter().zip(&mut times) {
                let begin = std::time::Instant::now();
                for k in 0..20_u32 {
                    let u = |axis| crate::hash::to_unit(crate::hash::hash(&[k, axis])) - 0.5;
                    let [tangent, view] =
                        [Vec3::new(u(0), u(1), u(2)), Vec3::new(u(3), u(4), u(5))].map(Vec3::normalize);
                    let color = Vec3::new(u(6) + 0.5, 0.4, 0.2);
                    fibre.reflect_faces(&StrandPoint { tangent, view, color }, &faces, &mut reflected);
                    std::hint::black_box(&reflected);
                }
                *time = time.min(begin.elapsed().as_secs_f64() * 1e6 / 20.0);
            }
        }
        println!("{} faces: {times:?} µs a point; tables {made:?} and {narrow:?}", igloo.len());
    }
}
