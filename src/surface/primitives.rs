//! Meshes of simple bodies.

use std::collections::HashMap;

use glam::DVec3;

use super::mesh::{Material, Mesh};

/// How often the icosahedron's triangles are cut in four. Five times leaves edges of at most 2.3° of arc, whose middle
/// lies below the sphere by 2 to 3 ten-thousandths of the radius.
const SPHERE_LEVEL: u32 = 5;

/// A sphere with smooth normals: 10,242 vertices and 20,480 triangles of nearly equal size. Neither its outline nor its
/// surface strays from the true one by a thousandth of the radius.
pub fn sphere(center: DVec3, radius: f64) -> Mesh {
    let (mut directions, mut triangles) = icosahedron();
    for _ in 0..SPHERE_LEVEL {
        subdivide(&mut directions, &mut triangles);
    }
    Mesh {
        positions: directions.iter().map(|d| (center + radius * *d).as_vec3()).collect(),
        normals: directions.iter().map(|d| d.as_vec3()).collect(),
        material: vec![0; triangles.len()],
        triangles,
        materials: vec![Material::default()],
    }
}

/// A rectangle of two triangles around `center`, seen from the side that `normal` points to; `normal` must not be zero.
///
/// `size` is the length of its sides: for a normal along y the first lies along x and the second along z; for one along
/// z, along x and y; for one along x, along y and z. For others the first side is at right angles to the normal and to
/// the axis z (or y, where the normal is within 6° of z).
pub fn plane(center: DVec3, normal: DVec3, size: [f64; 2]) -> Mesh {
    let n = normal.normalize_or(DVec3::Y);
    let reference = if n.z.abs() > 0.995 { DVec3::Y } else { DVec3::Z };
    let u = reference.cross(n).normalize();
    let v = n.cross(u);
    let (u, v) = (0.5 * size[0] * u, 0.5 * size[1] * v);
    Mesh {
        positions: [-u - v, u - v, u + v, v - u].iter().map(|p| (center + *p).as_vec3()).collect(),
        normals: vec![n.as_vec3(); 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material: vec![0; 2],
        materials: vec![Material::default()],
    }
}

/// The twelve corners, three golden rectangles, and the twenty faces among them.
fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = 0.5 * (1.0 + 5.0f64.sqrt());
    let mut corners = Vec::with_capacity(12);
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        corners.extend([DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)]);
    }
    // Faces are the triples of mutual neighbours: corners at the edge length of 2. Oriented to face outwards.
    let near = |i: usize, j: usize| (corners[i].distance(corners[j]) - 2.0).abs() < 1e-9;
    let mut faces = Vec::with_capacity(20);
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if near(i, j) && near(j, k) && near(i, k) {
                    let outward = corners[i].dot(corners[j].cross(corners[k])) > 0.0;
                    let (j, k) = if outward { (j, k) } else { (k, j) };
                    faces.push([i as u32, j as u32, k as u32]);
                }
            }
        }
    }
    (corners.into_iter().map(DVec3::normalize).collect(), faces)
}

/// Cuts each triangle in four at the middles of its edges, pushed out to the unit sphere.
fn subdivide(directions: &mut Vec<DVec3>, triangles: &mut Vec<[u32; 3]>) {
    let mut middles: HashMap<(u32, u32), u32> = HashMap::with_capacity(triangles.len() * 3 / 2);
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            directions.push((directions[a as usize] + directions[b as usize]).normalize());
            directions.len() as u32 - 1
        })
    };
    let mut finer = Vec::with_capacity(triangles.len() * 4);
    for &[a, b, c] in triangles.iter() {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    *triangles = finer;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::inspect::inspect;
    use glam::Vec3;
    use std::f64::consts::PI;

    #[test]
    fn sphere_is_round_closed_and_faces_outwards() {
        let (center, radius) = (DVec3::new(1.0, -2.0, 3.0), 2.5);
        let mesh = sphere(center, radius);
        assert_eq!(mesh.validate(), Ok(()));
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (10_242, 20_480));
        assert!(inspect(&mesh).closed);
        // Below the true sphere everywhere, and by less than a thousandth: at the middle of edges, which make the
        // outline, and at the middle of triangles.
        for i in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(i);
            for point in [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a), (a + b + c) / 3.0] {
                let depth = 1.0 - point.distance(center) / radius;
                assert!((-1e-6..1e-3).contains(&depth), "{depth}");
            }
            assert!(mesh.area_vector(i).dot(a - center) > 0.0);
        }
        let (area, volume) = (4.0 * PI * radius * radius, 4.0 / 3.0 * PI * radius.powi(3));
        assert!((0.998..1.0).contains(&(mesh.area() / area)), "{}", mesh.area() / area);
        assert!((0.998..1.0).contains(&(mesh.volume() / volume)), "{}", mesh.volume() / volume);
        for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
            assert!(((p.as_dvec3() - center) / radius).distance(n.as_dvec3()) < 1e-6);
        }
    }

    #[test]
    fn plane_has_its_size_its_side_and_its_axes() {
        for normal in [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::Y, DVec3::new(0.3, -2.0, 0.7), DVec3::new(0.01, 0.0, 1.0)]
        {
            let mesh = plane(DVec3::new(5.0, 6.0, 7.0), normal, [3.0, 0.5]);
            assert_eq!(mesh.validate(), Ok(()));
            assert!((mesh.area() - 1.5).abs() < 1e-5);
            for i in 0..2 {
                assert!(mesh.area_vector(i).normalize().distance(normal.normalize()) < 1e-5);
            }
            let [low, high] = mesh.bounds().unwrap();
            assert!((0.5 * (low + high)).distance(Vec3::new(5.0, 6.0, 7.0)) < 1e-5);
        }
        let extent = |n: DVec3| {
            let [low, high] = plane(DVec3::ZERO, n, [3.0, 0.5]).bounds().unwrap();
            high - low
        };
        assert!(extent(DVec3::Y).abs_diff_eq(Vec3::new(3.0, 0.0, 0.5), 1e-6));
        assert!(extent(DVec3::Z).abs_diff_eq(Vec3::new(3.0, 0.5, 0.0), 1e-6));
        assert!(extent(DVec3::X).abs_diff_eq(Vec3::new(0.0, 3.0, 0.5), 1e-6));
    }
}
