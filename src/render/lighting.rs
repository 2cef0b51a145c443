//! Stage 2: the light that a point sends to the eye, L_r = Σ F · Γ̄ · Λ̄ over the faces of an igloo (paper, Eq. 5 discretised).
//!
//! The one place where Γ, Λ and F meet.

mod fibres;
mod indirect;
mod lamps;
pub(super) mod shared;

use std::cell::Cell;

use glam::{Mat3, Vec3};

use self::shared::SharedLight;
use super::RenderError;
use super::clock::{Clock, Lap, Part};
use super::costs::{Built, Ledger};
use super::estimator::{self, Estimator};
use super::faces::{self, Arriving};
use super::lamp_lit::LampLit;
use super::pass::PointKey;
use super::progress::Progress;
use super::reflections::Reflections;
use super::shadows::{HairShadow, HairShadows, Made, ShadowMaps};
use crate::effects::{ABSENT, Effects};
use crate::embree::Device;
use crate::hair::{OnStrand, StrandSample};
use crate::hash::{GOLDEN_32, hash};
use crate::illumination::lights::Incident;
use crate::illumination::{Environment, Illumination};
use crate::occlusion::{Crossings, HairRays, Igloo, Receiver, Span, frame_around, raytraced};
use crate::scene::description::EffectName;
use crate::scene::{HairObject, Scene};
use crate::sequence::Sequence;
use crate::shading::{Faces, Fibre, Lambert, StrandPoint};
use crate::shadow::Point;
use crate::surface::SurfacePoint;
use crate::tally::{self, Work};

/// Purpose of the random numbers that place a ray in its face.
const FACE: u32 = 0x4641_4345;
/// Purpose of the random numbers of what a ray meets.
const MET: u32 = 0x4D45_5421;
/// Purpose of the random numbers that end rays to area lights and sources in hair.
const TOWARD: u32 = 0x544F_5744;

/// Light of a point, by layer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lit {
    /// From point, spot and directional lights.
    pub direct: Vec3,
    /// From everywhere else.
    pub environment: Vec3,
    /// The same without hair occlusion; zero unless the layer is wanted.
    pub unoccluded: Vec3,
    /// What it sends out by itself.
    pub emission: Vec3,
    /// Mean of Γ̄ over the igloo.
    pub occlusion: f32,
}

/// Everything that stage 2 needs of a scene.
#[derive(Debug)]
pub struct Lighting<'s> {
    scene: &'s Scene,
    /// What runs.
    effects: Effects,
    /// What counts: what runs, less what is forced on though the scene does not call for it.
    called_for: Effects,
    light: Illumination,
    estimator: Estimator,
    hair_rays: Option<HairRays>,
    /// For each light without extent how hair shadows it, and the maps among that.
    shadows: HairShadows,
    residual: f32,
    /// What crossings of hair do to rays towards area lights and small bright sources.
    crossings: Crossings,
    /// Samples along a side of an area light.
    area_samples: u32,
    /// Samples of a small bright source at the most.
    source_samples: u32,
    /// The igloo of hair: two hemispheres, unturned.
    sphere: Igloo,
    centers: Vec<Vec3>,
    /// Mirrors and glass that a ray meets at the most.
    specular_depth: u32,
    /// The igloo of surfaces: one hemisphere around the normal.
    hemisphere: Igloo,
    /// Mean cosine over each of its faces.
    cosines: Vec<f32>,
    /// How each hair object reflects, and what its time is counted as.
    fibres: Vec<(Box<dyn Fibre>, Part)>,
    /// Λ̄ that points on hair share, during a pass.
    shared: Option<SharedLight>,
    /// What the structures took.
    built: Vec<Built>,
}

/// Buffers that one thread keeps from point to point.
#[derive(Debug, Default)]
pub struct Workspace {
    far: Vec<f32>,
    gamma: Vec<f32>,
    /// What each face's ray met; nothing at all without surfaces.
    seen: Vec<Seen>,
    directions: Vec<Vec3>,
    /// Faces with rays of their own where others share theirs.
    own: Vec<u32>,
    light: Arriving,
    /// F of each face, of a point on hair.
    reflected: Vec<Vec3>,
    means: Vec<Vec3>,
    /// The normal around which `means` was computed.
    means_normal: Vec3,
    estimator: estimator::Space,
    pub clock: Clock,
    /// What rays saw in mirrors and glass.
    pub specular: Reflections,
}

impl<'s> Lighting<'s> {
    /// Builds the structures that the effects call for and those that the scene forces on beside them, and no others.
    ///
    /// # Errors
    /// Embree's own, shadow maps that take too much memory, and cancelled work.
    pub fn new(
        scene: &'s mut Scene,
        effects: Effects,
        maps: &mut ShadowMaps,
        progress: &dyn Progress,
    ) -> Result<Self, RenderError> {
        let device = Device::with_threads(rayon::current_num_threads())?;
        let called_for = effects;
        let effects = called_for.with(&scene.description().effects.forced);
        let mut ledger = Ledger::start(&device);
        let surfaces = std::mem::take(&mut scene.surfaces);
        let held = surfaces.bytes();
        let surfaces = effects.surfaces.then(|| surfaces.into_traceable(&device)).transpose()?;
        ledger.note(effects.surfaces, EffectName::Surfaces, held);
        if effects.color_variation {
            scene.hair.spread_colors();
            tally::add(Work::PointColors, scene.hair.points.len() as u64);
        }
        ledger.note(effects.color_variation, EffectName::ColorVariation, 0);
        let scene = &*scene;
        let settings = &scene.description().occlusion;
        let hair_rays = effects.hair_rays.then(|| estimator::hair_rays(&device, scene)).transpose()?;
        let held = hair_rays.as_ref().map_or(0, HairRays::bytes);
        ledger.note(effects.hair_rays, EffectName::RaysThroughHair, held);
        let shadows = HairShadow::build(scene, &called_for, maps, progress)?;
        ledger.pass();
        let faces = settings.face_count();
        let environment = Environment::new(scene.radiance.clone(), scene.sources.clone(), scene.to_map, faces);
        let light = Illumination::new(environment, scene.direct.clone(), scene.area.clone(), surfaces, faces);
        let sphere = Igloo::new(Span::Sphere, faces);
        let hemisphere = Igloo::new(Span::Hemisphere, faces);
        let centers = (0..sphere.len()).map(|face| sphere.center(face)).collect();
        let cosine = |face| {
            let ring = &hemisphere.rings()[hemisphere.ring_of_face(face)];
            // The mean of z over a zone is the mean of its bounds.
            0.5 * (ring.top + ring.bottom)
        };
        let cosines = (0..hemisphere.len()).map(cosine).collect();
        ledger.note(effects.environment, EffectName::Environment, scene.radiance.bytes());
        let forced = effects.highlight && !called_for.highlight;
        let fibre = |object: &HairObject| fibres::fibre(&object.shading, sphere.face_width(), forced);
        let objects = if scene.hair.is_empty() { &[] } else { &scene.hair_objects[..] };
        let fibres = objects.iter().map(fibre).collect();
        ledger.note(effects.highlight, EffectName::Highlight, 0);
        let estimator = Estimator::build(scene, &called_for, &sphere, &hemisphere);
        ledger.note(called_for.projected_occlusion, EffectName::HairOcclusionByProjection, estimator.bytes());
        Ok(Self {
            effects,
            called_for,
            light,
            estimator,
            hair_rays,
            shadows,
            residual: settings.residual as f32,
            crossings: estimator::ray_settings(settings, 1).crossings,
            source_samples: scene.description().sampling.area_light_samples,
            area_samples: (scene.description().sampling.area_light_samples as f32).sqrt().ceil() as u32,
            sphere,
            centers,
            specular_depth: scene.description().indirect.specular_depth,
            hemisphere,
            cosines,
            fibres,
            shared: None,
            built: ledger.built,
            scene,
        })
    }

    /// The scene, its surfaces taken out.
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// Surfaces, environment and lights.
    pub fn illumination(&self) -> &Illumination {
        &self.light
    }

    /// Light from a point on hair towards the unit direction `view`. `key` names its random numbers.
    pub fn hair(&self, sample: &StrandSample, object: u16, view: Vec3, key: PointKey, space: &mut Workspace) -> Lit {
        let (fibre, part) = &self.fibres[usize::from(object)];
        let point = StrandPoint { tangent: sample.tangent, view, color: sample.color };
        let receiver = on_hair(sample);
        let mut lit = Lit { occlusion: 1.0, ..Lit::default() };
        let in_direction = |direction| fibre.reflect(&point, direction);
        if self.gathers_on(object) {
            match &self.shared {
                Some(shared) if !ABSENT => self.look_shared(shared, &receiver, key, space),
                _ => self.look(&receiver, &self.sphere, key.sequence, space),
            }
            self.occlude(&receiver, &self.sphere, key.own, space);
            let mut lap = Lap::start();
            let faces = Faces { centers: &self.centers, solid_angle: self.sphere.face_solid_angle() };
            fibre.reflect_faces(&point, &faces, &mut space.reflected);
            lap.ends(*part, &mut space.clock);
            let means = self.light.means();
            let Workspace { reflected, seen, gamma, clock, light, specular, .. } = space;
            let count = (clock, specular);
            self.sum_faces(&self.sphere, means, key.own, seen, gamma, light, count, |face| reflected[face], &mut lit);
            self.area(&receiver, key, space, |_| receiver.position, in_direction, &mut lit);
        }
        self.direct(&Point::on_hair(sample), space, |_| sample.position, in_direction, &mut lit);
        lit
    }

    /// Light from a point on a surface; that of lamps from the place `lamp_lit`, if there is one. `key` names its random numbers.
    pub fn surface(
        &self,
        point: &SurfacePoint,
        lamp_lit: Option<&LampLit>,
        key: PointKey,
        space: &mut Workspace,
    ) -> Lit {
        let lambert = Lambert { albedo: point.albedo };
        let receiver = on_surface(point);
        let mut lit = Lit { emission: point.emission, occlusion: 1.0, ..Lit::default() };
        if point.albedo == Vec3::ZERO {
            return lit;
        }
        let cosine = |at: &SurfacePoint, direction: Vec3| lambert.evaluate(direction.dot(at.normal));
        let surfaces = self.light.surfaces.as_ref();
        let origin =
            |at: &SurfacePoint, toward| surfaces.map_or(at.leaving(), |surfaces| surfaces.toward_light(at, toward));
        if self.arrives() {
            self.look(&receiver, &self.hemisphere, key.sequence, space);
            self.occlude(&receiver, &self.hemisphere, key.own, space);
            let mut lap = Lap::start();
            // Neighbouring points on a plane share their normal.
            if space.means.len() != self.hemisphere.len() || space.means_normal != point.normal {
                self.turned_means(&receiver.frame, &mut space.means);
                space.means_normal = point.normal;
            }
            lap.ends(Part::Faces, &mut space.clock);
            let reflect = |face: usize| lambert.evaluate(self.cosines[face]);
            let Workspace { means, seen, gamma, clock, light, specular, .. } = space;
            self.sum_faces(&self.hemisphere, means, key.own, seen, gamma, light, (clock, specular), reflect, &mut lit);
            self.area(&receiver, key, space, |way| origin(point, way), |way| cosine(point, way), &mut lit);
            if self.effects.caustics {
                // Hair has taken its part of these photons on their way.
                let mut lap = Lap::start();
                let thrown = lambert.evaluate(1.0) * self.light.caustic_irradiance(point);
                lit.environment += thrown;
                lit.unoccluded += thrown;
                lap.ends(Part::Caustics, &mut space.clock);
            }
        }
        let (at, counts) = lamp_lit.map_or((point, 1.0), |lit| (&lit.at, lit.counts));
        let seen = Point::on_surface(at.leaving());
        self.direct(&seen, space, |way| origin(at, way), |way| cosine(at, way), &mut lit);
        lit.direct *= counts;
        lit
    }

    /// Γ̄ around a receiver as the shading of a point finds it, and what another estimator needs for the same question.
    pub fn around<'a>(&'a self, receiver: &Receiver, key: u32, space: &'a mut Workspace) -> Around<'a> {
        let igloo = if receiver.on.is_some() { &self.sphere } else { &self.hemisphere };
        self.look(receiver, igloo, Sequence::start(key), space);
        self.occlude(receiver, igloo, key, space);
        Around { igloo, far: &space.far, gamma: &space.gamma }
    }

    /// The first surface in each face around a receiver as the shading of a point finds it, and the igloo.
    pub(super) fn surroundings<'a>(
        &'a self,
        receiver: &Receiver,
        key: u32,
        space: &'a mut Workspace,
    ) -> (&'a Igloo, &'a [f32]) {
        let igloo = if receiver.on.is_some() { &self.sphere } else { &self.hemisphere };
        self.look(receiver, igloo, Sequence::start(key), space);
        (igloo, &space.far)
    }

    /// The estimator of Γ.
    pub(super) fn estimator(&self) -> &Estimator {
        &self.estimator
    }

    /// Takes the estimator out; hair then blocks nothing.
    pub(super) fn take_estimator(&mut self) -> Estimator {
        std::mem::replace(&mut self.estimator, Estimator::Free)
    }

    /// Takes another estimator of Γ.
    pub(super) fn set_estimator(&mut self, estimator: Estimator) {
        self.estimator = estimator;
    }

    /// The igloos of hair and of surfaces.
    pub(super) fn igloos(&self) -> [&Igloo; 2] {
        [&self.sphere, &self.hemisphere]
    }

    /// The effects that it was built for: what runs.
    pub(super) fn effects(&self) -> Effects {
        self.effects
    }

    /// What the scene calls for: what runs, less what is only forced on.
    pub(super) fn called_for(&self) -> Effects {
        self.called_for
    }

    /// What its structures took.
    pub(super) fn built(&self) -> &[Built] {
        &self.built
    }

    /// What rays through hair need; none where the effects do not call for it.
    pub fn hair_rays(&self) -> Option<&HairRays> {
        self.hair_rays.as_ref()
    }

    /// How hair's shadows of each light are found.
    pub fn hair_shadows(&self) -> &HairShadows {
        &self.shadows
    }

    /// The shadow maps that were made.
    pub fn maps(&self) -> &[Made] {
        &self.shadows.made
    }

    /// Whether any light comes from all around.
    pub(super) fn arrives(&self) -> bool {
        self.effects.environment || self.effects.area_lights || self.effects.reflection
    }

    /// Whether light from all around reaches a hair object.
    pub(super) fn gathers_on(&self, object: u16) -> bool {
        self.arrives() && self.scene.hair_objects[usize::from(object)].gather
    }

    /// One ray a face: what it meets is the face's Λ, and ends the hair that counts in its Γ.
    fn look(&self, receiver: &Receiver, igloo: &Igloo, sequence: Sequence, space: &mut Workspace) {
        let mut lap = Lap::start();
        space.far.clear();
        space.far.resize(igloo.len(), f32::INFINITY);
        space.seen.clear();
        if !ABSENT && self.effects.surfaces {
            space.directions.clear();
            space.directions.extend((0..igloo.len()).map(|face| Self::jittered(receiver, igloo, face, sequence)));
            let Workspace { far, seen, directions, .. } = space;
            self.light.nearest(receiver.position, directions, |face, hit| {
                if let Some(hit) = &hit {
                    far[face] = hit.distance;
                }
                seen.push(hit.map_or(Seen::Sky, |hit| Seen::Surface(hit, directions[face])));
            });
        }
        lap.ends(Part::Gather, &mut space.clock);
    }

    /// A direction in a face, drawn evenly.
    fn jittered(receiver: &Receiver, igloo: &Igloo, face: usize, sequence: Sequence) -> Vec3 {
        let key = |axis| hash(&[FACE, sequence.seed, face as u32, axis]);
        let [u, v] = sequence.pair([key(0), key(1)]);
        receiver.frame * igloo.direction(face, u, v)
    }

    /// Γ̄ of each face.
    fn occlude(&self, receiver: &Receiver, igloo: &Igloo, key: u32, space: &mut Workspace) {
        let mut lap = Lap::start();
        let Workspace { far, gamma, estimator, .. } = space;
        let (hair, rays, open) = (&self.scene.hair, self.hair_rays.as_ref(), ABSENT || !self.effects.surfaces);
        self.estimator.transmittances(hair, rays, receiver, igloo, far, open, key, gamma, estimator);
        lap.ends(Part::Occlusion, &mut space.clock);
    }

    /// Σ F Γ̄ Λ̄ over the faces: environment where the face's ray met nothing, else the surface that it met.
    #[expect(clippy::too_many_arguments, reason = "the three factors of one sum, and where it goes")]
    fn sum_faces(
        &self,
        igloo: &Igloo,
        means: &[Vec3],
        key: u32,
        seen: &[Seen],
        gamma: &[f32],
        light: &mut Arriving,
        (clock, specular): (&mut Clock, &mut Reflections),
        reflect: impl Fn(usize) -> Vec3,
        lit: &mut Lit,
    ) {
        let mut lap = Lap::start();
        let solid_angle = igloo.face_solid_angle();
        let free = |face: usize| reflect(face) * solid_angle;
        let Arriving { radiance, counts } = light;
        radiance.clear();
        counts.clear();
        radiance.extend(means.iter().zip(seen).map(|(mean, seen)| match seen {
            Seen::Sky => *mean,
            Seen::Surface(..) => Vec3::ZERO,
            Seen::Lit(radiance) => *radiance,
        }));
        if !ABSENT && self.effects.reflection {
            lap.ends(Part::Faces, clock);
            self.light_surfaces(free, key, seen, gamma, light, specular);
            lap.ends(Part::Reflection, clock);
        }
        if self.effects.environment {
            tally::add(Work::EnvironmentFaces, igloo.len() as u64);
        }
        if self.effects.environment || self.effects.reflection {
            let Arriving { radiance, counts } = light;
            let radiance = if seen.is_empty() { means } else { radiance };
            let sum = if !ABSENT && self.effects.unoccluded_layer {
                faces::sum::<true>(free, gamma, radiance, counts)
            } else {
                faces::sum::<false>(free, gamma, radiance, counts)
            };
            lit.environment += sum[0];
            lit.unoccluded += sum[1];
        }
        lit.occlusion = gamma.iter().sum::<f32>() / igloo.len() as f32;
        lap.ends(Part::Faces, clock);
    }

    /// Area lights and the environment's small bright sources, through surfaces and hair by a ray a sample: Γ̄ of a face cannot tell where in
    /// the face a light is.
    fn area(
        &self,
        receiver: &Receiver,
        key: PointKey,
        space: &mut Workspace,
        origin: impl Fn(Vec3) -> Vec3,
        reflect: impl Fn(Vec3) -> Vec3,
        lit: &mut Lit,
    ) {
        let Effects { area_lights, small_sources, photons, caustics, .. } = self.effects;
        if ABSENT || !(area_lights || small_sources || photons || caustics) {
            return;
        }
        let mut lap = Lap::start();
        let PointKey { own: key, sequence } = key;
        let shift = hash(&[TOWARD, key]);
        let samples = Cell::new(0_u64);
        let mut ray = 0_u32;
        let mut add = |incident: &Incident| {
            let Incident { toward, distance, irradiance } = *incident;
            samples.set(samples.get() + 1);
            let free = reflect(toward) * irradiance;
            // Golden steps through all samples: neighbours get numbers far apart.
            ray = ray.wrapping_add(GOLDEN_32);
            if free == Vec3::ZERO || !self.light.sees(origin(toward), toward, distance) {
                return;
            }
            let chance = (f64::from(ray.wrapping_add(shift)) + 1.0) / 4_294_967_296.0;
            let along = raytraced::Ray { origin: receiver.position, direction: toward, far: distance, on: receiver.on };
            lit.environment += free * self.occluded(&along, chance);
            lit.unoccluded += free;
        };
        if area_lights {
            self.light.area_light(receiver.position, self.area_samples, sequence, &mut add);
            tally::add(Work::AreaLight, samples.take());
            lap.ends(Part::AreaLights, &mut space.clock);
        }
        if small_sources {
            self.light.source_light(self.source_samples, key, &mut add);
            tally::add(Work::SmallSources, samples.take());
            lap.ends(Part::SmallSources, &mut space.clock);
        }
        if photons {
            self.light.hot_light(receiver.position, self.source_samples, key, &mut add);
            lap.ends(Part::HotSpots, &mut space.clock);
        }
        if caustics && receiver.on.is_some() {
            self.light.caustic_light(receiver.position, self.source_samples, key, &mut add);
            lap.ends(Part::Caustics, &mut space.clock);
        }
    }

    /// Γ along a ray: 1 without hair occlusion.
    fn occluded(&self, ray: &raytraced::Ray, chance: f64) -> f32 {
        match &self.hair_rays {
            Some(hair) if self.estimator.blocks() => {
                hair.transmittance_by(&self.scene.hair, ray, self.crossings, chance)
            }
            _ => 1.0,
        }
    }

    /// What hair leaves of the light from surface to surface. Without hair occlusion hair does not dim what surfaces reflect either.
    fn between_surfaces(&self, origin: Vec3, direction: Vec3, far: f32) -> f32 {
        if self.estimator.blocks() { self.through_hair(origin, direction, far, None) } else { 1.0 }
    }

    /// What hair leaves of the light along a ray.
    fn through_hair(&self, origin: Vec3, direction: Vec3, far: f32, on: Option<OnStrand>) -> f32 {
        self.hair_rays.as_ref().map_or(1.0, |hair| {
            hair.transmittance(&self.scene.hair, &raytraced::Ray { origin, direction, far, on }, self.residual)
        })
    }
}

/// What the ray of a face met.
#[derive(Clone, Copy, Debug)]
enum Seen {
    /// No surface.
    Sky,
    /// A surface, and the ray's direction.
    Surface(SurfacePoint, Vec3),
    /// A surface that neighbouring points have lit already: the radiance that it sends.
    Lit(Vec3),
}

/// Γ̄ of each face of a point's igloo.
#[derive(Clone, Copy, Debug)]
pub struct Around<'a> {
    /// A sphere for hair, a hemisphere around the normal for surfaces.
    pub igloo: &'a Igloo,
    /// Distance of the first opaque surface in each face.
    pub far: &'a [f32],
    /// Γ̄ of each face.
    pub gamma: &'a [f32],
}

/// The receiver of a point on hair.
pub fn on_hair(sample: &StrandSample) -> Receiver {
    Receiver { position: sample.position, on: Some(sample.on), frame: Mat3::IDENTITY }
}

/// The receiver of a point on a surface.
pub fn on_surface(point: &SurfacePoint) -> Receiver {
    Receiver { position: point.leaving(), on: None, frame: frame_around(point.normal) }
}
