use std::f32::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::tests::{FREE, WALLS, cube, lamp, lit, settings};
use super::*;
use crate::embree::Device;
use crate::hash::{hash, to_unit, unit};
use crate::illumination::{DirectLight, Illumination, RectLight};
use crate::surface::{Mesh, Optics, SurfaceModel, SurfacePoint, Surfaces, optics, primitives};

const WHITE: Optics = Optics::Mirror { reflectance: Vec3::ONE };
const GLASS: Optics = Optics::Glass { ior: 1.5, transmission: Vec3::ONE };

fn with_optics(walls: &[(Mesh, Vec3)], objects: &[(Mesh, Optics)], area: &[RectLight]) -> Surfaces {
    let mut model = SurfaceModel::default();
    for (mesh, albedo) in walls {
        let mut mesh = mesh.clone();
        mesh.materials.iter_mut().for_each(|material| material.diffuse = *albedo);
        model.add(&mesh, false);
    }
    for (mesh, optics) in objects {
        model.add_optics(mesh, true, *optics);
    }
    for light in area {
        model.add_light(light.corner, light.edge_u, light.edge_v, light.radiance);
    }
    model.into_traceable(&Device::new().expect("Embree")).expect("a scene")
}

fn ball(center: [f64; 3], radius: f64) -> Mesh {
    primitives::sphere(DVec3::from(center), radius)
}

fn aimed(photons: u32) -> CausticSettings {
    CausticSettings { photons, depth: 32, neighbours: 64, seed: 7 }
}

fn caustics(light: &Illumination, photons: u32) -> Caustics {
    light.caustic_map(&aimed(photons), None, &FREE, &|| false).expect("caustics")
}

fn power(photons: &[Photon]) -> Vec3 {
    photons.iter().map(|photon| photon.power.as_dvec3()).sum::<DVec3>().as_vec3()
}

#[test]
fn a_furnace_with_mirrors_and_glass_keeps_its_law() {
    // Walls of albedo a get Φ / (1 - a) in all, whatever lossless things stand in the room.
    for (what, optics) in [("mirror", WHITE), ("glass", GLASS)] {
        for albedo in [0.3_f32, 0.7] {
            let walls = cube([Vec3::splat(albedo); 6]);
            let objects = [(ball([-0.3, -0.4, 0.2], 0.45), optics), (ball([0.5, 0.1, -0.3], 0.3), optics)];
            let light = lit(Vec3::ZERO, vec![lamp()], vec![], with_optics(&walls, &objects, &[]));
            let map = light.photon_map(&settings(120_000), &FREE, &|| false).expect("photons");
            let side = 48;
            let at = |i: u32| 2.0 * (i as f32 + 0.5) / side as f32 - 1.0;
            let mut found = Vec3::ZERO;
            for out in WALLS {
                let frame = crate::igloo::frame_around(-out);
                let places = (0..side * side).map(|i| out + frame * Vec3::new(at(i % side), at(i / side), 0.0));
                let wall: Vec3 = places.filter_map(|p| map.irradiance(p, -out)).map(|found| found.total).sum();
                found += wall * (4.0 / (side * side) as f32);
            }
            let want = Vec3::new(1.0, 0.8, 0.5) * (4.0 * PI / (1.0 - albedo));
            let error = (found / want - 1.0).abs().max_element();
            println!("{what}, albedo {albedo}: {} of {}, error {error:.4}", found.x, want.x);
            assert!(error < 0.02, "{what}, albedo {albedo}: {found} against {want}");
        }
    }
}

#[test]
fn a_ball_throws_all_the_light_that_falls_on_it() {
    // From a point at the distance d a ball of radius r gets I 2π (1 - cos θ), sin θ = r / d; parallel light E π r².
    let center = Vec3::new(-0.2, -0.3, 0.1);
    let radius = 0.4_f32;
    let position = Vec3::new(0.1, 0.7, -0.05);
    let sine = radius / position.distance(center);
    let from_lamp = Vec3::new(1.0, 0.8, 0.5) * (TAU * (1.0 - (1.0 - sine * sine).sqrt()));
    let toward = Vec3::new(0.3, 0.9, 0.2).normalize();
    let sun = DirectLight::Directional { toward, irradiance: Vec3::new(1.0, 2.0, 3.0) };
    let from_sun = Vec3::new(1.0, 2.0, 3.0) * (PI * radius * radius);
    let tinted = Vec3::new(0.9, 0.6, 0.3);
    for (direct, arrives) in [(lamp(), from_lamp), (sun, from_sun)] {
        for (optics, share) in
            [(WHITE, Vec3::ONE), (Optics::Mirror { reflectance: tinted }, tinted), (GLASS, Vec3::ONE)]
        {
            let walls = match direct {
                DirectLight::Directional { toward, .. } => box_with_a_hole(center, toward),
                _ => cube([Vec3::splat(0.5); 6]),
            };
            let objects = [(ball(center.as_dvec3().to_array(), f64::from(radius)), optics)];
            let light = lit(Vec3::ZERO, vec![direct], vec![], with_optics(&walls, &objects, &[]));
            let caustics = caustics(&light, 40_000);
            let found = power(caustics.photons());
            let error = (found / (arrives * share) - 1.0).abs().max_element();
            println!("{direct:?} {optics:?}: {found} of {}, error {error:.4}, cut {}", arrives * share, caustics.cut);
            // The tessellated ball is smaller by up to a thousandth of its radius; a photon's life is chance for tinted mirrors only.
            assert!(error < 0.006, "{found} against {}", arrives * share);
            assert!(caustics.cut < 1e-3);
        }
    }
}

/// A box of 40 around a point, its lid towards the sun with a hole just wide enough for the light that falls on the ball.
fn box_with_a_hole(center: Vec3, toward: Vec3) -> Vec<(Mesh, Vec3)> {
    let frame = crate::igloo::frame_around(toward);
    let [x, y, z] = [frame.x_axis, frame.y_axis, frame.z_axis];
    let quad = |middle: Vec3, u: Vec3, v: Vec3| {
        let mesh = Mesh {
            positions: [-u - v, u - v, u + v, v - u].map(|corner| center + middle + corner).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material: vec![0; 2],
            materials: vec![crate::surface::Material::default()],
            ..Mesh::default()
        };
        (mesh, Vec3::splat(0.5))
    };
    let mut walls = vec![quad(-20.0 * z, 20.0 * x, 20.0 * y)];
    for side in [-1.0, 1.0] {
        walls.push(quad(side * 20.0 * x, 20.0 * y, 20.0 * z));
        walls.push(quad(side * 20.0 * y, 20.0 * x, 20.0 * z));
        walls.push(quad(20.0 * z + side * 10.25 * x, 9.75 * x, 20.0 * y));
        walls.push(quad(20.0 * z + side * 10.25 * y, 9.75 * y, 0.5 * x));
    }
    walls
}

/// Photons from lights to mirrors and glass and then to a wall, by chance among all photons: the last of these surfaces told by their paths' first steps.
fn unaimed(light: &Illumination, count: u32) -> DVec3 {
    let (emitter, surfaces) = (Emitter::new(light).expect("light"), light.surfaces.as_ref().expect("surfaces"));
    let one = |index: u32| {
        let start = emitter.emit(index, count, 3);
        let (mut origin, mut direction, mut power) = (start.origin, start.direction, start.power);
        for met in 0..32 {
            let Some(hit) = surfaces.closest(origin, direction, 0.0, f32::INFINITY) else { return DVec3::ZERO };
            let Some(optics) = hit.optics else {
                return if met > 0 && hit.albedo != Vec3::ZERO { power.as_dvec3() } else { DVec3::ZERO };
            };
            let way = optics.ways(&hit, direction).choose(to_unit(hash(&[5, index, met])));
            (origin, direction, power) = (way.origin, way.direction, power * way.share);
        }
        DVec3::ZERO
    };
    (0..count).into_par_iter().map(one).collect::<Vec<_>>().into_iter().sum()
}

#[test]
fn aimed_photons_carry_what_photons_to_everywhere_would() {
    // Two balls so close that their cones overlap and each shades the other, a mirror on the wall; all kinds of lamps.
    let rect = RectLight::new(Vec3::Y * 0.95, Vec3::X * 0.4, Vec3::Z * 0.3, Vec3::new(2.0, 3.0, 4.0)).expect("an area");
    let spot = DirectLight::Spot {
        position: Vec3::Y * 0.6,
        axis: Vec3::new(0.0, -0.8, 0.6),
        inner: 0.95,
        outer: 0.7,
        intensity: Vec3::new(3.0, 2.0, 1.0),
    };
    let sun = DirectLight::Directional { toward: Vec3::new(0.1, 0.2, 1.0).normalize(), irradiance: Vec3::ONE };
    let objects = [
        (ball([-0.25, -0.5, 0.2], 0.35), WHITE),
        (ball([0.3, -0.45, 0.35], 0.3), GLASS),
        (
            primitives::plane(DVec3::new(0.0, 0.0, -0.99), DVec3::Z, [1.0, 1.5]),
            Optics::Mirror { reflectance: Vec3::splat(0.8) },
        ),
    ];
    // The front is open, for the sun; what leaves there is lost to both.
    let walls: Vec<_> = cube([Vec3::splat(0.5); 6]).into_iter().take(5).collect();
    for (what, direct, area) in [
        ("point", vec![lamp()], vec![]),
        ("spot", vec![spot], vec![]),
        ("sun", vec![sun], vec![]),
        ("area", vec![], vec![rect]),
    ] {
        let light = lit(Vec3::ZERO, direct, area.clone(), with_optics(&walls, &objects, &area));
        let found = power(caustics(&light, 80_000).photons()).as_dvec3();
        let want = unaimed(&light, 500_000);
        let error = (found / want - 1.0).abs().max_element();
        println!("{what}: {found} against {want}, error {error:.4}");
        // A hundred thousand of the truth's photons meet the objects: .3 %; areas differ in power from photon to photon.
        assert!(error < 0.012, "{what}: {found} against {want}");
    }
}

/// Irradiance on cells of the floor y = -1 by an analytic ball of clear glass or mirror, in f64: both ways at each border, none of the program's code but
/// the two laws, which have tests of their own.
fn analytic(lamp: DVec3, center: DVec3, radius: f64, ior: Option<f64>, cells: usize, rays: u32) -> Vec<f64> {
    let mut floor = vec![0.0; cells * cells];
    let to = (center - lamp).normalize();
    let versine = 1.0 - (1.0 - (radius / center.distance(lamp)).powi(2)).sqrt();
    let side = to.any_orthonormal_pair();
    let mut land = |origin: DVec3, direction: DVec3, power: f64| {
        let t = (-1.0 - origin.y) / direction.y;
        let at = origin + t * direction;
        if t > 0.0 && at.x.abs() < 1.0 && at.z.abs() < 1.0 {
            let cell = |x: f64| ((x + 1.0) * 0.5 * cells as f64) as usize;
            floor[cell(at.z) * cells + cell(at.x)] += power;
        }
    };
    for i in 0..rays {
        let cosine = 1.0 - versine * unit(&[i, 0]);
        let (sin, cos) = (std::f64::consts::TAU * unit(&[i, 1])).sin_cos();
        let direction = to * cosine + (side.0 * cos + side.1 * sin) * (1.0 - cosine * cosine).sqrt();
        let power = std::f64::consts::TAU * versine / f64::from(rays);
        let b = (lamp - center).dot(direction);
        let root = b * b - (lamp - center).length_squared() + radius * radius;
        if root < 0.0 {
            continue;
        }
        let hit = lamp + direction * (-b - root.sqrt());
        let normal = (hit - center) / radius;
        let share = ior.map_or(1.0, |ior| optics::fresnel(-direction.dot(normal), ior));
        land(hit, optics::reflect(direction, normal), power * share);
        let Some(ior) = ior else { continue };
        let (mut at, mut inside) = (hit, optics::refract(direction, normal, ior).expect("always into the denser"));
        let mut left = power * (1.0 - share);
        for _ in 0..20 {
            at += inside * (-2.0 * (at - center).dot(inside));
            let inner = (center - at) / radius;
            let share = optics::fresnel(-inside.dot(inner), 1.0 / ior);
            if let Some(out) = optics::refract(inside, inner, 1.0 / ior) {
                land(at, out, left * (1.0 - share));
            }
            left *= share;
            inside = optics::reflect(inside, inner);
        }
    }
    floor
}

#[test]
fn the_caustic_on_the_floor_is_that_of_an_analytic_ball() {
    let (center, radius, cells) = (DVec3::new(-0.1, -0.35, 0.05), 0.4, 8);
    let position = DVec3::new(0.1, 0.7, -0.05);
    for (what, optics, ior) in [("mirror", WHITE, None), ("glass", GLASS, Some(1.5))] {
        let truth = analytic(position, center, radius, ior, cells, 1_000_000);
        let objects = [(primitives::sphere(center, radius), optics)];
        let light = DirectLight::Point { position: position.as_vec3(), intensity: Vec3::ONE };
        // The floor alone: light by way of other walls is no caustic, and what misses the floor is none of its.
        let floor = &cube([Vec3::splat(0.5); 6])[..1];
        let mut light = lit(Vec3::ZERO, vec![light], vec![], with_optics(floor, &objects, &[]));
        let mut errors = Vec::new();
        for photons in [20_000, 80_000, 320_000] {
            let map = caustics(&light, photons);
            let stored: f32 = power(map.photons()).x;
            light.set_caustics(Some(map));
            let fine = 48;
            let cell = |cell: usize| {
                let mut sum = 0.0;
                for i in 0..fine * fine {
                    let at =
                        |c: usize, i: usize| 2.0 * (c as f32 + (i as f32 + 0.5) / fine as f32) / cells as f32 - 1.0;
                    let position = Vec3::new(at(cell % cells, i % fine), -1.0, at(cell / cells, i / fine));
                    let normal = Vec3::Y;
                    let point = SurfacePoint::white(position, normal);
                    sum += f64::from(light.caustic_irradiance(&point).x);
                }
                sum * 4.0 / (cells * cells * fine * fine) as f64
            };
            let found: Vec<f64> = (0..cells * cells).into_par_iter().map(cell).collect();
            let (all, want) = (found.iter().sum::<f64>(), truth.iter().sum::<f64>());
            let off = found.iter().zip(&truth).map(|(a, b)| (a - b).abs()).sum::<f64>() / want;
            println!("{what}, {photons}: stored {stored}, found {all} of {want}; misplaced {:.4}", 0.5 * off);
            // Four standard errors of the share of the photons that land there.
            let share =
                want / (TAU * (1.0 - (1.0 - (radius / position.distance(center)).powi(2) as f32).sqrt())) as f64;
            let noise = 4.0 * ((1.0 - share) / (share * f64::from(photons))).sqrt();
            assert!((f64::from(stored) / want - 1.0).abs() < noise, "{what}: {stored} stored of {want}");
            // Disks over the floor's edge have the whole of their light on it only as nearly as probes say.
            let kept = all / f64::from(stored) - 1.0;
            assert!(kept.abs() < 0.02, "{what}: {all} found of {stored}");
            errors.push(0.5 * off);
        }
        // What is counted in another cell than its own: it falls with the disks of the estimates.
        assert!(errors[2] < 0.6 * errors[0] && errors[2] < 0.04, "{what}: {errors:?}");
    }
}

#[test]
fn light_from_a_plane_mirror_is_that_of_the_mirrored_lamp_also_in_the_air() {
    // The floor is a mirror: above it the lamp's image shines from below, I ρ / d² on what faces it.
    let reflectance = Vec3::new(0.9, 0.7, 0.5);
    let position = Vec3::new(0.1, 0.5, -0.05);
    let image = Vec3::new(position.x, -2.0 - position.y, position.z);
    let floor = (primitives::plane(DVec3::NEG_Y, DVec3::Y, [1.6, 1.6]), Optics::Mirror { reflectance });
    let walls: Vec<_> = cube([Vec3::splat(0.5); 6]).into_iter().skip(1).take(1).collect();
    let light = DirectLight::Point { position, intensity: Vec3::ONE };
    let mut light = lit(Vec3::ZERO, vec![light], vec![], with_optics(&walls, &[floor], &[]));
    let hair_box = Some([Vec3::splat(-0.6), Vec3::splat(0.6)]);
    let mut errors = Vec::new();
    for photons in [25_000, 100_000, 400_000] {
        light.set_caustics(light.caustic_map(&aimed(photons), hair_box, &FREE, &|| false));
        let (mut error2, mut mean, mut turned, n) = (0.0_f64, 0.0_f64, 0.0_f32, 200);
        for i in 0..n {
            let at = Vec3::from([0, 1, 2].map(|axis| 0.9 * unit(&[i, axis]) as f32 - 0.45));
            let want = reflectance / image.distance_squared(at);
            let (mut sum, mut toward) = (Vec3::ZERO, Vec3::ZERO);
            light.caustic_light(at, 16, i, |incident| {
                sum += incident.irradiance;
                toward += incident.toward * incident.irradiance.x;
                assert!(incident.distance > 0.1 && incident.distance < 2.5, "{}", incident.distance);
            });
            let relative = f64::from(sum.x / want.x) - 1.0;
            error2 += relative * relative / f64::from(n);
            mean += relative / f64::from(n);
            turned = turned.max(toward.angle_between(image - at));
            // One colour for all: chance decides only how much.
            assert!((sum / sum.x - reflectance / reflectance.x).abs().max_element() < 1e-3, "{sum}");
        }
        println!("{photons}: mean {mean:+.4}, RMS {:.4}, turned by {turned:.3} at the most", error2.sqrt());
        errors.push((error2.sqrt(), turned, mean));
    }
    // 64 marks of some ten photons each: noise of a tenth and more, whatever the number, but from nearer by.
    assert!(errors.iter().all(|(rms, ..)| *rms < 0.35) && errors[2].2.abs() < 0.02, "{errors:?}");
    assert!(errors[2].1 < 0.7 * errors[0].1, "{errors:?}");
    // On the ceiling, irradiance with its cosine.
    for i in 0..20 {
        let position = Vec3::new(1.2 * unit(&[i, 5]) as f32 - 0.6, 1.0, 1.2 * unit(&[i, 6]) as f32 - 0.6);
        let normal = Vec3::NEG_Y;
        let point = SurfacePoint::white(position, normal);
        let distance = image.distance(position);
        let want = reflectance * ((position.y - image.y) / distance.powi(3));
        let found = light.caustic_irradiance(&point);
        // 64 photons: an eighth.
        assert!((found / want - 1.0).abs().max_element() < 0.5, "{position}: {found} against {want}");
    }
}

#[test]
fn threads_do_not_change_a_caustic() {
    let objects = [(ball([-0.1, -0.35, 0.05], 0.4), GLASS)];
    let walls = cube([Vec3::splat(0.5); 6]);
    let hair_box = Some([Vec3::splat(-0.6), Vec3::splat(0.6)]);
    let traced = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let mut light = lit(Vec3::ZERO, vec![lamp()], vec![], with_optics(&walls, &objects, &[]));
        pool.install(|| light.set_caustics(light.caustic_map(&aimed(20_000), hair_box, &FREE, &|| false)));
        light
    };
    let (one, four) = (traced(1), traced(4));
    assert_eq!(one.caustics().expect("caustics").photons(), four.caustics().expect("caustics").photons());
    for i in 0..300 {
        let at = Vec3::from([0, 1, 2].map(|axis| to_unit(hash(&[i, axis])) - 0.5));
        let ask = |light: &Illumination| {
            let mut all = Vec::new();
            light.caustic_light(at, 16, i, |incident| all.push(*incident));
            all
        };
        assert_eq!(ask(&one), ask(&four));
    }
}
