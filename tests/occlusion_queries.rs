//! What must hold for whole queries of the projection, wherever they are asked: the same bits by all instructions, and no preferred axes.

mod common;

use common::models::*;
use glam::{Mat3, Vec3};
use tress::hair::{HairModel, OnStrand};
use tress::occlusion::{
    ClusterTree, DepthMap, Igloo, Instructions, Receiver, Scratch, Span, Transmittance, frame_around,
};

const FACES: u32 = 100;

fn everywhere(model: &HairModel) -> Vec<Receiver> {
    [on_hair(model, 40), on_scalp(20), on_floor(-1.6, 20)].concat()
}

/// A model's tree with maps of a number of cells a side.
struct Query<'a> {
    model: &'a HairModel,
    tree: ClusterTree,
    igloos: [Igloo; 2],
    maps: [DepthMap; 2],
}

impl<'a> Query<'a> {
    fn new(model: &'a HairModel, side: u32) -> Self {
        let igloos = [Igloo::new(Span::Sphere, FACES), Igloo::new(Span::Hemisphere, FACES)];
        let maps = igloos.each_ref().map(|igloo| DepthMap::new(igloo, side));
        Self { model, tree: ClusterTree::build(model, Transmittance::Crossing), igloos, maps }
    }

    /// Γ of each face; `opening` in widths of a cell.
    fn faces(&self, receiver: &Receiver, opening: f32, far: Option<&[f32]>, scratch: &mut Scratch) -> Vec<f32> {
        let kind = usize::from(receiver.on.is_none());
        let (igloo, map) = (&self.igloos[kind], &self.maps[kind]);
        let mut gamma = vec![0.0; igloo.len()];
        self.tree.transmittances(self.model, receiver, map, opening * map.cell_width(), far, &mut gamma, scratch);
        gamma
    }

    fn means(&self, receivers: &[Receiver], opening: f32) -> Vec<f64> {
        let mut scratch = Scratch::default();
        receivers.iter().map(|receiver| mean(&self.faces(receiver, opening, None, &mut scratch))).collect()
    }
}

#[test]
fn all_instructions_give_the_same_bits() {
    let all = Instructions::available();
    println!("{all:?}");
    assert_eq!(all.last(), Some(&Instructions::Baseline));
    for (style, width) in [(Style::Ball, 0.006), (Style::Clumps, 0.01), (Style::Curly, 0.03), (Style::Lock, 0.006)] {
        let model = grow(style, 1_200, 10, width, 0.3);
        for side in [8, 20] {
            let query = Query::new(&model, side);
            let mut scratches: Vec<Scratch> = all.iter().map(|&i| Scratch::with_instructions(i)).collect();
            for (key, receiver) in everywhere(&model).iter().enumerate() {
                let far: Vec<f32> = (0..2 * FACES).map(|face| 3.0 * random(&[60, key as u32, face])).collect();
                let far = [None, Some(&far[..])][key & 1];
                for opening in [0.3, 1.3] {
                    let bits = |scratch: &mut Scratch| {
                        let gamma = query.faces(receiver, opening, far, scratch);
                        gamma.into_iter().map(f32::to_bits).collect::<Vec<u32>>()
                    };
                    let want = bits(&mut Scratch::with_instructions(Instructions::Baseline));
                    for (scratch, instructions) in scratches.iter_mut().zip(&all) {
                        assert!(bits(scratch) == want, "{instructions:?}, {style:?}, {side} cells, {receiver:?}");
                    }
                }
            }
        }
    }
}

/// A model and its receivers under a rotation, or a reflection that leaves frames right-handed.
fn moved(
    model: &HairModel,
    receivers: &[Receiver],
    by: Mat3,
    frame: impl Fn(Mat3) -> Mat3,
) -> (HairModel, Vec<Receiver>) {
    let mut moved = model.clone();
    moved.points.iter_mut().for_each(|point| *point = by * *point);
    let receiver = |r: &Receiver| Receiver { position: by * r.position, on: r.on, frame: frame(r.frame) };
    (moved, receivers.iter().map(receiver).collect())
}

/// Largest difference of a face between two models, the face of the second named by the first's.
fn largest(a: (&HairModel, &[Receiver]), b: (&HairModel, &[Receiver]), face: impl Fn(&Igloo, usize) -> usize) -> f32 {
    let [p, q] = [a.0, b.0].map(|model| Query::new(model, 16));
    let mut scratch = Scratch::default();
    let mut largest = 0.0_f32;
    for (r, s) in a.1.iter().zip(b.1) {
        // Segment by segment: lumps are others when the tree's axes are.
        let [x, y] = [(&p, r), (&q, s)].map(|(query, r)| query.faces(r, 1e-4, None, &mut scratch));
        let igloo = &p.igloos[usize::from(r.on.is_none())];
        largest = (0..x.len()).map(|i| (x[i] - y[face(igloo, i)]).abs()).fold(largest, f32::max);
    }
    largest
}

#[test]
fn turning_everything_changes_nothing() {
    for (style, transparency) in [(Style::Ball, 0.5), (Style::Clumps, 0.0)] {
        let model = grow(style, 600, 10, 0.008, transparency);
        let receivers = everywhere(&model);
        for key in 0..3 {
            let turn = frame_around(direction(&[61, key])) * Mat3::from_rotation_z(6.0 * random(&[62, key]));
            let (turned, moved) = moved(&model, &receivers, turn, |frame| turn * frame);
            // Only rounding differs, measured by 6e-5: a wide ribbon's samples are each in one cell or the next by it.
            let largest = largest((&model, &receivers), (&turned, &moved), |_, face| face);
            println!("{style:?}: {largest:.6} by segments");
            assert!(largest < 1e-3, "{style:?}: {largest}");
            let [a, b] = [(&model, &receivers), (&turned, &moved)].map(|(m, r)| Query::new(m, 16).means(r, 1.3));
            let difference = Difference::between(&b, &a);
            println!("{style:?}: {difference} by lumps");
            assert!(difference.mean.abs() < 0.003 && difference.rms < 0.01, "{style:?}: {difference}");
        }
    }
}

#[test]
fn a_mirror_changes_nothing() {
    let mirror = Mat3::from_diagonal(Vec3::new(1.0, -1.0, 1.0));
    // A frame's y axis is mirrored twice, so that it stays right-handed: faces count the other way around.
    let face = |igloo: &Igloo, face: usize| {
        let ring = igloo.rings()[igloo.ring_of_face(face)];
        (2 * ring.first + ring.count) as usize - 1 - face
    };
    for (style, transparency) in [(Style::Ball, 0.5), (Style::Curly, 0.0)] {
        let model = grow(style, 600, 10, 0.008, transparency);
        let receivers = everywhere(&model);
        let (other, moved) = moved(&model, &receivers, mirror, |frame| mirror * frame * mirror);
        let largest = largest((&model, &receivers), (&other, &moved), face);
        println!("{style:?}: {largest:.6} by segments");
        // Samples of cells on a border between faces all go to one side, the other one in the mirror: measured .0326.
        assert!(largest < 0.04, "{style:?}: {largest}");
        let [a, b] = [(&model, &receivers), (&other, &moved)].map(|(m, r)| Query::new(m, 16).means(r, 1.3));
        let difference = Difference::between(&b, &a);
        println!("{style:?}: {difference} by lumps");
        assert!(difference.mean.abs() < 0.003 && difference.rms < 0.01, "{style:?}: {difference}");
    }
}

#[test]
fn a_query_leaves_nothing_to_the_next() {
    let model = grow(Style::Curly, 600, 10, 0.03, 0.3);
    let query = Query::new(&model, 12);
    let mut kept = Scratch::default();
    for receiver in everywhere(&model) {
        let fresh = query.faces(&receiver, 1.3, None, &mut Scratch::default());
        assert_eq!(query.faces(&receiver, 1.3, None, &mut kept), fresh, "{receiver:?}");
    }
}

#[test]
fn a_receiver_anywhere_gets_a_share() {
    let model = grow(Style::Lock, 600, 20, 0.02, 0.0);
    let query = Query::new(&model, 12);
    let mut scratch = Scratch::default();
    let on = Some(OnStrand { strand: 3, segment: 0, arc: 0.1, width: 0.02 });
    let at_points = model.points.iter().step_by(97).copied();
    for position in at_points.chain([Vec3::splat(1e9), Vec3::splat(-1e-30), Vec3::new(1e12, 0.0, 0.0)]) {
        for receiver in [on, None].map(|on| Receiver { position, on, frame: Mat3::IDENTITY }) {
            let gamma = query.faces(&receiver, 1.3, None, &mut scratch);
            assert!(gamma.iter().all(|gamma| (0.0..=1.0).contains(gamma)), "{receiver:?}: {gamma:?}");
        }
    }
}
