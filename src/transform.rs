//! Where an object is put: from the numbers of a scene file to an affine map, and the map applied to geometry.

use glam::{DAffine3, DMat3, DQuat, DVec3, EulerRot, Vec3};
use thiserror::Error;

use crate::hair::Strands;
use crate::scene::description::Transform;
use crate::surface::Mesh;

/// A volume ratio below this share of the product of the axes' lengths counts as flat.
const SINGULAR: f64 = 1e-9;

/// Why a `transform` cannot be used. The messages begin with the key, below that of the object.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Error {
    #[error("`transform.matrix` stands beside `transform.{key}`: give either the matrix or the others")]
    Both { key: &'static str },
    #[error("`transform.{key}` holds {value}, which is not a finite number")]
    NotFinite { key: &'static str, value: f64 },
    #[error("`transform.scale` is [{}, {}, {}]: a factor of zero flattens the object", .0[0], .0[1], .0[2])]
    ZeroScale([f64; 3]),
    #[error("`transform.matrix`: the last row is {0:?} and must be [0, 0, 0, 1]")]
    LastRow([f64; 4]),
    #[error("`transform.matrix` flattens the object: its determinant is {determinant}")]
    Singular { determinant: f64 },
}

/// The map from an object's space to the scene's.
///
/// # Errors
/// Numbers that are not finite, a matrix beside other keys, and maps that flatten the object.
pub fn affine(transform: &Transform) -> Result<DAffine3, Error> {
    let Transform { translate, rotate, scale, matrix } = transform;
    for (key, value) in [("translate", translate), ("rotate", rotate), ("scale", scale)] {
        if matrix.is_some() && value.is_some() {
            return Err(Error::Both { key });
        }
        if let Some(&value) = value.iter().flatten().find(|v| !v.is_finite()) {
            return Err(Error::NotFinite { key, value });
        }
    }
    if let Some(rows) = matrix {
        return from_rows(rows);
    }
    let scale = scale.unwrap_or([1.0; 3]);
    if scale.contains(&0.0) {
        return Err(Error::ZeroScale(scale));
    }
    let [x, y, z] = rotate.unwrap_or_default().map(f64::to_radians);
    // About x first, then y, then z, all about the fixed axes of the scene.
    let rotation = DQuat::from_euler(EulerRot::ZYX, z, y, x);
    let translation = DVec3::from(translate.unwrap_or_default());
    Ok(DAffine3::from_scale_rotation_translation(DVec3::from(scale), rotation, translation))
}

fn from_rows(rows: &[[f64; 4]; 4]) -> Result<DAffine3, Error> {
    if let Some(&value) = rows.iter().flatten().find(|v| !v.is_finite()) {
        return Err(Error::NotFinite { key: "matrix", value });
    }
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err(Error::LastRow(rows[3]));
    }
    let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
    let linear = DMat3::from_cols(column(0), column(1), column(2));
    // Of unit axes, so that a scale however small does not count as flat.
    let lengths = linear.x_axis.length() * linear.y_axis.length() * linear.z_axis.length();
    let determinant = linear.determinant();
    // Not `<`: a product that overflowed to infinity over infinity is refused, too.
    if !(determinant.abs() > SINGULAR * lengths && lengths.is_finite()) {
        return Err(Error::Singular { determinant });
    }
    Ok(DAffine3 { matrix3: linear, translation: column(3) })
}

/// Moves a mesh. Normals go with the inverse transpose, and a map that mirrors turns the triangles round, so that what
/// was outside stays outside. Computed in f64; positions beyond the range of f32 become infinite, which
/// [`Mesh::validate`] finds.
pub fn transform_mesh(map: &DAffine3, mesh: &mut Mesh) {
    move_points(map, &mut mesh.positions);
    let determinant = map.matrix3.determinant();
    // The adjugate's transpose is the inverse's times the determinant: the same direction up to sign, without the division.
    let cofactor = DMat3::from_cols(
        map.matrix3.y_axis.cross(map.matrix3.z_axis),
        map.matrix3.z_axis.cross(map.matrix3.x_axis),
        map.matrix3.x_axis.cross(map.matrix3.y_axis),
    ) * determinant.signum();
    for normal in &mut mesh.normals {
        *normal = (cofactor * normal.as_dvec3()).normalize_or_zero().as_vec3();
    }
    if determinant < 0.0 {
        for triangle in &mut mesh.triangles {
            triangle.swap(1, 2);
        }
    }
}

/// Moves strands. Widths scale with the cube root of the volume's ratio, as a strand has but one width.
/// Points beyond the range of f32 become infinite, which [`Strands::validate`] finds.
pub fn transform_strands(map: &DAffine3, strands: &mut Strands) {
    move_points(map, &mut strands.points);
    let factor = map.matrix3.determinant().abs().cbrt();
    for width in strands.width.values_mut() {
        *width = (f64::from(*width) * factor) as f32;
    }
}

fn move_points(map: &DAffine3, points: &mut [Vec3]) {
    for point in points {
        *point = map.transform_point3(point.as_dvec3()).as_vec3();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hair::Attribute;
    use crate::surface::primitives::sphere;
    use proptest::prelude::*;

    fn close(a: DVec3, b: DVec3) -> bool {
        a.distance(b) < 1e-12 * (1.0 + a.length())
    }

    #[test]
    fn scales_then_turns_x_y_z_then_moves() {
        let transform = Transform {
            translate: Some([10.0, 0.0, 0.0]),
            rotate: Some([90.0, 90.0, 0.0]),
            scale: Some([2.0, 3.0, 4.0]),
            matrix: None,
        };
        let map = affine(&transform).unwrap();
        // y: scaled to 3y; about x by 90° to 3z; about y by 90° to 3x; moved.
        assert!(close(map.transform_point3(DVec3::Y), DVec3::new(13.0, 0.0, 0.0)));
        // x: 2x; unmoved about x; about y to -2z.
        assert!(close(map.transform_point3(DVec3::X), DVec3::new(10.0, 0.0, -2.0)));
        // z: 4z; about x to -4y; unmoved about y.
        assert!(close(map.transform_point3(DVec3::Z), DVec3::new(10.0, -4.0, 0.0)));
        let quarter = Transform { rotate: Some([0.0, 0.0, 90.0]), ..Transform::default() };
        assert!(close(affine(&quarter).unwrap().transform_point3(DVec3::X), DVec3::Y));
    }

    #[test]
    fn matrix_is_by_rows_with_column_vectors() {
        let rows = [[1.0, 2.0, 0.0, 5.0], [0.0, 1.0, 0.0, 6.0], [0.0, 0.0, 1.0, 7.0], [0.0, 0.0, 0.0, 1.0]];
        let map = affine(&Transform { matrix: Some(rows), ..Transform::default() }).unwrap();
        assert!(close(map.transform_point3(DVec3::new(1.0, 1.0, 1.0)), DVec3::new(8.0, 7.0, 8.0)));
    }

    #[test]
    fn unusable_transforms_are_named() {
        let message = |t: Transform| affine(&t).unwrap_err().to_string();
        let none = Transform::default();
        let identity = DMat4Rows::identity();
        let both = Transform { matrix: Some(identity), rotate: Some([0.0; 3]), ..none.clone() };
        assert!(message(both).contains("`transform.matrix` stands beside `transform.rotate`"));
        assert!(message(Transform { scale: Some([1.0, 0.0, 1.0]), ..none.clone() }).contains("[1, 0, 1]"));
        let nan = Transform { translate: Some([0.0, f64::NAN, 0.0]), ..none.clone() };
        assert!(message(nan).contains("`transform.translate` holds NaN"));
        let mut flat = identity;
        flat[2] = flat[1];
        assert!(message(Transform { matrix: Some(flat), ..none.clone() }).contains("flattens"));
        let mut perspective = identity;
        perspective[3][0] = 0.5;
        assert!(message(Transform { matrix: Some(perspective), ..none.clone() }).contains("last row"));
        let mut huge = identity;
        (huge[0][0], huge[1][1], huge[2][2]) = (1e200, 1e200, 1e200);
        assert!(message(Transform { matrix: Some(huge), ..none.clone() }).contains("flattens"));
        // Small but sound.
        let mut small = identity;
        (small[0][0], small[1][1], small[2][2]) = (1e-6, 1e-6, 1e-6);
        assert!(affine(&Transform { matrix: Some(small), ..none }).is_ok());
    }

    struct DMat4Rows;
    impl DMat4Rows {
        fn identity() -> [[f64; 4]; 4] {
            std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))))
        }
    }

    #[test]
    fn widths_scale_with_the_cube_root_of_volume() {
        let mut strands = Strands {
            points: vec![Vec3::ZERO, Vec3::ONE],
            first: vec![0, 2],
            width: Attribute::Uniform(0.5),
            color: Attribute::Uniform(Vec3::ONE),
            transparency: Attribute::Uniform(0.0),
        };
        let t = Transform { scale: Some([-1.0, 2.0, 4.0]), ..Transform::default() };
        transform_strands(&affine(&t).unwrap(), &mut strands);
        assert_eq!(strands.width, Attribute::Uniform(1.0));
        assert_eq!(strands.points[1], Vec3::new(-1.0, 2.0, 4.0));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn outside_stays_outside_and_normals_stay_normal(
            rotate in prop::array::uniform3(-180.0f64..180.0),
            scale in prop::array::uniform3(prop_oneof![0.2f64..3.0, -3.0f64..-0.2]),
        ) {
            let t = Transform { rotate: Some(rotate), scale: Some(scale), ..Transform::default() };
            let map = affine(&t).unwrap();
            let mut mesh = sphere(DVec3::ZERO, 1.0);
            let ball = mesh.volume();
            transform_mesh(&map, &mut mesh);
            let factor = scale[0] * scale[1] * scale[2];
            // The enclosed volume is positive whether mirrored or not.
            prop_assert!((mesh.volume() - ball * factor.abs()).abs() < 1e-4 * ball * factor.abs());
            // The gradient of the ellipsoid's implicit function, up to length, is its outward normal.
            let inverse = map.inverse();
            for (p, n) in mesh.positions.iter().zip(&mesh.normals).step_by(97) {
                let local = inverse.transform_point3(p.as_dvec3());
                let gradient = (inverse.matrix3.transpose() * local).normalize();
                prop_assert!(gradient.dot(n.as_dvec3()) > 1.0 - 1e-5);
            }
        }
    }
}
