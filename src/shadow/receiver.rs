//! What asks for its light: a point on a strand or on a surface, and how far before it hair begins to count.

use glam::Vec3;

use super::view::Seen;
use crate::hair::{OnStrand, SELF_WIDTHS, StrandSample};

/// A point that is lit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    pub position: Vec3,
    /// On hair: where on which strand, and the strand's unit tangent.
    pub hair: Option<(OnStrand, Vec3)>,
}

impl Point {
    /// On a strand.
    pub fn on_hair(sample: &StrandSample) -> Self {
        Self { position: sample.position, hair: Some((sample.on, sample.tangent)) }
    }

    /// On a surface.
    pub fn on_surface(position: Vec3) -> Self {
        Self { position, hair: None }
    }

    /// How much nearer to the lamp than the point hair must be to count, in depth.
    ///
    /// A strand that leans towards the lamp lies before its own point in the pixels beside it, by `reach` times the cotangent of its
    /// angle with the ray, where `reach` is how far from the point a pixel that counts can reach. By the rule of rays nothing of the own
    /// strand counts within `SELF_WIDTHS` widths of it, which bounds the same; and nothing counts within one width. So the bias is
    ///
    ///   max(width, min(reach · cot, `SELF_WIDTHS` · width · cos)) · cosine to the image's axis.
    ///
    /// Hair of other strands between one width and the bias is lost: of an optical depth κ a unit length, κ (bias - width). It goes to
    /// zero with the pixel, and is at most 3 widths.
    pub(super) fn bias(&self, seen: &Seen, reach: f64) -> f64 {
        let Some((on, tangent)) = self.hair else { return 0.0 };
        let width = f64::from(on.width);
        let along = f64::from(tangent.dot(seen.ray)).abs().min(1.0);
        let across = (1.0 - along * along).sqrt();
        let slope = reach * along / across.max(1e-9);
        width.max(slope.min(f64::from(SELF_WIDTHS) * width * along)) * seen.cosine
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    #[test]
    fn the_bias_grows_with_the_lean_up_to_the_rule_of_rays() {
        let seen = Seen { image: 0, at: DVec2::ZERO, depth: 0.0, width: 1.0, ray: Vec3::Z, cosine: 1.0 };
        let bias = |lean: f32, reach| {
            let tangent = Vec3::new(lean.sin(), 0.0, -lean.cos());
            let on = OnStrand { strand: 0, arc: 0.0, width: 0.5 };
            Point { position: Vec3::ZERO, hair: Some((on, tangent)) }.bias(&seen, reach)
        };
        assert!((bias(1.4, 0.1) - 0.5).abs() < 1e-6, "across the ray a width");
        assert!((bias(0.1, 0.1) - 0.1 / 0.1_f64.tan()).abs() < 1e-4, "leaning, the slope");
        assert!((bias(0.0, 0.1) - 2.0).abs() < 1e-6, "along the ray four widths");
        assert_eq!(Point::on_surface(Vec3::ZERO).bias(&seen, 9.0), 0.0);
    }
}
