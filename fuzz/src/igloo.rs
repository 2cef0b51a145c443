//! The projection of hair on any numbers.

use glam::{Mat3, Vec3};
use tress::hair::{Attribute, HairModel, OnStrand, Strands};
use tress::occlusion::{
    ClusterTree, Fineness, Igloo, Instructions, Projection, Receiver, Scratch, Span, ThinnedSegments, Thinning,
    Transmittance, frame_around, layer,
};
use tress::scene::space::RenderSpace;
use tress::transform::transform_strands;

/// The bytes as a stream of what is asked of them; zeros behind their end.
struct Stream<'a>(&'a [u8]);

impl Stream<'_> {
    fn byte(&mut self) -> u8 {
        let (first, rest) = self.0.split_first().map_or((0, self.0), |(&first, rest)| (first, rest));
        self.0 = rest;
        first
    }

    /// Any bit pattern.
    fn float(&mut self) -> f32 {
        f32::from_le_bytes([self.byte(), self.byte(), self.byte(), self.byte()])
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.float(), self.float(), self.float())
    }
}

/// Points of a model at most: enough for a tree of two levels, few enough for thousands of models a second.
const POINTS: usize = 400;

/// Strands of up to nine points with any numbers, as a scene lets them pass: what is not finite or negative is cut, a
/// transparency is from 0 to 1. In render space, or, where `raw`, anywhere within a million of it.
fn model(stream: &mut Stream<'_>, raw: bool) -> HairModel {
    let (mut points, mut widths, mut transparencies, mut first) = (vec![], vec![], vec![], vec![0]);
    while !stream.0.is_empty() && points.len() < POINTS {
        for _ in 0..2 + stream.byte() % 8 {
            points.push(stream.vector());
            widths.push(stream.float());
            let transparency = stream.float();
            transparencies.push(if transparency.is_finite() { transparency.clamp(0.0, 1.0) } else { 0.0 });
        }
        first.push(points.len() as u32);
    }
    let mut strands = Strands {
        points,
        first,
        width: Attribute::PerPoint(widths),
        color: Attribute::Uniform(Vec3::ONE),
        transparency: Attribute::PerPoint(transparencies),
    };
    strands.cut_damaged().expect("the layout is sound");
    if let Some([low, high]) = strands.bounds().filter(|_| !raw) {
        let space = RenderSpace::around(low.as_dvec3(), high.as_dvec3());
        transform_strands(&space.from_scene(), &mut strands);
        strands.cut_damaged().expect("the layout is still sound");
    }
    let near = |point: &Vec3| point.abs().max_element() <= 1e6;
    let inside: Vec<bool> = strands.iter().map(|points| points.iter().all(near)).collect();
    strands.retain(|strand| inside[strand]);
    let mut model = HairModel::default();
    model.add(&strands, 0);
    model
}

/// Where Γ is asked: on the hair, or anywhere.
fn receiver(stream: &mut Stream<'_>, model: &HairModel) -> Receiver {
    let (kind, which) = (stream.byte(), usize::from(stream.byte()));
    let (position, normal) = (stream.vector(), stream.vector());
    let on_hair = |at: f32| {
        let sample = model.sample(which % model.segments(), at);
        (sample.position, Some(sample.on))
    };
    let (position, on): (Vec3, Option<OnStrand>) = match kind % 4 {
        0 if !model.is_empty() => on_hair(0.5),
        1 if !model.is_empty() => on_hair(0.0),
        _ if position.abs().max_element() <= 1e6 => (position, None),
        _ => (Vec3::ZERO, None),
    };
    let frame = normal.as_dvec3().try_normalize().map_or(Mat3::IDENTITY, |normal| frame_around(normal.as_vec3()));
    Receiver { position, on, frame }
}

/// Γ of each face is a number from 0 to 1.
fn assert_sound(gamma: &[f32], what: &str) {
    for (face, value) in gamma.iter().enumerate() {
        assert!((0.0..=1.0).contains(value), "{what}: face {face} is {value}");
    }
}

/// Hair of any numbers, projected from a point: in clusters with each kind of vector code, and segment by segment in both ways.
pub fn igloo(data: &[u8]) {
    let mut stream = Stream(data);
    let how = stream.byte();
    let span = if how & 1 == 0 { Span::Sphere } else { Span::Hemisphere };
    let rule = match how >> 1 & 1 {
        0 => Transmittance::Crossing,
        _ => Transmittance::SegmentLength { unit: 0.1 },
    };
    let raw = how >> 2 & 1 == 1;
    let igloo = Igloo::new(span, [16, 36, 64, 200][usize::from(how >> 3 & 3)]);
    let opening = [0.0, 0.5, 1.0, 4.0][usize::from(how >> 5 & 3)];
    // The last bit: whether there is a surface, at a distance from the stream.
    let surface = how >> 7 == 1;
    let mut far = vec![f32::INFINITY; igloo.len()];
    if surface {
        let distance = stream.float();
        let distance = if distance > 0.0 { distance } else { 1.0 };
        far.iter_mut().step_by(2).for_each(|far| *far = distance);
    }
    let seed = stream.0.get(..26).unwrap_or(stream.0);
    let mut receiver_stream = Stream(seed);
    stream.0 = &stream.0[seed.len()..];
    let model = model(&mut stream, raw);
    let receiver = receiver(&mut receiver_stream, &model);

    let fineness = Fineness::for_faces(span, 36, Some(opening));
    let map = fineness.map(&igloo);
    let tree = ClusterTree::build(&model, rule);
    let mut expected: Option<Vec<u32>> = None;
    for instructions in Instructions::available() {
        let mut scratch = Scratch::with_instructions(instructions);
        let mut gamma = vec![0.0; igloo.len()];
        let limits = surface.then_some(&far[..]);
        tree.transmittances(&model, &receiver, &map, fineness.angle(&map), limits, &mut gamma, &mut scratch);
        assert_sound(&gamma, "clusters");
        let bits: Vec<u32> = gamma.iter().map(|value| value.to_bits()).collect();
        assert_eq!(*expected.get_or_insert_with(|| bits.clone()), bits, "{instructions:?}");
    }

    let segments = ThinnedSegments::build(&model, rule);
    for (projection, name) in [(Projection::Sphere, "sphere"), (Projection::TangentPlane, "tangent plane")] {
        let (mut depths, mut pieces) = (vec![0.0; igloo.len()], vec![]);
        let all = &Thinning::NONE;
        segments.optical_depths(&receiver, &igloo, all, projection, &far, &mut depths, &model, &mut pieces);
        layer::transmittances(&mut depths);
        assert_sound(&depths, name);
    }
}
