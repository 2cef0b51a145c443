//! Strands: hair as one structure of arrays.

use std::ops::Range;

use glam::Vec3;
use thiserror::Error;

/// Diffuse reflectance of hair where nothing gives one: brown, linear Rec.709.
pub const DEFAULT_COLOR: Vec3 = Vec3::new(0.28, 0.18, 0.10);

/// Transmittance of one crossing where nothing gives one: opaque.
pub const DEFAULT_TRANSPARENCY: f32 = 0.0;

/// Larger coordinates and widths are taken for damage: their squares, and what is computed from these, would not be finite for long.
pub const LARGEST: f32 = 1e15;

/// A quantity that is the same everywhere, or given per strand, or per point.
#[derive(Clone, Debug, PartialEq)]
pub enum Attribute<T> {
    Uniform(T),
    PerStrand(Vec<T>),
    PerPoint(Vec<T>),
}

impl<T: Copy> Attribute<T> {
    /// The value at a point of a strand; `point` counts over all strands.
    #[inline]
    pub fn at(&self, strand: usize, point: usize) -> T {
        match self {
            Self::Uniform(value) => *value,
            Self::PerStrand(values) => values[strand],
            Self::PerPoint(values) => values[point],
        }
    }

    /// All values that are stored: one, one a strand or one a point.
    pub fn values(&self) -> &[T] {
        match self {
            Self::Uniform(value) => std::slice::from_ref(value),
            Self::PerStrand(values) | Self::PerPoint(values) => values,
        }
    }

    /// The same as [`values`](Self::values), to change in place.
    pub fn values_mut(&mut self) -> &mut [T] {
        match self {
            Self::Uniform(value) => std::slice::from_mut(value),
            Self::PerStrand(values) | Self::PerPoint(values) => values,
        }
    }

    /// What is wrong with its length, if anything.
    fn flaw(&self, what: &'static str, strands: usize, points: usize) -> Option<Flaw> {
        let (expected, per) = match self {
            Self::Uniform(_) => return None,
            Self::PerStrand(_) => (strands, "strand"),
            Self::PerPoint(_) => (points, "point"),
        };
        let found = self.values().len();
        (found != expected).then_some(Flaw::AttributeLength { what, per, expected, found })
    }

    /// Keeps the strands whose flag is set; `first` is the layout before the cut.
    fn keep(&mut self, flags: &[bool], first: &[u32]) {
        match self {
            Self::Uniform(_) => {}
            Self::PerStrand(values) => keep_strands(values, flags),
            Self::PerPoint(values) => keep_points(values, flags, first),
        }
    }
}

/// Hair: polylines with a width, a colour and a transparency, in the space of whoever holds them.
#[derive(Clone, Debug, PartialEq)]
pub struct Strands {
    /// The points of all strands, one strand after the other, root first.
    pub points: Vec<Vec3>,
    /// Where each strand begins in `points`, and one past the last: strand `i` owns `first[i]..first[i + 1]`, at least two points.
    pub first: Vec<u32>,
    /// Width (diameter), in the units of `points`.
    pub width: Attribute<f32>,
    /// Diffuse reflectance, linear Rec.709.
    pub color: Attribute<Vec3>,
    /// Transmittance of one crossing, 0 opaque to 1 invisible.
    pub transparency: Attribute<f32>,
}

/// A broken promise of [`Strands`].
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Flaw {
    #[error("`first` must begin with 0 and end with the number of points ({points}), but holds {first:?} .. {last:?}")]
    Ends { first: Option<u32>, last: Option<u32>, points: usize },
    #[error("strand {strand} begins at point {from} and ends before it, at {to}")]
    Order { strand: usize, from: u32, to: u32 },
    #[error("{what} has {found} values, but there are {expected} (one a {per})")]
    AttributeLength { what: &'static str, per: &'static str, expected: usize, found: usize },
    #[error("strand {strand} is damaged: {damage}")]
    Damaged { strand: usize, damage: Damage },
}

/// What can be wrong with a single strand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Damage {
    #[error("it has fewer than two points")]
    TooShort,
    #[error("a coordinate is not a number up to 1e15")]
    PointNotFinite,
    #[error("a width is not a number from 0 to 1e15")]
    BadWidth,
    #[error("a colour is not a finite number")]
    BadColor,
    #[error("a transparency is not a finite number")]
    BadTransparency,
}

/// The strands that [`Strands::cut_damaged`] took out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dropped {
    /// How many.
    pub count: usize,
    /// The first few of them: index before the cut, and what was wrong.
    pub examples: Vec<(usize, Damage)>,
}

impl Dropped {
    /// How many examples are kept.
    const EXAMPLES: usize = 5;

    /// A sentence for the user, or nothing where nothing was dropped.
    pub fn note(&self) -> Option<String> {
        let list: Vec<String> = self.examples.iter().map(|(index, damage)| format!("{index} ({damage})")).collect();
        let more = if self.count > self.examples.len() { ", ..." } else { "" };
        (self.count > 0).then(|| format!("dropped {} damaged strands: {}{more}", self.count, list.join(", ")))
    }
}

impl Strands {
    /// Number of strands.
    pub fn strand_count(&self) -> usize {
        self.first.len().saturating_sub(1)
    }

    /// Number of points over all strands.
    pub fn point_count(&self) -> usize {
        self.points.len()
    }

    /// Number of segments over all strands.
    pub fn segment_count(&self) -> usize {
        self.points.len().saturating_sub(self.strand_count())
    }

    /// The indices of a strand's points in `points`.
    #[inline]
    pub fn range(&self, strand: usize) -> Range<usize> {
        self.first[strand] as usize..self.first[strand + 1] as usize
    }

    /// The points of a strand, root first.
    #[inline]
    pub fn strand(&self, strand: usize) -> &[Vec3] {
        &self.points[self.range(strand)]
    }

    /// The strands in order, each as its points.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[Vec3]> + '_ {
        self.first.windows(2).map(|pair| &self.points[pair[0] as usize..pair[1] as usize])
    }

    /// The corners of the smallest box around all finite points; none where there are none. Widths are not counted.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        bounds(&self.points)
    }

    /// Length of a strand, in the units of the points.
    pub fn length(&self, strand: usize) -> f64 {
        self.strand(strand).windows(2).map(|p| p[0].as_dvec3().distance(p[1].as_dvec3())).sum()
    }

    /// Distance along the strand from its root, one a point, in the units of the points; summed in f64.
    pub fn arc_lengths(&self) -> Vec<f32> {
        let mut lengths = Vec::with_capacity(self.points.len());
        for strand in self.iter() {
            let mut sum = 0.0f64;
            for (k, point) in strand.iter().enumerate() {
                if k > 0 {
                    sum += strand[k - 1].as_dvec3().distance(point.as_dvec3());
                }
                lengths.push(sum as f32);
            }
        }
        lengths
    }

    /// Checks everything that the fields promise.
    ///
    /// # Errors
    /// The first flaw found: in the layout, in an attribute's length, or in a strand.
    pub fn validate(&self) -> Result<(), Flaw> {
        self.check_layout()?;
        match (0..self.strand_count()).find_map(|i| self.damage(i).map(|damage| (i, damage))) {
            Some((strand, damage)) => Err(Flaw::Damaged { strand, damage }),
            None => Ok(()),
        }
    }

    /// Takes out the strands that cannot be rendered and says which they were.
    ///
    /// # Errors
    /// A flaw in the layout or in an attribute's length, which no cut can mend; then nothing is changed.
    pub fn cut_damaged(&mut self) -> Result<Dropped, Flaw> {
        self.check_layout()?;
        let mut dropped = Dropped::default();
        let mut flags = vec![true; self.strand_count()];
        for (i, flag) in flags.iter_mut().enumerate() {
            if let Some(damage) = self.damage(i) {
                *flag = false;
                dropped.count += 1;
                if dropped.examples.len() < Dropped::EXAMPLES {
                    dropped.examples.push((i, damage));
                }
            }
        }
        if dropped.count > 0 {
            self.keep(&flags);
        }
        Ok(dropped)
    }

    /// Keeps the strands for which `wanted` holds; it is asked once for each index, in order.
    pub fn retain(&mut self, wanted: impl FnMut(usize) -> bool) {
        let flags: Vec<bool> = (0..self.strand_count()).map(wanted).collect();
        self.keep(&flags);
    }

    fn keep(&mut self, flags: &[bool]) {
        keep_points(&mut self.points, flags, &self.first);
        self.width.keep(flags, &self.first);
        self.color.keep(flags, &self.first);
        self.transparency.keep(flags, &self.first);
        let mut end = 0;
        let mut first = vec![0];
        for (pair, _) in self.first.windows(2).zip(flags).filter(|(_, kept)| **kept) {
            end += pair[1] - pair[0];
            first.push(end);
        }
        self.first = first;
    }

    fn check_layout(&self) -> Result<(), Flaw> {
        let (first, last, points) = (self.first.first().copied(), self.first.last().copied(), self.points.len());
        if first != Some(0) || last.map(|l| l as usize) != Some(points) {
            return Err(Flaw::Ends { first, last, points });
        }
        if let Some(strand) = self.first.windows(2).position(|pair| pair[0] > pair[1]) {
            return Err(Flaw::Order { strand, from: self.first[strand], to: self.first[strand + 1] });
        }
        let strands = self.strand_count();
        let flaw = (self.width.flaw("width", strands, points))
            .or_else(|| self.color.flaw("color", strands, points))
            .or_else(|| self.transparency.flaw("transparency", strands, points));
        flaw.map_or(Ok(()), Err)
    }

    /// What is wrong with a strand, if anything.
    fn damage(&self, strand: usize) -> Option<Damage> {
        let range = self.range(strand);
        if range.len() < 2 {
            return Some(Damage::TooShort);
        }
        for point in range {
            let position = self.points[point];
            if !position.is_finite() || position.abs().max_element() > LARGEST {
                return Some(Damage::PointNotFinite);
            }
            let width = self.width.at(strand, point);
            if !(0.0..=LARGEST).contains(&width) {
                return Some(Damage::BadWidth);
            }
            if !self.color.at(strand, point).is_finite() {
                return Some(Damage::BadColor);
            }
            if !self.transparency.at(strand, point).is_finite() {
                return Some(Damage::BadTransparency);
            }
        }
        None
    }
}

/// The corners of the smallest box around all finite points; none where there are none.
pub(crate) fn bounds(points: &[Vec3]) -> Option<[Vec3; 2]> {
    let mut finite = points.iter().filter(|p| p.is_finite());
    let start = *finite.next()?;
    Some(finite.fold([start, start], |[low, high], p| [low.min(*p), high.max(*p)]))
}

fn keep_strands<T>(values: &mut Vec<T>, flags: &[bool]) {
    let mut flags = flags.iter();
    values.retain(|_| flags.next().copied().unwrap_or(false));
}

fn keep_points<T: Copy>(values: &mut Vec<T>, flags: &[bool], first: &[u32]) {
    let mut end = 0;
    for (pair, _) in first.windows(2).zip(flags).filter(|(_, kept)| **kept) {
        let range = pair[0] as usize..pair[1] as usize;
        values.copy_within(range.clone(), end);
        end += range.len();
    }
    values.truncate(end);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Strands of the given numbers of points; the x of a point is its index, y the strand's.
    fn sample(counts: &[usize]) -> Strands {
        let mut s = Strands {
            points: vec![],
            first: vec![0],
            width: Attribute::PerPoint(vec![]),
            color: Attribute::Uniform(DEFAULT_COLOR),
            transparency: Attribute::PerStrand((0..counts.len()).map(|i| i as f32 / 100.0).collect()),
        };
        let mut widths = vec![];
        for (i, &n) in counts.iter().enumerate() {
            for _ in 0..n {
                widths.push(s.points.len() as f32);
                s.points.push(Vec3::new(s.points.len() as f32, i as f32, 0.0));
            }
            s.first.push(s.points.len() as u32);
        }
        s.width = Attribute::PerPoint(widths);
        s
    }

    #[test]
    fn counts_and_lengths() {
        let s = sample(&[2, 5, 3]);
        assert_eq!((s.strand_count(), s.point_count(), s.segment_count()), (3, 10, 7));
        assert_eq!(s.length(1), 4.0);
        assert_eq!(s.arc_lengths(), [0.0, 1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 0.0, 1.0, 2.0]);
        assert_eq!(s.bounds(), Some([Vec3::ZERO, Vec3::new(9.0, 2.0, 0.0)]));
        assert_eq!(s.iter().map(<[Vec3]>::len).collect::<Vec<_>>(), [2, 5, 3]);
        assert_eq!(s.validate(), Ok(()));
    }

    #[test]
    fn damage_is_cut_and_told() {
        let mut s = sample(&[3, 1, 2, 0, 4, 2]);
        s.points[4].z = f32::NAN;
        s.width.values_mut()[7] = -1.0;
        assert_eq!(s.validate(), Err(Flaw::Damaged { strand: 1, damage: Damage::TooShort }));
        let dropped = s.cut_damaged().unwrap();
        let expected =
            [(1, Damage::TooShort), (2, Damage::PointNotFinite), (3, Damage::TooShort), (4, Damage::BadWidth)];
        assert_eq!((dropped.count, &dropped.examples[..]), (4, &expected[..]));
        assert!(dropped.note().unwrap().contains("dropped 4 damaged strands: 1 (it has fewer"));
        assert_eq!(s.validate(), Ok(()));
        assert_eq!(s.points.iter().map(|p| p.x).collect::<Vec<_>>(), [0.0, 1.0, 2.0, 10.0, 11.0]);
        assert_eq!(s.width.values(), [0.0, 1.0, 2.0, 10.0, 11.0]);
        assert_eq!(s.transparency.values(), [0.0, 0.05]);
    }

    #[test]
    fn broken_layouts_are_named() {
        let mut s = sample(&[2, 2]);
        s.first = vec![0, 3, 2, 4];
        s.transparency = Attribute::Uniform(0.0);
        assert_eq!(s.validate(), Err(Flaw::Order { strand: 1, from: 3, to: 2 }));
        s.first = vec![0, 2];
        assert!(matches!(s.validate(), Err(Flaw::Ends { .. })));
        s.first = vec![];
        assert!(matches!(s.cut_damaged(), Err(Flaw::Ends { .. })));
        s.first = vec![0, 2, 4];
        s.color = Attribute::PerPoint(vec![Vec3::ONE; 3]);
        let flaw = Flaw::AttributeLength { what: "color", per: "point", expected: 4, found: 3 };
        assert_eq!(s.validate(), Err(flaw));
    }

    proptest! {
        #[test]
        fn retain_equals_rebuilding(counts in prop::collection::vec((0usize..6, any::<bool>()), 0..40)) {
            let lengths: Vec<usize> = counts.iter().map(|c| c.0).collect();
            let whole = sample(&lengths);
            let mut cut = whole.clone();
            cut.retain(|i| counts[i].1);
            let kept: Vec<usize> = (0..counts.len()).filter(|&i| counts[i].1).collect();
            prop_assert_eq!(cut.strand_count(), kept.len());
            for (new, &old) in kept.iter().enumerate() {
                prop_assert_eq!(cut.strand(new), whole.strand(old));
                prop_assert_eq!(cut.transparency.at(new, 0), whole.transparency.at(old, 0));
                for (a, b) in cut.range(new).zip(whole.range(old)) {
                    prop_assert_eq!(cut.width.at(new, a), whole.width.at(old, b));
                }
            }
        }
    }
}
