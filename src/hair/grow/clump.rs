//! Which strands close up with each other: each belongs to the nearest of some random guides.
//!
//! Near is meant on the surface. To keep the two sides of a thin sheet apart without walking along it, distance is
//! taken in six dimensions: the position, and the normal scaled by the spacing of the guides.

use rayon::prelude::*;

use super::{Grow, GrowError, Key, Root, Roots};

/// Position and scaled normal.
type Place = [f32; 6];

/// The guides, found by place.
pub(super) struct Clumps {
    roots: Vec<Root>,
    /// Length that a unit of normal counts as.
    normal_scale: f64,
    /// A balanced k-d tree in place: the middle of each range divides it along its axis, and the halves are trees.
    nodes: Vec<Node>,
}

struct Node {
    place: Place,
    guide: u32,
    axis: u8,
}

impl Clumps {
    pub fn new(grow: &Grow, roots: &Roots) -> Result<Self, GrowError> {
        let count = grow.count.div_ceil(grow.clump_size);
        let key = |index| Key { seed: grow.seed, stream: Key::GUIDE, index };
        let guides: Vec<Root> = (0..count).into_par_iter().map(|k| roots.sample(key(k))).collect::<Result<_, _>>()?;
        let normal_scale = (roots.area() / f64::from(count)).sqrt();
        let mut nodes: Vec<Node> = (guides.iter().zip(0..))
            .map(|(root, guide)| Node { place: place(root, normal_scale), guide, axis: 0 })
            .collect();
        build(&mut nodes);
        Ok(Self { roots: guides, normal_scale, nodes })
    }

    /// Where a guide stands.
    pub fn root(&self, guide: u32) -> &Root {
        &self.roots[guide as usize]
    }

    /// The guide nearest to a root; of equally near ones, the one of lowest index.
    pub fn nearest(&self, root: &Root) -> u32 {
        let mut best = (f32::INFINITY, u32::MAX);
        search(&self.nodes, &place(root, self.normal_scale), &mut best);
        // Only distances that are not finite leave no guide; the first one is then as good as any.
        if best.1 == u32::MAX { 0 } else { best.1 }
    }
}

fn place(root: &Root, normal_scale: f64) -> Place {
    let (p, n) = (root.position.as_vec3(), (root.normal * normal_scale).as_vec3());
    [p.x, p.y, p.z, n.x, n.y, n.z]
}

fn build(nodes: &mut [Node]) {
    if nodes.len() < 2 {
        return;
    }
    let (mut low, mut high) = (nodes[0].place, nodes[0].place);
    for node in nodes.iter() {
        for axis in 0..6 {
            low[axis] = low[axis].min(node.place[axis]);
            high[axis] = high[axis].max(node.place[axis]);
        }
    }
    let axis = (0..6).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap_or(0);
    let middle = nodes.len() / 2;
    // The index breaks ties, so that the tree does not depend on how the selection works.
    nodes.select_nth_unstable_by(middle, |a, b| a.place[axis].total_cmp(&b.place[axis]).then(a.guide.cmp(&b.guide)));
    nodes[middle].axis = axis as u8;
    let (left, right) = nodes.split_at_mut(middle);
    rayon::join(|| build(left), || build(&mut right[1..]));
}

fn search(nodes: &[Node], at: &Place, best: &mut (f32, u32)) {
    if nodes.is_empty() {
        return;
    }
    let middle = nodes.len() / 2;
    let node = &nodes[middle];
    let distance: f32 = node.place.iter().zip(at).map(|(a, b)| (a - b) * (a - b)).sum();
    if distance < best.0 || (distance == best.0 && node.guide < best.1) {
        *best = (distance, node.guide);
    }
    let axis = usize::from(node.axis);
    let beyond = at[axis] - node.place[axis];
    let (left, right) = (&nodes[..middle], &nodes[middle + 1..]);
    let (near, far) = if beyond < 0.0 { (left, right) } else { (right, left) };
    search(near, at, best);
    // Not `<`: an equally near guide of lower index may lie on the other side.
    if beyond * beyond <= best.0 {
        search(far, at, best);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::primitives::sphere;
    use glam::DVec3;

    #[test]
    fn the_tree_finds_what_a_full_search_finds() {
        let mesh = sphere(DVec3::ZERO, 2.0);
        let roots = Roots::new(&mesh, [-1.0, 1.0], DVec3::Y).unwrap();
        for count in [1, 2, 3, 10, 777] {
            let grow = Grow { count, clump_size: 1, ..Grow::default() };
            let clumps = Clumps::new(&grow, &roots).unwrap();
            for index in 0..300 {
                let root = roots.sample(Key { seed: 9, stream: Key::STRAND, index }).unwrap();
                let at = place(&root, clumps.normal_scale);
                let brute = (0..count).min_by(|&a, &b| {
                    let d = |k: u32| -> f32 {
                        let place = place(clumps.root(k), clumps.normal_scale);
                        place.iter().zip(&at).map(|(a, b)| (a - b) * (a - b)).sum()
                    };
                    d(a).total_cmp(&d(b)).then(a.cmp(&b))
                });
                assert_eq!(Some(clumps.nearest(&root)), brute);
            }
        }
    }
}
