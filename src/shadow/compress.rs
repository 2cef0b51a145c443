//! Compression of a transmittance function of depth (Lokovic and Veach 2000, section 3.2), to within a given error at every depth.

use serde::Serialize;

/// A node of a piecewise linear function: depth, and the share of light that is left there. Two nodes at one depth make a step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Node {
    pub depth: f32,
    pub left: f32,
}

/// Adds to `nodes` a function that differs from the given one by at most `error` at any depth, and never rises.
///
/// `steps` are the depths at which the function falls, ascending and each once, and what is left behind them; before the first it is 1.
///
/// From the last node a wedge of slopes is kept that stay within the error of all that came since; where it becomes empty, the middle of
/// it ends in the next node. The bound holds between steps too: there both functions are linear, and it holds at both ends.
pub fn compress(steps: &[Node], error: f32, nodes: &mut Vec<Node>) {
    let Some(first) = steps.first() else { return };
    let mut wedge = Wedge::at(f64::from(first.depth), 1.0);
    nodes.push(Node { depth: first.depth, left: 1.0 });
    // Rounding to f32 of what is stored takes its share of the error, 2^-24 of depth aside.
    let error = (f64::from(error) - 1e-7).max(0.0);
    let mut before = 1.0;
    for step in steps {
        for left in [before, f64::from(step.left)] {
            if !wedge.narrow(f64::from(step.depth), left, error) {
                if wedge.last > wedge.depth {
                    wedge = wedge.end();
                    nodes.push(wedge.node());
                }
                if !wedge.narrow(f64::from(step.depth), left, error) {
                    // A step higher than the error: both its ends are nodes.
                    wedge = Wedge::at(f64::from(step.depth), left);
                    nodes.push(wedge.node());
                }
            }
        }
        before = f64::from(step.left);
    }
    if wedge.last > wedge.depth {
        nodes.push(wedge.end().node());
    }
}

/// The slopes that a line from a node may have.
#[derive(Clone, Copy, Debug)]
struct Wedge {
    depth: f64,
    left: f64,
    low: f64,
    high: f64,
    /// The greatest depth at which it was narrowed.
    last: f64,
}

impl Wedge {
    fn at(depth: f64, left: f64) -> Self {
        // Light never comes back: no line rises. A line that falls no steeper than needed is always among them, as the function itself never rises.
        Self { depth, left, low: f64::NEG_INFINITY, high: 0.0, last: depth }
    }

    /// Keeps the slopes that pass within `error` of a value; false, and nothing is kept, if there is none.
    fn narrow(&mut self, depth: f64, value: f64, error: f64) -> bool {
        let run = depth - self.depth;
        if run <= 0.0 {
            return (self.left - value).abs() <= error;
        }
        // Below 0 no line may end: to lift its end there afterwards would turn it out of the wedge.
        let low = self.low.max(((value - error).max(0.0) - self.left) / run);
        let high = self.high.min((value + error - self.left) / run);
        if low > high {
            return false;
        }
        (self.low, self.high, self.last) = (low, high, depth);
        true
    }

    /// The end of the middle line, as the beginning of the next.
    fn end(&self) -> Self {
        let slope = 0.5 * (self.low + self.high);
        Self::at(self.last, (self.left + slope * (self.last - self.depth)).max(0.0))
    }

    fn node(&self) -> Node {
        Node { depth: self.depth as f32, left: self.left as f32 }
    }
}

/// The value of a function before a depth: a step exactly there is not yet taken.
pub(super) fn value(nodes: &[Node], depth: f32) -> f32 {
    let next = nodes.partition_point(|node| node.depth < depth);
    match (next.checked_sub(1).map(|i| nodes[i]), nodes.get(next)) {
        (None, _) => 1.0,
        (Some(last), None) => last.left,
        (Some(a), Some(b)) => a.left + (b.left - a.left) * ((depth - a.depth) / (b.depth - a.depth)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The function itself, before and behind a depth.
    fn exact(steps: &[Node], depth: f32) -> [f32; 2] {
        let left = |count: usize| if count == 0 { 1.0 } else { steps[count - 1].left };
        [steps.partition_point(|s| s.depth < depth), steps.partition_point(|s| s.depth <= depth)].map(left)
    }

    fn steps(parts: &[(f32, f32)]) -> Vec<Node> {
        let (mut depth, mut left) = (-1.0, 1.0);
        parts
            .iter()
            .map(|&(gap, share)| {
                depth += gap;
                left *= share;
                Node { depth, left }
            })
            .collect()
    }

    proptest! {
        #[test]
        fn the_error_holds_at_every_depth(
            parts in proptest::collection::vec((0.001_f32..0.3, 0.0_f32..1.0), 1..60),
            gentle in any::<bool>(),
            error in prop_oneof![Just(0.0_f32), 1e-4_f32..0.2],
        ) {
            let parts: Vec<_> = parts.iter().map(|&(gap, s)| (gap, if gentle { 1.0 - 0.05 * s } else { s })).collect();
            let steps = steps(&parts);
            let mut nodes = Vec::new();
            compress(&steps, error, &mut nodes);
            prop_assert!(nodes.windows(2).all(|n| n[0].depth <= n[1].depth && n[0].left >= n[1].left), "{nodes:?}");
            // Against both neighbours of each step, each node, and between.
            let places = steps.iter().chain(&nodes).map(|n| n.depth);
            for depth in places.flat_map(|d| [d, d.next_up(), d + 0.01, d + 0.1]) {
                let [before, _] = exact(&steps, depth);
                let found = value(&nodes, depth);
                // Rounding of a node's depth shifts a line of slope up to 1 / 0.001 by 1e-7 of it.
                prop_assert!((found - before).abs() <= error + 2e-4, "{depth}: {found} for {before}");
            }
        }
    }

    #[test]
    fn a_larger_error_takes_fewer_nodes() {
        let steps = steps(&(0..400).map(|i| (0.01, 1.0 - 0.02 * (i as f32 * 0.7).sin().powi(2))).collect::<Vec<_>>());
        let count = |error| {
            let mut nodes = Vec::new();
            compress(&steps, error, &mut nodes);
            nodes.len()
        };
        let counts = [0.0, 0.001, 0.01, 0.1].map(count);
        assert!(counts.windows(2).all(|c| c[1] < c[0]), "{counts:?}");
        assert!(counts[0] >= 800 - 1 && counts[2] < 40, "{counts:?}");
    }

    #[test]
    fn an_opaque_step_stays_one() {
        let mut nodes = Vec::new();
        compress(&[Node { depth: 0.5, left: 0.0 }], 0.01, &mut nodes);
        assert_eq!(nodes, [Node { depth: 0.5, left: 1.0 }, Node { depth: 0.5, left: 0.0 }]);
        assert_eq!([0.4, 0.5, 0.6].map(|d| value(&nodes, d)), [1.0, 1.0, 0.0]);
        assert_eq!(value(&[], 3.0), 1.0);
    }
}
