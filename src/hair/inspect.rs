//! What hair is like: the facts behind `tress info`.

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::strands::{Attribute, Strands};

/// Lowest, mean and highest of some numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    pub min: f64,
    pub mean: f64,
    pub max: f64,
}

/// How many values an attribute has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Given {
    Uniform,
    PerStrand,
    PerPoint,
}

/// Facts about hair. Lengths are in the units of the points.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    pub strands: usize,
    pub points: usize,
    pub segments: usize,
    pub points_per_strand: Spread,
    /// Lowest and highest corner of the box around the finite points, without widths.
    pub bounds: Option<[[f32; 3]; 2]>,
    pub segment_length: Spread,
    pub strand_length: Spread,
    pub width_given: Given,
    /// Diameter, over the stored values.
    pub width: Spread,
    pub transparency_given: Given,
    /// Transmittance of one crossing, over the stored values.
    pub transparency: Spread,
    pub color_given: Given,
    /// Mean of the stored colours, linear Rec.709.
    pub color_mean: [f32; 3],
    /// Segments whose two points are the same.
    pub zero_length_segments: usize,
    /// Points that are not finite.
    pub not_finite_points: usize,
    /// Strands whose points are, bit by bit, those of an earlier strand.
    pub duplicate_strands: usize,
    /// What a user may not have meant.
    pub suspicious: Vec<String>,
}

/// Running minimum, maximum and sum; numbers that are not finite are passed over.
#[derive(Default)]
struct Gather {
    spread: Option<Spread>,
    count: usize,
}

impl Gather {
    fn add(&mut self, value: f64) {
        if !value.is_finite() {
            return;
        }
        self.count += 1;
        let s = self.spread.get_or_insert(Spread { min: value, mean: 0.0, max: value });
        s.min = s.min.min(value);
        s.max = s.max.max(value);
        s.mean += value;
    }

    fn finish(self) -> Spread {
        let s = self.spread.unwrap_or_default();
        Spread { mean: s.mean / self.count.max(1) as f64, ..s }
    }
}

fn spread(values: impl Iterator<Item = f64>) -> Spread {
    let mut gather = Gather::default();
    values.for_each(|v| gather.add(v));
    gather.finish()
}

fn given<T>(attribute: &Attribute<T>) -> Given {
    match attribute {
        Attribute::Uniform(_) => Given::Uniform,
        Attribute::PerStrand(_) => Given::PerStrand,
        Attribute::PerPoint(_) => Given::PerPoint,
    }
}

/// Looks hair over. Its layout must be sound; points and widths need not be.
pub fn inspect(strands: &Strands) -> Report {
    let (mut segment_length, mut strand_length) = (Gather::default(), Gather::default());
    let mut zero_length_segments = 0;
    for strand in strands.iter() {
        let mut length = 0.0;
        for pair in strand.windows(2) {
            let step = pair[0].as_dvec3().distance(pair[1].as_dvec3());
            zero_length_segments += usize::from(pair[0] == pair[1]);
            segment_length.add(step);
            length += step;
        }
        strand_length.add(length);
    }
    let colors = strands.color.values();
    let color_sum: glam::DVec3 = colors.iter().filter(|c| c.is_finite()).map(|c| c.as_dvec3()).sum();
    let mut report = Report {
        strands: strands.strand_count(),
        points: strands.point_count(),
        segments: strands.segment_count(),
        points_per_strand: spread(strands.iter().map(|s| s.len() as f64)),
        bounds: strands.bounds().map(|b| b.map(|c| c.to_array())),
        segment_length: segment_length.finish(),
        strand_length: strand_length.finish(),
        width_given: given(&strands.width),
        width: spread(strands.width.values().iter().map(|&w| f64::from(w))),
        transparency_given: given(&strands.transparency),
        transparency: spread(strands.transparency.values().iter().map(|&t| f64::from(t))),
        color_given: given(&strands.color),
        color_mean: (color_sum / colors.len().max(1) as f64).as_vec3().to_array(),
        zero_length_segments,
        not_finite_points: strands.points.iter().filter(|p| !p.is_finite()).count(),
        duplicate_strands: duplicates(strands),
        suspicious: vec![],
    };
    report.suspicious = suspicious(&report);
    report
}

/// Strands that repeat an earlier one. They are sorted rather than hashed, so that no two can be confused.
fn duplicates(strands: &Strands) -> usize {
    let bits = |i: &u32| strands.strand(*i as usize).iter().flat_map(|p: &Vec3| p.to_array().map(f32::to_bits));
    // Most strands differ in their first point: its bits go beside the index, where a comparison finds them at once.
    let root = |i: u32| strands.strand(i as usize).first().map_or([0; 3], |p| p.to_array().map(f32::to_bits));
    let mut order: Vec<([u32; 3], u32)> = (0..strands.strand_count() as u32).map(|i| (root(i), i)).collect();
    order.par_sort_unstable_by(|a, b| a.0.cmp(&b.0).then_with(|| bits(&a.1).cmp(bits(&b.1))));
    order.windows(2).filter(|pair| pair[0].0 == pair[1].0 && bits(&pair[0].1).eq(bits(&pair[1].1))).count()
}

fn suspicious(report: &Report) -> Vec<String> {
    let mut list = vec![];
    let mut tell = |condition: bool, text: String| {
        if condition {
            list.push(text);
        }
    };
    let Report { width, transparency, segment_length, .. } = *report;
    tell(report.not_finite_points > 0, format!("{} points are not finite", report.not_finite_points));
    tell(report.zero_length_segments > 0, format!("{} segments have no length", report.zero_length_segments));
    tell(report.duplicate_strands > 0, format!("{} strands repeat another one", report.duplicate_strands));
    tell(report.strands > 0 && report.points_per_strand.min < 2.0, "a strand has fewer than two points".into());
    tell(width.max > 0.0 && width.min <= 0.0, "some widths are zero: that hair is not seen".into());
    tell(width.max <= 0.0, "all widths are zero: set `width`".into());
    tell(transparency.min >= 1.0, "all hair is wholly transparent: set `transparency`".into());
    let thick = width.mean > segment_length.mean && segment_length.mean > 0.0;
    let numbers = format!("{:.3e} against {:.3e}", width.mean, segment_length.mean);
    tell(thick, format!("strands are wider than their segments are long ({numbers}): are the units right?"));
    if let Some([low, high]) = report.bounds {
        let (low, high) = (Vec3::from(low), Vec3::from(high));
        let (size, distance) = (low.distance(high), (0.5 * (low + high)).length());
        // f32 then has fewer than ten bits for a segment: it shows as steps.
        let coarse = f64::from(low.abs().max(high.abs()).max_element()) * f64::from(f32::EPSILON) * 1000.0;
        let far = segment_length.mean > 0.0 && segment_length.mean < coarse;
        tell(far, format!("the hair is {size:.3e} large but {distance:.3e} from the origin: its points are coarse"));
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> Strands {
        let p = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        Strands {
            points: vec![p(0.0, 0.0), p(1.0, 0.0), p(1.0, 3.0), p(5.0, 5.0), p(5.0, 7.0)],
            first: vec![0, 3, 5],
            width: Attribute::PerStrand(vec![0.1, 0.2]),
            color: Attribute::PerStrand(vec![Vec3::ZERO, Vec3::ONE]),
            transparency: Attribute::Uniform(0.5),
        }
    }

    #[test]
    fn facts_are_right() {
        let r = inspect(&two());
        assert_eq!((r.strands, r.points, r.segments), (2, 5, 3));
        assert_eq!(r.points_per_strand, Spread { min: 2.0, mean: 2.5, max: 3.0 });
        assert_eq!(r.segment_length, Spread { min: 1.0, mean: 2.0, max: 3.0 });
        assert_eq!(r.strand_length, Spread { min: 2.0, mean: 3.0, max: 4.0 });
        assert_eq!((r.width_given, r.color_mean), (Given::PerStrand, [0.5; 3]));
        assert!(r.suspicious.is_empty(), "{:?}", r.suspicious);
    }

    #[test]
    fn oddities_are_told() {
        let told = |edit: &dyn Fn(&mut Strands)| {
            let mut s = two();
            edit(&mut s);
            inspect(&s).suspicious.join("\n")
        };
        assert!(told(&|s| s.points[1] = s.points[0]).contains("1 segments have no length"));
        assert!(told(&|s| s.points[4].z = f32::NAN).contains("1 points are not finite"));
        assert!(told(&|s| s.width = Attribute::Uniform(0.0)).contains("all widths are zero"));
        assert!(told(&|s| s.width = Attribute::Uniform(9.0)).contains("wider than their segments"));
        assert!(told(&|s| s.transparency = Attribute::Uniform(1.0)).contains("wholly transparent"));
        assert!(told(&|s| s.points.iter_mut().for_each(|p| p.x += 1e6)).contains("from the origin"));
        let repeat = |s: &mut Strands| {
            s.points.extend_from_within(3..5);
            s.first.push(7);
            s.width = Attribute::Uniform(0.1);
            s.color = Attribute::Uniform(Vec3::ONE);
        };
        assert!(told(&repeat).contains("1 strands repeat"));
    }

    #[test]
    fn straight_hair_is_not_suspicious() {
        let path =
            std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/hair/yuksel_straight.hair"));
        if !path.exists() {
            eprintln!("skipped: {} is not there", path.display());
            return;
        }
        let loaded = super::super::formats::read(path, Default::default(), &Default::default()).unwrap();
        let r = inspect(&loaded.strands);
        assert_eq!((r.zero_length_segments, r.not_finite_points, r.duplicate_strands), (0, 0, 0));
        assert!(r.suspicious.is_empty(), "{:?}", r.suspicious);
    }
}
