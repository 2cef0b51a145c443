//! A study from beginning to end: plan, reference, sweep, files.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::errors::{Halves, Picture};
use super::measure::{Bench, Pace};
use super::page::{Shown, page};
use super::plan::{LEFT_FOR_REFERENCE, Plan, REFERENCE_PASSES, Wish};
use super::probing::{Paces, probe};
use super::results::{Machine, Point, Reference, Study};
use super::settings::{Case, KNOB, REFERENCES, Skipped, cases, reference};
use super::state::{Measured, State, key};
use crate::file::{read_regular, write_whole};
use crate::fragment::PixelRect;
use crate::image::RgbImage;
use crate::render::progress::Progress;
use crate::render::statistics::Stage;
use crate::render::{RenderError, ShadowMaps};
use crate::scene::{AssetError, SceneError};

/// How a scene is studied.
#[derive(Clone, Debug)]
pub struct Options {
    /// Settings of all renders, as after `--set`.
    pub overrides: Vec<String>,
    /// The part of the picture that is looked at; all of it where none.
    pub crop: Option<PixelRect>,
    /// Where everything goes; made if it is not there.
    pub folder: PathBuf,
    /// Seconds of the clock on the wall that it may take.
    pub budget: Option<f64>,
    /// Renders of each setting, of different seeds.
    pub repeats: u32,
    /// Threads; one a processor where none.
    pub threads: Option<usize>,
    /// The command, for the record.
    pub command: String,
}

/// Why there is no study.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Asset(#[from] AssetError),
    #[error(transparent)]
    Render(#[from] RenderError),
    #[error("{}: {message}", path.display())]
    Output { path: PathBuf, message: String },
    #[error("{0}: nothing is seen in the picture, or it is black: there is no error to speak of")]
    Nothing(String),
}

/// The side of the picture that times are measured on, in pixels.
const PROBE_SIDE: f64 = 24.0;

/// Passes of the reference at the most.
const MOST_PASSES: u32 = 32;
/// Its standard error that is enough, as a share of the least error that is found, and in any case.
const SHARE: f64 = 0.2;
const ENOUGH: f64 = 0.0005;

/// Shares of a budget after which nothing is begun: passes of the reference beyond the first two, and cases.
const FOR_RENDERS: f64 = 0.9;
const FOR_CASES: f64 = 0.95;

/// Studies a scene and writes `study.html`, `study.json` and `study.csv` into the folder.
///
/// # Errors
/// Scenes that cannot be rendered, folders that cannot be written, cancelled work: what was measured is kept for the next time.
pub fn study(scene: &Path, options: &Options, progress: &dyn Progress) -> Result<Study, StudyError> {
    let begin = Instant::now();
    let failed = |e: std::io::Error| StudyError::Output { path: options.folder.clone(), message: e.to_string() };
    let mut state = State::open(&options.folder).map_err(failed)?;
    let Planned { plan, cases, paces, skipped, mut bench } = planned(scene, options, progress)?;
    plan.cut.iter().for_each(|line| progress.message(&format!("budget: {line}")));
    let mut work =
        Work { options, state: &mut state, begin, progress, cut: plan.cut.clone(), drift: [0.0; 2], kept: 0.0 };
    progress.stage("studying", (1000.0 * plan.seconds) as u64);
    let set = reference(bench.facts(), REFERENCES[plan.reference]);
    let nothing = || StudyError::Nothing(scene.display().to_string());
    let mut sums = Sums::default();
    work.reference(&mut bench, &set, &mut sums, REFERENCE_PASSES)?;
    sums.halves().ok_or_else(nothing)?;
    work.kept = options.budget.map_or(0.0, |budget| (LEFT_FOR_REFERENCE * budget - sums.wall).max(0.0));
    let done = work.cases(&mut bench, &cases, &paces)?;
    work.refine(&mut bench, &set, &mut sums, &done)?;
    let halves = sums.halves().ok_or_else(nothing)?;
    let (found, exposure) = (sums.found(set, &halves), bench.exposure());
    let (mut points, mut pictures) = (Vec::new(), Vec::new());
    for (index, (measured, rendered)) in done {
        let Some(errors) = halves.errors(&rendered, exposure) else { continue };
        points.push(point(&cases[index], &measured, errors));
        pictures.push(rendered.into_iter().next());
    }
    let mut study = Study {
        scene: scene.display().to_string(),
        version: env!("CARGO_PKG_VERSION"),
        command: options.command.clone(),
        overrides: options.overrides.clone(),
        machine: machine(options.threads),
        size: plan.size,
        repeats: options.repeats,
        reference: found,
        points,
        skipped,
        cut: work.cut,
        frontier: Vec::new(),
        advice: Vec::new(),
    };
    study.conclude();
    write_files(&study, &halves, &pictures, exposure, &options.folder)?;
    Ok(study)
}

/// What is to be done, and the scene at its size.
struct Planned<'a> {
    plan: Plan,
    cases: Vec<Case>,
    paces: Vec<Pace>,
    skipped: Vec<Skipped>,
    bench: Bench<'a>,
}

/// Probes all settings at a small size and plans; a plan that was made before for the same is taken again, so that a study can go on.
fn planned<'a>(scene: &Path, options: &Options, progress: &'a dyn Progress) -> Result<Planned<'a>, StudyError> {
    let begin = Instant::now();
    let threads = options.threads;
    let bench = Bench::new(scene, &options.overrides, options.crop, None, threads, progress)?;
    bench.notes().iter().for_each(|note| progress.message(&format!("note: {note}")));
    let size = bench.size();
    let (cases, skipped) = cases(bench.facts());
    let budget = options.budget.map_or_else(String::new, |budget| budget.to_string());
    let names: Vec<String> = cases.iter().map(|case| format!("{} = {}", case.setting, case.value)).collect();
    let key = key(&[&bench.key(&[], 0), &budget, &options.repeats.to_string(), &names.join("\n")]);
    let path = options.folder.join("plan.json");
    let mut maps = ShadowMaps::default();
    let (plan, paces) = match read_plan(&path, &key) {
        Some(before) => before,
        None => {
            let (plan, paces, made) = new_plan(scene, options, size, &cases, begin, progress)?;
            maps = made;
            let text = serde_json::to_vec(&(key, &plan, &paces)).unwrap_or_default();
            write_whole(&path, |out| out.write_all(&text)).map_err(|e| output_error(&path, &e))?;
            (plan, paces)
        }
    };
    drop(bench);
    let bench =
        Bench::new(scene, &options.overrides, options.crop, Some(plan.size), threads, progress)?.with_maps(maps);
    Ok(Planned { plan, cases, paces, skipped, bench })
}

fn new_plan(
    scene: &Path,
    options: &Options,
    size: [u32; 2],
    cases: &[Case],
    begin: Instant,
    progress: &dyn Progress,
) -> Result<(Plan, Vec<Pace>, ShadowMaps), StudyError> {
    let scale = (PROBE_SIDE / f64::from(size[0].min(size[1]))).min(1.0);
    let small = size.map(|side| (f64::from(side) * scale).round().max(1.0) as u32);
    let mut bench = Bench::new(scene, &options.overrides, options.crop, Some(small), options.threads, progress)?;
    progress.stage("probing", cases.len() as u64 + 1);
    let paces = match options.budget {
        Some(budget) => probe(&mut bench, cases, budget)?,
        None => Paces::alike(cases),
    };
    let knobs = cases.iter().filter(|case| case.setting.starts_with("knob")).count();
    let wish = Wish {
        size,
        crop: options.crop.is_some(),
        cases: &paces.cases,
        references: &paces.references,
        repeats: options.repeats,
        // The default and the coarsest of the knob are what a study cannot do without.
        kept: 1 + knobs.min(KNOB.len() / 3),
        budget: options.budget.map(|budget| (budget - begin.elapsed().as_secs_f64()).max(0.2 * budget)),
    };
    let mut plan = wish.plan();
    if plan.reference + 1 < REFERENCES.len() {
        let [[faces, layers, _], [fine, deep, _]] = [plan.reference, REFERENCES.len() - 1].map(|i| REFERENCES[i]);
        plan.cut.push(format!("the reference has {faces} faces and {layers} layers in place of {fine} and {deep}"));
    }
    Ok((plan, paces.cases, bench.into_maps()))
}

fn read_plan(path: &Path, key: &str) -> Option<(Plan, Vec<Pace>)> {
    let bytes = read_regular(path, 1 << 20).ok()?;
    let (found, plan, paces): (String, Plan, Vec<Pace>) = serde_json::from_slice(&bytes).ok()?;
    (found == key).then_some((plan, paces))
}

fn output_error(path: &Path, e: &dyn std::fmt::Display) -> StudyError {
    StudyError::Output { path: path.to_owned(), message: e.to_string() }
}

/// Renders of a study, those of an earlier run taken from its state.
struct Work<'a> {
    options: &'a Options,
    state: &'a mut State,
    begin: Instant,
    progress: &'a dyn Progress,
    cut: Vec<String>,
    /// Seconds that cases took, and those that were expected of them.
    drift: [f64; 2],
    /// Seconds of the budget that cases leave to the reference.
    kept: f64,
}

impl Work<'_> {
    fn elapsed(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    /// Passes of the reference until there are so many, in turns to two halves; those of an earlier run from its state.
    fn reference(
        &mut self,
        bench: &mut Bench<'_>,
        set: &[String],
        sums: &mut Sums,
        most: u32,
    ) -> Result<(), StudyError> {
        // Photons are drawn before the first pass: each half needs its own.
        let at_once = if bench.facts().effects.photons { 1 } else { 2 };
        while sums.count < most && (sums.count < 2 || !sums.count.is_multiple_of(2) || self.time_for_passes(sums)) {
            let seeds: Vec<u32> = (sums.count..sums.count + at_once).map(|pass| bench.reference_seed(pass)).collect();
            let before: Vec<_> = seeds.iter().map_while(|&seed| self.state.find(&bench.key(set, seed))).collect();
            let found = before.len();
            for (measured, picture) in before {
                self.progress.advance((1000.0 * measured.seconds()[1]) as u64);
                sums.add(&measured, picture);
            }
            let (state, progress) = (&mut *self.state, self.progress);
            let path = self.options.folder.clone();
            if found == seeds.len() {
                continue;
            }
            bench.passes("reference", set, &seeds[found..], |measured, picture| {
                progress.advance((1000.0 * measured.seconds()[1]) as u64);
                state.keep(&measured, &picture).map_err(|e| output_error(&path, &e))?;
                sums.add(&measured, picture);
                Ok(())
            })?;
        }
        Ok(())
    }

    /// More passes, until the best settings err by much more than the reference.
    fn refine(
        &mut self,
        bench: &mut Bench<'_>,
        set: &[String],
        sums: &mut Sums,
        done: &[(usize, Repetitions)],
    ) -> Result<(), StudyError> {
        let enough = |halves: Halves| {
            let errors = done.iter().filter_map(|(_, (_, pictures))| halves.rms(pictures));
            halves.standard_error() < (SHARE * errors.fold(f64::INFINITY, f64::min)).max(ENOUGH)
        };
        while sums.count < MOST_PASSES && self.time_for_passes(sums) && !sums.halves().is_none_or(enough) {
            let most = sums.count + 2;
            self.reference(bench, set, sums, most)?;
        }
        Ok(())
    }

    /// Whether there is time for two more passes.
    fn time_for_passes(&self, sums: &Sums) -> bool {
        let two = 2.0 * sums.wall / f64::from(sums.count.max(1));
        self.options.budget.is_none_or(|budget| self.elapsed() + two < FOR_RENDERS * budget)
    }

    /// As many cases as there is time for, with their numbers and in their order: all once, then again.
    fn cases(
        &mut self,
        bench: &mut Bench<'_>,
        cases: &[Case],
        paces: &[Pace],
    ) -> Result<Vec<(usize, Repetitions)>, StudyError> {
        let pixels: f64 = bench.size().map(f64::from).iter().product();
        // Those that take least first, so that it is the dear ones that are missed where the time is up before the end; of those that take the same, the
        // coarse ends of all settings.
        let step = |index: usize| (0..index).filter(|&i| cases[i].setting == cases[index].setting).count();
        let mut order: Vec<usize> = (0..cases.len()).collect();
        order.sort_by_key(|&index| step(index));
        // Each of these has shadow maps of its own: the scene's are made again after them.
        order.sort_by_key(|&index| cases[index].has_other_maps());
        order.sort_by(|&a, &b| paces[a].of(pixels).total_cmp(&paces[b].of(pixels)));
        order.sort_by_key(|&index| index > 0);
        let mut done: Vec<Repetitions> = vec![Repetitions::default(); cases.len()];
        for repeat in 0..self.options.repeats {
            for &index in &order {
                if done[index].0.len() < repeat as usize {
                    continue;
                }
                // Of a setting's values the later take more: as much more as the last that are done.
                let setting = &cases[index].setting;
                let seconds = |i: usize| done[i].0.last().map(|measured| measured.seconds()[1]);
                let mut earlier = (0..index).rev().filter(|&i| cases[i].setting == *setting).filter_map(seconds);
                let [last, before] = [earlier.next(), earlier.next()];
                let growth = last.zip(before).map_or(1.0, |(last, before)| (last / before).clamp(1.0, 8.0));
                let known = seconds(index).unwrap_or(growth * last.unwrap_or(0.0));
                let planned = paces[index].of(pixels);
                if let Some((measured, picture)) = self.case(bench, index, &cases[index], repeat, [known, planned])? {
                    done[index].0.push(measured);
                    done[index].1.push(picture.rgb);
                }
            }
        }
        self.cut.extend(missed(cases, &done, self.options.repeats));
        Ok(done.into_iter().enumerate().filter(|(_, (all, _))| !all.is_empty()).collect())
    }

    /// One repetition of a case; none where the budget is spent. Its time is at least the first of two numbers, and was planned to be the second.
    fn case(
        &mut self,
        bench: &mut Bench<'_>,
        index: usize,
        case: &Case,
        repeat: u32,
        [known, planned]: [f64; 2],
    ) -> Result<Option<(Measured, Picture)>, StudyError> {
        let seed = bench.repeat_seed(repeat);
        if let Some(found) = self.state.find(&bench.key(&case.set, seed)) {
            self.progress.advance((1000.0 * planned) as u64);
            return Ok(Some(found));
        }
        // What other work on the machine and a guess from few pixels make of it.
        let [took, expected] = self.drift;
        let factor = if took > 1.0 { (took / expected).clamp(0.1, 4.0) } else { 1.0 };
        let over = |budget: f64| self.elapsed() + (factor * planned).max(known) > FOR_CASES * budget - self.kept;
        // The first of all is done in any case: without it there is nothing to show.
        if (index > 0 || repeat > 0) && self.options.budget.is_some_and(over) {
            return Ok(None);
        }
        let done = bench.render(&format!("{} = {}", case.setting, case.value), &case.set, seed)?;
        self.drift[0] += done.0.seconds()[1];
        self.drift[1] += planned;
        let folder = &self.options.folder;
        self.state.keep(&done.0, &done.1).map_err(|e| output_error(folder, &e))?;
        self.progress.advance((1000.0 * planned) as u64);
        Ok(Some(done))
    }
}

/// What was missed for want of time, in words: a line a setting.
fn missed(cases: &[Case], done: &[Repetitions], repeats: u32) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let values = |setting: &str, rendered: usize| {
        let of = cases.iter().zip(done).filter(|(case, (all, _))| case.setting == setting && all.len() == rendered);
        of.map(|(case, _)| case.value.as_str()).collect::<Vec<_>>().join(", ")
    };
    let mut settings: Vec<&str> = cases.iter().map(|case| case.setting.as_str()).collect();
    settings.dedup();
    for setting in settings {
        let missing = values(setting, 0);
        if !missing.is_empty() {
            lines.push(format!("{setting}: {missing} left out, there was no time for it"));
        }
    }
    let fewer = done.iter().filter(|(all, _)| !all.is_empty() && all.len() < repeats as usize).count();
    if fewer > 0 {
        let all = done.iter().filter(|(all, _)| !all.is_empty()).count();
        lines.push(format!(
            "{fewer} of {all} settings were rendered fewer than {repeats} times; where it was once, noise counts as bias"
        ));
    }
    lines
}

/// What the repetitions of a case took, and their pictures.
type Repetitions = (Vec<Measured>, Vec<RgbImage>);

/// Two halves of the reference being summed.
#[derive(Default)]
struct Sums {
    halves: [Option<Picture>; 2],
    counts: [f32; 2],
    count: u32,
    cpu: f64,
    wall: f64,
}

impl Sums {
    fn add(&mut self, measured: &Measured, picture: Picture) {
        let half = self.count as usize % 2;
        self.counts[half] += 1.0;
        let n = self.counts[half];
        match &mut self.halves[half] {
            slot @ None => *slot = Some(picture),
            Some(sum) => {
                for (mean, value) in sum.rgb.pixels.iter_mut().flatten().zip(picture.rgb.pixels.iter().flatten()) {
                    *mean += (value - *mean) / n;
                }
                sum.alpha.iter_mut().zip(&picture.alpha).for_each(|(mean, value)| *mean += (value - *mean) / n);
            }
        }
        self.count += 1;
        let [cpu, wall] = measured.seconds();
        self.cpu += cpu;
        self.wall += wall;
    }

    fn found(&self, set: Vec<String>, halves: &Halves) -> Reference {
        let (standard_error, seen) = (halves.standard_error(), halves.seen());
        Reference { set, passes: self.count, standard_error, cpu_seconds: self.cpu, seen }
    }

    fn halves(&self) -> Option<Halves> {
        let [Some(a), Some(b)] = &self.halves else { return None };
        Halves::new([a.clone(), b.clone()])
    }
}

fn point(case: &Case, all: &[Measured], errors: super::errors::Errors) -> Point {
    let n = all.len() as f64;
    let mean = |part: usize| all.iter().map(|measured| measured.seconds()[part]).sum::<f64>() / n;
    let [cpu, wall] = [mean(0), mean(1)];
    let spread = all.iter().map(|measured| (measured.seconds()[0] - cpu).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let mut stages: Vec<Stage> = all[0].stages.clone();
    for stage in &mut stages {
        let of = |get: fn(&Stage) -> f64| {
            all.iter()
                .flat_map(|measured| measured.stages.iter().filter(|s| s.name == stage.name))
                .map(get)
                .sum::<f64>()
                / n
        };
        (stage.cpu_seconds, stage.seconds) = (of(|s| s.cpu_seconds), of(|s| s.seconds));
    }
    Point {
        setting: case.setting.clone(),
        value: case.value.clone(),
        set: case.set.clone(),
        errors,
        cpu_seconds: cpu,
        cpu_spread: spread.sqrt(),
        wall_seconds: wall,
        stages,
        peak_bytes: all.iter().map(|measured| measured.peak_bytes).max().unwrap_or(0),
        own_peak: all.iter().all(|measured| measured.own_peak),
    }
}

fn machine(threads: Option<usize>) -> Machine {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let info = read("/proc/cpuinfo");
    let model = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    Machine {
        processor: model.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned()),
        processors,
        threads: threads.unwrap_or(processors),
        system: format!("{} {}", std::env::consts::OS, read("/proc/sys/kernel/osrelease").trim()),
        load: read("/proc/loadavg").split(' ').next().and_then(|load| load.parse().ok()),
    }
}

fn write_files(
    study: &Study,
    halves: &Halves,
    pictures: &[Option<RgbImage>],
    exposure: f32,
    folder: &Path,
) -> Result<(), StudyError> {
    let shown = Shown { reference: &halves.mean, pictures, exposure };
    let html = page(study, &shown).map_err(|e| output_error(folder, &e))?;
    let json = serde_json::to_string_pretty(study).map_err(|e| output_error(folder, &e))?;
    for (name, text) in [("study.html", html), ("study.json", json), ("study.csv", study.csv())] {
        let path = folder.join(name);
        write_whole(&path, |out| out.write_all(text.as_bytes())).map_err(|e| output_error(&path, &e))?;
    }
    Ok(())
}
