use std::f32::consts::PI;

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::*;
use crate::embree::Device;
use crate::hash::{hash, to_unit};
use crate::illumination::{DirectLight, Environment, Illumination, Lamp, Radiance, RectLight};
use crate::surface::{SurfaceModel, Surfaces, primitives};

pub(super) const FREE: fn(Vec3, Vec3, f32) -> f32 = |_, _, _| 1.0;

fn surfaces(meshes: &[(crate::surface::Mesh, Vec3)], area: &[RectLight]) -> Surfaces {
    let mut model = SurfaceModel::default();
    for (mesh, albedo) in meshes {
        let mut mesh = mesh.clone();
        mesh.materials.iter_mut().for_each(|material| material.diffuse = *albedo);
        model.add(&mesh, false);
    }
    for light in area {
        model.add_light(light.corner, light.edge_u, light.edge_v, light.radiance);
    }
    model.into_traceable(&Device::new().expect("Embree")).expect("a scene")
}

/// Where the walls of the cube lie: floor, ceiling, left, right, back, front.
pub(super) const WALLS: [Vec3; 6] = [Vec3::NEG_Y, Vec3::Y, Vec3::NEG_X, Vec3::X, Vec3::NEG_Z, Vec3::Z];

/// The cube from -1 to 1.
pub(super) fn cube(albedos: [Vec3; 6]) -> Vec<(crate::surface::Mesh, Vec3)> {
    let wall = |n: Vec3| primitives::plane(n.as_dvec3(), -n.as_dvec3(), [2.0, 2.0]);
    WALLS.into_iter().zip(albedos).map(|(n, albedo)| (wall(n), albedo)).collect()
}

pub(super) fn lit(sky: Vec3, direct: Vec<DirectLight>, area: Vec<RectLight>, surfaces: Surfaces) -> Illumination {
    let environment = Environment::new(Radiance::Uniform(sky), None, Mat3::IDENTITY, 64);
    Illumination::new(
        environment,
        direct.into_iter().map(|light| Lamp { light, blocked: true }).collect(),
        area,
        Some(surfaces),
        64,
    )
}

pub(super) fn settings(photons: u32) -> Settings {
    Settings { photons, max_bounces: 200, neighbours: 64, seed: 3 }
}

pub(super) fn lamp() -> DirectLight {
    DirectLight::Point { position: Vec3::new(0.1, 0.7, -0.05), intensity: Vec3::new(1.0, 0.8, 0.5) }
}

/// Mean irradiance of a map over a wall of the cube, by a grid.
fn over_wall(map: &PhotonMap, out: Vec3, side: u32) -> Vec3 {
    let frame = crate::igloo::frame_around(-out);
    let at = |i: u32| 2.0 * (i as f32 + 0.5) / side as f32 - 1.0;
    let points = (0..side * side).map(|i| out + frame * Vec3::new(at(i % side), at(i / side), 0.0));
    points.filter_map(|point| map.irradiance(point, -out)).map(|found| found.indirect).sum::<Vec3>()
        / (side * side) as f32
}

#[test]
fn a_closed_white_box_gathers_the_geometric_series() {
    // All walls of albedo a: of the power Φ the walls get Φ a + Φ a² + ... = Φ a / (1 - a) by reflection.
    for albedo in [0.3_f32, 0.5, 0.8] {
        let light = lit(Vec3::ZERO, vec![lamp()], vec![], surfaces(&cube([Vec3::splat(albedo); 6]), &[]));
        let map = light.photon_map(&settings(60_000), &FREE, &|| false).expect("photons");
        let power: Vec3 = WALLS.iter().map(|&out| over_wall(&map, out, 64) * 4.0).sum();
        let want = Vec3::new(1.0, 0.8, 0.5) * (4.0 * PI * albedo / (1.0 - albedo));
        let error = (power / want - 1.0).abs().max_element();
        println!("albedo {albedo}: {} of {}, error {error:.4}", power.x, want.x);
        assert!(error < 0.02, "albedo {albedo}: {power} against {want}");
    }
}

#[test]
fn photons_carry_the_power_of_their_lights() {
    let rect = RectLight::new(Vec3::Y * 0.5, Vec3::X * 0.4, Vec3::Z * 0.3, Vec3::new(2.0, 3.0, 4.0)).expect("an area");
    let sun = DirectLight::Directional { toward: Vec3::new(0.6, 0.8, 0.0), irradiance: Vec3::new(1.0, 2.0, 3.0) };
    let axis = Vec3::new(0.0, -0.8, 0.6);
    let spot = DirectLight::Spot {
        position: Vec3::Y * 0.3,
        axis,
        inner: 0.95,
        outer: 0.8,
        intensity: Vec3::new(3.0, 2.0, 1.0),
    };
    let cases = [
        (vec![lamp()], vec![], Vec3::ZERO),
        (vec![sun], vec![], Vec3::ZERO),
        (vec![spot], vec![], Vec3::ZERO),
        (vec![], vec![rect], Vec3::ZERO),
        (vec![], vec![], Vec3::new(0.2, 0.3, 0.4)),
        (vec![lamp(), sun], vec![rect], Vec3::new(0.2, 0.3, 0.4)),
    ];
    let r2 = 3.0 * 1.0001_f32 * 1.0001;
    for (direct, area, sky) in cases {
        let mut want = sky * (4.0 * PI * PI * r2);
        for light in &direct {
            want += match *light {
                DirectLight::Point { intensity, .. } => intensity * 4.0 * PI,
                DirectLight::Spot { inner, outer, intensity, .. } => intensity * (PI * (2.0 - inner - outer)),
                DirectLight::Directional { irradiance, .. } => irradiance * (PI * r2),
            };
        }
        want += area.iter().map(|light| light.radiance * (light.area * PI)).sum::<Vec3>();
        let walls = surfaces(&cube([Vec3::ONE; 6]), &area);
        let light = lit(sky, direct, area, walls);
        let emitter = Emitter::new(&light).expect("light");
        assert!((emitter.power() / want - 1.0).abs().max_element() < 1e-4, "{} against {want}", emitter.power());
        let sum: Vec3 = (0..20_000).map(|i| emitter.emit(i, 20_000, 1).power).sum();
        // A spot's photons differ in power: four standard errors of 20,000 of them; all others have their share exactly.
        let bound =
            if matches!(light.direct[..], [Lamp { light: DirectLight::Spot { .. }, .. }]) { 1e-2 } else { 2e-3 };
        assert!((sum / want - 1.0).abs().max_element() < bound, "{sum} against {want}");
    }
}

/// (χ² - k) / sqrt(2 k) of counts against equal shares.
fn score(counts: &[u32]) -> f64 {
    let total: f64 = counts.iter().map(|&c| f64::from(c)).sum();
    let want = total / counts.len() as f64;
    let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - want).powi(2) / want).sum();
    let freedom = counts.len() as f64 - 1.0;
    (chi2 - freedom) / (2.0 * freedom).sqrt()
}

#[test]
fn directions_and_places_are_distributed_as_they_should() {
    let rect = RectLight::new(Vec3::ZERO, Vec3::X, Vec3::Z, Vec3::ONE).expect("an area");
    let sun = DirectLight::Directional { toward: Vec3::Z, irradiance: Vec3::ONE };
    let point = DirectLight::Point { position: Vec3::ZERO, intensity: Vec3::ONE };
    let bin = |x: f32| ((x * 16.0) as usize).min(15);
    let turn = |d: Vec3| bin(crate::igloo::azimuth(d.x, d.y) / (2.0 * PI));
    let of = |direct: Vec<DirectLight>, area: Vec<RectLight>, sky: f32, place: &dyn Fn(&Emission) -> [usize; 2]| {
        let light = lit(Vec3::splat(sky), direct, area.clone(), surfaces(&cube([Vec3::ONE; 6]), &area));
        let emitter = Emitter::new(&light).expect("light");
        let mut counts = vec![0; 256];
        for i in 0..200_000 {
            let [a, b] = place(&emitter.emit(i, 200_000, 5));
            counts[a * 16 + b] += 1;
        }
        score(&counts)
    };
    let sphere = |e: &Emission| [bin(0.5 - 0.5 * e.direction.z), turn(e.direction)];
    let disk = |e: &Emission| {
        let at = e.origin.truncate().extend(0.0);
        [bin(at.length_squared() / 3.0007), turn(at)]
    };
    let square = |e: &Emission| [bin(e.origin.x + 0.5), bin(e.origin.z + 0.5)];
    // The light shines down: the sine's square is uniform.
    let cosine =
        |e: &Emission| [bin(e.direction.y * e.direction.y), turn(Vec3::new(e.direction.x, e.direction.z, 0.0))];
    let scores = [
        of(vec![point], vec![], 0.0, &sphere),
        of(vec![sun], vec![], 0.0, &disk),
        of(vec![], vec![rect], 0.0, &square),
        of(vec![], vec![rect], 0.0, &cosine),
    ];
    // The sky is stratified over its faces: evener than chance.
    let sky = of(vec![], vec![], 1.0, &sphere);
    println!("scores {scores:?}, sky {sky}");
    assert!(scores.iter().all(|z| z.abs() < 5.0), "{scores:?}");
    assert!(sky < 5.0, "{sky}");
}

/// Irradiance at points of the cube's floor by light reflected at least once, by plain paths that end by chance, lit at each corner.
fn by_paths(
    light: &Illumination,
    hair: &impl Fn(Vec3, Vec3, f32) -> f32,
    position: Vec3,
    normal: Vec3,
    paths: u32,
) -> Vec3 {
    let surfaces = light.surfaces.as_ref().expect("surfaces");
    let mut sum = glam::DVec3::ZERO;
    for path in 0..paths {
        let (mut origin, mut normal, mut weight) = (position + normal * 1e-5, normal, Vec3::splat(PI));
        for bounce in 0..200 {
            let number = |axis| to_unit(hash(&[77, path, bounce, axis, position.x.to_bits(), position.z.to_bits()]));
            let z = (1.0 - number(1)).sqrt();
            let (sin, cos) = (2.0 * PI * number(0)).sin_cos();
            let local = Vec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z);
            let direction = crate::igloo::frame_around(normal) * local;
            let Some(hit) = surfaces.closest(origin, direction, 0.0, f32::INFINITY) else { break };
            weight *= hair(origin, direction, hit.distance) * hit.albedo;
            let leaving = hit.leaving();
            for incident in light.direct.iter().filter_map(|lamp| lamp.light.incident(leaving)) {
                let cosine = incident.toward.dot(hit.normal).max(0.0);
                if light.sees(leaving, incident.toward, incident.distance) {
                    let through = hair(leaving, incident.toward, incident.distance);
                    sum += (weight * incident.irradiance * (cosine * through / PI)).as_dvec3();
                }
            }
            let lives = hit.albedo.max_element();
            if number(2) >= lives {
                break;
            }
            weight /= lives;
            (origin, normal) = (leaving, hit.normal);
        }
    }
    (sum / f64::from(paths)).as_vec3()
}

fn red_and_green() -> [Vec3; 6] {
    let white = Vec3::splat(0.73);
    [white, white, Vec3::new(0.6, 0.06, 0.05), Vec3::new(0.12, 0.45, 0.1), white, white]
}

/// Mean over a grid of points a wall: map and paths.
fn compare(
    walls: &[Vec3],
    light: &Illumination,
    hair: &(impl Fn(Vec3, Vec3, f32) -> f32 + Sync),
    photons: u32,
    paths: u32,
) -> Vec<[Vec3; 2]> {
    let map = light.photon_map(&settings(photons), hair, &|| false).expect("photons");
    let side = 12;
    let at = |i: u32| 2.0 * (i as f32 + 0.5) / side as f32 - 1.0;
    let mean = |&out: &Vec3| {
        let frame = crate::igloo::frame_around(-out);
        let points: Vec<Vec3> = (0..side * side)
            .into_par_iter()
            .map(|i| by_paths(light, hair, out + frame * Vec3::new(at(i % side), at(i / side), 0.0), -out, paths))
            .collect();
        [over_wall(&map, out, 48), points.into_iter().sum::<Vec3>() / (side * side) as f32]
    };
    walls.iter().map(mean).collect()
}

#[test]
#[ignore = "slow: millions of paths"]
fn a_cornell_box_agrees_with_paths() {
    let mut meshes = cube(red_and_green());
    meshes.push((primitives::sphere(glam::DVec3::new(-0.2, -0.5, 0.1), 0.4), Vec3::splat(0.6)));
    let light = lit(Vec3::ZERO, vec![lamp()], vec![], surfaces(&meshes, &[]));
    for (wall, [map, paths]) in compare(&WALLS, &light, &FREE, 200_000, 8000).into_iter().enumerate() {
        let error = (map - paths).abs().max_element() / paths.max_element();
        println!("wall {wall}: {map} against {paths}: {error:.4}");
        assert!(error < 0.02, "wall {wall}: {map} against {paths}");
    }
}

#[test]
fn hair_lowers_indirect_light_as_it_does_for_paths() {
    // Stands for hair: a slab that lets 40 % of what crosses it through.
    let slab = |origin: Vec3, direction: Vec3, far: f32| {
        let t = (-0.3 - origin.y) / direction.y;
        if t > 0.0 && t < far { 0.4 } else { 1.0 }
    };
    let light = lit(Vec3::ZERO, vec![lamp()], vec![], surfaces(&cube(red_and_green()), &[]));
    let free = light.photon_map(&settings(50_000), &FREE, &|| false).expect("photons");
    let [map, paths] = compare(&WALLS[..1], &light, &slab, 100_000, 1000)[0];
    let error = (map - paths).abs().max_element() / paths.max_element();
    println!("floor {map} against {paths}: {error:.4}; without {}", over_wall(&free, Vec3::NEG_Y, 48));
    assert!(error < 0.03, "{map} against {paths}");
    assert!(map.x < 0.6 * over_wall(&free, Vec3::NEG_Y, 48).x);
}

#[test]
fn threads_do_not_change_a_photon() {
    let light = lit(Vec3::ONE, vec![lamp()], vec![], surfaces(&cube(red_and_green()), &[]));
    let traced = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| light.photon_map(&settings(20_000), &FREE, &|| false).expect("photons"))
    };
    let (one, four) = (traced(1), traced(4));
    assert_eq!(one.len(), four.len());
    for i in 0..2000 {
        let [u, v] = [0, 1].map(|axis| 2.0 * to_unit(hash(&[i, axis])) - 1.0);
        let ask = |map: &PhotonMap| map.irradiance(Vec3::new(u, -1.0, v), Vec3::Y);
        assert_eq!(ask(&one), ask(&four));
    }
}

#[test]
fn a_hot_spot_gives_as_much_light_in_two_parts_as_in_one() {
    // Just below the ceiling: most of the light comes from a spot a tenth as wide as the box.
    let lamp = DirectLight::Point { position: Vec3::new(0.1, 0.93, 0.0), intensity: Vec3::new(1.0, 0.9, 0.8) };
    let mut light = lit(Vec3::ZERO, vec![lamp], vec![], surfaces(&cube([Vec3::splat(0.5); 6]), &[]));
    light.set_photons(light.photon_map(&settings(100_000), &FREE, &|| false));
    let (map, walls) = (light.photons().expect("photons"), light.surfaces.as_ref().expect("walls"));
    assert!(map.hot_spots().is_some());
    for (position, normal) in [
        (Vec3::new(0.3, -1.0, 0.2), Vec3::Y),
        (Vec3::new(-1.0, 0.4, 0.1), Vec3::X),
        (Vec3::new(0.0, 0.0, 1.0), -Vec3::Z),
        // Beside the spot, where few photons are above the cap and rays bring most of their light.
        (Vec3::new(0.1, 0.96, -1.0), Vec3::Z),
    ] {
        let origin = position + normal * 1e-5;
        let frame = crate::igloo::frame_around(normal);
        let (mut whole, mut below, mut brightest) = (glam::DVec3::ZERO, glam::DVec3::ZERO, [0.0_f32; 2]);
        let count = 100_000;
        for i in 0..count {
            let number = |axis| to_unit(hash(&[91, i, axis, position.x.to_bits()]));
            let z = (1.0 - number(1)).sqrt();
            let (sin, cos) = (2.0 * PI * number(0)).sin_cos();
            let direction = frame * Vec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z);
            let hit = walls.closest(origin, direction, 0.0, f32::INFINITY).expect("a closed box");
            let known = map.irradiance(hit.position, hit.normal).expect("photons");
            let parts = [hit.albedo * known.total, light.reflected(&hit, direction, i, &FREE) * PI];
            whole += parts[0].as_dvec3();
            below += parts[1].as_dvec3();
            brightest = [0, 1].map(|k| brightest[k].max(parts[k].x));
        }
        let mut above = Vec3::ZERO;
        light.hot_light(origin, 4096, 5, |incident| {
            let cosine = incident.toward.dot(normal).max(0.0);
            if light.sees(origin, incident.toward, incident.distance) {
                above += incident.irradiance * cosine;
            }
        });
        let (whole, both) = (whole / f64::from(count), below / f64::from(count) + above.as_dvec3());
        let error = (both / whole - 1.0).abs().max_element();
        println!("{position}: {both} against {whole}, above {above}; brightest {brightest:?}");
        assert!(error < 0.02, "{both} against {whole}");
        // What speckles is gone from the rays.
        assert!(brightest[1] < 0.25 * brightest[0], "{brightest:?}");
    }
}

#[test]
fn a_sample_of_a_spot_is_bounded_however_near_it_is() {
    let lamp = DirectLight::Point { position: Vec3::new(0.1, 0.93, 0.0), intensity: Vec3::splat(1.0) };
    let mut light = lit(Vec3::ZERO, vec![lamp], vec![], surfaces(&cube([Vec3::splat(0.5); 6]), &[]));
    light.set_photons(light.photon_map(&settings(100_000), &FREE, &|| false));
    let hot = light.photons().and_then(PhotonMap::hot_spots).expect("hot spots");
    // The spot's radiance is that of the lamp straight above it, but for the map's noise of an eighth and its reflections.
    let brightest = 0.5 / PI / 0.07_f32.powi(2) * 1.5;
    let count = 16;
    let mut most = 0.0_f32;
    for i in 0..2000 {
        let number = |axis| to_unit(hash(&[17, i, axis]));
        let (place, normal, _) = hot.choose(f64::from(number(0))).expect("a spot");
        // From a hundred thousandth of the box to all of it.
        let at = place + (normal + Vec3::new(number(1), number(2), number(3)) - 0.5) * 10.0_f32.powf(-5.0 * number(4));
        // Strata are drawn: many numbers until they meet the spot beside the point.
        (0..64)
            .for_each(|key| hot.light(at, count, key, |incident| most = most.max(incident.irradiance.max_element())));
    }
    // What one gather ray of as many would bring.
    let bound = brightest / (0.6 * count as f32);
    println!("{most} of {bound} at the most");
    assert!(most < bound && most > 0.01 * bound, "{most} of {bound}");
}
