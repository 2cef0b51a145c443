use super::*;
use crate::hash::unit;

fn direction(key: u32, axis: u32) -> DVec3 {
    let [z, turn] = [0, 1].map(|k| unit(&[key, axis, k]));
    let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
    let z = 2.0 * z - 1.0;
    let radius = (1.0 - z * z).sqrt();
    DVec3::new(radius * cos, radius * sin, z)
}

fn point(normal: DVec3, flat: DVec3, outside: bool) -> SurfacePoint {
    SurfacePoint { normal: normal.as_vec3(), outside, ..SurfacePoint::white(Vec3::ZERO, flat.as_vec3()) }
}

fn glass(ior: f32) -> Optics {
    Optics::Glass { ior, transmission: Vec3::ONE }
}

#[test]
fn fresnel_is_that_of_the_angles() {
    // By sines and tangents of the sum and difference of the angles: another form of the same law.
    for eta in [1.05, 1.5, 2.4, 1.0 / 1.5, 1.0 / 1.05] {
        for step in 1..9000 {
            let i = f64::from(step).to_radians() / 100.0;
            let sine = i.sin() / eta;
            let want = if sine >= 1.0 {
                1.0
            } else {
                let t = sine.asin();
                0.5 * (((i - t).sin() / (i + t).sin()).powi(2) + ((i - t).tan() / (i + t).tan()).powi(2))
            };
            let found = fresnel(i.cos(), eta);
            // At the critical angle the slope is infinite: rounding of 1e-16 in the cosine is seen as 1e-8.
            assert!((found - want).abs() < 1e-7, "{eta}, {step}: {found} against {want}");
        }
        assert!((fresnel(1.0, eta) - ((eta - 1.0) / (eta + 1.0)).powi(2)).abs() < 1e-15);
        assert_eq!(fresnel(0.0, eta), 1.0);
    }
    assert_eq!(fresnel(0.7, 1.0), 0.0);
}

#[test]
fn snell_holds_to_rounding() {
    for key in 0..20_000 {
        let (normal, incoming) = (direction(key, 0), direction(key, 1));
        let normal = if incoming.dot(normal) > 0.0 { -normal } else { normal };
        let eta = 0.4 + 2.0 * unit(&[key, 2]);
        let sine = incoming.cross(normal).length();
        let mirrored = reflect(incoming, normal);
        assert!((mirrored.dot(normal) + incoming.dot(normal)).abs() < 1e-14);
        assert!(mirrored.cross(normal).distance(incoming.cross(normal)) < 1e-14);
        match refract(incoming, normal, eta) {
            Some(way) => {
                assert!((way.length() - 1.0).abs() < 1e-14);
                assert!(way.dot(normal) < 0.0, "it goes in");
                // The tangential part is kept, over eta: Snell's law and the plane of incidence in one.
                assert!(way.cross(normal).distance(incoming.cross(normal) / eta) < 1e-13, "{key}");
                assert!(sine <= eta * (1.0 + 1e-14));
                // Back again it is the same, and so is the share.
                let back = refract(-way, -normal, 1.0 / eta).expect("a way back");
                assert!(back.distance(-incoming) < 1e-6, "{key}: {back} against {}", -incoming);
                let shares = [fresnel(-incoming.dot(normal), eta), fresnel(-way.dot(normal), 1.0 / eta)];
                assert!((shares[0] - shares[1]).abs() < 1e-6, "{shares:?}");
            }
            None => assert!(sine >= eta * (1.0 - 1e-14), "{key}: reflected wholly below the critical angle"),
        }
    }
}

#[test]
fn clear_glass_and_white_mirrors_lose_nothing() {
    for key in 0..10_000 {
        let (flat, incoming) = (direction(key, 0), direction(key, 1));
        let flat = if incoming.dot(flat) > 0.0 { -flat } else { flat };
        // Up to 26° of bend between the triangle and what it stands for, as the surface gives it: facing the ray.
        let smooth = (flat + 0.5 * direction(key, 2)).normalize();
        let smooth = if smooth.dot(incoming) < 0.0 { smooth } else { flat };
        let at = point(smooth, flat, key % 2 == 0);
        for optics in [glass(1.5), glass(1.0), Optics::Mirror { reflectance: Vec3::ONE }] {
            let ways = optics.ways(&at, incoming.as_vec3());
            let through = ways.refracted.map_or(Vec3::ZERO, |way| way.share);
            assert!((ways.reflected.share + through - 1.0).abs().max_element() < 1e-6);
            assert!(ways.reflected.direction.dot(at.flat_normal) > 0.0, "{key}: a mirror sends light back");
            assert!(ways.reflected.origin.dot(at.flat_normal) > 0.0);
            if let Some(way) = ways.refracted {
                assert!(way.direction.dot(at.flat_normal) < 1e-6, "{key}: light goes through");
                assert!(way.origin.dot(at.flat_normal) < 0.0);
            }
            let chosen = ways.choose(unit(&[key, 3]) as f32);
            assert!((chosen.share - 1.0).abs().max_element() < 1e-5, "one way takes all: {}", chosen.share);
        }
    }
}

#[test]
fn ways_are_chosen_as_often_as_fresnel_says() {
    // χ² over angles from both sides: one degree of freedom each.
    let (mut chi2, mut angles, n) = (0.0, 0, 20_000_u32);
    for outside in [true, false] {
        for degrees in [5.0_f64, 30.0, 41.0, 60.0, 75.0, 85.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let ways = glass(1.5).ways(&point(DVec3::Z, DVec3::Z, outside), DVec3::new(sin, 0.0, -cos).as_vec3());
            let share = fresnel(cos, if outside { 1.5 } else { 1.0 / 1.5 });
            let count = (0..n)
                .filter(|&i| ways.choose(unit(&[i, degrees as u32, u32::from(outside)]) as f32).direction.z > 0.0)
                .count() as f64;
            if share == 1.0 {
                assert!(count == f64::from(n) && sin > 1.0 / 1.5, "{degrees}°");
                continue;
            }
            chi2 += (count - share * f64::from(n)).powi(2) / (f64::from(n) * share * (1.0 - share));
            angles += 1;
        }
    }
    let (mean, deviation) = (f64::from(angles), (2.0 * f64::from(angles)).sqrt());
    assert!(angles >= 8 && (chi2 - mean).abs() < 5.0 * deviation, "χ² {chi2} of {angles}");
}

#[test]
fn radiance_is_squeezed_and_set_free_again() {
    let into = glass(1.5).ways(&point(DVec3::Z, DVec3::Z, true), -Vec3::Z).refracted.expect("a way in");
    let out = glass(1.5).ways(&point(DVec3::Z, DVec3::Z, false), -Vec3::Z).refracted.expect("a way out");
    assert!((into.squeeze * out.squeeze - 1.0).abs() < 1e-6 && (into.squeeze - 1.0 / 2.25).abs() < 1e-6);
}
