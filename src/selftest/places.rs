//! Where things are: models far from the origin and of any size, mirrored and squeezed; segments below the last digit.

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};

use super::{Draw, Measured, Property, U32};
use crate::hair::{Attribute, HairModel, Strands};
use crate::scene::description::Transform;
use crate::scene::space::RenderSpace;
use crate::surface::{Mesh, SurfaceModel, primitives};
use crate::transform;

pub const PROPERTIES: &[Property] = &[
    Property { name: "space: to render space and back", quick: 4000, check: round_trip },
    Property { name: "space: the same scene far away", quick: 4000, check: far_away },
    Property { name: "transform: normals stay outside", quick: 300, check: normals },
    Property { name: "transform: hair's width", quick: 2000, check: widths },
    Property { name: "hair: tangents of tiny segments", quick: 4000, check: tangents },
];

/// A box anywhere, of any size that its place leaves digits for in `f64`.
fn boxed(draw: &mut Draw) -> (DVec3, f64) {
    let size = draw.scale(1e-4, 1e6);
    let place = draw.direction() * draw.pick(&[0.0, 1.0, 1e3, 1e6]);
    (place, size)
}

/// A point is rounded once to `f32` of the box, after f64 roundings of its place.
fn round_trip(draw: &mut Draw) -> Measured {
    let (place, size) = boxed(draw);
    let space = RenderSpace::around(place - size, place + size);
    let point = place + size * (DVec3::new(draw.unit(), draw.unit(), draw.unit()) * 2.0 - 1.0);
    let there = space.point32(point).as_dvec3();
    let back = space.from_scene().inverse().transform_point3(there);
    let bound = size * (2.0 * U32) + 16.0 * f64::EPSILON * place.length();
    Measured { error: back.distance(point), bound }
}

/// Moved by 1e6 and scaled from 1e-4 to 1e6: the same point in render space but for the digits that `f64` loses at that place.
fn far_away(draw: &mut Draw) -> Measured {
    let (place, size) = boxed(draw);
    let point = DVec3::new(draw.unit(), draw.unit(), draw.unit()) * 2.0 - 1.0;
    let here = RenderSpace::around(-DVec3::ONE, DVec3::ONE).point32(point);
    let there = RenderSpace::around(place - size, place + size).point32(place + size * point);
    let bound = 2.0 * U32 + 8.0 * f64::EPSILON * place.length() / size;
    Measured { error: here.distance(there).into(), bound }
}

/// Any map that does not flatten: mirrored, squeezed a thousandfold, turned.
fn map(draw: &mut Draw) -> DAffine3 {
    let scale = [0, 1, 2].map(|_| draw.scale(1e-3, 1e3) * draw.pick(&[-1.0, 1.0]));
    let rotate = [0, 1, 2].map(|_| draw.between(-180.0, 180.0));
    let transform =
        Transform { translate: Some([1e6, -3.0, 0.0]), rotate: Some(rotate), scale: Some(scale), matrix: None };
    // The scene's own words, so that its reading is checked, too.
    transform::affine(&transform).unwrap_or(DAffine3::IDENTITY)
}

/// A mirrored or squeezed ball is still closed, its triangles turn outwards, and its normals look the same way: a count of those that do not.
fn normals(draw: &mut Draw) -> Measured {
    let mut map = map(draw);
    map.translation = DVec3::ZERO;
    let mut mesh: Mesh = primitives::sphere(DVec3::ZERO, 1.0);
    transform::transform_mesh(&map, &mut mesh);
    let wrong = mesh.triangles.iter().filter(|triangle| {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
        let (across, middle) = ((b - a).cross(c - a), (a + b + c) / 3.0);
        // Each corner is rounded by up to √3 u of its distance, which turns the product of two sides by as much times their lengths: of a ball
        // squeezed a million times thinner than it is long, triangles at the tips have no side.
        let rounding = 4.0 * U32 * a.length().max(b.length()).max(c.length());
        let sure = across.dot(middle).abs() > rounding * (a.distance(b) + a.distance(c)) * middle.length();
        sure && across.dot(middle) < 0.0
    });
    let wrong = wrong.count();
    let mut model = SurfaceModel::default();
    model.add(&mesh, true);
    Measured { error: wrong as f64, bound: 0.0 }
}

/// |det|^(1/3) whatever the mirror; the scene's own determinant against the product of its factors.
fn widths(draw: &mut Draw) -> Measured {
    let scale = DVec3::new(draw.scale(1e-3, 1e3), -draw.scale(1e-3, 1e3), draw.scale(1e-3, 1e3));
    let turn = DQuat::from_axis_angle(draw.direction().normalize(), draw.between(0.0, 6.0));
    let map = DAffine3::from_mat3(DMat3::from_quat(turn) * DMat3::from_diagonal(scale));
    let mut strands = strands(&[Vec3::ZERO, Vec3::X], 0.1);
    transform::transform_strands(&map, &mut strands);
    let want = f64::from(0.1_f32) * (scale.x * scale.y * scale.z).abs().cbrt();
    Measured { error: (f64::from(strands.width.at(0, 0)) / want - 1.0).abs(), bound: 2.0 * U32 }
}

fn strands(points: &[Vec3], width: f32) -> Strands {
    Strands {
        points: points.to_vec(),
        first: vec![0, points.len() as u32],
        width: Attribute::Uniform(width),
        color: Attribute::Uniform(Vec3::ONE),
        transparency: Attribute::Uniform(0.5),
    }
}

/// Every segment that is kept has a tangent of unit length, however short it is; what is too short for one is left out.
fn tangents(draw: &mut Draw) -> Measured {
    let at = draw.direction().as_vec3() * draw.pick(&[0.0, 0.0, 1.0]) as f32;
    let step = (draw.direction() * draw.scale(1e-45, 1.0)).as_vec3();
    let mut model = HairModel::default();
    model.add(&strands(&[at, at + step, at + step + Vec3::Y], 0.01), 0);
    let mut error = 0.0_f64;
    for segment in 0..model.segments() {
        let sample = model.sample(segment, 0.5);
        let [a, b] = model.ends(segment).map(|end| end.as_dvec3());
        let off = sample.tangent.as_dvec3().distance((b - a).normalize());
        error = error.max(if off >= 0.0 { off } else { f64::INFINITY });
    }
    Measured { error, bound: 8.0 * U32 }
}
