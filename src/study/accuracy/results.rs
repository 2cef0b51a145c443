//! What a study found, in numbers.

use serde::Serialize;

use super::errors::Errors;
use super::frontier::frontier;
use super::settings::Skipped;
use crate::render::statistics::Stage;

/// A study of a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Study {
    /// The scene's file.
    pub scene: String,
    pub version: &'static str,
    /// The command that made it.
    pub command: String,
    /// Settings of all renders, as after `--set`.
    pub overrides: Vec<String>,
    pub machine: Machine,
    /// Columns and rows of the pictures.
    pub size: [u32; 2],
    /// Pictures of different seeds a point.
    pub repeats: u32,
    pub reference: Reference,
    /// The scene as it is first.
    pub points: Vec<Point>,
    /// Settings that do not apply.
    pub skipped: Vec<Skipped>,
    /// What was cut for the budget.
    pub cut: Vec<String>,
    /// Indices of the points that no other beats in both error and time, by time.
    pub frontier: Vec<usize>,
    pub advice: Vec<Advice>,
}

/// The machine that it ran on.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    pub processor: String,
    pub processors: usize,
    pub threads: usize,
    pub system: String,
    /// Jobs that waited for a processor in the last minute, at the end of the study: this one's own and others'.
    pub load: Option<f64>,
}

/// The converged picture.
#[derive(Clone, Debug, Serialize)]
pub struct Reference {
    pub set: Vec<String>,
    /// Passes in both halves together.
    pub passes: u32,
    /// RMS standard error of a pixel, relative to the mean.
    pub standard_error: f64,
    pub cpu_seconds: f64,
    /// Pixels in which something is seen, of all.
    pub seen: [usize; 2],
}

/// Settings, what they cost and by how much they err.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// The setting that is swept; "default" for the scene as it is.
    pub setting: String,
    pub value: String,
    pub set: Vec<String>,
    #[serde(flatten)]
    pub errors: Errors,
    /// Mean of the repetitions, in seconds; `spread` is their standard deviation.
    pub cpu_seconds: f64,
    pub cpu_spread: f64,
    pub wall_seconds: f64,
    /// Means of the repetitions.
    pub stages: Vec<Stage>,
    /// In bytes.
    pub peak_bytes: u64,
    /// Whether the peak is this render's own: where not, it is the process's so far.
    pub own_peak: bool,
}

/// What to use for an error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Advice {
    /// Relative RMS error.
    pub target: f64,
    /// The cheapest point within it; none where none is.
    pub point: Option<usize>,
    pub text: String,
    /// To copy; empty where there is no point.
    pub command: String,
}

/// The errors that advice is given for.
pub const TARGETS: [f64; 4] = [0.05, 0.02, 0.01, 0.005];

impl Study {
    /// Finds the frontier and the advice from the points.
    pub fn conclude(&mut self) {
        let pairs: Vec<[f64; 2]> = self.points.iter().map(|point| [point.cpu_seconds, point.errors.rms]).collect();
        self.frontier = frontier(&pairs);
        self.advice = TARGETS.iter().map(|&target| self.advise(target)).collect();
    }

    fn advise(&self, target: f64) -> Advice {
        let percent = percent(target);
        let within = self.frontier.iter().copied().find(|&i| self.points[i].errors.at_most <= target);
        let with = |set: &[String]| {
            // The size of the study's pictures is not that of the picture.
            let all = self.overrides.iter().filter(|set| !set.starts_with("camera.resolution=")).chain(set);
            let set: String = all.map(|set| format!(" --set {}", quoted(set))).collect();
            format!("tress render {} -o picture.exr{set}", quoted(&self.scene))
        };
        let Some(index) = within else {
            let least =
                |of: fn(&Errors) -> f64| self.points.iter().map(|p| of(&p.errors)).fold(f64::INFINITY, f64::min);
            let [best, sure] = [least(|errors| errors.rms), least(|errors| errors.at_most)];
            let why = if best <= target {
                let known = self::percent(self.reference.standard_error);
                format!(
                    "the reference, known to {known}, does not tell whether any of these settings is enough (the best err by less than {})",
                    self::percent(sure)
                )
            } else {
                format!("none of these settings is enough (the best err by {})", self::percent(best))
            };
            return Advice {
                target,
                point: None,
                text: format!("For an error of {percent}, {why}; --max-error finds more."),
                command: format!("{} --max-error {target}", with(&[])),
            };
        };
        let point = &self.points[index];
        let default = &self.points[0];
        let against = match point.cpu_seconds / default.cpu_seconds {
            _ if index == 0 => String::new(),
            ratio if ratio >= 1.0 => format!(", {ratio:.1} times the default's"),
            ratio => format!(", {:.0} % of the default's", 100.0 * ratio),
        };
        let text = format!(
            "For an error of {percent}, use {}: it errs by {} and takes {} of CPU time{against}.",
            if index == 0 { "the scene as it is".to_owned() } else { format!("{} = {}", point.setting, point.value) },
            self::percent(point.errors.rms),
            seconds(point.cpu_seconds),
        );
        Advice { target, point: Some(index), text, command: with(&point.set) }
    }

    /// All points as comma-separated values, with a head.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "setting,value,frontier,rms,at_most,noise,bias,mean,max,flip,cpu_seconds,cpu_spread,wall_seconds,building_cpu,calibrating_cpu,binning_cpu,rendering_cpu,peak_bytes,own_peak,set\n",
        );
        for (index, point) in self.points.iter().enumerate() {
            let e = &point.errors;
            let stage = |name: &str| {
                point.stages.iter().find(|stage| stage.name == name).map_or(0.0, |stage| stage.cpu_seconds)
            };
            let noise = e.noise.map_or_else(String::new, |noise| format!("{noise:.6}"));
            text.push_str(&format!(
                "{},{},{},{:.6},{:.6},{noise},{:.6},{:.6},{:.6},{:.6},{:.4},{:.4},{:.4},{:.4},{:.4},{:.4},{:.4},{},{},{}\n",
                cell(&point.setting),
                cell(&point.value),
                u8::from(self.frontier.contains(&index)),
                e.rms,
                e.at_most,
                e.bias,
                e.mean,
                e.max,
                e.flip,
                point.cpu_seconds,
                point.cpu_spread,
                point.wall_seconds,
                stage("building"),
                stage("calibrating"),
                stage("binning"),
                stage("rendering"),
                point.peak_bytes,
                point.own_peak,
                cell(&point.set.join(" ")),
            ));
        }
        text
    }
}

/// A cell of a table of comma-separated values (RFC 4180).
fn cell(text: &str) -> String {
    let plain = !text.contains([',', '"', '\n', '\r']);
    if plain { text.to_owned() } else { format!("\"{}\"", text.replace('"', "\"\"")) }
}

/// A word for a shell.
fn quoted(text: &str) -> String {
    let plain = text.chars().all(|c| c.is_ascii_alphanumeric() || "_./=-:+".contains(c));
    if plain && !text.is_empty() { text.to_owned() } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

/// A share in per cent, three digits of it.
#[must_use]
pub fn percent(share: f64) -> String {
    let value = 100.0 * share;
    let digits = if value.abs() >= 10.0 { 1 } else { 2 };
    let text = format!("{value:.digits$}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    format!("{text} %")
}

/// Seconds, three digits of them.
#[must_use]
pub fn seconds(seconds: f64) -> String {
    match seconds {
        s if s >= 100.0 => format!("{s:.0} s"),
        s if s >= 10.0 => format!("{s:.1} s"),
        s => format!("{s:.2} s"),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A study of made-up numbers.
    pub fn sample() -> Study {
        let point = |setting: &str, value: &str, cpu: f64, rms: f64| Point {
            setting: setting.to_owned(),
            value: value.to_owned(),
            set: vec![format!("sampling.layers={value}"), "occlusion.mode=igloo".to_owned()],
            errors: Errors {
                rms,
                at_most: 1.1 * rms,
                noise: Some(rms / 2.0),
                bias: rms * 0.8,
                mean: -rms / 3.0,
                max: rms * 9.0,
                flip: 0.01,
            },
            cpu_seconds: cpu,
            cpu_spread: 0.1,
            wall_seconds: cpu / 2.0,
            stages: vec![Stage { name: "rendering".to_owned(), seconds: cpu / 2.0, cpu_seconds: cpu, peak_bytes: 0 }],
            peak_bytes: 1 << 28,
            own_peak: true,
        };
        let mut study = Study {
            scene: "a <b> & 'c'.toml".to_owned(),
            version: "0",
            command: "tress study \"x\"".to_owned(),
            overrides: vec!["camera.resolution=[9, 9]".to_owned(), "sampling.seed=7".to_owned()],
            machine: Machine {
                processor: "one".to_owned(),
                processors: 2,
                threads: 2,
                system: "linux".to_owned(),
                load: Some(1.0),
            },
            size: [64, 64],
            repeats: 2,
            reference: Reference {
                set: vec!["occlusion.faces=256".to_owned()],
                passes: 4,
                standard_error: 0.001,
                cpu_seconds: 99.0,
                seen: [10, 20],
            },
            points: vec![
                point("default", "the scene as it is", 10.0, 0.03),
                point("knob igloo", "draft", 2.0, 0.04),
                point("layers", "4", 12.0, 0.015),
                point("layers", "8", 20.0, 0.016),
            ],
            skipped: vec![Skipped {
                setting: "opening".to_owned(),
                key: "occlusion.opening".to_owned(),
                reason: "idle".to_owned(),
            }],
            cut: vec!["something".to_owned()],
            frontier: Vec::new(),
            advice: Vec::new(),
        };
        study.conclude();
        study
    }

    #[test]
    fn advice_names_the_cheapest_within_an_error() {
        let study = sample();
        assert_eq!(study.frontier, [1, 0, 2]);
        let points: Vec<Option<usize>> = study.advice.iter().map(|advice| advice.point).collect();
        assert_eq!(points, [Some(1), Some(2), None, None]);
        assert!(study.advice[0].text.contains("20 % of the default's"), "{}", study.advice[0].text);
        assert_eq!(
            study.advice[0].command,
            "tress render 'a <b> & '\\''c'\\''.toml' -o picture.exr --set sampling.seed=7 --set sampling.layers=draft --set occlusion.mode=igloo"
        );
        assert!(
            study.advice[2].text.contains("1.5 %")
                && study.advice[2].command.ends_with("--set sampling.seed=7 --max-error 0.01")
        );
        // What the reference does not tell is not advised.
        let mut study = sample();
        for point in &mut study.points {
            (point.errors.rms, point.errors.at_most) = (0.004, 0.013);
        }
        study.conclude();
        let points: Vec<Option<usize>> = study.advice.iter().map(|advice| advice.point).collect();
        assert_eq!(points, [Some(1), Some(1), None, None]);
        assert!(study.advice[2].text.contains("does not tell") && study.advice[2].text.contains("less than 1.3 %"));
    }

    #[test]
    fn the_table_has_a_cell_for_each_column() {
        let csv = sample().csv();
        let columns: Vec<usize> = csv.lines().map(|line| line.split(',').count()).collect();
        assert_eq!(columns, [20; 5]);
        assert_eq!([cell("a"), cell("a,\"b\"")], ["a", "\"a,\"\"b\"\"\""]);
        assert_eq!(
            [percent(0.05), percent(0.005), percent(0.1234), percent(-0.0012)],
            ["5 %", "0.5 %", "12.3 %", "-0.12 %"]
        );
    }
}
