//! Λ: radiance that arrives along rays from a point, before hair takes its part: environment, area lights and the surfaces that
//! the rays meet, which are lit by all lights in turn.
//!
//! How hair dims light on its way to those surfaces comes in as `hair(origin, direction, far) -> transmittance`: Λ does not
//! know how Γ is found.

use std::f32::consts::PI;

use glam::Vec3;

use super::photon::{self, Emitter};
use super::{DirectLight, Environment, PhotonMap, RectLight, lights::Incident};
use crate::hash::{hash, to_unit};
use crate::igloo::{Igloo, Span, frame_around};
use crate::surface::{SurfacePoint, Surfaces};

/// Purposes of random numbers.
const SKY: u32 = 0x534B_5921;
const AREA: u32 = 0x4152_4541;

/// All light of a scene, and the surfaces that block and reflect it.
#[derive(Debug)]
pub struct Illumination {
    pub environment: Environment,
    pub direct: Vec<DirectLight>,
    pub area: Vec<RectLight>,
    pub surfaces: Option<Surfaces>,
    /// The environment as its averages over a coarse igloo, for single rays from surfaces: less noise than its pixels.
    coarse: Igloo,
    coarse_means: Vec<Vec3>,
    /// Light that surfaces have reflected more than once; none where only one reflection counts.
    photons: Option<PhotonMap>,
}

impl Illumination {
    /// Light of a scene; rays that leave surfaces see the environment blurred to `faces` faces a hemisphere.
    pub fn new(
        environment: Environment,
        direct: Vec<DirectLight>,
        area: Vec<RectLight>,
        surfaces: Option<Surfaces>,
        faces: u32,
    ) -> Self {
        let coarse = Igloo::new(Span::Sphere, faces);
        let coarse_means = environment.averages(&coarse);
        Self { environment, direct, area, surfaces, coarse, coarse_means, photons: None }
    }

    /// The first surface along a ray with unit direction.
    pub fn nearest(&self, origin: Vec3, direction: Vec3) -> Option<SurfacePoint> {
        self.surfaces.as_ref()?.closest(origin, direction, 0.0, f32::INFINITY)
    }

    /// Whether no surface lies between a point and the distance `far`.
    pub fn sees(&self, origin: Vec3, direction: Vec3, far: f32) -> bool {
        // A light may lie in a surface: the last part in a hundred thousand does not shadow it.
        self.surfaces.as_ref().is_none_or(|s| !s.blocks(origin, direction, 0.0, far * (1.0 - 1e-5)))
    }

    /// Light from the area lights at a point: `per_side`² stratified samples each, those behind surfaces left out.
    ///
    /// Each `Incident::irradiance` is its share; `key` names the random numbers.
    pub fn area_light(&self, position: Vec3, per_side: u32, key: u32, mut take: impl FnMut(&Incident)) {
        for (index, light) in self.area.iter().enumerate() {
            let jitter = |sample: u32, axis: u32| to_unit(hash(&[AREA, key, index as u32, sample, axis]));
            for sample in 0..per_side * per_side {
                let u = ((sample % per_side) as f32 + jitter(sample, 0)) / per_side as f32;
                let v = ((sample / per_side) as f32 + jitter(sample, 1)) / per_side as f32;
                let Some((mut incident, _)) = light.sample(position, u, v) else { continue };
                if self.sees(position, incident.toward, incident.distance) {
                    incident.irradiance /= (per_side * per_side) as f32;
                    take(&incident);
                }
            }
        }
    }

    /// Traces photons; nothing where none arrive, or too few for an estimate.
    pub fn photon_map(
        &self,
        settings: &photon::Settings,
        hair: &(impl Fn(Vec3, Vec3, f32) -> f32 + Sync),
    ) -> Option<PhotonMap> {
        let (surfaces, emitter) = (self.surfaces.as_ref()?, Emitter::new(self)?);
        let photons = photon::trace(&emitter, surfaces, settings, hair);
        PhotonMap::new(&photons, surfaces, settings.neighbours)
    }

    /// With a map [`Illumination::reflected`] counts light of any number of reflections.
    pub fn set_photons(&mut self, photons: Option<PhotonMap>) {
        self.photons = photons;
    }

    /// Radiance that a surface sends back along the ray that met it, from point and directional lights, one sample of each area light,
    /// one ray to the environment, and the photons. Emission is not in it: area lights are sampled as lights.
    pub fn reflected(&self, point: &SurfacePoint, key: u32, hair: &impl Fn(Vec3, Vec3, f32) -> f32) -> Vec3 {
        if point.albedo == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let origin = point.leaving();
        let mut irradiance = Vec3::ZERO;
        for incident in self.direct.iter().filter_map(|light| light.incident(origin)) {
            let cosine = incident.toward.dot(point.normal);
            if cosine > 0.0 && self.sees(origin, incident.toward, incident.distance) {
                irradiance += incident.irradiance * (cosine * hair(origin, incident.toward, incident.distance));
            }
        }
        self.area_light(origin, 1, key, |incident| {
            let cosine = incident.toward.dot(point.normal);
            if cosine > 0.0 {
                irradiance += incident.irradiance * (cosine * hair(origin, incident.toward, incident.distance));
            }
        });
        irradiance += self.sky_sample(point, origin, key, hair);
        if let Some(photons) = &self.photons {
            irradiance += photons.irradiance(point.position, point.normal);
        }
        point.albedo * irradiance / PI
    }

    /// Irradiance from the environment by one ray distributed as the cosine.
    fn sky_sample(&self, point: &SurfacePoint, origin: Vec3, key: u32, hair: &impl Fn(Vec3, Vec3, f32) -> f32) -> Vec3 {
        let [u, v] = [0, 1].map(|axis| to_unit(hash(&[SKY, key, axis])));
        let (sin, cos) = (2.0 * PI * u).sin_cos();
        let radius = v.sqrt();
        let local = Vec3::new(radius * cos, radius * sin, (1.0 - v).sqrt());
        let direction = frame_around(point.normal) * local;
        let radiance = self.coarse_means[self.coarse.face_of(direction)];
        if radiance == Vec3::ZERO || !self.sees(origin, direction, f32::INFINITY) {
            return Vec3::ZERO;
        }
        radiance * (PI * hair(origin, direction, f32::INFINITY))
    }

    /// The igloo of `means`.
    pub fn igloo(&self) -> &Igloo {
        &self.coarse
    }

    /// Mean radiance of the environment over the faces of the igloo that `new` was given, unturned.
    pub fn means(&self) -> &[Vec3] {
        &self.coarse_means
    }
}
