//! Renders of one scene with many settings: loaded once, its description changed from render to render.

use std::path::{Path, PathBuf};

use super::errors::Picture;
use super::run::StudyError;
use super::settings::Facts;
use super::state::{Measured, file_hash, key};
use crate::effects::Effects;
use crate::fragment::PixelRect;
use crate::hash::hash;
use crate::render::progress::Progress;
use crate::render::statistics::{Watch, peak_memory};
use crate::render::{self, Earlier, Pass, Prepared, ShadowMaps, with_threads};
use crate::scene::description::{EffectName, EnvironmentSources, Shadows};
use crate::scene::{self, Scene};
use crate::surface::SurfaceModel;

/// Purposes of random numbers.
const REPEAT: u32 = 0x5250_4541;
const REFERENCE: u32 = 0x5245_4652;

/// Forwards nothing but the wish to stop.
pub(super) struct Quiet<'a>(pub &'a dyn Progress);

impl Progress for Quiet<'_> {
    fn stage(&self, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn message(&self, _: &str) {}
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// A scene to be rendered with many settings.
pub(super) struct Bench<'a> {
    path: PathBuf,
    /// The user's overrides and the size of the picture.
    fixed: Vec<String>,
    scene: Scene,
    /// The part of the picture that is rendered.
    window: PixelRect,
    facts: Facts,
    surfaces: SurfaceModel,
    /// Made once for all renders that have the same.
    maps: ShadowMaps,
    threads: Option<usize>,
    /// The scene's own.
    seed: u32,
    /// Hash of all that is the same for every render.
    base: String,
    progress: &'a dyn Progress,
}

/// Seconds of the clock on the wall that a render takes: before its pixels, and for each of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Pace {
    pub before: f64,
    pub pixel: f64,
}

impl Pace {
    pub fn of(&self, pixels: f64) -> f64 {
        self.before + self.pixel * pixels
    }

    pub fn times(self, factor: f64) -> Self {
        Self { before: factor * self.before, pixel: factor * self.pixel }
    }
}

/// What a study leaves out of its pictures: other layers would cost time that is none of its business.
const LAYERS: &str = "output.layers=[\"beauty\", \"alpha\"]";

impl<'a> Bench<'a> {
    /// Loads a scene at a size: of the whole picture or, of a crop, so many pixels around its middle.
    pub fn new(
        path: &Path,
        overrides: &[String],
        crop: Option<PixelRect>,
        size: Option<[u32; 2]>,
        threads: Option<usize>,
        progress: &'a dyn Progress,
    ) -> Result<Self, StudyError> {
        progress.stage("loading", 0);
        let mut fixed = overrides.to_vec();
        fixed.push(LAYERS.to_owned());
        let whole = size.filter(|_| crop.is_none());
        fixed.extend(whole.map(|[width, height]| format!("camera.resolution=[{width}, {height}]")));
        let document = scene::load(path, &fixed)?;
        let files: Vec<String> = document
            .description
            .hair
            .iter()
            .filter_map(|hair| hair.file.as_ref())
            .chain(document.description.surface.iter().filter_map(|surface| surface.file.as_ref()))
            .chain(document.description.environment.file.as_ref())
            .map(|file| file_hash(&document.resolve(file)))
            .collect();
        let window = match crop {
            Some(crop) => middle(&crop, size),
            None => PixelRect::image(document.description.camera.resolution),
        };
        let seen = format!("{window:?}");
        let parts = [env!("CARGO_PKG_VERSION"), &document.source_hash, &fixed.join("\n"), &files.join("\n"), &seen];
        let (base, seed) = (key(&parts), document.description.sampling.seed);
        let scene = Scene::load(document)?;
        let surfaces = scene.surfaces.clone();
        let environment = &scene.description().environment;
        let facts = Facts {
            effects: Effects::of(&scene),
            occlusion: scene.description().occlusion.clone(),
            segments: scene.hair.segments(),
            size: scene.space.scene_length(1.0),
            sources_left: environment.file.is_some() && environment.sources == EnvironmentSources::None,
            lamps: lamps(&scene),
        };
        let (path, maps) = (path.to_owned(), ShadowMaps::default());
        Ok(Self { path, fixed, scene, window, facts, surfaces, maps, threads, seed, base, progress })
    }

    /// With the shadow maps of another size of the scene.
    pub fn with_maps(mut self, maps: ShadowMaps) -> Self {
        self.maps = maps;
        self
    }

    /// The shadow maps that were made.
    pub fn into_maps(self) -> ShadowMaps {
        self.maps
    }

    /// Of the scene as it is.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }

    /// Columns and rows that are rendered.
    pub fn size(&self) -> [u32; 2] {
        [0, 1].map(|axis| self.window.max[axis] - self.window.min[axis])
    }

    pub fn exposure(&self) -> f32 {
        self.scene.description().output.exposure as f32
    }

    pub fn notes(&self) -> &[String] {
        &self.scene.notes
    }

    /// The seed of a repetition, counted from 0: the scene's own is the first.
    pub fn repeat_seed(&self, repeat: u32) -> u32 {
        let seed = self.seed;
        if repeat == 0 { seed } else { hash(&[REPEAT, seed, repeat]) }
    }

    /// The seed of a pass of the reference.
    pub fn reference_seed(&self, pass: u32) -> u32 {
        hash(&[REFERENCE, self.seed, pass])
    }

    /// The key of a render of these settings.
    pub fn key(&self, set: &[String], seed: u32) -> String {
        key(&[&self.base, &set.join("\n"), &seed.to_string()])
    }

    /// Puts settings into the scene, and back the surfaces that the last render took out.
    fn set(&mut self, set: &[String]) -> Result<(), StudyError> {
        let all = [&self.fixed[..], set].concat();
        self.scene.set(scene::load(&self.path, &all)?.description)?;
        self.scene.surfaces = self.surfaces.clone();
        Ok(())
    }

    /// A render as `tress render` would do it.
    pub fn render(&mut self, label: &str, set: &[String], seed: u32) -> Result<(Measured, Picture), StudyError> {
        self.set(&[set, &[format!("sampling.seed={seed}")]].concat())?;
        // Memory is measured: maps that this render has not are in its way.
        if !self.scene.shadows.iter().any(|shadows| shadows.mode.is_map()) {
            self.maps.clear();
        }
        let own_peak = reset_peak();
        let options = render::Options { window: Some(self.window), threads: self.threads };
        let earlier = Earlier { photons: None, maps: &mut self.maps };
        let (film, statistics) = render::render_again(&mut self.scene, &options, earlier, &Quiet(self.progress))?;
        let (key, label) = (self.key(set, seed), label.to_owned());
        let measured = Measured { key, label, seed, stages: statistics.stages, peak_bytes: peak_memory(), own_peak };
        Ok((measured, Picture::from(&film)))
    }

    /// Passes of one set of settings, one for each seed. What is random before the first pass (photons) they share: it is drawn by the first
    /// of the seeds. `done` takes each as soon as it is there, and says whether to go on.
    pub fn passes(
        &mut self,
        label: &str,
        set: &[String],
        seeds: &[u32],
        mut done: impl FnMut(Measured, Picture) -> Result<(), StudyError> + Send,
    ) -> Result<(), StudyError> {
        let first = seeds.first().map(|seed| format!("sampling.seed={seed}"));
        self.set(&[set, first.as_slice()].concat())?;
        let (threads, base, progress) = (self.threads, self.base.clone(), self.progress);
        let options = render::Options { window: Some(self.window), threads };
        let own_peak = reset_peak();
        let (scene, maps, quiet) = (&mut self.scene, &mut self.maps, Quiet(progress));
        with_threads(threads, || {
            let mut prepared = Prepared::again(scene, &options, Earlier { photons: None, maps }, &quiet)?;
            let mut before = prepared.statistics().stages.clone();
            for &seed in seeds {
                let watch = Watch::start();
                let film = prepared.pass(Pass::alone(seed), &quiet)?;
                // The first pass pays for the structures.
                let mut stages = std::mem::take(&mut before);
                stages.push(watch.stage("rendering"));
                let key = key(&[&base, &set.join("\n"), &seed.to_string()]);
                let label = label.to_owned();
                done(Measured { key, label, seed, stages, peak_bytes: peak_memory(), own_peak }, Picture::from(&film))?;
            }
            Ok(())
        })?
    }

    /// Pixels of a probe.
    pub fn probed(&self) -> f64 {
        self.size().map(f64::from).iter().product()
    }

    /// One of the probes is done.
    pub fn advance(&self) {
        self.progress.advance(1);
    }

    /// How long a render of these settings takes, from one pass; the scene's own shadow maps do not count, which are there from then on.
    pub fn probe(&mut self, set: &[String]) -> Result<Pace, StudyError> {
        self.set(set)?;
        let (threads, quiet, pixels) = (self.threads, Quiet(self.progress), self.probed());
        let passes = self.scene.description().passes();
        let options = render::Options { window: Some(self.window), threads };
        let (scene, maps) = (&mut self.scene, &mut self.maps);
        with_threads(threads, || {
            let watch = Watch::start();
            let mut prepared = Prepared::again(scene, &options, Earlier { photons: None, maps }, &quiet)?;
            let made = prepared.statistics().shadow_maps.iter().filter(|map| set.is_empty() && !map.reused);
            let before = watch.elapsed().as_secs_f64() - made.map(|map| map.seconds).sum::<f64>();
            let watch = Watch::start();
            prepared.pass(Pass::alone(0), &quiet)?;
            Ok(Pace { before, pixel: watch.elapsed().as_secs_f64() / pixels * f64::from(passes) })
        })?
    }
}

/// Keys of the lights without extent, and how their shadows are found. None where a way to find them is left out: a light that were given that way had no shadow.
fn lamps(scene: &Scene) -> Vec<(String, Shadows)> {
    let without = scene.description().effects.without.iter().flat_map(|effect| effect.parts());
    let way = |effect: &EffectName| matches!(effect, EffectName::RayTracedShadows | EffectName::DeepShadowMaps);
    let left_out = without.copied().any(|effect| way(&effect));
    let lamps = scene.shadows.iter().filter(|_| !left_out);
    lamps.map(|shadows| (shadows.key.clone(), shadows.mode)).collect()
}

/// As many pixels around the middle of a rectangle; all of it without a size.
fn middle(crop: &PixelRect, size: Option<[u32; 2]>) -> PixelRect {
    let whole = [0, 1].map(|axis| crop.max[axis] - crop.min[axis]);
    let size = size.unwrap_or(whole);
    let min = [0, 1].map(|axis| crop.min[axis] + (whole[axis] - size[axis].min(whole[axis])) / 2);
    PixelRect { min, max: [0, 1].map(|axis| (min[axis] + size[axis]).min(crop.max[axis])) }
}

/// Lets the kernel forget the largest resident memory of this process so far; whether it did.
fn reset_peak() -> bool {
    // 5: the number of the kernel's manual (proc(5), clear_refs) for the peak resident set size.
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_are_not_given_shadows_that_are_left_out() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/shadows.toml");
        let of = |set: &[&str]| {
            let set: Vec<String> = set.iter().map(|set| (*set).to_owned()).collect();
            lamps(&Scene::load(scene::load(&path, &set).unwrap()).unwrap())
        };
        let modes: Vec<Shadows> = of(&[]).into_iter().map(|(_, shadows)| shadows).collect();
        assert_eq!(modes, [Shadows::Raytraced, Shadows::DeepMap, Shadows::Map]);
        // A reference that traced the map's lamp would have no shadow of it.
        assert!(of(&["effects.without=[\"ray-traced-shadows\"]"]).is_empty());
    }

    #[test]
    fn a_crop_shrinks_around_its_middle() {
        let crop = PixelRect { min: [10, 20], max: [50, 40] };
        assert_eq!(middle(&crop, None), crop);
        assert_eq!(middle(&crop, Some([20, 10])), PixelRect { min: [20, 25], max: [40, 35] });
        assert_eq!(middle(&crop, Some([1, 1])), PixelRect { min: [29, 29], max: [30, 30] });
    }
}
