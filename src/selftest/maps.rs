//! Deep shadow maps on every hard case, against brute force in `f64` and beside the rays that they stand for.
//!
//! A map's value is a mean over the pixels around a point. So is the truth here: rays spread over the same pixels with the same weights, each against every
//! segment. What is left is what a map does otherwise than a ray.

use glam::Vec3;
use rayon::prelude::*;

use super::hard::{self, Hard};
use super::{Error, Measured, Outcome, truth};
use crate::embree::Device;
use crate::hair::HairModel;
use crate::hash::unit;
use crate::occlusion::raytraced::Ray;
use crate::occlusion::{HairRays, Receiver, Transmittance};
use crate::shadow::{DeepMap, Footing, Point, Settings, View};

/// Suns around each case: directions of Fibonacci's lattice.
const SUNS: u32 = 24;
/// Lamps outside the hair, each with one image, and among it, each with the six of a cube.
const OUTSIDE: u32 = 6;
const AMONG: u32 = 3;
/// Rays along a side of a pixel, in the truth.
const STRATA: u32 = 6;
/// Purposes of random numbers.
const SPREAD: u32 = 0x4D41_5053;
const PLACE: u32 = 0x4C41_4D50;

/// A lamp.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lamp {
    Sun(Vec3),
    At(Vec3),
}

impl Lamp {
    fn view(self, model: &HairModel) -> View {
        match self {
            Self::Sun(toward) => View::parallel(model, toward),
            Self::At(position) => View::from_point(model, position, None),
        }
    }

    /// Unit direction from a point to the lamp, and how far it is.
    fn from(self, point: Vec3) -> (Vec3, f32) {
        match self {
            Self::Sun(toward) => (toward, f32::INFINITY),
            Self::At(position) => ((position - point).normalize(), position.distance(point)),
        }
    }
}

/// What lamps are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Suns,
    Outside,
    Among,
}

impl Kind {
    pub const ALL: [Self; 3] = [Self::Suns, Self::Outside, Self::Among];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Suns => "suns",
            Self::Outside => "lamps outside",
            Self::Among => "lamps among hair",
        }
    }

    fn lamps(self) -> Vec<Lamp> {
        match self {
            Self::Suns => (0..SUNS).map(|i| Lamp::Sun(truth::lattice(i, SUNS).as_vec3())).collect(),
            Self::Outside => {
                let distance = |i: u32| [1.6, 4.0, 1e3][i as usize % 3];
                (0..OUTSIDE).map(|i| Lamp::At((truth::lattice(i, OUTSIDE) * distance(i)).as_vec3())).collect()
            }
            Self::Among => (0..AMONG)
                .map(|i| Lamp::At(Vec3::from_array([0, 1, 2].map(|axis| (unit(&[PLACE, i, axis]) - 0.5) as f32))))
                .collect(),
        }
    }
}

/// Transmittance at one receiver from one lamp: means over the pixels around it.
#[derive(Clone, Copy, Debug)]
struct Found {
    map: f64,
    rays: f64,
    truth: f64,
}

fn found(
    map: &DeepMap,
    rays: &HairRays,
    model: &HairModel,
    lamp: Lamp,
    receiver: &Receiver,
    key: u32,
) -> Option<Found> {
    let point = Point { position: receiver.position, on: receiver.on };
    let jitter = |pixel, stratum, axis| unit(&[SPREAD, key, pixel, stratum, axis]);
    let mut found = Found { map: f64::from(map.transmittance(model, &point)), rays: 0.0, truth: 0.0 };
    for Footing { origin, weight } in map.footing(receiver.position, STRATA, jitter)? {
        let (direction, far) = lamp.from(origin);
        let ray = Ray { origin, direction, far, on: receiver.on };
        found.rays += weight * f64::from(rays.transmittance(model, &ray, 0.0));
        let here = Receiver { position: origin, ..*receiver };
        let exact = truth::transmittance_up_to(model, &here, direction.as_dvec3(), far.into());
        found.truth += weight * exact;
    }
    Some(found)
}

/// How far off maps and rays are on one hard case.
#[derive(Clone, Copy, Debug)]
pub struct Compared {
    /// Root mean square of map - truth over receivers and lamps.
    pub rms: f64,
    /// Largest of a receiver's mean over the lamps.
    pub mean: f64,
    /// Largest of rays - truth.
    pub rays: f64,
}

/// One hard case in the light of one kind of lamps, by maps of `resolution`, or of their own choice.
///
/// # Errors
/// Embree's own; none of maps, which are small.
pub fn compare(hard: &Hard, kind: Kind, resolution: Option<u32>) -> Result<Compared, Error> {
    compare_from(hard, kind.lamps(), resolution)
}

fn compare_from(hard: &Hard, lamps: Vec<Lamp>, resolution: Option<u32>) -> Result<Compared, Error> {
    let model = &hard.model;
    let rule = Transmittance::Crossing;
    let rays = HairRays::build(&Device::with_threads(1)?, model, rule)?;
    let settings = Settings { resolution, ..Settings::default() };
    let of_lamp = |lamp: Lamp| -> Result<Vec<Option<Found>>, Error> {
        let map = DeepMap::build(lamp.view(model), model, rule, &settings, &|| false)
            .map_err(|e| Error::Scene(e.to_string()))?;
        let found = |(i, receiver)| found(&map, &rays, model, lamp, receiver, i);
        Ok((0_u32..).zip(&hard.receivers).map(found).collect())
    };
    let by_lamp: Vec<Vec<Option<Found>>> = lamps.into_par_iter().map(of_lamp).collect::<Result<_, _>>()?;
    let mut compared = Compared { rms: 0.0, mean: 0.0, rays: 0.0 };
    let (mut squares, mut count) = (0.0, 0.0);
    for i in 0..hard.receivers.len() {
        let seen: Vec<Found> = by_lamp.iter().filter_map(|lamp| lamp[i]).collect();
        let off = |f: &Found| f.map - f.truth;
        squares += seen.iter().map(|f| off(f).powi(2)).sum::<f64>();
        count += seen.len() as f64;
        let mean = (seen.iter().map(off).sum::<f64>() / seen.len().max(1) as f64).abs();
        compared.mean = compared.mean.max(mean);
        compared.rays = seen.iter().map(|f| (f.rays - f.truth).abs()).fold(compared.rays, f64::max);
        // Neither may leave the numbers that a transmittance has.
        if !seen.iter().all(|f| [f.map, f.rays].iter().all(|t| (0.0..=1.0 + 1e-6).contains(t))) {
            return Ok(Compared { rms: f64::INFINITY, mean: f64::INFINITY, rays: f64::INFINITY });
        }
    }
    // None is seen only where no map looks: that would be an empty check.
    compared.rms = if count > 0.0 { (squares / count).sqrt() } else { f64::INFINITY };
    Ok(compared)
}

/// Every hard case in every light.
///
/// Bounds. *Rays* do the same arithmetic as the truth but in `f32`: one of the 144 at a point whose distance from a strand is within rounding of half the strand's
/// width may be decided otherwise, and count for the share that its pixel has, at most 1/36. *Maps*, at a point: compression errs by .004. Strands in one cell, a
/// quarter of a pixel wide, count as independent: where two lie across each other that is right, where they lie side by side or one behind the other it errs by up to a² (1 - t)²
/// of the cell, with either sign. What hair does behind the parts of the point's own strand is taken from beside them, and a strand a width away counts whole or
/// not. So the root mean square is below .015 for hair that lets a share of light through, and below .025 for opaque hair. *Mean over lamps*: of these errors, of both
/// signs, over the six lamps outside and 24 suns.
///
/// # Errors
/// As [`compare`].
pub fn against_truth() -> Result<Vec<Outcome>, Error> {
    let mut outcomes = Vec::new();
    for hard in hard::all() {
        let mut mean = 0.0_f64;
        for kind in Kind::ALL {
            // A cube of six images around a lamp in thick hair is dear.
            let compared = compare(&hard, kind, (kind == Kind::Among).then_some(64))?;
            if kind == Kind::Suns {
                mean = compared.mean;
            }
            outcomes.extend(judged(&hard, kind, &compared));
        }
        let name = format!("Γ, {}: deep maps, mean over suns", hard.name);
        outcomes.push(Outcome::one(name, Measured { error: mean, bound: 0.02 }));
    }
    Ok(outcomes)
}

/// The same under a sixth of the suns alone, for `tress selftest`, which has not the time for all.
///
/// # Errors
/// As [`compare`].
pub fn quick() -> Result<Vec<Outcome>, Error> {
    let mut outcomes = Vec::new();
    for hard in hard::all() {
        let compared = compare_from(&hard, Kind::Suns.lamps().into_iter().step_by(6).collect(), None)?;
        outcomes.extend(judged(&hard, Kind::Suns, &compared));
    }
    Ok(outcomes)
}

fn judged(hard: &Hard, kind: Kind, compared: &Compared) -> [Outcome; 2] {
    let name = |what: &str| format!("Γ, {}: {what}, {}", hard.name, kind.name());
    let opaque = hard.model.transparency.iter().any(|&t| t < 1e-6);
    let bound = if opaque { 0.025 } else { 0.015 };
    [
        Outcome::one(name("deep maps"), Measured { error: compared.rms, bound }),
        Outcome::one(name("shadow rays"), Measured { error: compared.rays, bound: 1.0 / 36.0 }),
    ]
}
