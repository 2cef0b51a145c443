//! Row 9: hair over an opaque scalp, the light of each face found by one ray, as pictures have it.

use glam::DVec3;
use rayon::prelude::*;
use tress::embree::Device;
use tress::hash::{hash, to_unit};
use tress::occlusion::raytraced::Ray;
use tress::occlusion::{Fineness, Igloo, Receiver, Reference, Scratch, Site, Span, calibrate};
use tress::surface::{SurfaceModel, Surfaces, primitives};

use crate::common::models::Difference;
use crate::measure::{FACES, Query};
use crate::scene::{Bench, Case, PLACES, Place};
use crate::table::{Bounds, Table};

/// Radiance of the sky and of the scalp.
const SKY: f32 = 1.0;
const SCALP: f32 = 0.3;

const ACCURACY: f64 = 0.004;
const TRUTH_RAYS: u32 = 50_000;
/// Sets of random numbers that an error is taken over.
const KEYS: u32 = 8;

pub fn print(bench: &Bench, _wanted: &dyn Fn(u32) -> bool) {
    let mut table = crate::table("Over an opaque scalp: radiance of a uniform sky 1, of the scalp .3");
    let device = Device::new().unwrap();
    let mut surfaces = SurfaceModel::default();
    surfaces.add(&primitives::sphere(DVec3::ZERO, 1.0), false);
    let scalp = surfaces.into_traceable(&device).unwrap();
    for place in PLACES {
        rows(bench, place, &scalp, &mut table);
    }
    table.print();
}

fn rows(bench: &Bench, place: Place, scalp: &Surfaces, table: &mut Table) {
    let case = bench.ball();
    let receivers = case.receivers(place, 0, place.points());
    let what = format!("{}-over-scalp-{SCALP}-{TRUTH_RAYS}", place.name());
    let truth = bench.kept(case, &what, &receivers, || by_rays(case, &receivers, place, scalp));
    let fineness = found(case, place, scalp);
    for rays in [1, 4] {
        let found = estimates(case, &receivers, place, scalp, fineness, rays);
        let all: Vec<f64> = found.iter().flatten().copied().collect();
        let all_truth: Vec<f64> =
            found.iter().zip(&truth).flat_map(|(keys, &truth)| keys.iter().map(move |_| truth)).collect();
        let error = Difference::between(&all, &all_truth);
        let means: Vec<f64> = found.iter().map(|keys| keys.iter().sum::<f64>() / keys.len() as f64).collect();
        // The mean over the random numbers has an eighth of their variance left in it.
        let noise2 =
            found.iter().zip(&means).flat_map(|(keys, mean)| keys.iter().map(move |v| (v - mean).powi(2))).sum::<f64>()
                / (found.len() as u32 * (KEYS - 1)) as f64;
        let lasting = (error.rms.powi(2) - noise2).max(0.0).sqrt();
        let measured = format!("{error}; {:.5} from the look's chance, {lasting:.5} lasting", noise2.sqrt());
        let what = format!("RMS error, {}, {rays} {} a face", place.name(), if rays == 1 { "ray" } else { "rays" });
        if rays == 1 {
            table.held(9, &what, &measured, error.rms, Bounds::at_most(0.005, 0.003));
        } else {
            table.said(9, &what, &measured);
        }
    }
}

/// Settings found at other points over the scalp, as a render finds them.
fn found(case: &Case, place: Place, scalp: &Surfaces) -> Fineness {
    let igloo = place.igloo();
    let site = |(point, receiver): (usize, Receiver)| {
        let key = hash(&[0x5349_5445, point as u32]);
        let far = (0..igloo.len()).map(|face| distance(scalp, &receiver, &igloo, face, key)).collect();
        Site { receiver, far: Some(far) }
    };
    let receivers = case.receivers(place, place.points(), place.points() + 64);
    let sites: Vec<Site> = receivers.into_iter().enumerate().map(site).collect();
    let (rays, go_on) = (case.rays(), || false);
    let reference = Reference::for_accuracy(rays, &case.model, &sites, &igloo, ACCURACY, &go_on).expect("it goes on");
    let found = calibrate(case.tree(), &case.model, &sites, &igloo, &reference, ACCURACY, &go_on);
    found.expect("it goes on").fineness
}

/// For each point the estimates Σ Γ̄ Λ̄ over the faces, one for each set of random numbers.
///
/// More rays a face are smaller faces with a ray each.
fn estimates(
    case: &Case,
    receivers: &[Receiver],
    place: Place,
    scalp: &Surfaces,
    fineness: Fineness,
    rays: u32,
) -> Vec<Vec<f64>> {
    let igloo = Igloo::new(place.igloo().span(), FACES * rays);
    let query = Query::new(case.tree(), &case.model, &igloo, fineness);
    let estimate = |scratch: &mut Scratch, (point, receiver): (usize, &Receiver)| -> Vec<f64> {
        let mut gamma = vec![0.0; igloo.len()];
        let one = |key: u32| {
            let far: Vec<f32> = (0..igloo.len())
                .map(|face| distance(scalp, receiver, &igloo, face, hash(&[key, point as u32])))
                .collect();
            query.fill(receiver, Some(&far), &mut gamma, scratch);
            let light = |far: f32| if far.is_finite() { SCALP } else { SKY };
            let sum: f64 = gamma.iter().zip(&far).map(|(gamma, far)| f64::from(gamma * light(*far))).sum();
            sum / igloo.len() as f64
        };
        (0..KEYS).map(one).collect()
    };
    receivers.par_iter().enumerate().map_init(Scratch::default, estimate).collect()
}

/// The same by rays that look for the scalp themselves, one in each of as many faces.
fn by_rays(case: &Case, receivers: &[Receiver], place: Place, scalp: &Surfaces) -> Vec<f64> {
    let span = place.igloo().span();
    let per_hemisphere = if span == Span::Sphere { TRUTH_RAYS / 2 } else { TRUTH_RAYS };
    let igloo = Igloo::new(span, per_hemisphere);
    let rays = case.rays();
    let value = |(point, receiver): (usize, &Receiver)| {
        let one = |face: usize| {
            let key = hash(&[0x5452_5545, point as u32]);
            let direction = direction(receiver, &igloo, face, key);
            let far = meets(scalp, receiver, direction);
            let ray = Ray { origin: receiver.position, direction, far, on: receiver.on };
            let light = if far.is_finite() { SCALP } else { SKY };
            f64::from(light * rays.transmittance(&case.model, &ray, 0.0))
        };
        (0..igloo.len()).map(one).sum::<f64>() / igloo.len() as f64
    };
    receivers.par_iter().enumerate().map(value).collect()
}

/// A jittered direction in a face.
fn direction(receiver: &Receiver, igloo: &Igloo, face: usize, key: u32) -> glam::Vec3 {
    let jitter = |axis| to_unit(hash(&[key, face as u32, axis]));
    receiver.frame * igloo.direction(face, jitter(0), jitter(1))
}

fn distance(scalp: &Surfaces, receiver: &Receiver, igloo: &Igloo, face: usize, key: u32) -> f32 {
    meets(scalp, receiver, direction(receiver, igloo, face, key))
}

/// Distance of the scalp along a direction; infinite where it is not met.
fn meets(scalp: &Surfaces, receiver: &Receiver, direction: glam::Vec3) -> f32 {
    scalp.closest(receiver.position, direction, 0.0, f32::INFINITY).map_or(f32::INFINITY, |hit| hit.distance)
}
