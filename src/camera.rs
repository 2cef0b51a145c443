//! The pinhole camera.
//!
//! Camera space has x to the right, y up and z along the view, so that z is a depth; it is left-handed, as in OpenEXR's `worldToCamera`.
//! Pixel coordinates are continuous: pixel (i, j) covers [i, i + 1) x [j, j + 1), with (0, 0) at the upper left corner of the image.
//! Lengths are in the units of the space that the camera was made in.

use glam::{DMat4, DVec2, DVec3, DVec4, Vec3};
use thiserror::Error;

/// Why a camera cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum CameraError {
    #[error("camera: {key} is not a finite number; give finite numbers")]
    NotFinite { key: &'static str },
    #[error("camera: position and target are the same point {position}; move one of them")]
    NoDirection { position: DVec3 },
    #[error("camera: up {up} is zero or points along the view; choose another up vector")]
    NoUp { up: DVec3 },
    #[error("camera: fov is {degrees} degrees; choose an angle above 0 and below 180")]
    FieldOfView { degrees: f64 },
    #[error("camera: resolution is {}x{}; both numbers must be at least 1", .resolution[0], .resolution[1])]
    Resolution { resolution: [u32; 2] },
    #[error("camera: near is {near}; it must be above 0")]
    Near { near: f64 },
}

/// From camera space to pixels, without the camera's place in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Size in pixels of a unit length at unit depth.
    pub focal: f64,
    /// Pixel coordinates of the point that the camera looks at.
    pub center: DVec2,
    /// Depth of the near plane, above 0.
    pub near: f64,
}

impl Projection {
    /// Continuous pixel coordinates of a point in camera space whose depth is above 0.
    pub fn pixel(&self, point: DVec3) -> DVec2 {
        let scale = self.focal / point.z;
        self.center + DVec2::new(point.x * scale, -point.y * scale)
    }
}

/// A perspective camera with square pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    position: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    resolution: [u32; 2],
    projection: Projection,
}

impl Camera {
    /// A camera at `position` that looks at `target`, with `up` upwards in the image. `fov_vertical_degrees` is the angle between the image's
    /// top and bottom edge; what has a depth below `near` is not seen.
    ///
    /// # Errors
    /// Numbers that are not finite or out of range, and view and up vectors that do not span a plane.
    pub fn new(
        position: DVec3,
        target: DVec3,
        up: DVec3,
        fov_vertical_degrees: f64,
        resolution: [u32; 2],
        near: f64,
    ) -> Result<Self, CameraError> {
        for (key, vector) in [("position", position), ("target", target), ("up", up)] {
            if !vector.is_finite() {
                return Err(CameraError::NotFinite { key });
            }
        }
        if !(fov_vertical_degrees > 0.0 && fov_vertical_degrees < 180.0) {
            return Err(CameraError::FieldOfView { degrees: fov_vertical_degrees });
        }
        if resolution.contains(&0) {
            return Err(CameraError::Resolution { resolution });
        }
        if !(near > 0.0 && near.is_finite()) {
            return Err(CameraError::Near { near });
        }
        let forward = (target - position).try_normalize().ok_or(CameraError::NoDirection { position })?;
        let across = up.try_normalize().map(|unit| forward.cross(unit));
        // Below this the cross product of two unit vectors is rounding noise.
        let right = across.filter(|r| r.length() > 1e-9).ok_or(CameraError::NoUp { up })?.normalize();
        let size = DVec2::new(resolution[0].into(), resolution[1].into());
        let focal = 0.5 * size.y / (0.5 * fov_vertical_degrees.to_radians()).tan();
        let projection = Projection { focal, center: 0.5 * size, near };
        Ok(Self { position, right, up: right.cross(forward), forward, resolution, projection })
    }

    /// The same view in another number of pixels (both at least 1); the vertical field of view stays.
    #[must_use]
    pub fn with_resolution(&self, resolution: [u32; 2]) -> Self {
        let size = DVec2::new(resolution[0].into(), resolution[1].into());
        let focal = self.projection.focal * size.y / f64::from(self.resolution[1]);
        let projection = Projection { focal, center: 0.5 * size, near: self.projection.near };
        Self { resolution, projection, ..self.clone() }
    }

    /// Where the camera stands.
    pub fn position(&self) -> DVec3 {
        self.position
    }

    /// Unit vector along the view.
    pub fn forward(&self) -> DVec3 {
        self.forward
    }

    /// Width and height of the image, in pixels.
    pub fn resolution(&self) -> [u32; 2] {
        self.resolution
    }

    /// Depth of the near plane.
    pub fn near(&self) -> f64 {
        self.projection.near
    }

    /// Size in pixels of a unit length at unit depth: (height / 2) / tan(fov / 2).
    pub fn focal_pixels(&self) -> f64 {
        self.projection.focal
    }

    /// From camera space to pixels.
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// A point in camera space. The difference is taken in `f64`, so that a camera far away loses nothing.
    pub fn to_camera(&self, point: Vec3) -> Vec3 {
        let offset = point.as_dvec3() - self.position;
        DVec3::new(offset.dot(self.right), offset.dot(self.up), offset.dot(self.forward)).as_vec3()
    }

    /// Continuous pixel coordinates of a point in camera space, or `None` in front of the near plane.
    pub fn project(&self, camera_point: Vec3) -> Option<DVec2> {
        let point = camera_point.as_dvec3();
        (point.z >= self.projection.near).then(|| self.projection.pixel(point))
    }

    /// Origin and unit direction of the ray through continuous pixel coordinates. The depth at distance t is t · (direction · forward).
    pub fn ray(&self, px: f64, py: f64) -> (Vec3, Vec3) {
        let Projection { focal, center, .. } = self.projection;
        let direction = self.right * ((px - center.x) / focal) - self.up * ((py - center.y) / focal) + self.forward;
        (self.position.as_vec3(), direction.normalize().as_vec3())
    }

    /// From the space that the camera was made in to camera space; points are column vectors.
    pub fn world_to_camera(&self) -> DMat4 {
        let rows = [self.right, self.up, self.forward].map(|axis| axis.extend(-axis.dot(self.position)));
        DMat4::from_cols(rows[0], rows[1], rows[2], DVec4::W).transpose()
    }

    /// From camera space to OpenEXR's normalised device coordinates, after division by w: (0, 0) at the image's upper left corner and (1, 1) at
    /// the lower right one; z is 0 at the near plane and 1 at infinity. Points are column vectors.
    pub fn camera_to_ndc(&self) -> DMat4 {
        let Projection { focal, center, near } = self.projection;
        let x = DVec4::new(0.5 * focal / center.x, 0.0, 0.5, 0.0);
        let y = DVec4::new(0.0, -0.5 * focal / center.y, 0.5, 0.0);
        let z = DVec4::new(0.0, 0.0, 1.0, -near);
        DMat4::from_cols(x, y, z, DVec4::Z).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::new(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 60.0, [300, 200], 0.1).unwrap()
    }

    #[test]
    fn looking_along_minus_z_x_is_right_and_y_is_up() {
        let camera = camera();
        assert_eq!(camera.to_camera(Vec3::new(1.0, 2.0, -1.0)), Vec3::new(1.0, 2.0, 6.0));
        let at = |p| camera.project(camera.to_camera(p)).unwrap();
        assert_eq!(at(Vec3::ZERO), DVec2::new(150.0, 100.0));
        assert!(at(Vec3::X).x > 150.0);
        assert!(at(Vec3::Y).y < 100.0, "image rows run from the top");
        // The top edge is half of the field of view above the axis.
        let top = Vec3::new(0.0, 5.0 * 30f32.to_radians().tan(), 0.0);
        assert!(at(top).y.abs() < 1e-4);
    }

    #[test]
    fn rays_and_matrices_agree_with_the_projection() {
        let position = DVec3::new(3.0, -2.0, 4.0);
        let camera = Camera::new(position, DVec3::new(0.1, 0.5, 0.0), DVec3::Z, 35.0, [640, 480], 0.01).unwrap();
        let matrix = camera.camera_to_ndc() * camera.world_to_camera();
        for (px, py) in [(0.0, 0.0), (320.5, 12.25), (639.9, 480.0)] {
            let (origin, direction) = camera.ray(px, py);
            assert!((direction.length() - 1.0).abs() < 1e-6);
            let point = origin + 2.5 * direction;
            let depth = camera.to_camera(point).z;
            assert!((depth - 2.5 * direction.dot(camera.forward().as_vec3())).abs() < 1e-5);
            let pixel = camera.project(camera.to_camera(point)).unwrap();
            assert!((pixel - DVec2::new(px, py)).length() < 1e-3, "{pixel}");
            let ndc = matrix.project_point3(point.as_dvec3());
            assert!((ndc.truncate() * DVec2::new(640.0, 480.0) - pixel).length() < 1e-3, "{ndc}");
        }
    }

    #[test]
    fn what_cannot_be_a_camera_is_refused() {
        let new = |target, up, fov, resolution, near| Camera::new(DVec3::ZERO, target, up, fov, resolution, near);
        let (z, y) = (DVec3::Z, DVec3::Y);
        assert_eq!(new(DVec3::ZERO, y, 35.0, [1, 1], 1.0), Err(CameraError::NoDirection { position: DVec3::ZERO }));
        assert_eq!(new(z, z, 35.0, [1, 1], 1.0), Err(CameraError::NoUp { up: z }));
        assert_eq!(new(z, DVec3::ZERO, 35.0, [1, 1], 1.0), Err(CameraError::NoUp { up: DVec3::ZERO }));
        assert_eq!(new(z, y, 180.0, [1, 1], 1.0), Err(CameraError::FieldOfView { degrees: 180.0 }));
        assert_eq!(new(z, y, 35.0, [0, 1], 1.0), Err(CameraError::Resolution { resolution: [0, 1] }));
        assert_eq!(new(z, y, 35.0, [1, 1], 0.0), Err(CameraError::Near { near: 0.0 }));
        assert_eq!(new(z * f64::NAN, y, 35.0, [1, 1], 1.0), Err(CameraError::NotFinite { key: "target" }));
    }

    #[test]
    fn nothing_in_front_of_the_near_plane_is_projected() {
        assert_eq!(camera().project(Vec3::new(0.0, 0.0, 0.09)), None);
        assert_eq!(camera().project(Vec3::new(0.0, 0.0, -1.0)), None);
    }
}
