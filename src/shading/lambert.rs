//! Lambert's law for surfaces.

use std::f32::consts::PI;

use glam::Vec3;

/// A diffuse surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lambert {
    /// Reflectance, 0 to 1.
    pub albedo: Vec3,
}

impl Lambert {
    /// Reflected radiance per incident radiance and steradian, for a direction at this cosine to the normal; 0 from below.
    #[inline]
    pub fn evaluate(&self, cosine: f32) -> Vec3 {
        self.albedo * (cosine.max(0.0) / PI)
    }
}
