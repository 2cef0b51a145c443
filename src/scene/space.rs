//! Render space: the scene moved to the origin and scaled to about unit size, so that `f32` is fine enough wherever and
//! however large the scene is.

use glam::{DAffine3, DVec3, Vec3};

/// The map between the scene's space and render space. Axes keep their directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSpace {
    center: DVec3,
    /// Render units a scene unit.
    scale: f64,
}

impl RenderSpace {
    /// The space in which the box from `low` to `high` is centred and has half a diagonal of 1.
    pub fn around(low: DVec3, high: DVec3) -> Self {
        let half = 0.5 * (high - low).length();
        let scale = if half > 0.0 && half.is_finite() { 1.0 / half } else { 1.0 };
        let center = 0.5 * (low + high);
        Self { center: if center.is_finite() { center } else { DVec3::ZERO }, scale }
    }

    /// Render units a scene unit.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// A length in render units.
    pub fn length(&self, scene: f64) -> f64 {
        scene * self.scale
    }

    /// A length in scene units.
    pub fn scene_length(&self, render: f64) -> f64 {
        render / self.scale
    }

    /// A point in render space.
    pub fn point(&self, scene: DVec3) -> DVec3 {
        (scene - self.center) * self.scale
    }

    /// A point in render space, rounded once.
    pub fn point32(&self, scene: DVec3) -> Vec3 {
        self.point(scene).as_vec3()
    }

    /// The map from the scene's space.
    pub fn from_scene(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(
            DVec3::splat(self.scale),
            glam::DQuat::IDENTITY,
            -self.center * self.scale,
        )
    }

    /// The map to the scene moved to the origin, lengths unchanged.
    pub fn centered(&self) -> DAffine3 {
        DAffine3::from_translation(-self.center)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_box_far_away_keeps_its_digits() {
        let at = DVec3::splat(1e6);
        let space = RenderSpace::around(at - 1e-3, at + 1e-3);
        let a = space.point32(at + DVec3::X * 1e-9);
        assert!((f64::from(a.x) / space.scale() - 1e-9).abs() < 1e-15 + 2e-10, "one part in 1e6 of the box");
        assert!((space.point(at + 1e-3).length() - 1.0).abs() < 1e-6);
        assert!((space.scene_length(space.length(0.3)) - 0.3).abs() < 1e-15);
    }

    #[test]
    fn a_single_point_is_a_sound_scene() {
        let space = RenderSpace::around(DVec3::ONE, DVec3::ONE);
        assert_eq!(space.point(DVec3::ONE), DVec3::ZERO);
        assert_eq!(space.scale(), 1.0);
    }
}
