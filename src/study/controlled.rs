//! Rendering to an error or to a time: settings found on the scene itself, passes until it is done, and the error that the picture then has.
//!
//! The error is looked at where it arises, in pixels drawn at random from those in which something is seen. For each there is a reference in
//! two independent halves, of rays, many faces and layers drawn by chance. Half of the pixels choose: for each place of the knob ([`KNOB`]) they give bias
//! and noise of a pass, so that the work of enough passes is known before the first. The other half judge the finished picture and
//! nothing else, so that the error claimed is not that of the settings which were lucky at the pixels that chose them. What is
//! judged is the picture itself: noise and bias need no model there.
//!
//! Work, not time, decides where an error is asked for, and all of it is counted, so the picture depends on the scene alone. Where a time is
//! asked for it cannot.

use std::collections::HashSet;
use std::time::Instant;

use self::settings::{set, set_truth, work};
use self::worth::{AIM, MOST_PASSES, Trial, Truth, Worth, least, level, total};
use super::accuracy::settings::KNOB;
use super::statistics::rms_of_squares;
use crate::hash::{hash, unit};
use crate::render::film::Pixel;
use crate::render::progress::Progress;
use crate::render::statistics::{Claim, Watch};
use crate::render::{Film, Mean, Options, Prepared, RenderError, Statistics, pass_seed, with_threads};
use crate::scene::Scene;
use crate::scene::description::Description;
use crate::surface::SurfaceModel;

mod settings;
mod worth;

/// Purposes of random numbers.
const DRAW: u32 = 0x4452_5043;
const TRUTH: u32 = 0x5452_5554;
const TRIAL: u32 = 0x5452_4941;

/// Pixels that choose, and as many that judge.
const PIXELS: usize = 96;
/// Pixels looked at for one of these, at the most.
const LOOKED_AT: usize = 64;

/// Rounds of a reference at the most; no more where its noise is below this share of the error asked for.
const MOST_ROUNDS: u32 = 8;
const NOISE: f64 = 1.5;

/// Runs of a trial at the most; no more where its bias is known to this share of the square aimed at.
const MOST_RUNS: u32 = 12;
const DOUBT: f64 = 0.25;

/// Shares of a time for the reference, and for all that comes before the picture.
const FOR_TRUTH: f64 = 0.2;
const FOR_TRIALS: f64 = 0.35;

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Relative RMS error of the beauty.
    Error(f64),
    /// Seconds of the clock on the wall.
    Time(f64),
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
        Job { scene, surfaces, given, goal, options, progress, begin: Instant::now() }.run()
    })?
}

struct Job<'a> {
    scene: &'a mut Scene,
    surfaces: SurfaceModel,
    given: Description,
    goal: Goal,
    options: &'a Options,
    progress: &'a dyn Progress,
    begin: Instant,
}

impl Job<'_> {
    fn run(mut self) -> Result<(Film, Statistics), RenderError> {
        let watch = Watch::start();
        let truths = self.truths()?;
        let (choosing, judging) = truths.split_at(truths.len() / 2);
        let level = level(choosing);
        let trials = self.trials(choosing, level)?;
        let (trial, passes) = self.choose(&trials);
        let (film, mut statistics) = self.passes(trial, passes, choosing, level, &watch)?;
        statistics.claim = self.claim(&film, judging, trial);
        self.scene.document.description.output = self.given.output.clone();
        Ok((film, statistics))
    }

    /// The scene with other settings, its surfaces back.
    fn prepare(&mut self, place: usize) -> Result<Prepared<'_>, RenderError> {
        let mut description = self.given.clone();
        match KNOB.get(place) {
            Some((_, values)) => set(&mut description, values),
            None => set_truth(&mut description),
        }
        self.scene.document.description = description;
        self.scene.surfaces = self.surfaces.clone();
        Prepared::new(self.scene, self.options, self.progress)
    }

    fn elapsed(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    /// Pixels in which something is seen, with their references.
    fn truths(&mut self) -> Result<Vec<Truth>, RenderError> {
        let (seed, progress) = (self.given.sampling.seed, self.progress);
        let prepared = self.prepare(0)?;
        progress.stage("looking for pixels", 0);
        let window = prepared.window();
        let [width, height] = [0, 1].map(|i| window.max[i] - window.min[i]);
        let all = width as usize * height as usize;
        let (mut drawn, mut seen) = (HashSet::new(), Vec::new());
        let mut number = 0;
        while seen.len() < 2 * PIXELS && drawn.len() < all.min(LOOKED_AT * 2 * PIXELS) {
            let mut some = Vec::new();
            while some.len() < PIXELS && drawn.len() < all {
                let pixel = (unit(&[DRAW, seed, number]) * all as f64) as usize;
                number += 1;
                // The last ones of a small picture would take for ever to be drawn.
                let pixel =
                    if number as usize > 4 * all { (0..all).find(|p| !drawn.contains(p)).unwrap_or(0) } else { pixel };
                if drawn.insert(pixel) {
                    some.push([
                        window.min[0] + (pixel % width as usize) as u32,
                        window.min[1] + (pixel / width as usize) as u32,
                    ]);
                }
            }
            let looked = prepared.pixels(&some, seed, progress)?;
            let with_something = some.into_iter().zip(looked.pixels).filter(|(_, pixel)| pixel.alpha > 0.0);
            seen.extend(with_something.map(|(at, _)| at));
        }
        seen.truncate(2 * PIXELS);
        drop(prepared);
        self.references(&seen)
    }

    /// References in rounds, until their noise tells errors apart that are as large as the one asked for.
    fn references(&mut self, seen: &[[u32; 2]]) -> Result<Vec<Truth>, RenderError> {
        let (seed, progress, goal, begin) = (self.given.sampling.seed, self.progress, self.goal, self.begin);
        let prepared = self.prepare(KNOB.len())?;
        progress.stage("calibrating", 2 * seen.len() as u64);
        let mut truths: Vec<Truth> = Vec::new();
        // Where time is short, as many pixels as there is time for.
        for some in seen.chunks(16) {
            let spent = |time: f64| begin.elapsed().as_secs_f64() > FOR_TRUTH * time;
            if matches!(goal, Goal::Time(time) if spent(time) && truths.len() >= 16) {
                break;
            }
            truths.extend(round(&prepared, some, [seed, 0], progress)?);
        }
        let Goal::Error(error) = goal else { return Ok(truths) };
        for done in 1..MOST_ROUNDS {
            let variance = truths.iter().map(Truth::variance).sum::<f64>() / truths.len().max(1) as f64;
            if variance.sqrt() < NOISE * error * level(&truths) {
                break;
            }
            progress.stage("calibrating", 2 * seen.len() as u64);
            for (truth, other) in truths.iter_mut().zip(round(&prepared, seen, [seed, done], progress)?) {
                let share = 1.0 / f64::from(done + 1);
                for (mean, new) in truth.halves.as_flattened_mut().iter_mut().zip(other.halves.as_flattened()) {
                    *mean += share * (new - *mean);
                }
            }
        }
        Ok(truths)
    }

    /// What a pass is worth from one place of the knob to the next, as far as it can pay.
    fn trials(&mut self, truths: &[Truth], level: f64) -> Result<Vec<Trial>, RenderError> {
        let mut trials: Vec<Trial> = Vec::new();
        for place in 0..=KNOB.len() {
            let left = match self.goal {
                Goal::Error(_) => f64::INFINITY,
                Goal::Time(time) if self.elapsed() > FOR_TRIALS * time && !trials.is_empty() => break,
                Goal::Time(time) => time - self.elapsed(),
            };
            let trial = self.trial(place, truths, level)?;
            trials.push(trial);
            let done = match self.goal {
                // A single pass is enough, or this place takes more than an earlier one: finer ones take more still.
                Goal::Error(error) => {
                    let enough = trial.passes((AIM * error).powi(2)) == Some(1);
                    enough || total(&trials[..trials.len() - 1], error) < total(&[trial], error).max(trial.work)
                }
                Goal::Time(_) => trial.work > left,
            };
            if done {
                break;
            }
        }
        Ok(trials)
    }

    fn trial(&mut self, place: usize, truths: &[Truth], level: f64) -> Result<Trial, RenderError> {
        let (seed, progress, goal) = (self.given.sampling.seed, self.progress, self.goal);
        let begin = Instant::now();
        let prepared = self.prepare(place)?;
        let before = begin.elapsed().as_secs_f64();
        let at: Vec<[u32; 2]> = truths.iter().map(|truth| truth.at).collect();
        let begin = Instant::now();
        let mut points = [0, 0];
        let mut runs: Vec<Vec<[f64; 3]>> = Vec::new();
        let worth = loop {
            let found = prepared.pixels(&at, hash(&[TRIAL, seed, runs.len() as u32]), progress)?;
            points = [points[0] + found.hair_points, points[1] + found.surface_points];
            runs.push(found.pixels.iter().map(|pixel| pixel.beauty.as_dvec3().to_array()).collect());
            if runs.len() < 2 {
                continue;
            }
            let worth = Worth::new(truths, &runs, level);
            let known = match goal {
                Goal::Error(error) => worth.doubt < DOUBT * (AIM * error).powi(2),
                Goal::Time(_) => true,
            };
            if known || runs.len() >= MOST_RUNS as usize {
                break worth;
            }
        };
        let window = prepared.window();
        let all = f64::from(window.max[0] - window.min[0]) * f64::from(window.max[1] - window.min[1]);
        let scale = all / (truths.len() * runs.len()).max(1) as f64;
        let work = match goal {
            Goal::Error(_) => scale * work(&prepared, points[0], points[1]),
            Goal::Time(_) => scale * begin.elapsed().as_secs_f64(),
        };
        Ok(Trial { place, worth, work, before })
    }

    /// The settings that take least work for the error, or leave the least error for the time; and how many passes.
    fn choose(&self, trials: &[Trial]) -> (Trial, u32) {
        let left = match self.goal {
            Goal::Error(error) => {
                let square = (AIM * error).powi(2);
                let best = trials
                    .iter()
                    .filter_map(|trial| Some((trial, trial.passes(square)?)))
                    .min_by(|a, b| (a.0.work * f64::from(a.1)).total_cmp(&(b.0.work * f64::from(b.1))));
                // None: what errs least in its bias, in passes that hardly add to it.
                return best.map_or_else(
                    || {
                        let least = *least(trials, |trial| trial.worth.bias);
                        (least, least.passes(square.max(1.1 * least.worth.bias)).unwrap_or(64))
                    },
                    |(trial, passes)| (*trial, passes),
                );
            }
            Goal::Time(time) => time - self.elapsed(),
        };
        let passes = |trial: &Trial| ((left - trial.before) / trial.work.max(1e-9)).floor();
        let possible: Vec<Trial> = trials.iter().filter(|trial| passes(trial) >= 1.0).copied().collect();
        if possible.is_empty() {
            return (*least(trials, |trial| trial.work), 1);
        }
        let best = *least(&possible, |trial| trial.worth.bias + trial.worth.noise / passes(trial).max(1.0));
        (best, passes(&best).min(f64::from(MOST_PASSES)) as u32)
    }

    fn passes(
        &mut self,
        trial: Trial,
        planned: u32,
        choosing: &[Truth],
        level: f64,
        watch: &Watch,
    ) -> Result<(Film, Statistics), RenderError> {
        let (seed, progress, goal, begin) = (self.given.sampling.seed, self.progress, self.goal, self.begin);
        let mut prepared = self.prepare(trial.place)?;
        let stage = watch.stage("calibrating");
        let window = prepared.window();
        let width = (window.max[0] - window.min[0]) as usize;
        let index = |[x, y]: [u32; 2]| (y - window.min[1]) as usize * width + (x - window.min[0]) as usize;
        let mut mean = Mean::new(prepared.pass(pass_seed(seed, 0), progress)?);
        let mut most = planned;
        let mut done = 1;
        loop {
            let begun = begin.elapsed().as_secs_f64();
            match goal {
                Goal::Time(time) => {
                    // Another pass takes as long as those before it.
                    let each = prepared.statistics().stages.iter().find(|stage| stage.name == "rendering");
                    let each = each.map_or(0.0, |stage| stage.seconds / f64::from(done));
                    if begun + each > time || done >= MOST_PASSES {
                        break;
                    }
                }
                Goal::Error(error) if done >= most => {
                    let square = choosing.iter().map(|truth| {
                        let value = mean.beauty(index(truth.at)).as_dvec3().to_array();
                        truth.product(value, value) - truth.variance()
                    });
                    let square = square.sum::<f64>() / (choosing.len().max(1) as f64 * level * level);
                    let noise = trial.worth.noise / f64::from(done);
                    // More passes help against noise only.
                    if square <= error * error || noise < 0.1 * square || done >= MOST_PASSES || done >= 8 * planned {
                        break;
                    }
                    most = done + done.div_ceil(2);
                }
                Goal::Error(_) => {}
            }
            mean.add(&prepared.pass(pass_seed(seed, done), progress)?);
            done += 1;
        }
        let film = mean.film();
        let mut statistics = prepared.statistics().clone();
        statistics.mean = film.mean_beauty().to_array();
        statistics.stages.retain(|stage| stage.name == "rendering");
        statistics.stages.insert(0, stage);
        Ok((film, statistics))
    }

    /// The error of the finished picture, by the pixels that had no part in it.
    fn claim(&self, film: &Film, judging: &[Truth], trial: Trial) -> Option<Claim> {
        let seen = film.pixels.iter().filter(|pixel| pixel.alpha > 0.0);
        let (sum, count) = seen
            .fold((0.0, 0.0), |(sum, count), pixel| (sum + pixel.beauty.as_dvec3().element_sum() / 3.0, count + 1.0));
        let level = sum / count;
        if level.is_nan() || level <= 0.0 {
            return None;
        }
        let index =
            |[x, y]: [u32; 2]| (y - film.window.min[1]) as usize * film.width() + (x - film.window.min[0]) as usize;
        let squares: Vec<f64> = judging
            .iter()
            .map(|truth| {
                let value = film.pixels[index(truth.at)].beauty.as_dvec3().to_array();
                truth.product(value, value) / (level * level)
            })
            .collect();
        let noises: Vec<f64> = judging.iter().map(|truth| truth.variance() / (level * level)).collect();
        let estimate = rms_of_squares(&squares, &noises)?;
        let asked = match self.goal {
            Goal::Error(error) => Some(error),
            Goal::Time(_) => None,
        };
        let description = self.scene.description();
        let mut set = vec![
            format!("occlusion.accuracy={}", description.occlusion.accuracy),
            format!("occlusion.faces={}", description.occlusion.face_count()),
            format!("sampling.layers={}", description.sampling.layers),
            format!("sampling.area_light_samples={}", description.sampling.area_light_samples),
            format!("sampling.surface_samples={}", description.sampling.surface_samples),
        ];
        set.extend(description.occlusion.rays.map(|rays| format!("occlusion.rays={rays}")));
        Some(Claim {
            asked,
            error: estimate.value,
            low: estimate.low.unwrap_or(0.0),
            high: estimate.high.unwrap_or(1.0),
            pixels: judging.len(),
            settings: KNOB.get(trial.place).map_or("reference", |(name, _)| *name).to_owned(),
            set,
            reached: asked.is_none_or(|asked| estimate.value <= asked),
        })
    }
}

/// One round of references: each half by random numbers of its own. `name` is the seed and the number of the round.
fn round(
    prepared: &Prepared<'_>,
    pixels: &[[u32; 2]],
    [seed, number]: [u32; 2],
    progress: &dyn Progress,
) -> Result<Vec<Truth>, RenderError> {
    let [a, b] = [0, 1].map(|half| prepared.pixels(pixels, hash(&[TRUTH, seed, half, number]), progress));
    let (a, b) = (a?, b?);
    let truth = |(&at, (a, b)): (&[u32; 2], (&Pixel, &Pixel))| Truth {
        at,
        halves: [a.beauty, b.beauty].map(|beauty| beauty.as_dvec3().to_array()),
    };
    Ok(pixels.iter().zip(a.pixels.iter().zip(&b.pixels)).map(truth).collect())
}
