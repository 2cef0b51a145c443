//! Embree through its safe interface: triangles, errors, lifetimes, threads.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};

use glam::{DVec3, Vec3, Vec4};
use proptest::prelude::*;
use tress::embree::{CurveScene, Device, Error, TriangleScene};

fn device() -> Device {
    Device::with_threads(1).unwrap()
}

/// Möller and Trumbore in double precision: distance, u, v.
fn meet(triangle: [Vec3; 3], origin: Vec3, direction: Vec3) -> Option<(f64, f64, f64)> {
    let [a, b, c] = triangle.map(Vec3::as_dvec3);
    let (origin, direction): (DVec3, DVec3) = (origin.as_dvec3(), direction.as_dvec3());
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let inverse = 1.0 / e1.dot(p);
    let s = origin - a;
    let q = s.cross(e1);
    let (u, v, t) = (s.dot(p) * inverse, direction.dot(q) * inverse, e2.dot(q) * inverse);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0).then_some((t, u, v))
}

fn point() -> impl Strategy<Value = Vec3> {
    (-1.0..1.0_f32, -1.0..1.0_f32, -1.0..1.0_f32).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn closest_triangle_is_that_of_brute_force(
        corners in prop::collection::vec([point(), point(), point()], 1..40),
        rays in prop::collection::vec((point(), point()), 20),
    ) {
        let positions: Vec<Vec3> = corners.iter().flatten().copied().collect();
        let triangles: Vec<[u32; 3]> = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let scene = TriangleScene::build(&device(), positions.clone(), triangles).unwrap();
        prop_assert_eq!(scene.positions(), &positions[..]);
        for (origin, direction) in rays {
            prop_assume!(direction.length() > 0.05);
            let all = corners.iter().enumerate().filter_map(|(i, &t)| Some((i, meet(t, origin, direction)?)));
            let expected = all.min_by(|a, b| a.1.0.total_cmp(&b.1.0));
            let Some(hit) = scene.closest(origin, direction, 0.0, f32::INFINITY) else {
                // Only a ray along an edge may go either way.
                let edge = |(_, (_, u, v)): (usize, (f64, f64, f64))| u.min(v).min(1.0 - u - v);
                prop_assert!(expected.is_none_or(|e| edge(e) < 1e-4), "missed {expected:?}");
                continue;
            };
            let corner = corners[hit.triangle as usize];
            let at = corner[0] + hit.u * (corner[1] - corner[0]) + hit.v * (corner[2] - corner[0]);
            let normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
            let thin = normal.normalize_or_zero().dot(direction.normalize()).abs() < 1e-3 || normal.length() < 1e-3;
            prop_assume!(!thin);
            prop_assert!(at.distance(origin + hit.distance * direction) < 1e-3);
            prop_assert!(hit.normal.distance(normal) < 1e-4, "{} is not {normal}", hit.normal);
            let (_, (distance, ..)) = expected.expect("Embree found a triangle that is not there");
            prop_assert!((f64::from(hit.distance) - distance).abs() < 1e-3 * (1.0 + distance));
            prop_assert!(scene.occluded(origin, direction, 0.0, f32::INFINITY));
            prop_assert!(scene.occluded(origin, direction, hit.distance * 0.99, hit.distance * 1.01));
            prop_assert!(!scene.occluded(origin, direction, 0.0, hit.distance * 0.99));
        }
    }
}

#[test]
fn rays_from_one_point_meet_together_what_each_meets_alone() {
    let corner = |i: u32, axis| tress::hash::to_unit(tress::hash::hash(&[i, axis])) * 2.0 - 1.0;
    let positions: Vec<Vec3> = (0..60).map(|i| Vec3::new(corner(i, 0), corner(i, 1), corner(i, 2))).collect();
    let triangles: Vec<[u32; 3]> = (0..20).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let scene = TriangleScene::build(&device(), positions, triangles).unwrap();
    let origin = Vec3::new(0.1, 0.2, -0.3);
    // A count that fills no whole packet, and rays that cannot meet anything among the others.
    let mut directions: Vec<Vec3> =
        (0..1003).map(|i| Vec3::new(corner(i, 3), corner(i, 4), corner(i, 5)).normalize()).collect();
    directions[17] = Vec3::NAN;
    directions[18] = Vec3::ZERO;
    let mut met = Vec::new();
    scene.closest_from(origin, &directions, |i, hit| {
        assert_eq!(i, met.len());
        met.push(hit);
    });
    assert_eq!(met.len(), directions.len());
    assert!(met[17].is_none() && met[18].is_none());
    let hits = met.iter().flatten().count();
    assert!((100..1000).contains(&hits), "{hits} of 1003 rays meet something");
    for (direction, together) in directions.iter().zip(&met) {
        let alone = scene.closest(origin, *direction, 0.0, f32::INFINITY);
        assert_eq!(together.map(|hit| hit.triangle), alone.map(|hit| hit.triangle), "{direction}");
        if let (Some(together), Some(alone)) = (together, alone) {
            assert!((together.distance - alone.distance).abs() <= 1e-5 * (1.0 + alone.distance));
        }
    }
}

#[test]
fn rays_at_shared_edges_do_not_slip_through() {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
    let scene = TriangleScene::build(&device(), positions, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
    for i in 1..1000 {
        let on_diagonal = Vec3::new(i as f32 / 1000.0, i as f32 / 1000.0, 0.0);
        let origin = Vec3::new(0.3, -0.7, 5.0);
        assert!(scene.occluded(origin, on_diagonal - origin, 0.0, f32::INFINITY), "{on_diagonal}");
    }
}

#[test]
fn what_embree_would_drop_is_refused_by_index() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 2e18] {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(0.0, bad, 0.0)];
        let error = TriangleScene::build(&device(), positions, vec![[0, 1, 2]]).unwrap_err();
        assert!(matches!(error, Error::Vertex { index: 2, .. }), "{error}");
        let vertices = vec![Vec4::W, Vec4::new(0.0, 0.0, bad, 1.0)];
        let error = CurveScene::build(&device(), vertices, vec![0]).unwrap_err();
        assert!(matches!(error, Error::Vertex { index: 1, .. }), "{error}");
    }
    for bad in [f32::NAN, f32::INFINITY, -1.0] {
        let error = CurveScene::build(&device(), vec![Vec4::W, Vec4::new(1.0, 0.0, 0.0, bad)], vec![0]).unwrap_err();
        assert!(matches!(error, Error::Radius { index: 1, .. }), "{error}");
    }
    let error = TriangleScene::build(&device(), vec![Vec3::ZERO; 3], vec![[0, 1, 2], [0, 1, 3]]).unwrap_err();
    assert!(matches!(error, Error::Triangle { index: 1, count: 3, .. }), "{error}");
    let error = CurveScene::build(&device(), vec![Vec4::W; 2], vec![0, 1]).unwrap_err();
    assert!(matches!(error, Error::Segment { index: 1, first: 1, count: 2 }), "{error}");
    let error = CurveScene::build(&device(), vec![Vec4::W; 2], vec![u32::MAX]).unwrap_err();
    assert!(matches!(error, Error::Segment { index: 0, .. }), "{error}");
}

#[test]
fn empty_scenes_are_empty() {
    let (origin, direction) = (Vec3::ZERO, Vec3::Z);
    for positions in [vec![], vec![Vec3::ZERO; 5]] {
        let scene = TriangleScene::build(&device(), positions, vec![]).unwrap();
        assert_eq!(scene.closest(origin, direction, 0.0, f32::INFINITY), None);
        assert!(!scene.occluded(origin, direction, 0.0, f32::INFINITY));
    }
    for vertices in [vec![], vec![Vec4::ONE; 5]] {
        let scene = CurveScene::build(&device(), vertices, vec![]).unwrap();
        assert!(!scene.crossings(origin, direction, 0.0, f32::INFINITY, |_| panic!("nothing is there")));
    }
}

/// Some strands on the line x = y = 0, one unit apart.
fn ladder(rungs: u32) -> CurveScene {
    let rung = |i: u32| [-1.0, 1.0].map(|x| Vec4::new(x, 0.0, i as f32 + 1.0, 0.01));
    CurveScene::build(&device(), (0..rungs).flat_map(rung).collect(), (0..rungs).map(|i| 2 * i).collect()).unwrap()
}

#[test]
fn unsound_rays_cross_nothing() {
    let scene = ladder(3);
    let nowhere = Vec3::new(0.0, f32::NAN, 0.0);
    let crosses =
        |origin, direction, near, far| scene.crossings(origin, direction, near, far, |_| ControlFlow::Break(()));
    assert!(crosses(Vec3::ZERO, Vec3::Z, 0.0, f32::INFINITY));
    assert!(!crosses(nowhere, Vec3::Z, 0.0, f32::INFINITY));
    assert!(!crosses(Vec3::ZERO, nowhere, 0.0, f32::INFINITY));
    assert!(!crosses(Vec3::ZERO, Vec3::ZERO, 0.0, f32::INFINITY));
    assert!(!crosses(Vec3::ZERO, Vec3::INFINITY, 0.0, f32::INFINITY));
    assert!(!crosses(Vec3::ZERO, Vec3::Z, f32::NAN, f32::INFINITY));
    assert!(!crosses(Vec3::ZERO, Vec3::Z, 0.0, f32::NAN));
    assert!(!crosses(Vec3::ZERO, Vec3::Z, 5.0, 1.0));
}

#[test]
fn near_and_far_bound_the_crossings_and_break_ends_them() {
    let scene = ladder(100);
    let count = |near, far| {
        let mut count = 0;
        scene.crossings(Vec3::ZERO, Vec3::Z, near, far, |c| {
            assert!((c.distance - (c.segment + 1) as f32).abs() < 1e-4 && (c.u - 0.5).abs() < 1e-4);
            count += 1;
            ControlFlow::Continue(())
        });
        count
    };
    assert_eq!(count(0.0, f32::INFINITY), 100);
    assert_eq!(count(10.5, 20.5), 10);
    let mut seen = 0;
    let broke = scene.crossings(Vec3::ZERO, Vec3::Z, 0.0, f32::INFINITY, |_| {
        seen += 1;
        if seen == 7 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(broke && seen == 7);
}

#[test]
fn a_panic_of_the_visitor_reaches_the_caller() {
    let scene = ladder(5);
    let mut calls = 0;
    let caught = catch_unwind(AssertUnwindSafe(|| {
        scene.crossings(Vec3::ZERO, Vec3::Z, 0.0, f32::INFINITY, |_| {
            calls += 1;
            std::panic::resume_unwind(Box::new("visitor"))
        })
    }));
    assert_eq!(caught.unwrap_err().downcast_ref(), Some(&"visitor"));
    assert_eq!(calls, 1);
    assert!(scene.crossings(Vec3::ZERO, Vec3::Z, 0.0, f32::INFINITY, |_| ControlFlow::Break(())), "still usable");
}

#[test]
fn scenes_outlive_their_device_and_are_traced_by_many_threads() {
    fn shared<T: Send + Sync>(value: T) -> T {
        value
    }
    let device = shared(Device::new().unwrap());
    assert!(device.version() >= (4, 3, 0));
    let before = device.memory_bytes();
    let vertices: Vec<Vec4> = (0..20_000).map(|i| Vec4::new((i % 2) as f32, i as f32 * 1e-4, 1.0, 1e-3)).collect();
    let scene = shared(CurveScene::build(&device, vertices, (0..10_000).map(|i| 2 * i).collect()).unwrap());
    assert!(device.memory_bytes() > before + 100_000, "{}", device.memory_bytes());
    drop(device);
    let count = |y: f32| {
        let mut count = 0;
        scene.crossings(Vec3::new(0.3, y, 0.0), Vec3::Z, 0.0, f32::INFINITY, |_| {
            count += 1;
            ControlFlow::Continue(())
        });
        count
    };
    let alone = count(0.7);
    assert!(alone > 5);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| (0..1000).for_each(|_| assert_eq!(count(0.7), alone)));
        }
    });
}

#[test]
fn memory_is_given_back() {
    let device = device();
    let build = || ladder_on(&device);
    drop(build());
    let before = device.memory_bytes();
    for _ in 0..20 {
        drop(build());
    }
    assert!(device.memory_bytes() <= before + 4096, "{before} became {}", device.memory_bytes());
}

fn ladder_on(device: &Device) -> CurveScene {
    let vertices = (0..2000).map(|i| Vec4::new((i % 2) as f32, 0.0, i as f32, 0.01)).collect();
    CurveScene::build(device, vertices, (0..1000).map(|i| 2 * i).collect()).unwrap()
}

#[test]
fn a_device_that_cannot_start_says_why() {
    let error = Device::with_config("isa=nonsense\0").unwrap_err();
    assert!(matches!(&error, Error::Start { message } if message.contains("zero byte")), "{error}");
}
