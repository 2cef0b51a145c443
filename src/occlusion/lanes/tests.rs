use glam::{DMat3, DVec3};

use super::*;
use crate::occlusion::testing::{ball, direction, model, random, receiver, signed};
use crate::occlusion::view::{Turned, WIDE};
use crate::occlusion::{ClusterTree, DepthMap, Igloo, Span, Transmittance};

fn map(side: u32) -> DepthMap {
    DepthMap::new(&Igloo::new(Span::Sphere, 100), side)
}

fn center(node: &Node, lane: usize) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| f64::from(node.center[axis][lane])))
}

fn half(node: &Node, lane: usize) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| f64::from(node.half[axis][lane])))
}

/// Squared sine of the mean between hair and a direction, 1 - dᵀ T d / d².
fn sine2(tensor: &[Lanes; 6], lane: usize, d: DVec3) -> f64 {
    let [xx, yy, zz, xy, xz, yz] = [0, 1, 2, 3, 4, 5].map(|i| f64::from(tensor[i][lane]));
    let t = DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz));
    1.0 - d.dot(t * d) / d.length_squared()
}

/// Distance from the origin to the rod c - h .. c + h.
fn rod_distance(c: DVec3, h: DVec3) -> f64 {
    let s = if h.length_squared() > 0.0 { (-c.dot(h) / h.length_squared()).clamp(-1.0, 1.0) } else { -1.0 };
    (c + s * h).length()
}

/// Positions inside, between and far from the hair of a ball.
fn positions() -> Vec<Vec3> {
    let inside = (0..24).map(|key| 2.0 * Vec3::new(signed(&[1, key]), signed(&[2, key]), signed(&[3, key])));
    inside.chain([Vec3::ZERO, Vec3::new(40.0, -7.0, 3.0), Vec3::new(0.0, 0.0, 1e4)]).collect()
}

/// Thin bundles of nearly parallel hair, and hair in all directions.
fn bundles() -> crate::hair::HairModel {
    let (mut points, mut first) = (Vec::new(), vec![0]);
    for strand in 0..1_024_u32 {
        let bundle = strand / 64;
        let root = direction(&[30, bundle]) + 0.003 * direction(&[31, strand]);
        let along = direction(&[32, if bundle < 12 { bundle } else { strand }]) + 0.01 * direction(&[33, strand]);
        points.extend((0..4).map(|i| root + 0.2 * i as f32 * along));
        first.push(points.len() as u32);
    }
    let widths = vec![0.002; points.len()];
    model(points, first, widths, 0.4)
}

#[test]
fn exponentials_are_right_to_1e_5() {
    let depths: Vec<f32> = (0..=870_000).map(|i| 1e-4 * i as f32).collect();
    let mut got = depths.clone();
    exponentials(&mut got);
    let mut worst = 0.0_f64;
    for (&x, &y) in depths.iter().zip(&got) {
        if x < 87.0 {
            worst = worst.max((f64::from(y) / (-f64::from(x)).exp() - 1.0).abs());
        } else {
            assert_eq!(y, 0.0, "{x}");
        }
        assert!((0.0..=1.0).contains(&y), "{x}: {y}");
    }
    println!("worst relative error {worst:.2e}");
    assert!(worst < 1e-5, "{worst}");
    // What is no depth lets all or nothing through, and the result is a share in any case.
    let mut odd = [0.0, -0.0, -1.0, -3e38, f32::NEG_INFINITY, 87.0, 1e10, f32::MAX, f32::INFINITY, f32::NAN, 1e-45];
    exponentials(&mut odd);
    assert_eq!(odd, [1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn exponentials_never_rise_by_more_than_rounding() {
    let mut depths: Vec<f32> = (0..200_000).map(|i| 1e-5 * i as f32).collect();
    exponentials(&mut depths);
    assert!(depths.windows(2).all(|pair| pair[1] <= pair[0] * (1.0 + 4.0 * f32::EPSILON)));
}

#[test]
fn saturation_is_the_logarithm() {
    // The series' first missing term is k¹⁰/11 with k = x / (2 - x): 2.2e-6 of 1.39 at 1/2, .0042 of 2.01 at .8. No share is above .95.
    for i in 1..=950 {
        let x = i as f32 * 1e-3;
        let want = -(-f64::from(x)).ln_1p() / f64::from(x);
        let error = f64::from(saturation(x)) / want - 1.0;
        let bound = if x <= 0.5 {
            2e-6
        } else if x <= 0.8 {
            2.2e-3
        } else {
            0.074
        };
        assert!(error.abs() < bound, "{x}: {error:e}");
        // What is left out is positive: hair is never too dark for it.
        assert!(error < 5e-7, "{x}: {error:e}");
    }
    assert_eq!(saturation(0.0), 1.0);
}

#[test]
fn lumps_of_nodes_have_the_solid_angle_of_their_hair_times_opacity() {
    let model = bundles();
    let tree = ClusterTree::build(&model, Transmittance::Crossing);
    let map = map(16);
    let mut lumps = [0; 4];
    for (key, position) in positions().into_iter().enumerate() {
        let receiver = receiver(position, key as u32);
        for opening in [0.05, 0.3] {
            let view = View::<Turned>::new(&receiver, &map, opening);
            for node in tree.levels.iter().flatten() {
                let ((splat, distance2), division) = super::node(&view, node);
                for (lane, amount) in splat.amount.iter().enumerate() {
                    let d = center(node, lane) - position.as_dvec3();
                    let mass = f64::from(node.mass[lane]);
                    let got: f64 = amount.iter().map(|&x| f64::from(x)).sum();
                    if mass == 0.0 {
                        // A lane that holds nothing is one lump of nothing.
                        assert_eq!((got, division.one >> lane & 1), (0.0, 1));
                        continue;
                    }
                    assert!((f64::from(distance2[lane]) / d.length_squared() - 1.0).abs() < 1e-6);
                    if division.one >> lane & 1 == 1 {
                        // The sine is a root: its square is right to rounding.
                        let scale = mass / d.length_squared();
                        let want = sine2(&node.tensor, lane, d).max(0.0);
                        let error = (got / scale).powi(2) - want;
                        assert!(error.abs() < 4e-6, "{:e} against {want:e}", (got / scale).powi(2));
                    } else {
                        assert_eq!(got, 0.0, "of what is no lump");
                    }
                    // How it is taken, where rounding does not decide.
                    let opening = f64::from(opening);
                    let lump = (f64::from(node.extent[lane]) / (opening * d.length()))
                        .max(f64::from(node.radius[lane]) / (0.9 * d.length()));
                    let nearest = rod_distance(d, half(node, lane)) * opening;
                    let thick = f64::from(node.thickness[lane]) / nearest;
                    let long = half(node, lane).length() / nearest;
                    let decided = |x: f64| (x - 1.0).abs() > 1e-4;
                    if ![lump, thick, long, long / 2.0, long / 4.0, long / 8.0].into_iter().all(decided) {
                        continue;
                    }
                    let want = if lump < 1.0 {
                        1
                    } else if thick > 1.0 || long > 8.0 {
                        NEAR
                    } else {
                        [1.0, 2.0, 4.0, 8.0].into_iter().find(|&n| long < n).map_or(NEAR, |n| n as u32)
                    };
                    assert_eq!(division.lumps[lane], want, "lump {lump}, thick {thick}, long {long}");
                    let bits = (division.one >> lane & 1, division.near >> lane & 1);
                    assert_eq!(bits, (u32::from(want == 1), u32::from(want == NEAR)));
                    lumps[match want {
                        1 => 0,
                        NEAR => 3,
                        2 => 1,
                        _ => 2,
                    }] += 1;
                }
            }
        }
    }
    println!("one, two, more, near: {lumps:?}");
    assert!(lumps.iter().all(|&count| count > 20), "{lumps:?}");
}

#[test]
fn a_rod_s_lumps_have_the_formula_s_amounts_and_sum_to_one_lump_of_it_far_away() {
    let model = ball(500, 8, 0.01, 0.4);
    let tree = ClusterTree::build(&model, Transmittance::Crossing);
    let map = map(16);
    for (key, position) in positions().into_iter().enumerate() {
        let view = View::<Turned>::new(&receiver(position, key as u32), &map, 0.2);
        for node in tree.levels.iter().flatten() {
            let rods = Rods { center: node.center, half: node.half, mass: node.mass, tensor: node.tensor };
            for (s, share) in [(0.0, 1.0), (-0.5, 0.5), (0.75, 0.25), (0.125, 0.125)] {
                let (splat, _) = rod_lumps(&view, &rods, s, share, &[1; LANES]);
                for lane in (0..LANES).filter(|&lane| node.mass[lane] > 0.0) {
                    let d = center(node, lane) + f64::from(s) * half(node, lane) - position.as_dvec3();
                    let got: f64 = splat.amount[lane].iter().map(|&x| f64::from(x)).sum();
                    let scale = f64::from(node.mass[lane] * share) / d.length_squared();
                    let error = (got / scale).powi(2) - sine2(&node.tensor, lane, d).max(0.0);
                    // A lump's place is the sum of two products, rounded: more where it is next to the point.
                    let near = 1.0 + 4.0 / d.length();
                    assert!(error.abs() < 4e-6 * near, "{error:e} at {}", d.length());
                }
            }
        }
    }
}

/// Solid angle of a thin ribbon that faces the origin, its width linear along it: ∫ w h / r³ ds.
fn ribbon(a: DVec3, b: DVec3, widths: [f64; 2]) -> f64 {
    let length = a.distance(b);
    let axis = (b - a) / length;
    let (from, to) = (a.dot(axis), b.dot(axis));
    let h = (a - from * axis).length();
    let taper = (widths[1] - widths[0]) / length;
    let foot = widths[0] - taper * from;
    let (r0, r1) = (a.length(), b.length());
    foot / h * (to / r1 - from / r0) - taper * h * (1.0 / r1 - 1.0 / r0)
}

#[test]
fn lumps_of_segments_sum_to_the_solid_angle_of_the_ribbon() {
    // Cells of .22 to .06 radians; a piece's half length x is at most the view's stride. The midpoint rule is off by the second derivative of
    // h / r³ over the piece, which is at most 12 h / r⁵: (2x)² / 24 * 12 = 2 x² of it at most, at its nearest point; and, with the width
    // falling by a half, by 2 * 2/3 / (2x) * 3 * (2x)² / 24 = x / 3.
    for side in [16, 32, 64] {
        let map = map(side);
        let view = View::<Turned>::new(&receiver(Vec3::ZERO, side), &map, 0.2);
        let (mut counts, mut worst) = ([0; 4], 0.0_f64);
        for key in 0..4_000 {
            let mut block = Block::default();
            for lane in 0..LANES {
                let number = |i: u32| signed(&[4, side, key, lane as u32, i]);
                let length = 10.0_f32.powf(-1.5 + 1.2 * number(10));
                for axis in 0..3 {
                    block.a[axis][lane] = number(axis as u32);
                    block.b[axis][lane] = block.a[axis][lane] + length * number(3 + axis as u32);
                }
                block.widths = [[1e-4; LANES], [5e-5; LANES]];
                block.opacity[lane] = 0.01 + 0.9 * random(&[5, key, lane as u32]);
                block.segment[lane] = lane as u32;
            }
            let ((lump, _), division) = super::block(&view, &block, u32::MAX);
            for (kind, lumps) in [1, 2, 4, 8].into_iter().enumerate() {
                let mut sums = [0.0_f64; LANES];
                let wanted = division.lumps.map(|count| u32::from(count == lumps));
                for i in 0..lumps {
                    let share = 1.0 / lumps as f32;
                    let (splat, _) = block_lumps(&view, &block, (i as f32 + 0.5) * share, share, &wanted);
                    if lumps == 1 {
                        assert_eq!(splat, lump);
                    }
                    for (sum, amount) in sums.iter_mut().zip(&splat.amount) {
                        *sum += amount.iter().map(|&x| f64::from(x)).sum::<f64>();
                    }
                }
                for lane in (0..LANES).filter(|&lane| wanted[lane] == 0) {
                    assert_eq!(sums[lane], 0.0, "of what is not wanted");
                }
                for lane in (0..LANES).filter(|&lane| division.lumps[lane] == lumps) {
                    let [a, b] = block.ends(lane).map(Vec3::as_dvec3);
                    let [w0, w1] = [0, 1].map(|end| f64::from(block.widths[end][lane]));
                    // Hair this thin is not saturated, but for what a strand takes of its cell.
                    let want = ribbon(a, b, [w0, w1]) * f64::from(block.opacity[lane]);
                    let nearest = rod_distance(0.5 * (a + b), 0.5 * (b - a));
                    let x = 0.5 * a.distance(b) / f64::from(lumps) / nearest;
                    assert!(x < 1.001 * f64::from(view.stride2.sqrt()));
                    let saturation = f64::from(view.crossing(1e-4 / nearest as f32));
                    let error = sums[lane] / want - 1.0;
                    assert!(
                        error.abs() < 2.2 * x * x + 0.37 * x + saturation + 1e-4,
                        "{a:?} {b:?}, {lumps} lumps: {error}"
                    );
                    worst = worst.max(error.abs());
                    counts[kind] += 1;
                }
            }
            // Those of the own strand are never lumps, whatever their size, but their number is known.
            let ((none, _), own) = super::block(&view, &block, 0);
            assert_eq!((own.one, own.near, own.used), (0, 0, ALL));
            assert_eq!(own.lumps, division.lumps.map(|lumps| lumps + OWN));
            assert_eq!(none.amount, [[0.0; 4]; LANES]);
        }
        println!("{side}: {counts:?} in 1, 2, 4, 8 lumps, worst {worst:.4}");
        assert!(counts.iter().all(|&count| count > 20), "{counts:?}");
    }
}

#[test]
fn what_is_wider_than_a_part_of_a_cell_is_near() {
    let map = map(16);
    let view = View::<Turned>::new(&receiver(Vec3::ZERO, 1), &map, 0.2);
    let wide = WIDE * map.cell_width();
    for (width, near) in [(0.99 * wide, 0), (1.01 * wide, 1)] {
        let mut block = Block { segment: [u32::MAX; LANES], strand: [7; LANES], ..Block::default() };
        (block.a[0][0], block.b[0][0], block.b[1][0]) = (1.0, 1.0, 0.01);
        (block.widths[0][0], block.widths[1][0], block.segment[0]) = (width, width, 3);
        let (_, division) = super::block(&view, &block, u32::MAX);
        assert_eq!((division.near, division.one, division.used), (near, 1 - near, 1), "{width}");
        // Lanes that hold no segment are taken neither way.
        assert_eq!((division.near | division.one) & !1, 0);
    }
}
