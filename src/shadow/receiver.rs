//! What asks for its light: a point on a strand or on a surface, and how far before it hair begins to count.

use glam::{DVec2, Vec3};

use super::view::{Seen, View};
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

    /// How its own strand lies in a lamp's image; none on a surface.
    pub(super) fn own(&self, view: &View, seen: &Seen) -> Option<Own> {
        let (on, tangent) = self.hair?;
        let (drift, depth) = view.drift(seen, tangent);
        let length = drift.length().max(1e-9);
        let width = f64::from(on.width);
        Some(Own {
            along: drift / length,
            slope: depth / length,
            most: f64::from(SELF_WIDTHS) * width * depth.abs(),
            held_back: width * seen.cosine,
            beside: width / seen.cosine,
            slant: 0.5 * width * (1.0 - seen.cosine * seen.cosine) / seen.cosine,
        })
    }
}

/// A point's own strand in a lamp's image, as a straight line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Own {
    /// Unit vector along it, x right and y down.
    along: DVec2,
    /// Depth that it gains a unit of length across the ray.
    slope: f64,
    /// Depth over which it does not count.
    most: f64,
    /// How much further from the lamp the map holds it.
    held_back: f64,
    /// Distance from the line within which a pixel may hold some of it: half of its width in the image, twice, for strands that bend.
    beside: f64,
    /// How much further along the line a ray off the image's axis may meet the ribbon's border, which faces the ray, not the image.
    slant: f64,
}

impl Own {
    /// How much nearer to the lamp than the point hair in a pixel must be to count, in depth.
    ///
    /// A strand that leans towards the lamp lies before its own point in the pixels on that side. `offset` leads from the point to the
    /// pixel's middle, `half` is half the pixel's side, in lengths at the point's depth. Where the strand is in the pixel it comes as
    /// near to the lamp as its slope says at the pixel's border; by the rule of rays nothing of it counts within `SELF_WIDTHS` widths
    /// of arc, which bounds the same; and the map holds hair as if it were a width further from the lamp ([`View::counted_from`]).
    ///
    /// Hair of other strands nearer than that is lost: of an optical depth κ a unit length, κ times this. It goes to zero with the
    /// pixel, and is at most three widths of it.
    pub fn bias(&self, offset: DVec2, half: f64) -> f64 {
        let reach = half * (self.along.x.abs() + self.along.y.abs());
        if self.along.perp_dot(offset).abs() > reach + self.beside {
            return 0.0;
        }
        let nearer = (reach + self.slant) * self.slope.abs() - self.along.dot(offset) * self.slope;
        (nearer.min(self.most) - self.held_back).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bias_is_where_the_strand_leans_to_and_bounded_by_the_rule_of_rays() {
        // Width 0.5; to the right the strand goes away from the lamp.
        let own = |slope: f64| {
            let depth = slope / (1.0 + slope * slope).sqrt();
            Own { along: DVec2::X, slope, most: 4.0 * 0.5 * depth, held_back: 0.5, beside: 0.25, slant: 0.0 }
        };
        let bias = |slope, x, y| own(slope).bias(DVec2::new(x, y), 0.1);
        assert_eq!(bias(0.1, 0.0, 0.0), 0.0, "across the ray none");
        assert_eq!(bias(5.0, 0.2, 0.0), 0.0, "none where it lies behind");
        assert!((bias(5.0, -0.1, 0.2) - (5.0 * 0.2 - 0.5)).abs() < 1e-12, "before it, to the pixel's border");
        assert_eq!(bias(5.0, -0.1, 0.36), 0.0, "none beside it");
        assert!((bias(1e6, -0.2, 0.0) - 1.5).abs() < 1e-6, "along the ray three widths");
    }
}
