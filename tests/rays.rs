//! Γ by rays: each way of tracing gives what the plain one gives, to the bit, on average, or within its stated bound.

mod common;

use std::ops::ControlFlow;

use common::models::*;
use glam::{Vec3, Vec4};
use tress::embree::{Crossing, CurveScene, Device, PACKET};
use tress::hair::HairModel;
use tress::occlusion::raytraced::Ray;
use tress::occlusion::{Crossings, HairRays, Igloo, RaySettings, Receiver, Transmittance};

fn hair_rays(model: &HairModel, device: &Device) -> HairRays {
    HairRays::build(device, model, Transmittance::Crossing).unwrap()
}

fn small_model() -> HairModel {
    grow(Style::Ball, 2_000, 12, 0.01, 0.5)
}

/// Γ̄ of each face.
fn gamma(rays: &HairRays, model: &HairModel, receiver: &Receiver, settings: &RaySettings, key: u32) -> Vec<f32> {
    let igloo: Igloo = igloo_for(receiver, 40);
    // Some faces look at a wall, one of them from within reach of the point's own strand.
    let far: Vec<f32> = (0..igloo.len()).map(|face| [f32::INFINITY, 0.4, 0.01][face % 7 % 3]).collect();
    let mut gamma = vec![f32::NAN; igloo.len()];
    rays.transmittances(model, receiver, &igloo, settings, &far, key, &mut gamma);
    gamma
}

fn receivers(model: &HairModel) -> Vec<Receiver> {
    [on_hair(model, 16), on_scalp(4), on_floor(-1.6, 8)].concat()
}

const WAYS: [Crossings; 5] = [
    Crossings::Multiply { residual: 0.0 },
    Crossings::Multiply { residual: 0.01 },
    Crossings::Stochastic { roulette: 0.1 },
    Crossings::Stochastic { roulette: RaySettings::ROULETTE },
    Crossings::Stochastic { roulette: 1.0 },
];

#[test]
fn a_packet_meets_the_crossings_that_its_rays_meet_alone() {
    let model = small_model();
    let vertices: Vec<Vec4> = model.points.iter().zip(&model.width).map(|(p, w)| p.extend(0.5 * w)).collect();
    // With narrow vectors Embree splits packets.
    for config in ["", "isa=avx", "isa=sse2"] {
        let device = Device::with_config(config).unwrap();
        let scene = CurveScene::build(&device, vertices.clone(), model.segment_point.clone()).unwrap();
        let mut met = 0;
        for (key, receiver) in receivers(&model).iter().cycle().take(600).enumerate() {
            let mut directions: Vec<Vec3> = (0..PACKET as u32).map(|i| direction(&[1, key as u32, i])).collect();
            let mut far = [f32::INFINITY, 0.3, 0.6, f32::INFINITY, 2.0, 0.1, f32::INFINITY, 1.0];
            directions[key % PACKET].x = f32::NAN;
            far[(key + 3) % PACKET] = -1.0;
            let count = 1 + key % PACKET;
            let mut together: [Vec<Crossing>; PACKET] = Default::default();
            let broke = scene.packet_crossings(receiver.position, &directions[..count], &far, |ray, crossing| {
                together[ray].push(crossing);
                // The third ray ends at its second crossing.
                if ray == 2 && together[2].len() == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            for ray in 0..PACKET {
                let mut alone = Vec::new();
                if ray < count {
                    scene.crossings(receiver.position, directions[ray], 0.0, far[ray], |crossing| {
                        alone.push(crossing);
                        ControlFlow::Continue(())
                    });
                }
                met += alone.len();
                if ray == 2 {
                    assert_eq!(broke[2], alone.len() >= 2);
                    assert_eq!(together[2].len(), alone.len().min(2));
                    continue;
                }
                let sort = |crossings: &mut Vec<Crossing>| {
                    crossings.sort_by_key(|crossing| crossing.segment);
                    crossings.iter().map(|crossing| crossing.segment).collect::<Vec<u32>>()
                };
                assert!(!broke[ray]);
                assert_eq!(sort(&mut together[ray]), sort(&mut alone), "{config:?}, point {key}, ray {ray}");
            }
        }
        assert!(met > 300, "{config:?}: only {met} crossings");
    }
}

#[test]
fn a_panic_in_a_packet_reaches_the_caller() {
    let vertices = vec![Vec4::new(-1.0, 0.0, 1.0, 0.1), Vec4::new(1.0, 0.0, 1.0, 0.1)];
    let scene = CurveScene::build(&Device::new().unwrap(), vertices, vec![0]).unwrap();
    let mut calls = 0;
    let caught = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        scene.packet_crossings(Vec3::ZERO, &[Vec3::Z; PACKET], &[f32::INFINITY; PACKET], |_, _| {
            calls += 1;
            std::panic::resume_unwind(Box::new("visitor"))
        })
    }));
    assert_eq!(caught.unwrap_err().downcast_ref(), Some(&"visitor"));
    assert_eq!(calls, 1);
}

#[test]
fn packets_and_single_rays_give_the_same_bits() {
    for model in [small_model(), grow(Style::Clumps, 1_000, 10, 0.01, 0.0)] {
        let rays = hair_rays(&model, &Device::new().unwrap());
        for crossings in WAYS {
            for (key, receiver) in receivers(&model).iter().enumerate() {
                let trace = |packets| {
                    let settings = RaySettings { rays: 200, crossings, packets };
                    gamma(&rays, &model, receiver, &settings, key as u32)
                };
                assert_eq!(trace(true), trace(false), "{crossings:?}, point {key}");
            }
        }
    }
}

#[test]
fn threads_change_no_bit() {
    let model = small_model();
    let [one, two] = [1, 2].map(|threads| hair_rays(&model, &Device::with_threads(threads).unwrap()));
    for crossings in WAYS {
        let settings = RaySettings { rays: 200, crossings, packets: true };
        for (key, receiver) in receivers(&model).iter().enumerate() {
            let [a, b] = [&one, &two].map(|rays| gamma(rays, &model, receiver, &settings, key as u32));
            assert_eq!(a, b, "{crossings:?}, point {key}");
        }
    }
}

#[test]
fn the_residual_bounds_the_bias() {
    let model = small_model();
    let rays = hair_rays(&model, &Device::new().unwrap());
    let mut largest = 0.0_f32;
    for residual in [0.5, 0.1, 0.01, 1e-3] {
        for (key, receiver) in receivers(&model).iter().enumerate() {
            let trace = |residual| {
                let settings = RaySettings { crossings: Crossings::Multiply { residual }, ..RaySettings::exact(400) };
                gamma(&rays, &model, receiver, &settings, key as u32)
            };
            for (exact, cut) in trace(0.0).into_iter().zip(trace(residual)) {
                assert!(cut <= exact && exact - cut < residual, "residual {residual}: {cut} of {exact}");
                largest = largest.max((exact - cut) / residual);
            }
        }
    }
    assert!(largest > 0.1, "nothing was cut: {largest}");
}

#[test]
fn roulette_leaves_the_mean_alone() {
    let model = small_model();
    let rays = hair_rays(&model, &Device::new().unwrap());
    const KEYS: u32 = 100;
    let mut worst = 0.0_f64;
    for roulette in [0.1, RaySettings::ROULETTE, 1.0] {
        let stochastic = RaySettings { crossings: Crossings::Stochastic { roulette }, ..RaySettings::fastest(80) };
        for (point, receiver) in receivers(&model).iter().enumerate() {
            // The same directions for both, so that the difference is that of the roulette alone.
            let difference = |key: u32| {
                let [a, b] = [stochastic, RaySettings::exact(80)].map(|settings| {
                    let faces = gamma(&rays, &model, receiver, &settings, key * 100 + point as u32);
                    faces.iter().map(|&g| f64::from(g)).sum::<f64>() / faces.len() as f64
                });
                a - b
            };
            let differences: Vec<f64> = (0..KEYS).map(difference).collect();
            let mean = differences.iter().sum::<f64>() / f64::from(KEYS);
            let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / f64::from(KEYS - 1);
            // Five standard deviations of the mean, 84 times: wrong once in 20,000 runs, and keys do not change.
            let deviation = (variance / f64::from(KEYS)).sqrt();
            assert!(mean.abs() <= 5.0 * deviation + 1e-6, "roulette {roulette}, point {point}: {mean} ± {deviation}");
            worst = worst.max(deviation);
        }
    }
    assert!(worst < 1e-2 && worst > 0.0, "the test's own precision: {worst}");
}

#[test]
fn stochastic_rays_are_worth_nothing_the_threshold_or_their_light() {
    let model = small_model();
    let rays = hair_rays(&model, &Device::new().unwrap());
    let one_ray_a_face =
        |roulette| RaySettings { rays: 1, crossings: Crossings::Stochastic { roulette }, packets: true };
    for (key, receiver) in receivers(&model).iter().enumerate() {
        let exact = gamma(&rays, &model, receiver, &RaySettings::exact(1), key as u32);
        for value in gamma(&rays, &model, receiver, &one_ray_a_face(1.0), key as u32) {
            assert!(value == 0.0 || value == 1.0, "{value}");
        }
        for (value, exact) in gamma(&rays, &model, receiver, &one_ray_a_face(0.3), key as u32).into_iter().zip(exact) {
            assert!(if exact > 0.3 { value == exact } else { value == 0.0 || value == 0.3 }, "{value} for {exact}");
        }
    }
}

#[test]
fn the_first_crossing_is_where_the_ray_first_loses_light() {
    let model = grow(Style::Ball, 2_000, 12, 0.01, 0.0);
    let rays = hair_rays(&model, &Device::new().unwrap());
    let (mut met, mut own) = (0, 0);
    for (key, receiver) in receivers(&model).iter().cycle().take(600).enumerate() {
        let direction = direction(&[2, key as u32]);
        let endless = Ray { origin: receiver.position, direction, far: f32::INFINITY, on: receiver.on };
        let passes = |far: f32| rays.transmittance(&model, &Ray { far, ..endless }, 0.0) == 1.0;
        let Some(distance) = rays.first_crossing(&model, &endless) else {
            assert!(passes(f32::INFINITY));
            continue;
        };
        met += 1;
        assert!(passes(0.9999 * distance) && !passes(1.0001 * distance), "ray {key}, first crossing at {distance}");
        assert_eq!(rays.first_crossing(&model, &Ray { far: 0.9999 * distance, ..endless }), None);
        own += u32::from(rays.first_crossing(&model, &Ray { on: None, ..endless }) != Some(distance));
    }
    assert!(met > 100, "{met} rays met hair");
    println!("{met} rays met hair, {own} would have met their own strand first");
}
