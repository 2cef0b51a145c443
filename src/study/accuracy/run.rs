//! A study from beginning to end: plan, reference, sweep, files.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::errors::{Halves, Picture};
use super::measure::{Bench, Pace};
use super::page::{Shown, page};
use super::plan::{FEWEST_PIXELS, Plan, REFERENCE_PASSES, plan};
use super::results::{Machine, Point, Reference, Study};
use super::settings::{Case, KNOB, REFERENCE_WORK, REFERENCES, Skipped, cases, reference};
use super::state::{Measured, State, key};
use crate::file::{read_regular, write_whole};
use crate::image::RgbImage;
use crate::render::RenderError;
use crate::render::progress::Progress;
use crate::render::statistics::Stage;
use crate::scene::{AssetError, SceneError};

/// How a scene is studied.
#[derive(Clone, Debug)]
pub struct Options {
    /// Settings of all renders, as after `--set`.
    pub overrides: Vec<String>,
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
const PROBE_SIDE: f64 = 96.0;

/// Passes of the reference at the most, and the standard error that is enough.
const MOST_PASSES: u32 = 32;
const ENOUGH: f64 = 0.0015;

/// Share of a budget that may go into finding out how long settings take.
const FOR_PROBES: f64 = 0.12;

/// Share of a budget that the reference may take.
const FOR_REFERENCE: f64 = 0.45;

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
    let mut work = Work { options, state: &mut state, begin, progress, paces: &paces, cut: plan.cut.clone() };
    progress.stage("studying", (1000.0 * plan.seconds) as u64);
    let (halves, found) = work.reference(&mut bench, scene, &plan.reference)?;
    let exposure = bench.exposure();
    let mut points = Vec::new();
    let mut pictures = Vec::new();
    for (index, case) in cases.iter().enumerate().filter(|(index, _)| !plan.left_out.contains(index)) {
        if let Some((measured, rendered)) = work.case(&mut bench, index, case)? {
            let Some(errors) = halves.errors(&rendered, exposure) else { continue };
            points.push(point(case, &measured, errors));
            pictures.push(rendered.into_iter().next());
        }
    }
    let mut study = Study {
        scene: scene.display().to_string(),
        version: env!("CARGO_PKG_VERSION"),
        command: options.command.clone(),
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
    let bench = Bench::new(scene, &options.overrides, None, threads, progress)?;
    bench.notes().iter().for_each(|note| progress.message(&format!("note: {note}")));
    let (size, facts) = (bench.size(), bench.facts());
    let (cases, skipped) = cases(&facts);
    let budget = options.budget.map_or_else(String::new, |budget| budget.to_string());
    let names: Vec<String> = cases.iter().map(|case| format!("{} = {}", case.setting, case.value)).collect();
    let key = key(&[&bench.key(&[], 0), &budget, &options.repeats.to_string(), &names.join("\n")]);
    let path = options.folder.join("plan.json");
    let (plan, paces) = match read_plan(&path, &key) {
        Some(before) => before,
        None => {
            let scale = (PROBE_SIDE / f64::from(size[0].min(size[1]))).min(1.0);
            let small = size.map(|side| (f64::from(side) * scale).round().max(1.0) as u32);
            let mut probing = Bench::new(scene, &options.overrides, Some(small), threads, progress)?;
            progress.stage("probing", cases.len() as u64 + 1);
            let time = options.budget.unwrap_or(0.0);
            // Without a budget nothing depends on it: each render then counts the same.
            let mut paces = vec![Pace { before: 1.0, pixel: 0.0 }; cases.len()];
            let mut of_reference = Pace { before: 1.0, pixel: 0.0 };
            if options.budget.is_some() {
                of_reference = probing.probe(&reference(&facts, REFERENCES[1]))?;
                let probing_since = Instant::now();
                for (index, case) in cases.iter().enumerate() {
                    // What comes after is taken for the scene as it is; when its turn comes the time is looked at again.
                    let late = index > 0 && probing_since.elapsed().as_secs_f64() > FOR_PROBES * time;
                    paces[index] = if late { paces[0] } else { probing.probe(&case.set)? };
                    progress.advance(1);
                }
            }
            let knobs = cases.iter().filter(|case| case.setting.starts_with("knob")).count();
            // The default and the coarser half of the knob are what a study cannot do without.
            let kept = 1 + knobs.min(KNOB.len() / 2);
            let left = options.budget.map(|budget| (budget - begin.elapsed().as_secs_f64()).max(0.2 * budget));
            let finest = REFERENCES.len() - 1;
            let place = left.map_or(finest, |left| affordable(of_reference, left));
            let of_reference = Pace { pixel: of_reference.pixel * REFERENCE_WORK[place], ..of_reference };
            let mut plan = plan(size, &paces, &names, of_reference, options.repeats, kept, left);
            plan.reference = reference(&facts, REFERENCES[place]);
            if place < finest {
                let [faces, layers] = REFERENCES[place];
                plan.cut.push(format!("the reference has {faces} faces and {layers} layers in place of 256 and 256"));
            }
            let text = serde_json::to_vec(&(key, &plan, &paces)).unwrap_or_default();
            write_whole(&path, |out| out.write_all(&text)).map_err(|e| output_error(&path, &e))?;
            (plan, paces)
        }
    };
    drop(bench);
    let bench = Bench::new(scene, &options.overrides, Some(plan.size), threads, progress)?;
    Ok(Planned { plan, cases, paces, skipped, bench })
}

/// The finest reference that keeps to its share of a time at a small size.
fn affordable(second: Pace, left: f64) -> usize {
    let takes = |place: &usize| {
        let passes = f64::from(REFERENCE_PASSES) * REFERENCE_WORK[*place];
        second.before + passes * second.pixel * FEWEST_PIXELS
    };
    (0..REFERENCES.len()).rev().find(|place| takes(place) < FOR_REFERENCE * left).unwrap_or(0)
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
    paces: &'a [Pace],
    cut: Vec<String>,
}

impl Work<'_> {
    fn elapsed(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    /// The reference: passes in turns to two halves, until it is good enough or its share of the budget is spent.
    fn reference(
        &mut self,
        bench: &mut Bench<'_>,
        scene: &Path,
        set: &[String],
    ) -> Result<(Halves, Reference), StudyError> {
        let nothing = || StudyError::Nothing(scene.display().to_string());
        let seeds: Vec<u32> = (0..MOST_PASSES).map(|pass| bench.reference_seed(pass)).collect();
        let keys: Vec<String> = seeds.iter().map(|&seed| bench.key(set, seed)).collect();
        let mut sums = Sums::default();
        let before: Vec<_> = keys.iter().map_while(|key| self.state.find(key)).collect();
        for (measured, picture) in before {
            sums.add(&measured, picture);
            self.progress.advance((1000.0 * measured.seconds()[1]) as u64);
        }
        let enough = |sums: &Sums, elapsed: f64| {
            let spent = self.options.budget.is_some_and(|budget| elapsed > FOR_REFERENCE * budget);
            let pair = sums.count >= 2 && sums.count.is_multiple_of(2);
            pair && (spent || sums.count >= MOST_PASSES || sums.halves().is_none_or(|h| h.standard_error() < ENOUGH))
        };
        while !enough(&sums, self.elapsed()) {
            // In pairs, so that both halves stay of one size.
            let next = sums.count as usize..(sums.count as usize / 2 * 2 + 2).min(seeds.len());
            let (state, progress) = (&mut *self.state, self.progress);
            let path = self.options.folder.clone();
            bench.passes("reference", set, &seeds[next], |measured, picture| {
                progress.advance((1000.0 * measured.seconds()[1]) as u64);
                state.keep(&measured, &picture).map_err(|e| output_error(&path, &e))?;
                sums.add(&measured, picture);
                Ok(())
            })?;
        }
        let halves = sums.halves().ok_or_else(nothing)?;
        let found = Reference {
            set: set.to_vec(),
            passes: sums.count,
            standard_error: halves.standard_error(),
            cpu_seconds: sums.cpu,
            seen: halves.seen(),
        };
        Ok((halves, found))
    }

    /// All repetitions of a case; none where the budget is spent.
    fn case(&mut self, bench: &mut Bench<'_>, index: usize, case: &Case) -> Result<Option<Repetitions>, StudyError> {
        let (mut all, mut pictures) = (Vec::new(), Vec::new());
        let label = format!("{} = {}", case.setting, case.value);
        let pixels = bench.size().iter().map(|&side| f64::from(side)).product();
        let expected = self.paces.get(index).map_or(0.0, |pace| pace.of(pixels));
        for repeat in 0..self.options.repeats {
            let seed = bench.repeat_seed(repeat);
            let (measured, picture) = match self.state.find(&bench.key(&case.set, seed)) {
                Some(found) => found,
                None => {
                    let over = |budget: f64| self.elapsed() + expected > budget;
                    // The first of all is done in any case: without it there is nothing to show.
                    if index > 0 && self.options.budget.is_some_and(over) {
                        self.cut.push(format!(
                            "{label}: {repeat} of {} repetitions: the time was up",
                            self.options.repeats
                        ));
                        break;
                    }
                    let done = bench.render(&label, &case.set, seed)?;
                    let folder = &self.options.folder;
                    self.state.keep(&done.0, &done.1).map_err(|e| output_error(folder, &e))?;
                    done
                }
            };
            self.progress.advance((1000.0 * expected) as u64);
            all.push(measured);
            pictures.push(picture.rgb);
        }
        Ok((!all.is_empty()).then_some((all, pictures)))
    }
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
        self.cpu += measured.seconds()[0];
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
