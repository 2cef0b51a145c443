//! Closed bodies in light from outside: nothing of it comes in.
//!
//! A point of a wall is rounded, and rays leave from beside it ([`SurfacePoint::leaving`](crate::surface::SurfacePoint::leaving)); that must not be beyond the wall, nor beyond the other
//! walls at an edge or in a corner. A leak is what a diffuse wall picks up of the light outside: each ray by its cosine. None would be right, but a ray along a
//! wall and its sharp edge, within 1e-3 radians of both, meets the other wall at an angle that is rounding in single precision, and may pass it.

use glam::{DMat3, DQuat, DVec3};

use super::{Draw, Measured, Property};
use crate::embree::Device;
use crate::surface::{Mesh, SurfaceModel, Surfaces};

pub const PROPERTIES: &[Property] =
    &[Property { name: "walls: rays from anywhere on them stay inside", quick: 400, check: stays_inside }];

/// Rays from each point of a wall, and points of a case.
const RAYS: u32 = 24;
const POINTS: u32 = 24;

/// The smallest body, in half diagonals of the scene: below, the points from which rays leave are beside the wall by a notable part of it.
const SMALLEST: f64 = 1e-3;

/// Purpose of the random numbers of points and rays.
const WALL: u32 = 0x5741_4C4C;

/// A box, or a wedge of four corners whose sharpest edge is 35 degrees, by corners and outward triangles.
fn body(draw: &mut Draw) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    if draw.unit() < 0.6 {
        let corners = (0..8).map(|i| DVec3::from_array([0, 1, 2].map(|axis| f64::from(i >> axis & 1) * 2.0 - 1.0)));
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        return (corners.collect(), quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect());
    }
    let low = draw.between(0.4, 1.0);
    let corners = vec![
        DVec3::new(-1.0, 0.0, -low),
        DVec3::new(1.0, 0.0, -low),
        DVec3::new(0.0, -0.8, low),
        DVec3::new(0.0, 0.8, low),
    ];
    (corners, vec![[0, 1, 2], [1, 0, 3], [2, 3, 0], [3, 2, 1]])
}

/// It anywhere in a scene, turned and of any size that the scene's own leaves digits for.
fn placed(draw: &mut Draw) -> Option<(Surfaces, Vec<DVec3>, Vec<[u32; 3]>)> {
    let (corners, triangles) = body(draw);
    let size = draw.scale(SMALLEST, 0.5);
    let axis = draw.direction();
    let turn = if draw.unit() < 0.3 {
        DMat3::IDENTITY
    } else {
        DMat3::from_quat(DQuat::from_axis_angle(axis, draw.between(0.0, 6.0)))
    };
    let place = draw.direction() * draw.pick(&[0.0, 0.5 * draw.clone().unit(), 0.5]);
    let corners: Vec<DVec3> = corners.iter().map(|&c| (place + turn * c * size).as_vec3().as_dvec3()).collect();
    let mesh = Mesh {
        positions: corners.iter().map(|c| c.as_vec3()).collect(),
        normals: Vec::new(),
        material: vec![0; triangles.len()],
        triangles: triangles.clone(),
        materials: vec![crate::surface::Material::default()],
    };
    let mut model = SurfaceModel::default();
    model.add(&mesh, false);
    let surfaces = model.into_traceable(&Device::with_threads(1).ok()?).ok()?;
    Some((surfaces, corners, triangles))
}

/// Share of the light outside that a point of a wall may pick up: one of its [`RAYS`] within 1e-3 radians of the wall, the angle of a few roundings of the place
/// over the length of a small body.
const PICKED_UP: f64 = 1e-4;

/// Rays from points of the walls, most of them at edges and corners, along the wall or into the body: the most of the light outside that a point picks up.
fn stays_inside(draw: &mut Draw) -> Measured {
    let none = Measured { error: f64::INFINITY, bound: PICKED_UP };
    let Some((surfaces, corners, triangles)) = placed(draw) else { return none };
    let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
    let key = (draw.unit() * 4e9) as u32;
    let random = |point: u32, what: u32| crate::hash::unit(&[WALL, key, point, what]);
    let mut most = 0.0_f64;
    for point in 0..POINTS {
        let triangle = triangles[(random(point, 0) * triangles.len() as f64) as usize];
        // A share of the triangle's height from each edge: some, or next to none.
        let weights = [1, 2, 3].map(|i| {
            let share = random(point, i);
            if random(point, 3 + i) < 0.4 {
                10f64.powf(-9.0 * share) * f64::from(u8::from(share < 0.9))
            } else {
                0.1 + share
            }
        });
        let sum: f64 = weights.iter().sum();
        // All of them next to nothing say nothing: the middle.
        let weights = if sum > 0.0 { weights.map(|weight| weight / sum) } else { [1.0 / 3.0; 3] };
        let target: DVec3 = (0..3).map(|i| corners[triangle[i] as usize] * weights[i]).sum();
        let from = middle.lerp(target, 0.5 * random(point, 7));
        let Some(hit) =
            surfaces.closest(from.as_vec3(), (target - from).normalize_or(DVec3::X).as_vec3(), 0.0, f32::INFINITY)
        else {
            return none;
        };
        let origin = hit.leaving();
        let (mut outside, mut all) = (0.0, 0.0);
        for ray in 0..RAYS {
            let number = |axis| crate::hash::unit(&[WALL, key, point, ray, axis]);
            // From the wall's normal to a millionth of a radian along it.
            let cosine = if number(0) < 0.5 { number(1) } else { 10f64.powf(-6.0 * number(1)) };
            let (sin, cos) = (std::f64::consts::TAU * number(2)).sin_cos();
            let sine = ((1.0 - cosine) * (1.0 + cosine)).sqrt();
            let direction =
                crate::igloo::frame_around(hit.flat_normal) * DVec3::new(sine * cos, sine * sin, cosine).as_vec3();
            all += cosine;
            outside += if surfaces.blocks(origin, direction.normalize(), 0.0, f32::INFINITY) { 0.0 } else { cosine };
        }
        most = most.max(outside / all);
    }
    Measured { error: most, bound: PICKED_UP }
}
