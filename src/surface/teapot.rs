//! Newell's teapot: the 32 bicubic Bézier patches of 1975, with rim, lid and bottom.
//!
//! The numbers are the public ones, in their own units: z up, the spout along +x, 3.15 high. Body and lid, spout and handle do not
//! meet in closed seams: the lid lies within the rim, and spout and handle end inside the body. So the mesh is open at
//! six rings: rim, lid, and both ends of spout and handle.

use std::collections::HashMap;

use glam::{DMat3, DVec3};

use super::mesh::{Material, Mesh};

/// How far the mesh may stray from the surface, as a share of the teapot's size: less than a sphere's.
const SAGITTA: f64 = 1e-3;
/// Patches that meet at a larger angle (this is its cosine) have a crease there; at a smaller one, one normal.
const CREASE: f64 = 0.87;

/// A teapot with smooth normals whose longest extent, from handle to spout, is `size`, its box around `center` and its lid
/// towards the unit vector `up`, an axis. The spout points along x where y or z is up, else along y.
///
/// The mesh strays from the surface by less than a thousandth of the size, nowhere has cracks, and is open where the teapot is.
pub fn teapot(center: DVec3, size: f64, up: DVec3) -> Mesh {
    tessellated(center, size, up, SAGITTA)
}

/// The same to within `sagitta` times the size.
pub fn tessellated(center: DVec3, size: f64, up: DVec3, sagitta: f64) -> Mesh {
    // Turned by cyclic or quarter turns: nothing is mirrored.
    let turn = if up.z > 0.5 {
        DMat3::IDENTITY
    } else if up.x > 0.5 {
        DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X)
    } else {
        DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y)
    };
    let steps = steps(sagitta * LENGTH);
    let mut welder = Welder::default();
    let mut triangles = Vec::with_capacity(64 * steps * steps);
    for patch in &PATCHES {
        let controls = patch.map(|index| DVec3::from(POINTS[usize::from(index)]));
        let mut grid = Vec::with_capacity((steps + 1) * (steps + 1));
        for i in 0..=steps {
            for j in 0..=steps {
                let (position, normal) = evaluate(&controls, i as f64 / steps as f64, j as f64 / steps as f64);
                grid.push(welder.vertex(position, normal));
            }
        }
        for i in 0..steps {
            for j in 0..steps {
                let at = |di: usize, dj: usize| grid[(i + di) * (steps + 1) + j + dj];
                let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
                triangles.extend([[a, c, b], [b, c, d]]);
            }
        }
    }
    // Where a patch's edge is a point its triangles have lost a side.
    let position = |index: u32| welder.positions[index as usize];
    triangles
        .retain(|&[a, b, c]| position(a) != position(b) && position(b) != position(c) && position(c) != position(a));
    let positions: Vec<DVec3> = welder.positions.iter().map(|p| turn * *p).collect();
    let low = positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let (middle, scale) = (0.5 * (low + high), size / (high - low).max_element());
    Mesh {
        positions: positions.iter().map(|p| (center + (*p - middle) * scale).as_vec3()).collect(),
        normals: welder.normals.iter().map(|n| (turn * n.normalize()).as_vec3()).collect(),
        material: vec![0; triangles.len()],
        triangles,
        materials: vec![Material::default()],
    }
}

/// Steps along each side of a patch for this error: a bilinear grid strays from a surface by at most
/// h² (|f_uu| + 2 |f_uv| + |f_vv|) / 8 (Filip et al. 1986), and the control points' differences bound the derivatives.
///
/// All patches have the same, so that they meet without cracks.
fn steps(error: f64) -> usize {
    let curvature = PATCHES.iter().map(|patch| {
        let p = |i: usize, j: usize| DVec3::from(POINTS[usize::from(patch[4 * i + j])]);
        let (mut uu, mut uv, mut vv) = (0.0_f64, 0.0_f64, 0.0_f64);
        for k in 0..4 {
            for l in 0..2 {
                uu = uu.max(6.0 * (p(l, k) - 2.0 * p(l + 1, k) + p(l + 2, k)).length());
                vv = vv.max(6.0 * (p(k, l) - 2.0 * p(k, l + 1) + p(k, l + 2)).length());
            }
        }
        for i in 0..3 {
            for j in 0..3 {
                uv = uv.max(9.0 * (p(i + 1, j + 1) - p(i + 1, j) - p(i, j + 1) + p(i, j)).length());
            }
        }
        uu + 2.0 * uv + vv
    });
    let largest = curvature.fold(0.0, f64::max);
    (largest / (8.0 * error)).sqrt().ceil().clamp(1.0, 500.0) as usize
}

/// A patch's point and its unit normal, outwards.
fn evaluate(controls: &[DVec3; 16], u: f64, v: f64) -> (DVec3, DVec3) {
    let [bu, bv] = [u, v].map(bernstein);
    let [du, dv] = [u, v].map(bernstein_slope);
    let sum = |a: &[f64; 4], b: &[f64; 4]| (0..16).map(|k| controls[k] * (a[k / 4] * b[k % 4])).sum::<DVec3>();
    let (position, along_u, along_v) = (sum(&bu, &bv), sum(&du, &bv), sum(&bu, &dv));
    // In Newell's numbers u runs away from the axis or root and v clockwise, so that v x u is outwards.
    let mut normal = along_v.cross(along_u);
    if normal.length() < 1e-9 {
        // An edge that is a point: f_v vanishes with u, and its direction is that of f_uv.
        normal = sum(&du, &dv).cross(along_u) * if u < 0.5 { 1.0 } else { -1.0 };
    }
    (position, normal.normalize())
}

fn bernstein(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]
}

fn bernstein_slope(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-3.0 * s * s, 3.0 * s * s - 6.0 * s * t, 6.0 * s * t - 3.0 * t * t, 3.0 * t * t]
}

/// Vertices that patches share: one a place, but for creases.
#[derive(Default)]
struct Welder {
    positions: Vec<DVec3>,
    /// Sums of unit normals.
    normals: Vec<DVec3>,
    places: HashMap<[i64; 3], Vec<u32>>,
}

impl Welder {
    fn vertex(&mut self, position: DVec3, normal: DVec3) -> u32 {
        // The same point of two patches differs by rounding only; points of one are further apart than this by far.
        let place = position.to_array().map(|x| (x * 1e7).round() as i64);
        let here = self.places.entry(place).or_default();
        let like = here.iter().find(|&&v| self.normals[v as usize].normalize().dot(normal) > CREASE);
        if let Some(&vertex) = like {
            self.normals[vertex as usize] += normal;
            return vertex;
        }
        // Not a hair's breadth between the two sides of a crease.
        let position = here.first().map_or(position, |&v| self.positions[v as usize]);
        let vertex = self.positions.len() as u32;
        here.push(vertex);
        self.positions.push(position);
        self.normals.push(normal);
        vertex
    }
}

/// Length from handle to spout in the numbers' units.
const LENGTH: f64 = 6.43;

#[rustfmt::skip]
const POINTS: [[f64; 3]; 290] = [
    [1.4, 0.0, 2.4], [1.4, -0.784, 2.4], [0.784, -1.4, 2.4], [0.0, -1.4, 2.4], [1.3375, 0.0, 2.53125],
    [1.3375, -0.749, 2.53125], [0.749, -1.3375, 2.53125], [0.0, -1.3375, 2.53125], [1.4375, 0.0, 2.53125],
    [1.4375, -0.805, 2.53125], [0.805, -1.4375, 2.53125], [0.0, -1.4375, 2.53125], [1.5, 0.0, 2.4], [1.5, -0.84, 2.4],
    [0.84, -1.5, 2.4], [0.0, -1.5, 2.4], [-0.784, -1.4, 2.4], [-1.4, -0.784, 2.4], [-1.4, 0.0, 2.4],
    [-0.749, -1.3375, 2.53125], [-1.3375, -0.749, 2.53125], [-1.3375, 0.0, 2.53125], [-0.805, -1.4375, 2.53125],
    [-1.4375, -0.805, 2.53125], [-1.4375, 0.0, 2.53125], [-0.84, -1.5, 2.4], [-1.5, -0.84, 2.4], [-1.5, 0.0, 2.4],
    [-1.4, 0.784, 2.4], [-0.784, 1.4, 2.4], [0.0, 1.4, 2.4], [-1.3375, 0.749, 2.53125], [-0.749, 1.3375, 2.53125],
    [0.0, 1.3375, 2.53125], [-1.4375, 0.805, 2.53125], [-0.805, 1.4375, 2.53125], [0.0, 1.4375, 2.53125],
    [-1.5, 0.84, 2.4], [-0.84, 1.5, 2.4], [0.0, 1.5, 2.4], [0.784, 1.4, 2.4], [1.4, 0.784, 2.4],
    [0.749, 1.3375, 2.53125], [1.3375, 0.749, 2.53125], [0.805, 1.4375, 2.53125], [1.4375, 0.805, 2.53125],
    [0.84, 1.5, 2.4], [1.5, 0.84, 2.4], [1.75, 0.0, 1.875], [1.75, -0.98, 1.875], [0.98, -1.75, 1.875],
    [0.0, -1.75, 1.875], [2.0, 0.0, 1.35], [2.0, -1.12, 1.35], [1.12, -2.0, 1.35], [0.0, -2.0, 1.35], [2.0, 0.0, 0.9],
    [2.0, -1.12, 0.9], [1.12, -2.0, 0.9], [0.0, -2.0, 0.9], [-0.98, -1.75, 1.875], [-1.75, -0.98, 1.875],
    [-1.75, 0.0, 1.875], [-1.12, -2.0, 1.35], [-2.0, -1.12, 1.35], [-2.0, 0.0, 1.35], [-1.12, -2.0, 0.9],
    [-2.0, -1.12, 0.9], [-2.0, 0.0, 0.9], [-1.75, 0.98, 1.875], [-0.98, 1.75, 1.875], [0.0, 1.75, 1.875],
    [-2.0, 1.12, 1.35], [-1.12, 2.0, 1.35], [0.0, 2.0, 1.35], [-2.0, 1.12, 0.9], [-1.12, 2.0, 0.9], [0.0, 2.0, 0.9],
    [0.98, 1.75, 1.875], [1.75, 0.98, 1.875], [1.12, 2.0, 1.35], [2.0, 1.12, 1.35], [1.12, 2.0, 0.9],
    [2.0, 1.12, 0.9], [2.0, 0.0, 0.45], [2.0, -1.12, 0.45], [1.12, -2.0, 0.45], [0.0, -2.0, 0.45], [1.5, 0.0, 0.225],
    [1.5, -0.84, 0.225], [0.84, -1.5, 0.225], [0.0, -1.5, 0.225], [1.5, 0.0, 0.15], [1.5, -0.84, 0.15],
    [0.84, -1.5, 0.15], [0.0, -1.5, 0.15], [-1.12, -2.0, 0.45], [-2.0, -1.12, 0.45], [-2.0, 0.0, 0.45],
    [-0.84, -1.5, 0.225], [-1.5, -0.84, 0.225], [-1.5, 0.0, 0.225], [-0.84, -1.5, 0.15], [-1.5, -0.84, 0.15],
    [-1.5, 0.0, 0.15], [-2.0, 1.12, 0.45], [-1.12, 2.0, 0.45], [0.0, 2.0, 0.45], [-1.5, 0.84, 0.225],
    [-0.84, 1.5, 0.225], [0.0, 1.5, 0.225], [-1.5, 0.84, 0.15], [-0.84, 1.5, 0.15], [0.0, 1.5, 0.15],
    [1.12, 2.0, 0.45], [2.0, 1.12, 0.45], [0.84, 1.5, 0.225], [1.5, 0.84, 0.225], [0.84, 1.5, 0.15],
    [1.5, 0.84, 0.15], [-1.6, 0.0, 2.025], [-1.6, -0.3, 2.025], [-1.5, -0.3, 2.25], [-1.5, 0.0, 2.25],
    [-2.3, 0.0, 2.025], [-2.3, -0.3, 2.025], [-2.5, -0.3, 2.25], [-2.5, 0.0, 2.25], [-2.7, 0.0, 2.025],
    [-2.7, -0.3, 2.025], [-3.0, -0.3, 2.25], [-3.0, 0.0, 2.25], [-2.7, 0.0, 1.8], [-2.7, -0.3, 1.8],
    [-3.0, -0.3, 1.8], [-3.0, 0.0, 1.8], [-1.5, 0.3, 2.25], [-1.6, 0.3, 2.025], [-2.5, 0.3, 2.25], [-2.3, 0.3, 2.025],
    [-3.0, 0.3, 2.25], [-2.7, 0.3, 2.025], [-3.0, 0.3, 1.8], [-2.7, 0.3, 1.8], [-2.7, 0.0, 1.575],
    [-2.7, -0.3, 1.575], [-3.0, -0.3, 1.35], [-3.0, 0.0, 1.35], [-2.5, 0.0, 1.125], [-2.5, -0.3, 1.125],
    [-2.65, -0.3, 0.9375], [-2.65, 0.0, 0.9375], [-2.0, -0.3, 0.9], [-1.9, -0.3, 0.6], [-1.9, 0.0, 0.6],
    [-3.0, 0.3, 1.35], [-2.7, 0.3, 1.575], [-2.65, 0.3, 0.9375], [-2.5, 0.3, 1.125], [-1.9, 0.3, 0.6],
    [-2.0, 0.3, 0.9], [1.7, 0.0, 1.425], [1.7, -0.66, 1.425], [1.7, -0.66, 0.6], [1.7, 0.0, 0.6], [2.6, 0.0, 1.425],
    [2.6, -0.66, 1.425], [3.1, -0.66, 0.825], [3.1, 0.0, 0.825], [2.3, 0.0, 2.1], [2.3, -0.25, 2.1],
    [2.4, -0.25, 2.025], [2.4, 0.0, 2.025], [2.7, 0.0, 2.4], [2.7, -0.25, 2.4], [3.3, -0.25, 2.4], [3.3, 0.0, 2.4],
    [1.7, 0.66, 0.6], [1.7, 0.66, 1.425], [3.1, 0.66, 0.825], [2.6, 0.66, 1.425], [2.4, 0.25, 2.025],
    [2.3, 0.25, 2.1], [3.3, 0.25, 2.4], [2.7, 0.25, 2.4], [2.8, 0.0, 2.475], [2.8, -0.25, 2.475],
    [3.525, -0.25, 2.49375], [3.525, 0.0, 2.49375], [2.9, 0.0, 2.475], [2.9, -0.15, 2.475], [3.45, -0.15, 2.5125],
    [3.45, 0.0, 2.5125], [2.8, 0.0, 2.4], [2.8, -0.15, 2.4], [3.2, -0.15, 2.4], [3.2, 0.0, 2.4],
    [3.525, 0.25, 2.49375], [2.8, 0.25, 2.475], [3.45, 0.15, 2.5125], [2.9, 0.15, 2.475], [3.2, 0.15, 2.4],
    [2.8, 0.15, 2.4], [0.0, 0.0, 3.15], [0.8, 0.0, 3.15], [0.8, -0.45, 3.15], [0.45, -0.8, 3.15], [0.0, -0.8, 3.15],
    [0.0, 0.0, 2.85], [0.2, 0.0, 2.7], [0.2, -0.112, 2.7], [0.112, -0.2, 2.7], [0.0, -0.2, 2.7], [-0.45, -0.8, 3.15],
    [-0.8, -0.45, 3.15], [-0.8, 0.0, 3.15], [-0.112, -0.2, 2.7], [-0.2, -0.112, 2.7], [-0.2, 0.0, 2.7],
    [-0.8, 0.45, 3.15], [-0.45, 0.8, 3.15], [0.0, 0.8, 3.15], [-0.2, 0.112, 2.7], [-0.112, 0.2, 2.7], [0.0, 0.2, 2.7],
    [0.45, 0.8, 3.15], [0.8, 0.45, 3.15], [0.112, 0.2, 2.7], [0.2, 0.112, 2.7], [0.4, 0.0, 2.55], [0.4, -0.224, 2.55],
    [0.224, -0.4, 2.55], [0.0, -0.4, 2.55], [1.3, 0.0, 2.55], [1.3, -0.728, 2.55], [0.728, -1.3, 2.55],
    [0.0, -1.3, 2.55], [1.3, 0.0, 2.4], [1.3, -0.728, 2.4], [0.728, -1.3, 2.4], [0.0, -1.3, 2.4],
    [-0.224, -0.4, 2.55], [-0.4, -0.224, 2.55], [-0.4, 0.0, 2.55], [-0.728, -1.3, 2.55], [-1.3, -0.728, 2.55],
    [-1.3, 0.0, 2.55], [-0.728, -1.3, 2.4], [-1.3, -0.728, 2.4], [-1.3, 0.0, 2.4], [-0.4, 0.224, 2.55],
    [-0.224, 0.4, 2.55], [0.0, 0.4, 2.55], [-1.3, 0.728, 2.55], [-0.728, 1.3, 2.55], [0.0, 1.3, 2.55],
    [-1.3, 0.728, 2.4], [-0.728, 1.3, 2.4], [0.0, 1.3, 2.4], [0.224, 0.4, 2.55], [0.4, 0.224, 2.55],
    [0.728, 1.3, 2.55], [1.3, 0.728, 2.55], [0.728, 1.3, 2.4], [1.3, 0.728, 2.4], [0.0, 0.0, 0.0], [1.425, 0.0, 0.0],
    [1.425, 0.798, 0.0], [0.798, 1.425, 0.0], [0.0, 1.425, 0.0], [1.5, 0.0, 0.075], [1.5, 0.84, 0.075],
    [0.84, 1.5, 0.075], [0.0, 1.5, 0.075], [-0.798, 1.425, 0.0], [-1.425, 0.798, 0.0], [-1.425, 0.0, 0.0],
    [-0.84, 1.5, 0.075], [-1.5, 0.84, 0.075], [-1.5, 0.0, 0.075], [-1.425, -0.798, 0.0], [-0.798, -1.425, 0.0],
    [0.0, -1.425, 0.0], [-1.5, -0.84, 0.075], [-0.84, -1.5, 0.075], [0.0, -1.5, 0.075], [0.798, -1.425, 0.0],
    [1.425, -0.798, 0.0], [0.84, -1.5, 0.075], [1.5, -0.84, 0.075],
];

#[rustfmt::skip]
const PATCHES: [[u16; 16]; 32] = [
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15],
    [3, 16, 17, 18, 7, 19, 20, 21, 11, 22, 23, 24, 15, 25, 26, 27],
    [18, 28, 29, 30, 21, 31, 32, 33, 24, 34, 35, 36, 27, 37, 38, 39],
    [30, 40, 41, 0, 33, 42, 43, 4, 36, 44, 45, 8, 39, 46, 47, 12],
    [12, 13, 14, 15, 48, 49, 50, 51, 52, 53, 54, 55, 56, 57, 58, 59],
    [15, 25, 26, 27, 51, 60, 61, 62, 55, 63, 64, 65, 59, 66, 67, 68],
    [27, 37, 38, 39, 62, 69, 70, 71, 65, 72, 73, 74, 68, 75, 76, 77],
    [39, 46, 47, 12, 71, 78, 79, 48, 74, 80, 81, 52, 77, 82, 83, 56],
    [56, 57, 58, 59, 84, 85, 86, 87, 88, 89, 90, 91, 92, 93, 94, 95],
    [59, 66, 67, 68, 87, 96, 97, 98, 91, 99, 100, 101, 95, 102, 103, 104],
    [68, 75, 76, 77, 98, 105, 106, 107, 101, 108, 109, 110, 104, 111, 112, 113],
    [77, 82, 83, 56, 107, 114, 115, 84, 110, 116, 117, 88, 113, 118, 119, 92],
    [120, 121, 122, 123, 124, 125, 126, 127, 128, 129, 130, 131, 132, 133, 134, 135],
    [123, 136, 137, 120, 127, 138, 139, 124, 131, 140, 141, 128, 135, 142, 143, 132],
    [132, 133, 134, 135, 144, 145, 146, 147, 148, 149, 150, 151, 68, 152, 153, 154],
    [135, 142, 143, 132, 147, 155, 156, 144, 151, 157, 158, 148, 154, 159, 160, 68],
    [161, 162, 163, 164, 165, 166, 167, 168, 169, 170, 171, 172, 173, 174, 175, 176],
    [164, 177, 178, 161, 168, 179, 180, 165, 172, 181, 182, 169, 176, 183, 184, 173],
    [173, 174, 175, 176, 185, 186, 187, 188, 189, 190, 191, 192, 193, 194, 195, 196],
    [176, 183, 184, 173, 188, 197, 198, 185, 192, 199, 200, 189, 196, 201, 202, 193],
    [203, 203, 203, 203, 204, 205, 206, 207, 208, 208, 208, 208, 209, 210, 211, 212],
    [203, 203, 203, 203, 207, 213, 214, 215, 208, 208, 208, 208, 212, 216, 217, 218],
    [203, 203, 203, 203, 215, 219, 220, 221, 208, 208, 208, 208, 218, 222, 223, 224],
    [203, 203, 203, 203, 221, 225, 226, 204, 208, 208, 208, 208, 224, 227, 228, 209],
    [209, 210, 211, 212, 229, 230, 231, 232, 233, 234, 235, 236, 237, 238, 239, 240],
    [212, 216, 217, 218, 232, 241, 242, 243, 236, 244, 245, 246, 240, 247, 248, 249],
    [218, 222, 223, 224, 243, 250, 251, 252, 246, 253, 254, 255, 249, 256, 257, 258],
    [224, 227, 228, 209, 252, 259, 260, 229, 255, 261, 262, 233, 258, 263, 264, 237],
    [265, 265, 265, 265, 266, 267, 268, 269, 270, 271, 272, 273, 92, 119, 118, 113],
    [265, 265, 265, 265, 269, 274, 275, 276, 273, 277, 278, 279, 113, 112, 111, 104],
    [265, 265, 265, 265, 276, 280, 281, 282, 279, 283, 284, 285, 104, 103, 102, 95],
    [265, 265, 265, 265, 282, 286, 287, 266, 285, 288, 289, 270, 95, 94, 93, 92],
];

#[cfg(test)]
mod tests;
