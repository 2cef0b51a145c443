use std::f64::consts::PI;

use glam::Mat3;

use super::*;
use crate::occlusion::Receiver;
use crate::occlusion::lanes::LANES;
use crate::occlusion::testing::{direction as random_direction, rotation};
use crate::occlusion::view::{Above, Directions, Splat, Turned, View, add};

const SPANS: [Span; 2] = [Span::Sphere, Span::Hemisphere];

/// Of tents: the plain one, the same in another way, and the steepest that nodes give.
const STEEPNESSES: [Option<f32>; 3] = [None, Some(1.0), Some(1.75)];

fn whole(span: Span) -> f64 {
    if span == Span::Sphere { 4.0 * PI } else { 2.0 * PI }
}

fn view<D: Directions>(map: &DepthMap, frame: Mat3) -> View<D> {
    View::new(&Receiver { position: Vec3::ZERO, on: None, frame }, map, 0.1)
}

/// Lumps by the kernel for the map's kind, by tents this steep.
fn splat<const N: usize>(
    map: &DepthMap,
    frame: Mat3,
    toward: &[[f32; N]; 3],
    amount: &[f32; N],
    steepness: Option<f32>,
) -> Splat<N> {
    let steepness = steepness.map(|steepness| [steepness; N]);
    match map.span {
        Span::Sphere => view::<Turned>(map, frame).splat(toward, amount, steepness.as_ref()),
        Span::Hemisphere => view::<Above>(map, frame).splat(toward, amount, steepness.as_ref()),
    }
}

/// The cell of a direction by the kernel for the map's kind.
fn cell(map: &DepthMap, frame: Mat3, toward: [f32; 3]) -> u32 {
    let toward = toward.map(|x| [x]);
    let [cell] = match map.span {
        Span::Sphere => view::<Turned>(map, frame).cells(&toward),
        Span::Hemisphere => view::<Above>(map, frame).cells(&toward),
    };
    cell
}

/// What lumps of these amounts in these directions give at each cell.
fn splatted(map: &DepthMap, frame: Mat3, lumps: &[(Vec3, f32)], steepness: Option<f32>) -> Vec<Corners> {
    let mut corners = vec![Corners::default(); map.len()];
    for chunk in lumps.chunks(LANES) {
        let mut toward = [[0.0; LANES]; 3];
        let mut amount = [0.0; LANES];
        for (lane, (direction, lump)) in chunk.iter().enumerate() {
            (0..3).for_each(|axis| toward[axis][lane] = direction[axis]);
            amount[lane] = *lump;
        }
        let splat = splat(map, frame, &toward, &amount, steepness);
        for lane in 0..chunk.len() {
            add(&mut corners[splat.cell[lane] as usize], &splat.amount[lane]);
        }
    }
    corners
}

/// The same, summed up in the cells.
fn gathered(map: &DepthMap, frame: Mat3, lumps: &[(Vec3, f32)], steepness: Option<f32>) -> Vec<f32> {
    let mut cells = vec![0.0; map.len()];
    map.collect(&splatted(map, frame, lumps, steepness), &mut cells);
    if map.span == Span::Sphere {
        fold(map.side, &mut cells);
    }
    cells
}

fn inside(map: &DepthMap) -> impl Iterator<Item = (usize, usize)> {
    let side = map.side;
    (0..side * side).map(move |i| (i % side, i / side))
}

fn index(map: &DepthMap, (column, row): (usize, usize)) -> usize {
    (row + 1) * map.stride() + column + 1
}

#[test]
fn samples_have_the_solid_angle_of_the_whole_and_of_each_face() {
    for span in SPANS {
        for side in [8, 16, 32, 64] {
            let igloo = Igloo::new(span, 100);
            let mut faces = vec![0.0; igloo.len()];
            for (column, row) in (0..side * side).map(|i| (i % side, i / side)) {
                for i in 0..SAMPLES * SAMPLES {
                    let [x, y] = [i % SAMPLES, i / SAMPLES].map(|k| (k as f64 + 0.5) / SAMPLES as f64);
                    let (toward, weight) = direction(span, side, column, row, x, y);
                    faces[igloo.face_of(toward)] += weight;
                }
            }
            // Midpoint rule with step s = 2 / (8 side): s²/24 times the second derivatives of 1/r³, which stay below 30.
            let total: f64 = faces.iter().sum();
            let step = 2.0 / (SAMPLES * side) as f64;
            assert!((total / whole(span) - 1.0).abs() < 60.0 * step * step / 24.0, "{span:?} {side}: {total}");
            // Of a face's n samples the 4 √n on its border are right in the mean only: √(4 √n) / n / √12 is one deviation of it.
            let want = f64::from(igloo.face_solid_angle());
            let worst = faces.iter().map(|face| (face / want - 1.0).abs()).fold(0.0, f64::max);
            let n = (SAMPLES * side).pow(2) as f64 / igloo.len() as f64;
            let bound = 6.0 * n.powf(-0.75);
            println!("{span:?} {side}: worst face off by {worst:.5}, bound {bound:.5}");
            assert!(worst < bound, "{span:?} {side}: a face is off by {worst}");
        }
    }
}

#[test]
fn shares_of_each_face_add_up_to_1_and_faces_fill_the_cells() {
    for span in SPANS {
        for faces in [1, 2, 7, 100, 1000] {
            let igloo = Igloo::new(span, faces);
            for side in [4, 10, 32, 64] {
                let map = DepthMap::new(&igloo, side);
                let mut filled = vec![0.0; map.len()];
                let mut largest = 0.0_f64;
                for face in 0..igloo.len() {
                    let cells = &map.cells[map.first[face] as usize..map.first[face + 1] as usize];
                    let sum: f64 = cells.iter().map(|&(_, share)| f64::from(share)).sum();
                    // A sum of n numbers in f32 is off by n/2 roundings at most.
                    let rounding = cells.len() as f64 * f64::from(f32::EPSILON) + 2e-7;
                    assert!((sum - 1.0).abs() < rounding, "{span:?}, {faces} faces, {side}: {sum}");
                    for &(cell, share) in cells {
                        assert!(share > 0.0 && map.weight[cell as usize] > 0.0);
                        let part = f64::from(share * igloo.face_solid_angle());
                        filled[cell as usize] += part;
                        largest = largest.max(part);
                    }
                }
                // Each cell is filled as far as it is large, where faces hold enough samples to be as large as they should.
                // Samples on the horizon all go to one side.
                let samples = f64::from(map.side()).powi(2) * 64.0 / igloo.len() as f64;
                // Slivers of a cell are left out, of which it may have two.
                let bound = 5.0 * samples.powf(-0.75) + 3.0 / (SAMPLES * map.side) as f64 + 2.0 * f64::from(SLIVER);
                if samples < 300.0 {
                    continue;
                }
                for place in inside(&map) {
                    let size: f64 = (0..4096)
                        .map(|i| {
                            let [x, y] = [i % 64, i / 64].map(|k| (f64::from(k) + 0.5) / 64.0);
                            let at = |x: f64, k: usize| k as f64 + x;
                            solid_angle(span, map.side, at(x, place.0), at(y, place.1)) / 64.0
                        })
                        .sum();
                    let share = filled[index(&map, place)] / size;
                    // One sliver may be left out, as large a part as the cell is smaller than the largest.
                    let bound = bound + f64::from(SLIVER) * largest / size;
                    assert!((share - 1.0).abs() < bound, "{span:?}, {faces} faces, {side}, {place:?}: {share}");
                }
            }
        }
    }
}

#[test]
fn the_cell_of_a_direction_is_the_one_that_it_lies_in() {
    for span in SPANS {
        let igloo = Igloo::new(span, 100);
        for side in [4, 10, 32, 64, 256] {
            let map = DepthMap::new(&igloo, side);
            for place in inside(&map) {
                for (x, y) in [(0.5, 0.5), (0.01, 0.3), (0.99, 0.6), (0.2, 0.01), (0.7, 0.99)] {
                    let (toward, _) = direction(span, map.side, place.0, place.1, x, y);
                    let want = index(&map, place) as u32;
                    assert_eq!(map.cell_of(toward), want, "{span:?} {side}: {toward:?}");
                    let cell = cell(&map, Mat3::IDENTITY, toward.to_array());
                    assert_eq!(cell, want, "{span:?} {side}: {toward:?} by kernel");
                    // And back: the middle's direction is not farther than the cell is wide. The largest are √3 times the mean.
                    let (middle, _) = direction(span, map.side, place.0, place.1, 0.5, 0.5);
                    assert!(middle.distance(toward) < 1.8 * map.cell_width(), "{span:?} {side}: {toward:?}");
                }
                let (middle, _) = direction(span, map.side, place.0, place.1, 0.5, 0.5);
                assert_eq!(map.faces()[index(&map, place)] as usize, igloo.face_of(middle));
            }
        }
    }
}

#[test]
fn lengths_and_frames_of_directions_do_not_matter() {
    for span in SPANS {
        let map = DepthMap::new(&Igloo::new(span, 100), 32);
        for key in 0..2_000 {
            let frame = rotation(&[1, key]);
            let direction = random_direction(&[2, key]);
            let place = |frame: Mat3, d: Vec3| splat(&map, frame, &d.to_array().map(|x| [x]), &[1.0], None);
            let want = place(Mat3::IDENTITY, direction);
            for length in [1e-9, 0.3, 1.0, 7e8] {
                let got = place(frame, frame * direction * length);
                // On the border between two cells' middles rounding decides: then hardly anything falls on either side.
                if got.cell == want.cell {
                    for (got, want) in got.amount[0].iter().zip(&want.amount[0]) {
                        assert!((got - want).abs() < 2e-5, "{direction:?}: {got} against {want}");
                    }
                } else {
                    let edge = |x: f32| x.min(1.0 - x) < 2e-5;
                    let [a, b, c, _] = want.amount[0];
                    let outside = got.amount[0] == [0.0; 4] || want.amount[0] == [0.0; 4];
                    assert!(edge(a + b) || edge(a + c) || outside, "{direction:?}: {want:?} {got:?}");
                }
            }
        }
    }
}

/// Fibonacci's lattice from z = 1 down to `lowest`, each point with its solid angle.
fn lattice(count: u32, lowest: f64) -> Vec<(Vec3, f32)> {
    let each = 2.0 * PI * (1.0 - lowest) / f64::from(count);
    let point = |i: u32| {
        let z = 1.0 - (1.0 - lowest) * (f64::from(i) + 0.5) / f64::from(count);
        let (sin, cos) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
        let r = (1.0 - z * z).sqrt();
        (Vec3::new((r * cos) as f32, (r * sin) as f32, z as f32), each as f32)
    };
    (0..count).map(point).collect()
}

#[test]
fn an_even_sky_gives_an_even_depth() {
    // 200 and more lumps a cell: what they miss of a tent falls with their number, to about .003. The border's cells are among
    // those that are looked at: they have part of their sky from across the octahedron's edges, or from below the horizon.
    for span in SPANS {
        let lumps = lattice(400_000, if span == Span::Sphere { -1.0 } else { -0.8 });
        for frame in [Mat3::IDENTITY, rotation(&[3])] {
            let turned: Vec<(Vec3, f32)> = lumps.iter().map(|&(d, amount)| (frame * d, amount)).collect();
            for (side, steepness) in [8, 14, 32].into_iter().flat_map(|side| STEEPNESSES.map(|s| (side, s))) {
                let map = DepthMap::new(&Igloo::new(span, 100), side);
                let cells = gathered(&map, frame, &turned, steepness);
                let (mut border, mut middle) = (0.0_f32, 0.0_f32);
                for place in inside(&map) {
                    let cell = index(&map, place);
                    let off = (cells[cell] * map.weight[cell] - 1.0).abs();
                    let last = map.side - 1;
                    let at_border = [place.0, place.1].iter().any(|&k| k == 0 || k == last);
                    if at_border { border = border.max(off) } else { middle = middle.max(off) }
                }
                println!("{span:?}, {side}, steepness {steepness:?}: {middle:.5} inside, {border:.5} at the border");
                // A cell's weight is that of the plain tent. A steeper one gathers less from beside the cell, which is not the same
                // where the solid angle has a crease, at the octahedron's edges: measured .045 with 8 cells, .015 with 32.
                let steep = if steepness == Some(1.75) { 0.36 / side as f32 } else { 0.0 };
                assert!(
                    middle.max(border) < 0.01 + steep,
                    "{span:?}, {side}, {steepness:?}: {middle} inside, {border} at the border"
                );
            }
        }
    }
}

#[test]
fn nothing_is_lost_on_the_sphere() {
    let frame = rotation(&[4]);
    for (side, steepness) in [4, 6, 16, 64].into_iter().flat_map(|side| STEEPNESSES.map(|s| (side, s))) {
        let map = DepthMap::new(&Igloo::new(Span::Sphere, 100), side);
        let lumps: Vec<(Vec3, f32)> = (0..10_000).map(|i| (random_direction(&[5, i]), 1.0 + (i % 7) as f32)).collect();
        let sum = |cells: &[f32]| cells.iter().map(|&x| f64::from(x)).sum::<f64>();
        let cells = gathered(&map, frame, &lumps, steepness);
        let want: f64 = lumps.iter().map(|&(_, amount)| f64::from(amount)).sum();
        // 10,000 lumps in a few cells: each addition rounds by 6e-8 of the cell at most.
        assert!((sum(&cells) / want - 1.0).abs() < 1e-5, "{side}: {} of {want}", sum(&cells));
        // What is inside has it all: the border is empty.
        for (cell, amount) in cells.iter().enumerate().filter(|(cell, _)| map.weight[*cell] == 0.0) {
            assert_eq!(*amount, 0.0, "{side}: cell {cell}");
        }
    }
}

#[test]
fn a_lump_on_edges_corners_and_poles_is_spread_evenly() {
    // Everything that maps one octahedron on itself maps the cells on each other: equal amounts in as many cells as there are around.
    let map = DepthMap::new(&Igloo::new(Span::Sphere, 100), 10);
    let alone = |d: Vec3| {
        let cells = gathered(&map, Mat3::IDENTITY, &[(d, 1.0)], None);
        assert!((cells.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{d:?}");
        let mut given: Vec<f32> = cells.into_iter().filter(|&x| x > 1e-6).collect();
        given.sort_by(f32::total_cmp);
        given
    };
    let close =
        |got: &[f32], want: &[f32]| got.len() == want.len() && got.iter().zip(want).all(|(a, b)| (a - b).abs() < 2e-6);
    for axis in Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]) {
        let given = alone(axis);
        // At the square's middle and corners four cells meet; in the middle of its sides two cells and their images, twice each.
        let want: &[f32] = if axis.z != 0.0 { &[0.25; 4] } else { &[0.5; 2] };
        assert!(close(&given, want), "{axis:?}: {given:?}");
    }
    for key in 0..200 {
        // On the four edges around the horizon: half to either side of the square's border.
        let t = crate::occlusion::testing::random(&[6, key]);
        let d = Vec3::new(t.copysign(if key & 1 == 0 { 1.0 } else { -1.0 }), 1.0 - t, 0.0);
        let (above, below) = (alone(d + Vec3::Z * 1e-6), alone(d - Vec3::Z * 1e-6));
        assert!((1..=4).contains(&above.len()), "{d:?}: {above:?}");
        assert!(above.iter().zip(&below).all(|(a, b)| (a - b).abs() < 1e-4), "{d:?}: {above:?} {below:?}");
    }
}

#[test]
fn the_border_goes_to_the_cells_across_the_edges() {
    for side in [4, 10, 16] {
        let map = DepthMap::new(&Igloo::new(Span::Sphere, 40), side);
        let home = home(Span::Sphere, map.side);
        for (cell, &home) in home.iter().enumerate() {
            let mut cells = vec![0.0; map.len()];
            cells[cell] = 1.0;
            fold(map.side, &mut cells);
            assert_eq!(cells[home as usize], 1.0, "{side}: cell {cell}");
            assert_eq!(map.face[cell], map.face[home as usize]);
        }
    }
}

#[test]
fn directions_that_are_none_fall_nowhere() {
    let odd = [0.0, -0.0, 1.0, -1.0, 1e-38, -1e-45, 1e18, -3e38, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
    for span in SPANS {
        let map = DepthMap::new(&Igloo::new(span, 10), 12);
        for frame in [Mat3::IDENTITY, rotation(&[7])] {
            for (i, steepness) in (0..odd.len().pow(3)).flat_map(|i| STEEPNESSES.map(|steepness| (i, steepness))) {
                let d = [i, i / odd.len(), i / odd.len() / odd.len()].map(|k| odd[k % odd.len()]);
                let splat = splat(&map, frame, &d.map(|x| [x]), &[2.0], steepness);
                assert!((splat.cell[0] as usize) + map.stride() + 1 < map.len(), "{d:?}: {splat:?}");
                let sum: f32 = splat.amount[0].iter().sum();
                assert!(splat.amount[0].iter().all(|&x| (0.0..=2.0).contains(&x)), "{d:?}: {splat:?}");
                // All of it, or nothing.
                assert!(sum == 0.0 || (sum - 2.0).abs() < 1e-5, "{d:?}: {splat:?}");
                if d.iter().any(|x| x.is_nan()) || d == [0.0; 3] {
                    assert_eq!(sum, 0.0, "{d:?}: {splat:?}");
                }
                let cell = cell(&map, frame, d);
                assert!((cell as usize) < map.len(), "{d:?}: {cell}");
                assert!((map.cell_of(Vec3::from_array(d)) as usize) < map.len(), "{d:?}");
            }
        }
    }
}

#[test]
fn far_below_the_horizon_falls_nowhere() {
    let map = DepthMap::new(&Igloo::new(Span::Hemisphere, 50), 16);
    for key in 0..1_000 {
        let d = random_direction(&[8, key]);
        // One border's cell is as high as two widths of a cell where they are largest.
        let sum: f32 = gathered(&map, Mat3::IDENTITY, &[(d, 1.0)], None).iter().sum();
        if d.z > 0.0 {
            assert!((sum - 1.0).abs() < 1e-6, "{d:?}: {sum}");
        } else if d.z < -2.0 * map.cell_width() {
            assert_eq!(sum, 0.0, "{d:?}");
        }
    }
}

#[test]
fn an_empty_map_lets_all_through_and_a_full_one_nothing() {
    for span in SPANS {
        let igloo = Igloo::new(span, 50);
        let map = DepthMap::new(&igloo, 12);
        let (mut buffer, mut gamma) = (Vec::new(), vec![0.0; igloo.len()]);
        map.finish(&vec![Corners::default(); map.len()], None, &mut buffer, &mut gamma);
        // Shares add up to 1 to rounding, never to more.
        assert!(gamma.iter().all(|&gamma| (1.0 - 1e-6..=1.0).contains(&gamma)), "{gamma:?}");
        map.finish(&vec![[1e3; 4]; map.len()], None, &mut buffer, &mut gamma);
        assert!(gamma.iter().all(|&gamma| gamma == 0.0), "{gamma:?}");
        // An even depth of 1 gives 1/e in every face.
        let frame = Mat3::IDENTITY;
        let lumps = lattice(400_000, if span == Span::Sphere { -1.0 } else { -0.8 });
        map.finish(&splatted(&map, frame, &lumps, None), None, &mut buffer, &mut gamma);
        assert!(gamma.iter().all(|gamma| (gamma * 1.0_f32.exp() - 1.0).abs() < 0.01), "{gamma:?}");
    }
}
