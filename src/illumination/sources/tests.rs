use super::super::{Environment, Mapping, Radiance};
use super::*;
use crate::hash::unit;
use crate::igloo::{Igloo, Span};
use crate::image;
use glam::{DVec3, Mat3};

/// A real map, its values as the scene's loader leaves them; none where the folder is absent.
pub(in crate::illumination) fn real(name: &str) -> Option<Map> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/env/").to_owned() + name;
    if !std::path::Path::new(&path).exists() {
        eprintln!("skipped: {path} is not there");
        return None;
    }
    let rgb = image::read(path.as_ref(), &image::Limits::default()).and_then(|image| image.rgb()).expect("a picture");
    let pixels = rgb.pixels.iter().map(|pixel| Vec3::from_array(pixel.map(|v| v.clamp(0.0, 65_504.0)))).collect();
    let mapping = if rgb.width == rgb.height { Mapping::Angular } else { Mapping::LatLong };
    Some(Map::new(mapping, rgb.width as usize, rgb.height as usize, pixels))
}

/// A dim sky with discs: direction, angular radius, radiance.
fn sky(width: usize, dim: f32, discs: &[(Vec3, f32, Vec3)]) -> Map {
    let blank = Map::new(Mapping::LatLong, width, width / 2, vec![Vec3::ZERO; width * width / 2]);
    let color = |pixel: usize| {
        let d = blank.direction(pixel % width, pixel / width, 0.5, 0.5);
        let inside = discs.iter().find(|(at, radius, _)| d.dot(*at) > radius.cos());
        inside.map_or(Vec3::splat(dim), |(_, _, radiance)| *radiance)
    };
    blank.with_pixels((0..width * width / 2).map(color).collect())
}

fn energy(map: &Map) -> DVec3 {
    let pixel = |(i, p): (usize, &Vec3)| p.as_dvec3() * f64::from(map.solid_angle(i % map.width, i / map.width));
    map.pixels.iter().enumerate().map(pixel).sum()
}

fn holds_the_energy(map: &Map, found: &Sources) {
    let whole = energy(map);
    let parts = energy(&found.rest) + found.list.iter().map(|s| s.energy.as_dvec3()).sum::<DVec3>();
    for axis in 0..3 {
        let error = parts[axis] / whole[axis] - 1.0;
        assert!(error.abs() < 1e-4, "channel {axis}: {error}");
    }
    let share = found.list.iter().map(|s| f64::from(s.energy.element_sum())).sum::<f64>() / whole.element_sum();
    assert!((share / found.share() - 1.0).abs() < 1e-3, "{share} against {}", found.share());
}

#[test]
fn the_lamps_of_real_maps_are_found_and_no_light_is_lost() {
    for (name, count, share) in
        [("pmndrs_studio.hdr", 1..=3, 0.85..0.99), ("StageEnvLatLong.exr", 1..=MOST, 0.05..0.99)]
    {
        let Some(map) = real(name) else { return };
        for faces in [36, 64, 100] {
            let found = Sources::find(&map, faces).expect("sources");
            println!("{name}, {faces} faces: {} sources, {:.4} of the light", found.list.len(), found.share());
            for s in &found.list {
                println!("  share {:.4}, {:.5} sr, {} pixels, {}", s.share, s.solid_angle, s.pixels.len(), s.direction);
            }
            assert!(count.contains(&found.list.len()) && share.contains(&found.share()));
            holds_the_energy(&map, &found);
        }
    }
    let Some(venice) = real("pmndrs_venice.hdr") else { return };
    assert!(Sources::find(&venice, 64).is_none(), "bright parts of a sky that is not much brighter are not worth it");
}

#[test]
fn faces_of_the_rest_and_samples_of_the_sources_make_the_map_again() {
    let Some(map) = real("pmndrs_studio.hdr") else { return };
    let found = std::sync::Arc::new(Sources::find(&map, 64).expect("sources"));
    let igloo = Igloo::new(Span::Sphere, 64);
    let whole = Environment::new(Radiance::Map(map.clone()), None, Mat3::IDENTITY, 64).averages(&igloo);
    let mut parts = Environment::new(Radiance::Map(map), Some(found.clone()), Mat3::IDENTITY, 64).averages(&igloo);
    let n = 20_000;
    for (index, source) in found.list.iter().enumerate() {
        for i in 0..n {
            let u = (f64::from(i) + 0.5) / f64::from(n);
            let (direction, energy) = source.sample(&found.rest, u, hash(&[index as u32, i])).expect("a sample");
            parts[igloo.face_of(direction)] += energy / (n as f32 * igloo.face_solid_angle());
        }
    }
    let total: f32 = whole.iter().map(|mean| mean.y).sum();
    let difference: f32 = whole.iter().zip(&parts).map(|(a, b)| (a.y - b.y).abs()).sum();
    assert!(difference / total < 1e-3, "{}", difference / total);
}

#[test]
fn a_sun_is_taken_with_its_extent_and_colour() {
    let at = Vec3::new(0.3, 0.8, -0.4).normalize();
    // A disc of 1.5 degrees, across the seam in the second case.
    for at in [at, Vec3::new(0.0, 0.2, -1.0).normalize()] {
        let map = sky(1024, 0.5, &[(at, 0.026, Vec3::new(9_000.0, 7_000.0, 1_000.0))]);
        let found = Sources::find(&map, 64).expect("a sun");
        assert_eq!(found.list.len(), 1);
        let sun = &found.list[0];
        holds_the_energy(&map, &found);
        assert!(sun.direction.distance(at) < 2e-3);
        assert!((sun.solid_angle / (std::f64::consts::PI * 0.026_f64.powi(2)) - 1.0).abs() < 0.05);
        for i in 0..2_000 {
            let (direction, energy) = sun.sample(&found.rest, unit(&[i]), i).expect("a sample");
            assert!(direction.dot(at) > 0.034_f32.cos(), "{direction} is outside the disc");
            assert!((energy / sun.energy - 1.0).abs().max_element() < 1e-4);
        }
        // What stays in the map is no brighter than four times the sky.
        assert!(found.rest.pixels.iter().all(|&pixel| brightness(pixel) < 2.01));
    }
}

#[test]
fn what_would_not_err_by_much_stays_in_the_map() {
    let at = Vec3::new(0.3, 0.8, -0.4).normalize();
    let disc = |radiance: f32| Sources::find(&sky(512, 1.0, &[(at, 0.05, Vec3::splat(radiance))]), 64);
    // 0.00785 sr: 1.2 % of the sky's light at 20 times its radiance, 5.6 % at 100 times.
    assert!(disc(20.0).is_none());
    assert_eq!(disc(100.0).map(|found| found.list.len()), Some(1));
    // As many small lamps, none of which is worth it, together are: the worst go until the rest would err by less.
    let lamps: Vec<_> = (0..40)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f32 + 1.0) / 40.0;
            let (sin, cos) = (i as f32 * 2.4).sin_cos();
            (Vec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z, 0.02, Vec3::splat(600.0 + 40.0 * i as f32))
        })
        .collect();
    let found = Sources::find(&sky(1024, 0.3, &lamps), 64).expect("lamps");
    assert!((2..=MOST).contains(&found.list.len()), "{}", found.list.len());
    assert!(found.list.windows(2).all(|pair| pair[0].share >= pair[1].share * 0.99));
    // Half the sky is no small source, nor is an even or a black one.
    assert!(Sources::find(&sky(256, 0.01, &[(Vec3::Y, 1.5, Vec3::ONE)]), 64).is_none());
    assert!(Sources::find(&sky(64, 1.0, &[]), 64).is_none() && Sources::find(&sky(64, 0.0, &[]), 64).is_none());
}

#[test]
fn pixels_are_sampled_by_their_energy() {
    let Some(map) = real("pmndrs_studio.hdr") else { return };
    let found = Sources::find(&map, 64).expect("sources");
    let source = &found.list[0];
    // Runs of pixels of one hundredth of the energy each.
    let n = 100_000;
    let mut counts = vec![0_u32; source.pixels.len()];
    let index_of: std::collections::HashMap<u32, usize> =
        source.pixels.iter().enumerate().map(|(i, (place, _))| (*place, i)).collect();
    for i in 0..n {
        let (direction, _) = source.sample(&found.rest, unit(&[5, i]), i).expect("a sample");
        let (theta, turn) = (direction.y.clamp(-1.0, 1.0).acos(), direction.x.atan2(-direction.z));
        let y = (theta / std::f32::consts::PI * map.height as f32) as usize;
        let x = (turn.rem_euclid(std::f32::consts::TAU) / std::f32::consts::TAU * map.width as f32) as usize;
        // Rounding may put a sample next door, one in thousands.
        if let Some(&index) = index_of.get(&((y * map.width + x) as u32)) {
            counts[index] += 1;
        }
    }
    let met: u32 = counts.iter().sum();
    assert!(met > n - n / 200, "{met} of {n} inside the source");
    let weight = |i: usize| {
        let (place, excess) = source.pixels[i];
        f64::from(brightness(excess) * map.solid_angle(place as usize % map.width, place as usize / map.width))
    };
    let (mut chi2, mut bins, mut want, mut count) = (0.0, 0, 0.0, 0);
    for i in 0..counts.len() {
        want += weight(i) / source.by_energy.total() * f64::from(met);
        count += counts[i];
        if want >= 1_000.0 || i + 1 == counts.len() {
            chi2 += (f64::from(count) - want).powi(2) / want;
            (bins, want, count) = (bins + 1, 0.0, 0);
        }
    }
    let score = (chi2 - f64::from(bins)) / (2.0 * f64::from(bins)).sqrt();
    assert!(bins > 50 && score < 4.0, "chi-squared {chi2} of {bins} bins");
}

#[test]
fn one_source_stands_for_all() {
    let discs = [
        (Vec3::Y, 0.03, Vec3::splat(4_000.0)),
        (Vec3::X, 0.05, Vec3::new(1_000.0, 100.0, 3_000.0)),
        (-Vec3::Y, 0.04, Vec3::splat(3_000.0)),
    ];
    let map = sky(512, 0.1, &discs);
    let found = Sources::find(&map, 64).expect("sources");
    assert_eq!(found.list.len(), 3);
    for normal in [Vec3::Y, Vec3::new(1.0, 1.0, 0.3).normalize(), Vec3::new(0.7, 0.02, 0.7).normalize()] {
        let facing = |d: Vec3| d.dot(normal).max(0.0);
        let (n, mut mean) = (40_000, DVec3::ZERO);
        for i in 0..n {
            let Some((source, chance)) = choose_one(&found.list, normal, unit(&[1, i])) else { continue };
            let (d, energy) = source.sample(&map, unit(&[2, i]), i).expect("a sample");
            mean += (energy / chance * facing(d)).as_dvec3() / f64::from(n);
        }
        // All pixels above the horizon.
        let mut want = DVec3::ZERO;
        for (place, excess) in found.list.iter().flat_map(|source| &source.pixels) {
            let (x, y) = (*place as usize % map.width, *place as usize / map.width);
            want += (*excess * facing(map.direction(x, y, 0.5, 0.5)) * map.solid_angle(x, y)).as_dvec3();
        }
        assert!((mean - want).abs().max_element() / want.max_element() < 0.01, "{normal}: {mean} against {want}");
    }
}
