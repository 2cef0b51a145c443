//! Several hair objects as one.

use super::strands::{Attribute, Strands};

/// One after the other, in order; none where there would be more points than a `u32` counts. An attribute stays uniform
/// where all have the same value, and is else given per point.
pub fn join(parts: &[&Strands]) -> Option<Strands> {
    let points: usize = parts.iter().map(|part| part.point_count()).sum();
    u32::try_from(points).ok()?;
    let mut first = vec![0];
    let mut base = 0;
    for part in parts {
        first.extend(part.first.iter().skip(1).map(|end| base + end));
        base += part.point_count() as u32;
    }
    Some(Strands {
        points: parts.iter().flat_map(|part| part.points.iter().copied()).collect(),
        first,
        width: attribute(parts, |part| &part.width)?,
        color: attribute(parts, |part| &part.color)?,
        transparency: attribute(parts, |part| &part.transparency)?,
    })
}

fn attribute<T: Copy + PartialEq>(parts: &[&Strands], of: impl Fn(&Strands) -> &Attribute<T>) -> Option<Attribute<T>> {
    let first = of(parts.first()?);
    if let Attribute::Uniform(_) = first
        && parts.iter().all(|part| of(part) == first)
    {
        return Some(first.clone());
    }
    let mut values = Vec::with_capacity(parts.iter().map(|part| part.point_count()).sum());
    for part in parts {
        for strand in 0..part.strand_count() {
            values.extend(part.range(strand).map(|point| of(part).at(strand, point)));
        }
    }
    Some(Attribute::PerPoint(values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn strand(x: f32, points: usize, width: Attribute<f32>) -> Strands {
        Strands {
            points: (0..points).map(|i| Vec3::new(x, i as f32, 0.0)).collect(),
            first: vec![0, points as u32],
            width,
            color: Attribute::Uniform(Vec3::ONE),
            transparency: Attribute::PerStrand(vec![x]),
        }
    }

    #[test]
    fn strands_keep_their_points_and_values() {
        let parts = [
            strand(0.25, 2, Attribute::Uniform(1.0)),
            strand(0.5, 3, Attribute::PerPoint(vec![2.0, 3.0, 4.0])),
            strand(0.75, 2, Attribute::PerStrand(vec![5.0])),
        ];
        let joined = join(&parts.each_ref()).unwrap();
        assert_eq!(joined.validate(), Ok(()));
        assert_eq!(joined.first, [0, 2, 5, 7]);
        assert_eq!(joined.strand(1), parts[1].strand(0));
        assert_eq!(joined.width, Attribute::PerPoint(vec![1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 5.0]));
        assert_eq!(joined.color, Attribute::Uniform(Vec3::ONE));
        assert_eq!(joined.transparency.at(2, 6), 0.75);
        assert_eq!(join(&[]), None);
    }
}
