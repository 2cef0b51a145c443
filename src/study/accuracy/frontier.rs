//! Which settings are worth their time.

/// The Pareto frontier: the indices of those (time, error) that no other beats in one without losing in the other, by time.
pub(super) fn frontier(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a][0].total_cmp(&points[b][0]).then(points[a][1].total_cmp(&points[b][1])));
    let mut best = f64::INFINITY;
    order.retain(|&i| {
        let better = points[i][1] < best;
        best = best.min(points[i][1]);
        better
    });
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_cheapest_of_each_error_remains() {
        let points = [[2.0, 0.5], [1.0, 1.0], [3.0, 0.6], [2.0, 0.7], [4.0, 0.1]];
        assert_eq!(frontier(&points), [1, 0, 4]);
        assert!(frontier(&[]).is_empty());
    }

    proptest! {
        #[test]
        fn nothing_beats_the_frontier(points in proptest::collection::vec((0.0_f64..9.0, 0.0_f64..9.0), 1..40)) {
            let points: Vec<[f64; 2]> = points.into_iter().map(|(a, b)| [a, b]).collect();
            let front = frontier(&points);
            let beats = |a: &[f64; 2], b: &[f64; 2]| a[0] <= b[0] && a[1] <= b[1] && a != b;
            for (i, point) in points.iter().enumerate() {
                let beaten = points.iter().any(|other| beats(other, point));
                prop_assert!(front.contains(&i) != beaten || points.iter().filter(|p| *p == point).count() > 1);
            }
        }
    }
}
