//! Small hair models, points on them, and two independent values of Γ for each point.

use std::f32::consts::TAU;
use std::path::Path;

use glam::{Mat3, Vec3};
use rayon::prelude::*;
use tress::embree::Device;
use tress::hair::formats::{Options, read};
use tress::hair::{Attribute, HairModel, Strands};
use tress::hash::unit;
use tress::occlusion::{
    Calibration, ClusterTree, DepthMap, Fineness, HairRays, Igloo, Projection, RaySettings, Receiver, Reference,
    Scratch, Site, Span, ThinnedSegments, Thinning, Transmittance, calibrate, frame_around, layer,
};
use tress::scene::description::HairFormat;

/// A uniform number in [0, 1).
pub fn random(key: &[u32]) -> f32 {
    unit(key) as f32
}

/// A uniform direction.
pub fn direction(key: &[u32]) -> Vec3 {
    let two = |axis: u32| random(&[key, &[axis]].concat());
    let z = 2.0 * two(0) - 1.0;
    let (sin, cos) = (TAU * two(1)).sin_cos();
    Vec3::new(cos, sin, 0.0) * (1.0 - z * z).max(0.0).sqrt() + Vec3::Z * z
}

/// How the strands of a test model run. All are rooted on the unit sphere and half a unit long.
#[derive(Clone, Copy, Debug)]
pub enum Style {
    /// Outwards with a random walk.
    Ball,
    /// Clumps of 25 strands that come together towards their tips, combed down.
    Clumps,
    /// Helices.
    Curly,
    /// Long wavy hair in a few thick locks that hang down.
    Lock,
}

/// A model of `strands` x `segments`, of one width and transparency.
pub fn grow(style: Style, strands: u32, segments: u32, width: f32, transparency: f32) -> HairModel {
    let mut points = Vec::new();
    let mut first = vec![0];
    for strand in 0..strands {
        match style {
            Style::Ball => ball(strand, segments, &mut points),
            Style::Clumps => clump(strand, segments, &mut points),
            Style::Curly => curl(strand, segments, &mut points),
            Style::Lock => lock(strand, segments, &mut points),
        }
        first.push(points.len() as u32);
    }
    model(points, first, width, transparency)
}

pub fn model(points: Vec<Vec3>, first: Vec<u32>, width: f32, transparency: f32) -> HairModel {
    let strands = Strands {
        points,
        first,
        width: Attribute::Uniform(width),
        color: Attribute::Uniform(Vec3::ONE),
        transparency: Attribute::Uniform(transparency),
    };
    let mut model = HairModel::default();
    assert_eq!(model.add(&strands, 0), 0, "segments of no length");
    model
}

fn ball(strand: u32, segments: u32, points: &mut Vec<Vec3>) {
    let mut here = direction(&[1, strand]);
    let mut toward = here;
    for point in 0..=segments {
        points.push(here);
        toward = (toward + 0.25 * direction(&[2, strand, point])).normalize();
        here += toward * (0.5 / segments as f32);
    }
}

fn clump(strand: u32, segments: u32, points: &mut Vec<Vec3>) {
    let middle = direction(&[3, strand / 25]);
    let root = (middle + 0.08 * direction(&[4, strand])).normalize();
    let (mut lead, mut toward) = (middle, middle);
    for point in 0..=segments {
        let t = point as f32 / segments as f32;
        points.push(lead + (root - middle) * (1.0 - 0.6 * t));
        toward = (toward - Vec3::Y * (4.0 / segments as f32)).normalize();
        // Combed hair lies on the head.
        toward = (toward + lead.normalize() * (1.05 - lead.length()).max(0.0) * 4.0).normalize();
        lead += toward * (0.5 / segments as f32);
    }
}

fn curl(strand: u32, segments: u32, points: &mut Vec<Vec3>) {
    let root = direction(&[5, strand]);
    let frame = frame_around(root);
    let phase = TAU * random(&[6, strand]);
    for point in 0..=segments {
        let t = point as f32 / segments as f32;
        let (sin, cos) = (phase + 5.0 * TAU * t).sin_cos();
        points.push(root * (1.0 + 0.4 * t) + frame * (0.04 * Vec3::new(cos, sin, 0.0) * t.min(0.2) * 5.0));
    }
}

fn lock(strand: u32, segments: u32, points: &mut Vec<Vec3>) {
    let lock = strand / 300;
    // Roots on the upper half.
    let middle = {
        let d = direction(&[40, lock]);
        Vec3::new(d.x, d.y.abs(), d.z)
    };
    let offset = 0.07 * direction(&[41, strand]);
    let phase = TAU * random(&[42, lock]) + 0.5 * random(&[43, strand]);
    let frame = frame_around(middle);
    let (mut lead, mut toward) = (middle, middle);
    for point in 0..=segments {
        let t = point as f32 / segments as f32;
        let (sin, cos) = (phase + 3.0 * TAU * t).sin_cos();
        let wave = frame * (0.04 * t * Vec3::new(cos, sin, 0.0));
        points.push(lead + offset * (1.0 - 0.4 * t) + wave);
        toward = (toward - Vec3::Y * (5.0 / segments as f32)).normalize();
        toward = (toward + lead.normalize() * (1.05 - lead.length()).max(0.0) * 4.0).normalize();
        lead += toward * (1.2 / segments as f32);
    }
}

/// Each segment cut in `parts` of the same length.
pub fn cut(model: &HairModel, parts: u32) -> HairModel {
    let mut points = Vec::new();
    let mut first = vec![0];
    for segment in 0..model.segments() {
        let [a, b] = model.ends(segment);
        if segment == 0 || model.strand[segment] != model.strand[segment - 1] {
            if segment > 0 {
                first.push(points.len() as u32);
            }
            points.push(a);
        }
        points.extend((1..=parts).map(|i| if i == parts { b } else { a.lerp(b, i as f32 / parts as f32) }));
    }
    first.push(points.len() as u32);
    self::model(points, first, model.width[0], model.transparency[0])
}

/// The strands in another order, each from tip to root.
pub fn reversed(model: &HairModel) -> HairModel {
    let mut points = model.points.clone();
    points.reverse();
    let mut first = vec![0];
    for strand in (0..model.object.len() as u32).rev() {
        let segments = model.strand.iter().filter(|&&s| s == strand).count() as u32;
        first.push(first[first.len() - 1] + segments + 1);
    }
    self::model(points, first, model.width[0], model.transparency[0])
}

/// The 10,000 strands of a real head, moved to the origin and scaled to unit size; none where the file is not there.
pub fn yuksel_straight(transparency: f32) -> Option<HairModel> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/hair/yuksel_straight.hair");
    if !Path::new(path).exists() {
        eprintln!("skipped: {path} is not there");
        return None;
    }
    let loaded = read(Path::new(path), HairFormat::Hair, &Options::default()).expect("a sound file");
    let mut strands = loaded.strands;
    let (low, high) =
        strands.points.iter().fold((strands.points[0], strands.points[0]), |(l, h), &p| (l.min(p), h.max(p)));
    let scale = 2.0 / (high - low).max_element();
    for point in &mut strands.points {
        *point = (*point - 0.5 * (low + high)) * scale;
    }
    for width in strands.width.values_mut() {
        *width *= scale;
    }
    strands.transparency = Attribute::Uniform(transparency);
    let mut model = HairModel::default();
    model.add(&strands, 0);
    Some(model)
}

/// Points on hair, each with its strand.
pub fn on_hair(model: &HairModel, count: u32) -> Vec<Receiver> {
    let receiver = |i| {
        let segment = (unit(&[7, i]) * model.segments() as f64) as usize;
        let sample = model.sample(segment, random(&[8, i]));
        Receiver { position: sample.position, on: Some(sample.on), frame: Mat3::IDENTITY }
    };
    (0..count).map(receiver).collect()
}

/// Points on the unit sphere between the roots, looking outwards.
pub fn on_scalp(count: u32) -> Vec<Receiver> {
    let receiver = |i| {
        let normal = direction(&[9, i]);
        Receiver { position: normal, on: None, frame: frame_around(normal) }
    };
    (0..count).map(receiver).collect()
}

/// Points on a floor at height `y`, looking up.
pub fn on_floor(y: f32, count: u32) -> Vec<Receiver> {
    let receiver = |i| {
        let square = |axis| 4.0 * random(&[10, i, axis]) - 2.0;
        Receiver { position: Vec3::new(square(0), y, square(1)), on: None, frame: frame_around(Vec3::Y) }
    };
    (0..count).map(receiver).collect()
}

/// The points of a list that are not among its first `count`: apart from those that a shorter list of the kind has.
pub fn apart(mut receivers: Vec<Receiver>, count: u32) -> Vec<Receiver> {
    receivers.split_off(count as usize)
}

/// A model with what a calibration needs of it.
pub struct Calibrated<'a> {
    pub model: &'a HairModel,
    pub tree: ClusterTree,
    pub rays: HairRays,
}

impl<'a> Calibrated<'a> {
    pub fn new(model: &'a HairModel) -> Self {
        let rule = Transmittance::Crossing;
        let rays = HairRays::build(&Device::new().unwrap(), model, rule).unwrap();
        Self { model, tree: ClusterTree::build(model, rule), rays }
    }

    /// What is found for an accuracy on points of one kind.
    pub fn find(&self, receivers: &[Receiver], faces: u32, accuracy: f64) -> Calibration {
        calibrated(&self.tree, &self.rays, self.model, receivers, &igloo_for(&receivers[0], faces), accuracy)
    }

    /// Γ̄ of points with given settings.
    pub fn means(&self, receivers: &[Receiver], faces: u32, fineness: Fineness) -> Vec<f64> {
        let igloo = igloo_for(&receivers[0], faces);
        let map = fineness.map(&igloo);
        let value = |scratch: &mut Scratch, receiver: &Receiver| {
            let mut gamma = vec![0.0; igloo.len()];
            let opening = fineness.angle(&map);
            self.tree.transmittances(self.model, receiver, &map, opening, None, &mut gamma, scratch);
            mean(&gamma)
        };
        receivers.par_iter().map_init(Scratch::default, value).collect()
    }
}

/// The igloo that suits a receiver and all of its kind.
pub fn igloo_for(receiver: &Receiver, faces: u32) -> Igloo {
    Igloo::new(if receiver.on.is_some() { Span::Sphere } else { Span::Hemisphere }, faces)
}

/// A way to find Γ by projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Way {
    /// With clusters; where no fineness is given, that which goes with the faces.
    Clusters(Option<Fineness>),
    /// Segment by segment, on whole faces.
    Segments(Thinning),
}

/// What one way needs of a model and a kind of igloo.
pub enum Projector<'a> {
    Clusters { tree: ClusterTree, map: DepthMap, opening: f32, model: &'a HairModel, igloo: &'a Igloo },
    Segments { segments: ThinnedSegments, thinning: Thinning, model: &'a HairModel, igloo: &'a Igloo },
}

impl<'a> Projector<'a> {
    pub fn new(model: &'a HairModel, rule: Transmittance, igloo: &'a Igloo, way: Way) -> Self {
        match way {
            Way::Clusters(fineness) => {
                let per_hemisphere = igloo.len() as u32 / if igloo.span() == Span::Sphere { 2 } else { 1 };
                let usual = Fineness::for_faces(igloo.span(), per_hemisphere, None);
                let fineness = fineness.unwrap_or(usual);
                let map = fineness.map(igloo);
                let opening = fineness.angle(&map);
                Self::Clusters { tree: ClusterTree::build(model, rule), map, opening, model, igloo }
            }
            Way::Segments(thinning) => {
                Self::Segments { segments: ThinnedSegments::build(model, rule), thinning, model, igloo }
            }
        }
    }

    /// Γ of each face.
    pub fn faces(&self, receiver: &Receiver, far: Option<&[f32]>, scratch: &mut Scratch) -> Vec<f32> {
        match self {
            Self::Clusters { tree, map, opening, model, igloo } => {
                let mut gamma = vec![0.0; igloo.len()];
                tree.transmittances(model, receiver, map, *opening, far, &mut gamma, scratch);
                gamma
            }
            Self::Segments { segments, thinning, model, igloo } => {
                let mut depth = vec![0.0; igloo.len()];
                let endless = vec![f32::INFINITY; igloo.len()];
                let (far, mut pieces) = (far.unwrap_or(&endless), Vec::new());
                let sphere = Projection::Sphere;
                segments.optical_depths(receiver, igloo, thinning, sphere, far, &mut depth, model, &mut pieces);
                layer::transmittances(&mut depth);
                depth
            }
        }
    }

    /// Γ̄ over the igloo for many points of one kind, with nothing behind the hair.
    pub fn means(&self, receivers: &[Receiver]) -> Vec<f64> {
        let value = |scratch: &mut Scratch, receiver: &Receiver| mean(&self.faces(receiver, None, scratch));
        receivers.par_iter().map_init(Scratch::default, value).collect()
    }
}

/// The settings that a calibration at some points finds, with nothing behind the hair.
pub fn calibrated(
    tree: &ClusterTree,
    rays: &HairRays,
    model: &HairModel,
    receivers: &[Receiver],
    igloo: &Igloo,
    accuracy: f64,
) -> Calibration {
    let sites: Vec<Site> = receivers.iter().copied().map(Site::from).collect();
    let reference = Reference::for_accuracy(rays, model, &sites, igloo, accuracy, &|| false).expect("not cancelled");
    calibrate(tree, model, &sites, igloo, &reference, accuracy, &|| false).expect("not cancelled")
}

/// Γ̄ over the igloo by projection, with nothing behind the hair.
pub fn projected(model: &HairModel, receivers: &[Receiver], faces: u32, way: Way) -> Vec<f64> {
    let igloo = igloo_for(&receivers[0], faces);
    Projector::new(model, Transmittance::Crossing, &igloo, way).means(receivers)
}

/// Γ̄ over the igloo by `rays` rays, with nothing behind the hair.
pub fn traced(rays: &HairRays, model: &HairModel, receivers: &[Receiver], count: u32) -> Vec<f64> {
    let igloo = igloo_for(&receivers[0], 100);
    let far = vec![f32::INFINITY; igloo.len()];
    let value = |(key, receiver): (usize, &Receiver)| {
        let mut gamma = vec![0.0; igloo.len()];
        rays.transmittances(model, receiver, &igloo, &RaySettings::exact(count), &far, key as u32, &mut gamma);
        mean(&gamma)
    };
    receivers.par_iter().enumerate().map(value).collect()
}

pub fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
}

/// Mean, root mean square and largest of `a - b`.
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    pub mean: f64,
    pub rms: f64,
    pub largest: f64,
}

impl Difference {
    pub fn between(a: &[f64], b: &[f64]) -> Self {
        assert_eq!(a.len(), b.len());
        let n = a.len() as f64;
        let differences = || a.iter().zip(b).map(|(a, b)| a - b);
        Self {
            mean: differences().sum::<f64>() / n,
            rms: (differences().map(|d| d * d).sum::<f64>() / n).sqrt(),
            largest: differences().map(f64::abs).fold(0.0, f64::max),
        }
    }
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "mean {:+.5} rms {:.5} max {:.4}", self.mean, self.rms, self.largest)
    }
}
