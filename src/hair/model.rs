//! All hair of a scene as one model in render space: what stage 1 draws and Γ is computed from.

use glam::Vec3;

use super::Strands;

/// Hair of a whole scene, structure of arrays. Segment `s` runs from point `segment_point[s]` to the next one.
#[derive(Clone, Debug, Default)]
pub struct HairModel {
    /// Points of all strands, root first.
    pub points: Vec<Vec3>,
    /// Width (diameter) at each point.
    pub width: Vec<f32>,
    /// Length along the strand from its root to each point.
    pub arc: Vec<f32>,
    /// Diffuse reflectance at each point, linear Rec.709.
    pub color: Vec<Vec3>,
    /// Transmittance of one crossing, a segment (the mean of its ends).
    pub transparency: Vec<f32>,
    /// First point of each segment.
    pub segment_point: Vec<u32>,
    /// Strand of each segment.
    pub strand: Vec<u32>,
    /// Index of the hair object (its highlight and name) of each strand.
    pub object: Vec<u16>,
}

/// Segments up to this length, in render units, count as points: fourth powers of shorter ones leave the normal numbers of `f32`. Only a point far
/// away from all other hair, which makes that small, leads to such.
pub const SHORTEST: f64 = 1e-9;

impl HairModel {
    /// Adds the strands of one hair object. Segments of next to no length are left out: they cover nothing and have no direction.
    ///
    /// Returns how many segments were left out.
    pub fn add(&mut self, strands: &Strands, object: u16) -> usize {
        let mut degenerate = 0;
        let (points, segments) = (strands.point_count(), strands.segment_count());
        // Grown bit by bit, each would for a while be held three times.
        self.points.reserve(points);
        self.width.reserve(points);
        self.color.reserve(points);
        self.arc.reserve(points);
        self.segment_point.reserve(segments);
        self.strand.reserve(segments);
        self.transparency.reserve(segments);
        self.object.reserve(strands.strand_count());
        for (index, bounds) in strands.first.windows(2).enumerate() {
            let strand = self.object.len() as u32;
            self.object.push(object);
            let (start, end) = (bounds[0] as usize, bounds[1] as usize);
            let mut arc = 0.0_f64;
            for point in start..end {
                let here = self.points.len() as u32;
                let position = strands.points[point];
                if point > start {
                    let length = f64::from(position.distance(strands.points[point - 1]));
                    arc += length;
                    if length > SHORTEST {
                        self.segment_point.push(here - 1);
                        self.strand.push(strand);
                        let ends = [point - 1, point].map(|p| strands.transparency.at(index, p));
                        self.transparency.push(0.5 * (ends[0] + ends[1]));
                    } else {
                        degenerate += 1;
                    }
                }
                self.points.push(position);
                self.width.push(strands.width.at(index, point));
                self.color.push(strands.color.at(index, point));
                self.arc.push(arc as f32);
            }
        }
        degenerate
    }

    /// Number of segments.
    pub fn segments(&self) -> usize {
        self.segment_point.len()
    }

    /// Whether there is no hair.
    pub fn is_empty(&self) -> bool {
        self.segment_point.is_empty()
    }

    /// The two ends of a segment.
    #[inline]
    pub fn ends(&self, segment: usize) -> [Vec3; 2] {
        let p = self.segment_point[segment] as usize;
        [self.points[p], self.points[p + 1]]
    }

    /// Widths at the two ends of a segment.
    #[inline]
    pub fn widths(&self, segment: usize) -> [f32; 2] {
        let p = self.segment_point[segment] as usize;
        [self.width[p], self.width[p + 1]]
    }

    /// The point at parameter `u` (0 to 1) of a segment.
    pub fn sample(&self, segment: usize, u: f32) -> StrandSample {
        let p = self.segment_point[segment] as usize;
        let [a, b] = self.ends(segment);
        let mix = |x: f32, y: f32| x + (y - x) * u;
        StrandSample {
            position: a + (b - a) * u,
            tangent: (b - a).normalize(),
            color: self.color[p] + (self.color[p + 1] - self.color[p]) * u,
            width: mix(self.width[p], self.width[p + 1]),
            on: OnStrand {
                strand: self.strand[segment],
                arc: mix(self.arc[p], self.arc[p + 1]),
                width: mix(self.width[p], self.width[p + 1]),
            },
        }
    }
}

/// A point on a strand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrandSample {
    /// Position in render space.
    pub position: Vec3,
    /// Unit direction from root to tip.
    pub tangent: Vec3,
    /// Diffuse reflectance.
    pub color: Vec3,
    /// Width.
    pub width: f32,
    /// Where on which strand it is.
    pub on: OnStrand,
}

/// Identity of a point on a strand: what keeps the strand from shadowing itself there.
///
/// The rule is the same in every estimator: of its own strand nothing within `SELF_WIDTHS` widths of arc length to either side
/// counts, and of any strand nothing nearer than that strand's own width (Embree's flat curves ignore such hits).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnStrand {
    pub strand: u32,
    pub arc: f32,
    pub width: f32,
}

/// How many widths of arc length to either side of a point its own strand does not count.
pub const SELF_WIDTHS: f32 = 4.0;

impl OnStrand {
    /// The range of arc lengths of the own strand that does not count.
    #[inline]
    pub fn excluded(&self) -> [f32; 2] {
        [self.arc - SELF_WIDTHS * self.width, self.arc + SELF_WIDTHS * self.width]
    }
}
