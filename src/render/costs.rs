//! What each effect took: CPU time, memory and counted work. Measured where the work is done, and shared out without counting anything twice.
//!
//! CPU times in seconds, of all threads; memory in bytes that structures hold. Not everything is an effect's own:
//! - What the faces' sum takes is the environment's, or without one the reflecting surfaces'.
//! - A look-up in the photon map is the reflected light's, a ray through hair that of the effect that asked for it.
//! - Hair of a highlight is counted there, not with Kajiya and Kay.
//! - The unoccluded layer and colours that vary are a part of what others take: they have no time of their own.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;

use super::clock::{Clock, Part};
use super::shadows::Made;
use super::statistics::{Statistics, Watch};
use crate::embree::Device;
use crate::hair::{Colors, HairModel};
use crate::scene::description::EffectName;
use crate::tally::Work;

/// What a structure took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Built {
    pub effect: EffectName,
    pub cpu_seconds: f64,
    pub bytes: u64,
}

/// Notes what structures take, one after the other.
#[derive(Debug)]
pub(super) struct Ledger<'d> {
    device: &'d Device,
    /// Embree's memory at the last note.
    held: u64,
    watch: Watch,
    pub built: Vec<Built>,
}

impl<'d> Ledger<'d> {
    /// Begins; `device` is the one that all structures for rays are built with.
    pub fn start(device: &'d Device) -> Self {
        Self { device, held: device.memory_bytes(), watch: Watch::start(), built: Vec::new() }
    }

    /// The time since the last note, `bytes` and what Embree has taken since are an effect's, if it is on; else nobody's.
    pub fn note(&mut self, on: bool, effect: EffectName, bytes: u64) {
        let held = self.device.memory_bytes();
        let bytes = bytes + held.saturating_sub(std::mem::replace(&mut self.held, held));
        let cpu_seconds = self.watch.lap();
        if on {
            self.built.push(Built { effect, cpu_seconds, bytes });
        }
    }

    /// The time since the last note is told elsewhere.
    pub fn pass(&mut self) {
        self.watch.lap();
    }
}

/// What an effect took.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    pub effect: EffectName,
    pub name: &'static str,
    pub on: bool,
    /// CPU seconds before the first pixel,
    pub building: f64,
    /// and of the pixels, all passes together.
    pub rendering: f64,
    /// Bytes that its structures hold.
    pub bytes: u64,
    /// Work that is done for this effect only: nothing where it is off.
    pub work: BTreeMap<&'static str, u64>,
    /// What was expected, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planned: Option<Planned>,
}

/// What an effect is expected to take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Planned {
    pub cpu_seconds: f64,
    pub bytes: u64,
}

impl Cost {
    /// CPU seconds in all.
    #[must_use]
    pub fn cpu_seconds(&self) -> f64 {
        self.building + self.rendering
    }

    /// What is expected of a render of `pixels` times the pixels.
    pub(super) fn scaled(&self, pixels: f64) -> Planned {
        // Segments of hair cover more pixels as these shrink, in proportion to their length only.
        let pixels = if self.effect == EffectName::Hair { pixels.sqrt() } else { pixels };
        Planned { cpu_seconds: self.building + self.rendering * pixels, bytes: self.bytes }
    }
}

/// The work that is done for an effect and for nothing else.
#[must_use]
pub fn own_work(effect: EffectName) -> &'static [Work] {
    use EffectName as E;
    match effect {
        E::Hair => &[Work::HairFragments],
        E::Surfaces => {
            &[Work::TriangleGeometries, Work::Triangles, Work::GatherRays, Work::FirstHits, Work::ShadowRays]
        }
        E::Environment => &[Work::EnvironmentFaces],
        E::SmallBrightSources => &[Work::SmallSources],
        E::AreaLights => &[Work::AreaLight],
        E::PointLights => &[Work::PointLight],
        E::SpotLights => &[Work::SpotLight],
        E::DirectionalLights => &[Work::DirectionalLight],
        E::RayTracedShadows => &[Work::RaytracedShadows],
        E::DeepShadowMaps => &[Work::DeepMaps],
        E::ShadowMaps => &[Work::PlainMaps],
        E::HairShadowsOnHair => &[Work::HairShadowsOnHair],
        E::HairShadowsOnSurfaces => &[Work::HairShadowsOnSurfaces],
        E::LightReflectedBySurfaces => &[Work::Reflections, Work::SharedCorners],
        E::MoreThanOneReflection => &[Work::Photons, Work::PhotonLookups],
        E::MirrorsAndGlass => &[Work::SpecularWays],
        E::Caustics => &[Work::CausticPhotons],
        E::HairOcclusionByProjection => &[Work::ClusterTrees, Work::Projections],
        E::HairOcclusionByRays => &[Work::RaytracedPoints],
        E::SettingsByAccuracy => &[Work::CalibrationPoints],
        E::RaysThroughHair => &[Work::CurveGeometries, Work::CurveSegments, Work::HairRays],
        E::KajiyaKay => &[Work::KajiyaKay],
        E::Highlight => &[Work::HighlightTables, Work::Highlight],
        E::Marschner => &[Work::MarschnerTables, Work::Marschner],
        E::ColorVariation => &[Work::PointColors],
        E::UnoccludedLayer => &[Work::UnoccludedFaces],
        E::PointAndDirectionalLights | E::HairOcclusion => &[],
    }
}

/// What was measured of a render.
pub(super) struct Measured<'a> {
    pub built: &'a [Built],
    pub clock: &'a Clock,
    pub maps: &'a [Made],
    pub hair: &'a HairModel,
    /// Bytes of the lists of segments that touch tiles.
    pub bins: u64,
    /// Whether Γ is found by projection.
    pub projects: bool,
}

impl Measured<'_> {
    /// What each effect took, in the order of the plan.
    pub fn costs(&self, statistics: &Statistics) -> Vec<Cost> {
        let is_on = |key| statistics.effects.iter().any(|effect| effect.key == key && effect.on);
        let shines = is_on(EffectName::Environment);
        let cost = |effect: &crate::effects::Effect| {
            // To read the clock around what is off takes a little time: no effect's.
            let (building, bytes) = if effect.on { self.structures(effect.key, statistics) } else { (0.0, 0) };
            let rendering = if effect.on { self.pixels(effect.key, shines, statistics) } else { 0.0 };
            let count = |work: &Work| (work.name(), statistics.work.of(*work));
            let work = own_work(effect.key).iter().map(count).collect();
            Cost {
                effect: effect.key,
                name: effect.name,
                on: effect.on,
                building,
                rendering,
                bytes,
                work,
                planned: None,
            }
        };
        statistics.effects.iter().map(cost).collect()
    }

    /// CPU time before the first pixel, and memory.
    fn structures(&self, effect: EffectName, statistics: &Statistics) -> (f64, u64) {
        let built = self.built.iter().filter(|built| built.effect == effect);
        let (seconds, bytes) = built.fold((0.0, 0), |(s, b), built| (s + built.cpu_seconds, b + built.bytes));
        let stage = |name| statistics.stages.iter().find(|stage| stage.name == name).map_or(0.0, |s| s.cpu_seconds);
        let maps = |deep| {
            let of_kind = self.maps.iter().filter(move |made| made.deep == deep);
            of_kind.fold((0.0, 0), |(s, b), made| (s + made.cpu_seconds, b + made.size.bytes as u64))
        };
        let colors = match &self.hair.color {
            Colors::PerPoint(colors) => size_of_val(&colors[..]) as u64,
            Colors::PerObject(_) => 0,
        };
        match effect {
            EffectName::Hair => (seconds + stage("binning"), self.hair.bytes() - colors + self.bins),
            EffectName::ColorVariation => (seconds, colors),
            EffectName::SettingsByAccuracy => (stage("calibrating"), bytes),
            EffectName::DeepShadowMaps => maps(true),
            EffectName::ShadowMaps => maps(false),
            _ => (seconds, bytes),
        }
    }

    /// CPU time of the pixels.
    fn pixels(&self, effect: EffectName, shines: bool, statistics: &Statistics) -> f64 {
        let of = |parts: &[Part]| parts.iter().map(|&part| self.clock.of(part)).sum::<Duration>().as_secs_f64();
        let occluded = |by_projection: bool| if self.projects == by_projection { of(&[Part::Occlusion]) } else { 0.0 };
        match effect {
            EffectName::Hair => statistics.cpu_seconds.fragments - of(&[Part::CameraRays]),
            EffectName::Surfaces => of(&[Part::CameraRays, Part::Gather]),
            EffectName::Environment if shines => of(&[Part::Faces]),
            EffectName::LightReflectedBySurfaces if shines => of(&[Part::Reflection]),
            EffectName::LightReflectedBySurfaces => of(&[Part::Reflection, Part::Faces]),
            EffectName::AreaLights => of(&[Part::AreaLights]),
            EffectName::SmallBrightSources => of(&[Part::SmallSources]),
            EffectName::MoreThanOneReflection => of(&[Part::HotSpots]),
            EffectName::Caustics => of(&[Part::Caustics]),
            EffectName::PointLights => of(&[Part::PointLights]),
            EffectName::SpotLights => of(&[Part::SpotLights]),
            EffectName::DirectionalLights => of(&[Part::DirectionalLights]),
            EffectName::HairShadowsOnHair => of(&[Part::HairShadowsOnHair]),
            EffectName::HairShadowsOnSurfaces => of(&[Part::HairShadowsOnSurfaces]),
            EffectName::HairOcclusionByProjection => occluded(true),
            EffectName::HairOcclusionByRays => occluded(false),
            EffectName::KajiyaKay => of(&[Part::KajiyaKay]),
            EffectName::Highlight => of(&[Part::Highlight]),
            EffectName::Marschner => of(&[Part::Marschner]),
            _ => 0.0,
        }
    }
}
