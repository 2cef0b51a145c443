//! Λ: radiance that arrives along rays from a point, before hair takes its part: environment, area lights and the surfaces that
//! the rays meet, which are lit by all lights in turn.
//!
//! How hair dims light on its way to those surfaces comes in as `hair(origin, direction, far) -> transmittance`: Λ does not
//! know how Γ is found.

use std::f32::consts::PI;
use std::sync::OnceLock;

use glam::Vec3;

use super::guide::Guide;
use super::photon::{self, Aimed, Emitter, HotSpots};
use super::{Caustics, Environment, Lamp, PhotonMap, RectLight, lights::Incident, sources};
use crate::hash::{hash, to_unit, unit};
use crate::igloo::{Igloo, Span};
use crate::sequence::Sequence;
use crate::surface::{SurfacePoint, Surfaces};
use crate::tally::{self, Work};

/// Purposes of random numbers.
const SKY: u32 = 0x534B_5921;
const AREA: u32 = 0x4152_4541;
const SOURCE: u32 = 0x5355_4E21;
const ONE_SOURCE: u32 = 0x4F4E_4521;

/// Purpose of the random numbers of the places at which irradiance is known beforehand.
const PLACES: u32 = 0x504C_4353;
/// So many photons are counted for one whose place is one of those.
const PHOTONS_A_PLACE: u32 = 4;
/// The map stands for all light of a point where the radius of its estimate is below this share of the ray's length: the disk is then smaller than a
/// face of the igloo is wide (.3 at 64 faces a hemisphere). Nearer, rays to the lights find what arrives straight from them.
const BLUR: f32 = 0.15;

/// All light of a scene, and the surfaces that block and reflect it.
#[derive(Debug)]
pub struct Illumination {
    pub environment: Environment,
    pub direct: Vec<Lamp>,
    pub area: Vec<RectLight>,
    pub surfaces: Option<Surfaces>,
    /// The igloo of hair.
    igloo: Igloo,
    /// The environment's averages over it.
    means: Vec<Vec3>,
    /// Where single rays from surfaces go.
    guide: OnceLock<Guide>,
    /// Faces a hemisphere of the igloos.
    faces: u32,
    /// Light that surfaces have reflected more than once; none where only one reflection counts.
    photons: Option<PhotonMap>,
    /// Light that mirrors and glass throw on other things; none where there are no such surfaces.
    caustics: Option<Caustics>,
}

impl Illumination {
    /// Light of a scene, the environment averaged over `faces` faces a hemisphere; rays that leave surfaces see it blurred to as many or fewer.
    pub fn new(
        environment: Environment,
        direct: Vec<Lamp>,
        area: Vec<RectLight>,
        surfaces: Option<Surfaces>,
        faces: u32,
    ) -> Self {
        let igloo = Igloo::new(Span::Sphere, faces);
        let means = environment.averages(&igloo);
        Self {
            environment,
            direct,
            area,
            surfaces,
            igloo,
            means,
            guide: OnceLock::new(),
            faces,
            photons: None,
            caustics: None,
        }
    }

    /// Where single rays from surfaces go; found when the first of them asks.
    fn guide(&self) -> &Guide {
        self.guide.get_or_init(|| {
            let coarse = Guide::igloo(self.faces);
            if coarse.len() == self.igloo.len() {
                Guide::new(coarse, self.means.clone())
            } else {
                let means = self.environment.averages(&coarse);
                Guide::new(coarse, means)
            }
        })
    }

    /// The first surfaces along rays of unit direction from one point: `take` gets the number of each ray, in order, and what it meets.
    pub fn nearest(&self, origin: Vec3, directions: &[Vec3], mut take: impl FnMut(usize, Option<SurfacePoint>)) {
        match &self.surfaces {
            Some(surfaces) => surfaces.closest_from(origin, directions, take),
            None => (0..directions.len()).for_each(|i| take(i, None)),
        }
    }

    /// Whether no surface lies between a point and the distance `far`.
    pub fn sees(&self, origin: Vec3, direction: Vec3, far: f32) -> bool {
        // A light may lie in a surface: the last part in a hundred thousand does not shadow it.
        self.surfaces.as_ref().is_none_or(|s| !s.blocks(origin, direction, 0.0, far * (1.0 - 1e-5)))
    }

    /// Light from the area lights at a point: `per_side`² stratified samples each, whether or not surfaces are in the way.
    ///
    /// Each `Incident::irradiance` is its share; the random numbers are a sequence's.
    pub fn area_light(&self, position: Vec3, per_side: u32, sequence: Sequence, mut take: impl FnMut(&Incident)) {
        for (index, light) in self.area.iter().enumerate() {
            for sample in 0..per_side * per_side {
                let key = |axis| hash(&[AREA, sequence.seed, index as u32, sample, axis]);
                let [x, y] = sequence.pair([key(0), key(1)]);
                let u = ((sample % per_side) as f32 + x) / per_side as f32;
                let v = ((sample / per_side) as f32 + y) / per_side as f32;
                let Some((mut incident, _)) = light.sample(position, u, v) else { continue };
                incident.irradiance /= (per_side * per_side) as f32;
                take(&incident);
            }
        }
    }

    /// Light from the environment's small bright sources, whether or not surfaces are in the way: each has samples by its share of the
    /// light and its size, `most` at the most, in strata of its own.
    ///
    /// Each `Incident::irradiance` is its share; `key` names the random numbers.
    pub fn source_light(&self, most: u32, key: u32, mut take: impl FnMut(&Incident)) {
        let Some(found) = self.environment.sources() else { return };
        let from_map = self.environment.to_map().transpose();
        for (index, source) in found.list.iter().enumerate() {
            let samples = source.samples(self.igloo.face_width(), most);
            for sample in 0..samples {
                let name = [SOURCE, key, index as u32, sample];
                let u = (f64::from(sample) + unit(&name)) / f64::from(samples);
                let Some((direction, energy)) = source.sample(&found.rest, u, hash(&name)) else { continue };
                let irradiance = energy / samples as f32;
                take(&Incident { toward: from_map * direction, distance: f32::INFINITY, irradiance });
            }
        }
    }

    /// One sample of one of the small bright sources, for a surface with this normal; its irradiance stands for all of them.
    fn one_source(&self, normal: Vec3, key: u32) -> Option<Incident> {
        let found = self.environment.sources()?;
        let to_map = self.environment.to_map();
        let numbers = |axis| unit(&[ONE_SOURCE, key, axis]);
        let (source, chance) = sources::choose_one(&found.list, to_map * normal, numbers(0))?;
        let (direction, energy) = source.sample(&found.rest, numbers(1), hash(&[ONE_SOURCE, key]))?;
        let toward = to_map.transpose() * direction;
        Some(Incident { toward, distance: f32::INFINITY, irradiance: energy / chance })
    }

    /// Traces photons; nothing where hardly any light is reflected twice, or too few arrive for an estimate; something or nothing soon after
    /// `cancelled` says to stop.
    pub fn photon_map(
        &self,
        settings: &photon::Settings,
        hair: &(impl Fn(Vec3, Vec3, f32) -> f32 + Sync),
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Option<PhotonMap> {
        let (surfaces, emitter) = (self.surfaces.as_ref()?, Emitter::new(self)?);
        if !photon::reflects(&emitter, surfaces, settings, hair, cancelled) {
            return None;
        }
        let photons = photon::trace(&emitter, surfaces, settings, hair, cancelled);
        let fewer = photon::Settings {
            photons: settings.photons.div_ceil(PHOTONS_A_PLACE),
            seed: hash(&[PLACES, settings.seed]),
            ..*settings
        };
        let places = photon::trace(&emitter, surfaces, &fewer, hair, cancelled);
        PhotonMap::new(photons, &places, surfaces, settings.neighbours, cancelled)
    }

    /// With a map [`Illumination::reflected`] counts light of any number of reflections.
    pub fn set_photons(&mut self, photons: Option<PhotonMap>) {
        self.photons = photons;
    }

    /// The photons that [`Illumination::reflected`] counts.
    pub fn photons(&self) -> Option<&PhotonMap> {
        self.photons.as_ref()
    }

    /// Traces the photons of caustics, after those of [`Illumination::set_photons`], whose hot spots are lamps here. They are also counted inside the box
    /// `hair_box` around all hair. Nothing where no such light arrives anywhere.
    pub fn caustic_map(
        &self,
        settings: &photon::CausticSettings,
        hair_box: Option<[Vec3; 2]>,
        hair: &(impl Fn(Vec3, Vec3, f32) -> f32 + Sync),
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Option<Caustics> {
        let (surfaces, emitter) = (self.surfaces.as_ref()?, Aimed::new(self)?);
        Caustics::trace(&emitter, surfaces, settings, hair_box, hair, cancelled)
    }

    /// With a map [`Illumination::caustic_irradiance`] and [`Illumination::caustic_light`] find light.
    pub fn set_caustics(&mut self, caustics: Option<Caustics>) {
        self.caustics = caustics;
    }

    /// Takes both maps out: nothing counts them here any more.
    pub fn take_maps(&mut self) -> (Option<PhotonMap>, Option<Caustics>) {
        (self.photons.take(), self.caustics.take())
    }

    /// The caustics that are counted.
    pub fn caustics(&self) -> Option<&Caustics> {
        self.caustics.as_ref()
    }

    /// Irradiance on a surface from lamps, small bright sources and hot spots by way of mirrors and glass.
    pub fn caustic_irradiance(&self, point: &SurfacePoint) -> Vec3 {
        self.caustics.as_ref().map_or(Vec3::ZERO, |caustics| caustics.irradiance(point.position, point.normal))
    }

    /// The same light at a point of hair, whether or not something is in its way from the last mirror or glass: `count` samples. Each
    /// `Incident::irradiance` is its share; `key` names the random numbers.
    pub fn caustic_light(&self, position: Vec3, count: u32, key: u32, take: impl FnMut(&Incident)) {
        if let (Some(caustics), Some(surfaces)) = (&self.caustics, &self.surfaces) {
            caustics.light(surfaces, position, count, key, take);
        }
    }

    /// Radiance that a surface sends back along the ray of unit `direction` that met it: by the photons, or where they would blur it from lights
    /// without extent, one sample of each area light and of one small bright source, one ray to the environment, and the photons of reflected light. Emission is not in
    /// it: area lights are sampled as lights; nor is what [`Illumination::hot_light`] brings, by way of mirrors and glass as caustics.
    pub fn reflected(
        &self,
        point: &SurfacePoint,
        direction: Vec3,
        key: u32,
        hair: &impl Fn(Vec3, Vec3, f32) -> f32,
    ) -> Vec3 {
        let cosine = -direction.dot(point.normal);
        self.sent_back(point, key, hair, |hot, irradiance| {
            hot.by_rays(point.albedo, irradiance, point.distance, cosine)
        })
    }

    /// The same as a mirror or glass shows it: with all of a hot spot's light where no caustics bring it.
    pub(super) fn reflected_in_mirror(
        &self,
        point: &SurfacePoint,
        key: u32,
        hair: &impl Fn(Vec3, Vec3, f32) -> f32,
    ) -> Vec3 {
        let caustics = self.caustics.is_some();
        self.sent_back(
            point,
            key,
            hair,
            |hot, irradiance| {
                if caustics { hot.below(point.albedo, irradiance) } else { 1.0 }
            },
        )
    }

    /// What a surface sends back; `counts` is the part of it that counts, by hot spots and irradiance.
    fn sent_back(
        &self,
        point: &SurfacePoint,
        key: u32,
        hair: &impl Fn(Vec3, Vec3, f32) -> f32,
        counts: impl Fn(&HotSpots, Vec3) -> f32,
    ) -> Vec3 {
        tally::add(Work::Reflections, 1);
        if point.albedo == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let known = self.photons.as_ref().and_then(|photons| photons.irradiance(point.position, point.normal));
        let hot = self.photons.as_ref().and_then(PhotonMap::hot_spots);
        // Of hot spots rays count a part only.
        let part = hot.zip(known).map_or(1.0, |(hot, known)| counts(hot, known.total));
        if let Some(known) = known.filter(|known| known.radius < BLUR * point.distance) {
            return point.albedo * known.total * (part / PI);
        }
        let origin = point.leaving();
        let mut irradiance = Vec3::ZERO;
        let mut add = |incident: &Incident, blocked: bool| {
            let cosine = incident.toward.dot(point.normal);
            if cosine > 0.0 && (!blocked || self.sees(origin, incident.toward, incident.distance)) {
                let left = if blocked { hair(origin, incident.toward, incident.distance) } else { 1.0 };
                irradiance += incident.irradiance * (cosine * left);
            }
        };
        for lamp in &self.direct {
            lamp.light.incident(origin).iter().for_each(|incident| add(incident, lamp.blocked));
        }
        self.area_light(origin, 1, Sequence::start(key), |incident| add(incident, true));
        self.one_source(point.normal, key).iter().for_each(|incident| add(incident, true));
        irradiance += self.sky_sample(point, origin, key, hair);
        // The photons of reflected light are of caustics, too.
        irradiance += known.map_or_else(|| self.caustic_irradiance(point), |known| known.indirect);
        point.albedo * irradiance * (part / PI)
    }

    /// Light from hot spots of surfaces, the part that [`Illumination::reflected`] leaves out, whether or not something is in the way: `most` samples at
    /// the most.
    pub fn hot_light(&self, position: Vec3, most: u32, key: u32, take: impl FnMut(&Incident)) {
        if let Some(hot) = self.photons.as_ref().and_then(PhotonMap::hot_spots) {
            hot.light(position, hot.samples(most), key, take);
        }
    }

    /// Irradiance from the environment, its small bright sources left out, by one ray.
    fn sky_sample(&self, point: &SurfacePoint, origin: Vec3, key: u32, hair: &impl Fn(Vec3, Vec3, f32) -> f32) -> Vec3 {
        let numbers = [0, 1, 2].map(|axis| to_unit(hash(&[SKY, key, axis])));
        let Some((direction, irradiance)) = self.guide().sample(point.normal, numbers) else { return Vec3::ZERO };
        if irradiance == Vec3::ZERO || !self.sees(origin, direction, f32::INFINITY) {
            return Vec3::ZERO;
        }
        irradiance * hair(origin, direction, f32::INFINITY)
    }

    /// The igloo of `means`.
    pub fn igloo(&self) -> &Igloo {
        &self.igloo
    }

    /// Mean radiance of the environment over the faces of the igloo that `new` was given, unturned; small bright sources are not in it.
    pub fn means(&self) -> &[Vec3] {
        &self.means
    }
}
