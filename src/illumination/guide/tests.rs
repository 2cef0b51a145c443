use super::super::sources::tests::real;
use super::super::{Environment, Radiance, Sources};
use super::*;
use crate::hash::{hash, to_unit};
use glam::DVec3;

fn numbers(i: u32) -> [f32; 3] {
    [0, 1, 2].map(|axis| to_unit(hash(&[77, i, axis])))
}

fn normal(i: u32) -> Vec3 {
    let igloo = Igloo::new(Span::Sphere, 1);
    igloo.direction(i as usize % 2, to_unit(hash(&[8, i])), to_unit(hash(&[9, i])))
}

/// Guides of real maps, with their sources and without.
fn guides(faces: u32) -> Option<Vec<(&'static str, Guide)>> {
    let mut guides = Vec::new();
    for (name, apart) in [("pmndrs_studio.hdr", true), ("pmndrs_studio.hdr", false), ("pmndrs_venice.hdr", true)] {
        let map = real(name)?;
        let sources = Sources::find(&map, 64).filter(|_| apart).map(std::sync::Arc::new);
        let environment = Environment::new(Radiance::Map(map), sources, Mat3::IDENTITY, 64);
        let igloo = Guide::igloo(faces);
        let means = environment.averages(&igloo);
        guides.push((if apart { name } else { "studio with its lamps" }, Guide::new(igloo, means)));
    }
    Some(guides)
}

/// Irradiance of a guide's faces by 32 x 32 places in each.
fn irradiance(guide: &Guide, normal: Vec3) -> DVec3 {
    let place = |i: usize| (i as f32 + 0.5) / 32.0;
    let face = |face: usize| {
        let cosine = |i: usize| guide.igloo.direction(face, place(i % 32), place(i / 32)).dot(normal).max(0.0);
        let mean = (0..1024).map(|i| f64::from(cosine(i))).sum::<f64>() / 1024.0;
        guide.means[face].as_dvec3() * mean * f64::from(guide.igloo.face_solid_angle())
    };
    (0..guide.means.len()).map(face).sum()
}

#[test]
fn the_mean_is_the_irradiance_and_the_noise_less_than_by_cosine() {
    let Some(guides) = guides(64) else { return };
    let n = 20_000;
    for (name, guide) in guides {
        let (mut ours, mut theirs) = (0.0, 0.0);
        for k in 0..6 {
            let normal = normal(k);
            let want = irradiance(&guide, normal).y;
            let variance = |value: &dyn Fn([f32; 3]) -> f32| {
                let (mut sum, mut squares) = (0.0, 0.0);
                for i in 0..n {
                    let value = f64::from(value(numbers(i)));
                    (sum, squares) = (sum + value, squares + value * value);
                }
                let mean = sum / f64::from(n);
                let variance = squares / f64::from(n) - mean * mean;
                let sigma = (variance / f64::from(n)).sqrt();
                assert!((mean - want).abs() < 4.5 * sigma + 1e-3 * want, "{name}: {mean} ± {sigma} against {want}");
                variance / (want * want)
            };
            ours += variance(&|u| guide.sample(normal, u).map_or(0.0, |(_, irradiance)| irradiance.y)) / 6.0;
            theirs +=
                variance(&|[_, v, w]| PI * guide.means[guide.igloo.face_of(cosine_sample(normal, [v, w]))].y) / 6.0;
        }
        println!("{name}: relative variance {ours:.4}, by cosine {theirs:.4}");
        assert!(ours < 0.5 * theirs, "{name}: {ours} against {theirs}");
    }
}

#[test]
fn directions_come_with_their_density() {
    let Some(guides) = guides(36) else { return };
    let n = 200_000;
    for (name, guide) in guides {
        let normal = normal(3);
        // Four cells a face; the density follows from the value: radiance times cosine over it.
        let cell = |direction: Vec3| {
            let face = guide.igloo.face_of(direction);
            let ring = &guide.igloo.rings()[guide.igloo.ring_of_face(face)];
            let down = usize::from(direction.z < 0.5 * (ring.top + ring.bottom));
            let turn = crate::igloo::azimuth(direction.x, direction.y) / (2.0 * PI) * ring.count as f32;
            face * 4 + down * 2 + usize::from(turn.fract() >= 0.5)
        };
        let mut counts = vec![0.0_f64; guide.means.len() * 4];
        for i in 0..n {
            // Below the horizon nothing comes back; the face was chosen all the same.
            if let Some((direction, _)) = guide.sample(normal, numbers(i)) {
                counts[cell(direction)] += 1.0;
            }
        }
        let total: f32 = (0..guide.means.len())
            .map(|face| guide.brightness[face] * guide.mean_cosine(guide.centers[face].dot(normal)))
            .sum();
        let (mut chi2, mut freedom) = (0.0, 0.0);
        for face in 0..guide.means.len() {
            let share = guide.brightness[face] * guide.mean_cosine(guide.centers[face].dot(normal)) / total;
            for part in 0..4 {
                let corners = [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)];
                let (across, down) = corners[part];
                // The part above the horizon, by places in it.
                let above = (0..256).filter(|i| {
                    let place = |k: usize| (k as f32 + 0.5) / 32.0;
                    guide.igloo.direction(face, across + place(i % 16), down + place(i / 16)).dot(normal) > 0.0
                });
                let whole = above.count();
                let want = f64::from(share) * f64::from(n) / 4.0;
                // Cells that the horizon cuts are left out: how much of them lies above is known to a per cent only.
                if whole == 256 && want > 10.0 {
                    chi2 += (counts[face * 4 + part] - want).powi(2) / want;
                    freedom += 1.0;
                } else if whole == 0 {
                    assert_eq!(counts[face * 4 + part], 0.0);
                }
            }
        }
        let score = (chi2 - freedom) / (2.0_f64 * freedom).sqrt();
        assert!(freedom > 40.0 && score < 4.0, "{name}: chi-squared {chi2} of {freedom} cells");
    }
}

#[test]
fn an_even_sky_has_no_noise_and_a_black_one_no_light() {
    let igloo = || Guide::igloo(36);
    let even = Guide::new(igloo(), vec![Vec3::splat(2.0); igloo().len()]);
    let black = Guide::new(igloo(), vec![Vec3::ZERO; igloo().len()]);
    let mut below = vec![Vec3::ZERO; igloo().len()];
    below[igloo().face_of(-Vec3::Z)] = Vec3::ONE;
    let below = Guide::new(igloo(), below);
    for i in 0..500 {
        let (direction, irradiance) = even.sample(Vec3::Z, numbers(i)).expect("light");
        assert!(direction.z >= 0.0 && (irradiance.x / (2.0 * PI) - 1.0).abs() < 1e-6);
        assert!(black.sample(Vec3::Z, numbers(i)).is_none_or(|(_, irradiance)| irradiance == Vec3::ZERO));
        assert!(below.sample(Vec3::Z, numbers(i)).is_none());
    }
    // A hundred thousand faces are not walked for each ray.
    assert!(Guide::igloo(100_000).len() <= 2 * MOST_FACES as usize);
}
