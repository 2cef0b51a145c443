use glam::{DMat3, DVec3};

use super::*;
use crate::occlusion::testing::{ball, direction, model, random};

/// The segments below child `lane` of node `index` at a level.
fn below(tree: &ClusterTree, level: usize, index: usize, lane: usize) -> Vec<(usize, usize)> {
    let size = LANES.pow(level as u32);
    let first = (index * LANES + lane) * size;
    let blocks = first.min(tree.blocks.len())..(first + size).min(tree.blocks.len());
    let lanes = blocks.flat_map(|block| (0..LANES).map(move |lane| (block, lane)));
    lanes.filter(|&(block, lane)| tree.blocks[block].segment[lane] != u32::MAX).collect()
}

#[test]
fn each_segment_is_in_one_lane_and_blocks_are_full() {
    for strands in [1, 3, 4, 5, 33, 513] {
        let model = ball(strands, 8, 0.01, 0.5);
        let tree = ClusterTree::build(&model, Transmittance::Crossing);
        let mut seen: Vec<u32> =
            tree.blocks.iter().flat_map(|block| block.segment).filter(|&s| s != u32::MAX).collect();
        assert_eq!(tree.blocks.len(), seen.len().div_ceil(LANES));
        seen.sort_unstable();
        assert!(seen.iter().copied().eq(0..model.segments() as u32), "{strands} strands");
        assert_eq!(tree.levels.last().map(Vec::len), Some(1));
        for (block, lane) in below(&tree, tree.levels.len() - 1, 0, 0) {
            let (block, s) = (&tree.blocks[block], tree.blocks[block].segment[lane] as usize);
            assert_eq!(block.ends(lane), model.ends(s));
            assert_eq!([block.widths[0][lane], block.widths[1][lane]], model.widths(s));
            assert_eq!((block.opacity[lane], block.strand[lane]), (0.5, model.strand[s]));
        }
    }
    let empty = ClusterTree::build(&HairModel::default(), Transmittance::Crossing);
    assert!(empty.levels.is_empty() && empty.blocks.is_empty());
}

#[test]
fn nodes_hold_what_is_below_them() {
    let model = ball(700, 8, 0.01, 0.3);
    let tree = ClusterTree::build(&model, Transmittance::Crossing);
    assert!(tree.levels.len() >= 3, "{} levels", tree.levels.len());
    for (level, nodes) in tree.levels.iter().enumerate() {
        for (index, node) in nodes.iter().enumerate() {
            for lane in 0..LANES {
                let segments = below(&tree, level, index, lane);
                if segments.is_empty() {
                    assert_eq!((node.mass[lane], node.radius[lane], node.center[0][lane]), (0.0, 0.0, NOWHERE));
                    continue;
                }
                let (mut mass, mut moment, mut tensor) = (0.0, DVec3::ZERO, DMat3::ZERO);
                let at = |(block, lane): (usize, usize)| {
                    let block = &tree.blocks[block];
                    let [a, b] = block.ends(lane).map(Vec3::as_dvec3);
                    let width = 0.5 * f64::from(block.widths[0][lane] + block.widths[1][lane]);
                    (a, b, width * a.distance(b) * f64::from(block.opacity[lane]))
                };
                for (a, b, m) in segments.iter().map(|&s| at(s)) {
                    let u = (b - a).normalize();
                    mass += m;
                    moment += m * 0.5 * (a + b);
                    tensor += m * DMat3::from_cols(u * u.x, u * u.y, u * u.z);
                }
                let centroid = moment / mass;
                let got = DVec3::from_array([0, 1, 2].map(|axis| f64::from(node.center[axis][lane])));
                assert!(got.distance(centroid) < 1e-5, "{got} against {centroid}");
                let radius = f64::from(node.radius[lane]) * (1.0 + 1e-5) + 1e-6;
                let mut spread2 = 0.0;
                for (a, b, m) in segments.iter().map(|&s| at(s)) {
                    assert!(a.distance(got).max(b.distance(got)) <= radius, "outside of the radius");
                    spread2 +=
                        m / mass * ((0.5 * (a + b)).distance_squared(centroid) + (b - a).length_squared() / 12.0);
                    let half = DVec3::from_array([0, 1, 2].map(|axis| f64::from(node.half[axis][lane])));
                    // Within the thickness of the mean segment, end by end.
                    let thickness = f64::from(node.thickness[lane]) * (1.0 + 1e-5) + 1e-6;
                    let beside = |a: DVec3, b: DVec3| (a - got + half).length().max((b - got - half).length());
                    assert!(beside(a, b).min(beside(b, a)) <= thickness, "beside the rod by more than its thickness");
                }
                let extent = (5.0 / 3.0 * spread2).sqrt();
                assert!((f64::from(node.extent[lane]) / extent - 1.0).abs() < 1e-4);
                let [xx, yy, zz, xy, xz, yz] = [0, 1, 2, 3, 4, 5].map(|i| f64::from(node.tensor[i][lane]));
                let t = tensor * (1.0 / mass);
                let want = [t.x_axis.x, t.y_axis.y, t.z_axis.z, t.x_axis.y, t.x_axis.z, t.y_axis.z];
                assert!([xx, yy, zz, xy, xz, yz].iter().zip(want).all(|(got, want)| (got - want).abs() < 1e-5));
                // The mass is lessened by up to .038, the more the less parallel the hair.
                let factor = f64::from(node.mass[lane]) / mass;
                let spread = 1.5
                    * (1.0
                        - want.iter().take(3).map(|t| t * t).sum::<f64>()
                        - 2.0 * want.iter().skip(3).map(|t| t * t).sum::<f64>());
                assert!((factor - 1.0 + 0.038 * spread.clamp(0.0, 1.0)).abs() < 1e-5, "{factor}, spread {spread}");
            }
        }
    }
}

#[test]
fn the_sine_of_the_mean_is_right_over_all_directions() {
    // From all around, hair is seen under the sines of its own angles: their mean against that of the root of the mean square,
    // lessened by `sine_factor`. Exact for parallel hair and for even hair; between them within half of the .038.
    for (spread, bound) in [(0.0, 1e-3), (0.3, 0.01), (1.0, 0.02), (1e3, 5e-3)] {
        let hair: Vec<Vec3> = (0..400).map(|i| (Vec3::Z + spread * direction(&[1, i])).normalize()).collect();
        let mut tensor = [0.0; 6];
        for u in &hair {
            let own = [u.x * u.x, u.y * u.y, u.z * u.z, u.x * u.y, u.x * u.z, u.y * u.z];
            (0..6).for_each(|i| tensor[i] += own[i]);
        }
        let factor = sine_factor(400.0, |i| tensor[i]);
        let (mut exact, mut lump) = (0.0, 0.0);
        for i in 0..2_000 {
            let d = direction(&[2, i]);
            exact += hair.iter().map(|u| u.cross(d).length()).sum::<f32>();
            let [xx, yy, zz, xy, xz, yz] = tensor.map(|t| t / 400.0);
            let along = d.x * d.x * xx
                + d.y * d.y * yy
                + d.z * d.z * zz
                + 2.0 * (d.x * d.y * xy + d.x * d.z * xz + d.y * d.z * yz);
            lump += 400.0 * factor * (1.0 - along).max(0.0).sqrt();
        }
        println!("spread {spread}: {}", lump / exact);
        assert!((lump / exact - 1.0).abs() < bound, "spread {spread}: {}", lump / exact);
    }
}

#[test]
fn the_partition_does_not_depend_on_threads() {
    // Many equal coordinates, where a selection may order at will.
    let points: Vec<Vec3> = (0..2_000)
        .flat_map(|i| {
            let root = Vec3::new((random(&[3, i]) * 4.0).floor(), (random(&[4, i]) * 4.0).floor(), 0.0);
            [root, root + Vec3::Z]
        })
        .collect();
    let model = model(points, (0..=2_000).map(|i| 2 * i).collect(), vec![0.01; 4_000], 0.0);
    let order = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let tree = pool.install(|| ClusterTree::build(&model, Transmittance::Crossing));
        tree.blocks.iter().flat_map(|block| block.segment).collect::<Vec<u32>>()
    };
    assert_eq!(order(1), order(2));
}
