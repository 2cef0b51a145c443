//! Rendering to an error or to a time: settings found on the scene itself, passes until it is done, and the error that the picture then has.
//!
//! The error is looked at where it arises, in pixels drawn with a chance that grows with their light (`pixels`). For each there is a reference in
//! two independent halves (`references`), of rays, many faces, layers drawn by chance and photons of their own. A first set of pixels chooses: for places of
//! the knob (`KNOB`) they give bias and noise of a pass (`trials`), so that the work of enough passes is known before the first. A second set, with
//! references of its own, judges the finished picture and nothing else, so that the error claimed is not that of the settings which were lucky at the pixels
//! that chose them. What is judged is the picture itself: noise and bias need no model there.
//!
//! How fine references are and how often trials are run follows the error that is asked for. Work, not time, decides there, and all of it is counted, so the
//! picture depends on the scene alone. Where a time is asked for it cannot.

use std::time::Instant;

use self::further::Further;
use self::references::Judges;
use self::settings::{set, set_truth};
use self::streams::Streams;
use self::worth::{AIM, MOST_PASSES, Trial, Truth};
use super::accuracy::settings::KNOB;
use crate::fragment::PixelRect;
use crate::render::progress::Progress;
use crate::render::statistics::Watch;
use crate::render::{
    Earlier, Film, Mean, Options, Pass, Photons, Prepared, RenderError, ShadowMaps, Statistics, with_threads,
};
use crate::scene::Scene;
use crate::scene::description::{Description, Layer, Shadows};
use crate::scene::loaded::LampShadows;
use crate::surface::SurfaceModel;

/// Passes from which on it is asked whether they are enough, however many were planned: they may be worth more together than one by one.
const FIRST_LOOK: u32 = 2 * Pass::STREAMS;

mod claim;
mod further;
mod pixels;
mod references;
mod settings;
mod streams;
mod trials;
mod worth;

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Relative RMS error of the beauty.
    Error(f64),
    /// Seconds of the clock on the wall.
    Time(f64),
}

impl Goal {
    /// How many sets of photons a render has in memory: the picture's and those of both halves of the references.
    #[must_use]
    pub fn photon_sets(self) -> u64 {
        3 * Streams::new(self.error()).count() as u64
    }

    /// The error that is asked for, if one is.
    fn error(self) -> Option<f64> {
        match self {
            Self::Error(error) => Some(error),
            Self::Time(_) => None,
        }
    }
}

/// Renders a scene to an error or a time. The scene comes back without its surfaces and with the settings that were chosen.
///
/// # Errors
/// As [`crate::render::render`].
pub fn render_to(
    scene: &mut Scene,
    goal: Goal,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Film, Statistics), RenderError> {
    with_threads(options.threads, || {
        let surfaces = scene.surfaces.clone();
        let given = scene.document.description.clone();
        let shadows = scene.shadows.clone();
        let (streams, maps) = (Streams::new(goal.error()), ShadowMaps::default());
        Job { scene, surfaces, given, shadows, goal, options, progress, begin: Instant::now(), streams, maps }.run()
    })?
}

struct Job<'a> {
    scene: &'a mut Scene,
    surfaces: SurfaceModel,
    given: Description,
    shadows: Vec<LampShadows>,
    goal: Goal,
    options: &'a Options,
    progress: &'a dyn Progress,
    begin: Instant,
    /// The picture's photons.
    streams: Streams,
    /// Of all settings.
    maps: ShadowMaps,
}

impl Job<'_> {
    fn run(mut self) -> Result<(Film, Statistics), RenderError> {
        let watch = Watch::start();
        let looked = self.look()?;
        let drawn = looked.sets(self.given.sampling.seed);
        let [choosing, judging] = self.references(&drawn, looked.level)?;
        let trials = self.trials(&choosing, looked.level)?;
        let (trial, passes) = self.choose(&trials);
        let (film, judged, mut statistics) =
            self.passes(trial, passes, &choosing.truths, &judging, looked.level, &watch)?;
        statistics.claim = self.claim(&film, &judging.truths, &judged, trial);
        self.scene.document.description.output = self.given.output.clone();
        Ok((film, statistics))
    }

    /// The scene at a place of the knob with a seed, its surfaces back, and with photons of that seed, if they were traced before: who has done with them puts them back.
    fn prepare(&mut self, place: usize, seed: u32, photons: Option<Photons>) -> Result<Prepared<'_>, RenderError> {
        let mut description = self.given.clone();
        self.scene.shadows = self.shadows.clone();
        match KNOB.get(place) {
            Some((_, values)) => set(&mut description, values),
            None => {
                set_truth(&mut description, self.goal.error());
                // A map is an approximation of rays.
                for shadows in self.scene.shadows.iter_mut().filter(|shadows| shadows.mode.is_map()) {
                    shadows.mode = Shadows::Raytraced;
                }
            }
        }
        description.sampling.seed = seed;
        self.scene.document.description = description;
        self.scene.surfaces = self.surfaces.clone();
        Prepared::again(self.scene, self.options, Earlier { photons, maps: &mut self.maps }, self.progress)
    }

    fn elapsed(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    /// The picture in passes of settings that were tried, and the mean of more of them at the pixels that judge it.
    fn passes(
        &mut self,
        trial: Trial,
        planned: u32,
        choosing: &[Truth],
        judges: &Judges,
        level: f64,
        watch: &Watch,
    ) -> Result<(Film, Mean, Statistics), RenderError> {
        let (seed, progress, goal, begin) = (self.given.sampling.seed, self.progress, self.goal, self.begin);
        // A standard error takes two.
        let least = if self.given.output.layers.contains(&Layer::StandardError) { 2 } else { 1 };
        let mut streams = std::mem::take(&mut self.streams);
        let mut prepared = self.prepare(trial.place, seed, streams.first())?;
        let stage = watch.stage("calibrating");
        let window = prepared.window();
        let mut mean = Mean::new(prepared.pass(Pass::of(seed, 0), progress)?);
        let mut most = planned.min(FIRST_LOOK).max(least);
        let mut done = 1;
        loop {
            let begun = begin.elapsed().as_secs_f64();
            match goal {
                Goal::Time(time) => {
                    // Another pass takes as long as those before it.
                    let each = prepared.statistics().stages.iter().find(|stage| stage.name == "rendering");
                    let each = each.map_or(0.0, |stage| stage.seconds / f64::from(done));
                    if done >= least && (begun + each > time || done >= MOST_PASSES) {
                        break;
                    }
                }
                Goal::Error(error) if done >= most => {
                    // A few pixels tell little of the noise; passes tell it all over the picture, if there is more than one.
                    let (square, noise) = match mean.variance().map(|variance| variance / level.powi(2)) {
                        Some(noise) => (noise + trial.worth.shown_bias(), noise),
                        None => (error_at(choosing, &mean, &window, level), trial.worth.noise),
                    };
                    // More passes help against noise only.
                    let enough = square <= (AIM * error).powi(2);
                    if enough || noise < 0.1 * square || done >= MOST_PASSES || done >= 32 * planned {
                        break;
                    }
                    most = done + done.div_ceil(2);
                }
                Goal::Error(_) => {}
            }
            streams.turn(&mut prepared, seed, done, progress)?;
            mean.add(&prepared.pass(Pass::of(seed, done), progress)?);
            done += 1;
        }
        let watch = Watch::start();
        let further = Further { judges, error: goal.error(), level, seed, work: trial.work };
        let judged = further.passes(&mean, &mut prepared, &mut streams, progress)?;
        let judging = watch.stage("judging");
        let film = mean.film();
        let mut statistics = prepared.statistics().clone();
        statistics.mean = film.mean_beauty().to_array();
        statistics.stages.retain(|stage| ["tracing more photons", "rendering"].contains(&stage.name.as_str()));
        statistics.stages.insert(0, stage);
        statistics.stages.push(judging);
        Ok((film, judged, statistics))
    }
}

/// Mean square error of a picture at the pixels of references, as a share of the squared level.
fn error_at(truths: &[Truth], mean: &Mean, window: &PixelRect, level: f64) -> f64 {
    let squares = truths.iter().map(|truth| {
        let value = mean.beauty(window.index(truth.at)).as_dvec3().to_array();
        truth.weight * (truth.product(value, value) - truth.variance())
    });
    squares.sum::<f64>() / (truths.len().max(1) as f64 * level.powi(2))
}
