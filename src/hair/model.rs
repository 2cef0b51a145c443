//! All hair of a scene as one model in render space: what stage 1 draws and Γ is computed from.

use glam::Vec3;

use super::{Attribute, Strands};

/// Hair of a whole scene, structure of arrays. Segment `s` runs from point `segment_point[s]` to the next one.
#[derive(Clone, Debug, Default)]
pub struct HairModel {
    /// Points of all strands, root first.
    pub points: Vec<Vec3>,
    /// Width (diameter) at each point.
    pub width: Vec<f32>,
    /// Length along the strand from its root to each point.
    pub arc: Vec<f32>,
    /// Diffuse reflectance, linear Rec.709.
    pub color: Colors,
    /// Transmittance of one crossing, a segment (the mean of its ends).
    pub transparency: Vec<f32>,
    /// First point of each segment.
    pub segment_point: Vec<u32>,
    /// Strand of each segment.
    pub strand: Vec<u32>,
    /// Index of the hair object (its highlight and name) of each strand.
    pub object: Vec<u16>,
}

/// Diffuse reflectance of all hair, linear Rec.709.
#[derive(Clone, Debug, PartialEq)]
pub enum Colors {
    /// One a hair object: no object's varies.
    PerObject(Vec<Vec3>),
    /// One a point: some object's does.
    PerPoint(Vec<Vec3>),
}

impl Default for Colors {
    fn default() -> Self {
        Self::PerObject(Vec::new())
    }
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
        self.arc.reserve(points);
        self.segment_point.reserve(segments);
        self.strand.reserve(segments);
        self.transparency.reserve(segments);
        self.object.reserve(strands.strand_count());
        self.add_colors(strands, object);
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
                if let Colors::PerPoint(colors) = &mut self.color {
                    colors.push(strands.color.at(index, point));
                }
                self.arc.push(arc as f32);
            }
        }
        degenerate
    }

    /// Makes room for the colours of an object that is about to be added: one of it, if it and all before it have one.
    fn add_colors(&mut self, strands: &Strands, object: u16) {
        let index = usize::from(object);
        if let (Colors::PerObject(colors), Attribute::Uniform(color)) = (&mut self.color, &strands.color)
            && colors.get(index).is_none_or(|before| before == color)
        {
            colors.resize(colors.len().max(index + 1), *color);
            return;
        }
        self.spread_colors();
        if let Colors::PerPoint(colors) = &mut self.color {
            colors.reserve(strands.point_count());
        }
    }

    /// Gives each point a colour of its own, the one that it has: for strands whose colour varies, and for a plan that asks for it.
    pub fn spread_colors(&mut self) {
        if let Colors::PerObject(colors) = &self.color {
            // Points of no segment are never asked for theirs.
            let mut all = vec![Vec3::ZERO; self.points.len()];
            for (&point, &strand) in self.segment_point.iter().zip(&self.strand) {
                all[point as usize..point as usize + 2].fill(colors[usize::from(self.object[strand as usize])]);
            }
            self.color = Colors::PerPoint(all);
        }
    }

    /// Gives each object the mean colour of its segments, each counted once.
    pub fn mean_colors(&mut self) {
        let Colors::PerPoint(colors) = &self.color else { return };
        let objects = self.object.iter().max().map_or(0, |&last| usize::from(last) + 1);
        let mut sums = vec![(glam::DVec3::ZERO, 0_u64); objects];
        for (&point, &strand) in self.segment_point.iter().zip(&self.strand) {
            let (sum, count) = &mut sums[usize::from(self.object[strand as usize])];
            let ends = colors[point as usize].as_dvec3() + colors[point as usize + 1].as_dvec3();
            (*sum, *count) = (*sum + 0.5 * ends, *count + 1);
        }
        let mean = |(sum, count): (glam::DVec3, u64)| (sum / count.max(1) as f64).as_vec3();
        self.color = Colors::PerObject(sums.into_iter().map(mean).collect());
    }

    /// What it holds, in bytes.
    pub fn bytes(&self) -> u64 {
        let colors = match &self.color {
            Colors::PerObject(colors) | Colors::PerPoint(colors) => size_of_val(&colors[..]),
        };
        let points = size_of_val(&self.points[..]) + size_of_val(&self.width[..]) + size_of_val(&self.arc[..]);
        let segments = size_of_val(&self.transparency[..]) + size_of_val(&self.segment_point[..]);
        let strands = size_of_val(&self.strand[..]) + size_of_val(&self.object[..]);
        (colors + points + segments + strands) as u64
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

    /// Lengths of arc from the root to the two ends of a segment.
    #[inline]
    pub fn arcs(&self, segment: usize) -> [f32; 2] {
        let p = self.segment_point[segment] as usize;
        [self.arc[p], self.arc[p + 1]]
    }

    /// The point at parameter `u` (0 to 1) of a segment.
    pub fn sample(&self, segment: usize, u: f32) -> StrandSample {
        let p = self.segment_point[segment] as usize;
        let [a, b] = self.ends(segment);
        let mix = |x: f32, y: f32| x + (y - x) * u;
        StrandSample {
            position: a + (b - a) * u,
            tangent: (b - a).normalize(),
            color: match &self.color {
                Colors::PerPoint(colors) => colors[p] + (colors[p + 1] - colors[p]) * u,
                // The same to the bit: what is added above is zero then.
                Colors::PerObject(colors) => colors[usize::from(self.object[self.strand[segment] as usize])],
            },
            width: mix(self.width[p], self.width[p + 1]),
            on: OnStrand {
                strand: self.strand[segment],
                segment: segment as u32,
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
    /// The segment that it is on.
    pub segment: u32,
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

#[cfg(test)]
mod tests {
    use super::*;

    fn strands(color: Attribute<Vec3>) -> Strands {
        let points = (0..6).map(|i| Vec3::new(i as f32, (i % 3) as f32, 0.0)).collect();
        let (width, transparency) = (Attribute::Uniform(0.1), Attribute::Uniform(0.5));
        Strands { points, first: vec![0, 3, 6], width, color, transparency }
    }

    fn colors(model: &HairModel) -> Vec<Vec3> {
        (0..model.segments()).flat_map(|s| [0.0, 0.37, 1.0].map(|u| model.sample(s, u).color)).collect()
    }

    #[test]
    fn one_colour_an_object_is_the_same_to_the_bit_as_one_a_point() {
        let (red, blue) = (Vec3::new(0.7, 0.1, 1.0 / 3.0), Vec3::new(0.1, 0.2, 0.9));
        let mut model = HairModel::default();
        model.add(&strands(Attribute::Uniform(red)), 0);
        model.add(&strands(Attribute::Uniform(blue)), 1);
        assert_eq!(model.color, Colors::PerObject(vec![red, blue]));
        let before = colors(&model);
        let bytes = model.bytes();
        model.spread_colors();
        assert_eq!(before, colors(&model));
        assert_eq!(model.bytes() - bytes, 12 * 12 - 2 * 12);
        // And back.
        model.mean_colors();
        assert_eq!(model.color, Colors::PerObject(vec![red, blue]));
    }

    #[test]
    fn an_object_whose_colour_varies_takes_those_before_it_along() {
        let (red, blue) = (Vec3::X, Vec3::Z);
        let mut model = HairModel::default();
        model.add(&strands(Attribute::Uniform(red)), 0);
        model.add(&strands(Attribute::PerStrand(vec![red, blue])), 1);
        model.add(&strands(Attribute::Uniform(blue)), 2);
        let want = [[red; 18], [blue; 18]].concat();
        assert_eq!(colors(&model), want);
        model.mean_colors();
        assert_eq!(model.color, Colors::PerObject(vec![red, Vec3::new(0.5, 0.0, 0.5), blue]));
        // Two colours under one number are no object's colour.
        let mut model = HairModel::default();
        model.add(&strands(Attribute::Uniform(red)), 0);
        model.add(&strands(Attribute::Uniform(blue)), 0);
        assert_eq!(colors(&model), [[red; 12], [blue; 12]].concat());
    }
}
