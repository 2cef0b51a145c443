//! Rendering to an error or to a time: settings found on the scene itself, passes until it is done, and the error that the picture then has.
//!
//! The error is looked at where it arises, in pixels drawn with a chance that grows with their light and noise (`pixels`). For each there is a reference in
//! two independent halves (`references`), of rays, many faces, layers drawn by chance and photons of their own. A first set of pixels chooses: for places of
//! the knob (`KNOB`) they give bias and noise of a pass (`trials`), so that the work of enough passes is known before the first. A second set, drawn from
//! the finished picture and with rounds of references of its own, judges that and nothing else, so that the error claimed is not that of the settings which
//! were lucky at the pixels that chose them. (The heaviest pixels are in both sets, and both have the references' photons.) What is judged is the picture
//! itself: noise and bias need no model there.
//!
//! How fine references are and how often trials are run follows the error that is asked for. Work, not time, decides there, and all of it is counted, so the
//! picture depends on the scene alone. Where a time is asked for it cannot.

use std::time::Instant;

use self::further::Further;
use self::pixels::{Drawn, Looked, Purpose};
use self::references::Half;
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

    /// The time that is asked for, if one is: seconds.
    fn time(self) -> Option<f64> {
        match self {
            Self::Time(time) => Some(time),
            Self::Error(_) => None,
        }
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
        let halves = Half::both(given.sampling.seed, goal);
        let begin = Instant::now();
        Job { scene, surfaces, given, shadows, goal, options, progress, begin, streams, halves, maps }.run()
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
    /// Of all references.
    halves: [Half; 2],
    /// Of all settings.
    maps: ShadowMaps,
}

/// A picture's passes.
struct Picture {
    /// Their settings.
    trial: Trial,
    window: PixelRect,
    mean: Mean,
    statistics: Statistics,
    /// Pixels that judge it, and the mean of its and further passes there.
    drawn: Vec<Drawn>,
    judged: Mean,
    /// Since they began to.
    judging: Watch,
}

impl Job<'_> {
    fn run(mut self) -> Result<(Film, Statistics), RenderError> {
        let watch = Watch::start();
        let (seed, looked) = (self.given.sampling.seed, self.look()?);
        let drawn = looked.draw(seed, Purpose::Choosing, usize::MAX);
        let choosing = self.references(&drawn, Purpose::Choosing, looked.level)?;
        let trials = self.trials(&choosing, looked.level)?;
        let (trial, passes) = self.choose(&trials);
        // Where time was short for those that choose it is for those that judge: fewer are drawn, rather than some of those drawn left out.
        let short = self.goal.time().is_some() && choosing.truths.len() < Purpose::CHOOSING;
        let judges = if short { choosing.truths.len() } else { usize::MAX };
        let picture = self.passes(trial, passes, &choosing.truths, looked.level, judges, &watch)?;
        let judging = self.references(&picture.drawn, Purpose::Judging, looked.level)?;
        // References have settings of their own.
        self.describe(trial.place, seed);
        let claim = self.claim(&picture, &judging.truths);
        let Picture { mean, mut statistics, judging, .. } = picture;
        let film = mean.film();
        statistics.stage(Purpose::Judging.stage(), &judging);
        statistics.mean = film.mean_beauty().to_array();
        statistics.claim = claim;
        self.scene.document.description.output = self.given.output.clone();
        Ok((film, statistics))
    }

    /// The scene at a place of the knob with a seed, its surfaces back, and with photons of that seed, if they were traced before.
    fn prepare(&mut self, place: usize, seed: u32, photons: Option<Photons>) -> Result<Prepared<'_>, RenderError> {
        self.describe(place, seed);
        self.scene.surfaces = self.surfaces.clone();
        Prepared::again(self.scene, self.options, Earlier { photons, maps: &mut self.maps }, self.progress)
    }

    /// Gives the scene the settings of a place of the knob.
    fn describe(&mut self, place: usize, seed: u32) {
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
    }

    fn elapsed(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    /// Seconds until the picture has to be there, if a time is asked for: its judges need some, too.
    fn left(&self, time: f64) -> f64 {
        time - self.kept(time) - self.elapsed()
    }

    /// The picture in passes of settings that were tried, and more of them at so many pixels at the most that judge it.
    fn passes(
        &mut self,
        trial: Trial,
        planned: u32,
        choosing: &[Truth],
        level: f64,
        judges: usize,
        watch: &Watch,
    ) -> Result<Picture, RenderError> {
        let (seed, progress, goal, begin) = (self.given.sampling.seed, self.progress, self.goal, self.begin);
        let kept = goal.time().map_or(0.0, |time| self.kept(time));
        // A standard error takes two.
        let least = if self.given.output.layers.contains(&Layer::StandardError) { 2 } else { 1 };
        let mut streams = std::mem::take(&mut self.streams);
        let mut prepared = self.prepare(trial.place, seed, streams.first())?;
        let stage = watch.stage(Purpose::Choosing.stage());
        let window = prepared.window();
        let mut mean = Mean::new(prepared.pass(Pass::of(seed, 0), progress)?);
        let mut most = planned.min(FIRST_LOOK).max(least);
        let mut done = 1;
        loop {
            let begun = begin.elapsed().as_secs_f64();
            match goal {
                Goal::Time(time) => {
                    // Another pass takes as long as those before it.
                    let each = prepared.statistics().seconds_of("rendering") / f64::from(done);
                    if done >= least && (begun + each > time - kept || done >= MOST_PASSES) {
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
        let judging = Watch::start();
        let looked = Looked::at(&mean, &window);
        let drawn = looked.draw(seed, Purpose::Judging, judges);
        let further = Further { drawn: &drawn, error: goal.error(), level: looked.level, seed, work: trial.work };
        let judged = further.passes(&mean, &mut prepared, &mut streams, progress)?;
        let mut statistics = prepared.statistics().clone();
        statistics.stages.retain(|stage| ["tracing more photons", "rendering"].contains(&stage.name.as_str()));
        statistics.stages.insert(0, stage);
        Ok(Picture { trial, window, mean, statistics, drawn, judged, judging })
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
