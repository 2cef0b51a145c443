//! What a render did, and what it took.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::calibration::Settled;
use super::costs::Cost;
use super::cpu;
use super::shadows::Made;
use crate::effects::Effect;
use crate::tally::Counts;

/// A value that was not finite, and where.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NonFinite {
    /// Column and row of the pixel.
    pub pixel: [u32; 2],
    /// Which of the pixel's shading points, as `--pixel` numbers them; none where they are sound and their sum is not.
    pub sample: Option<u32>,
    /// What was shaded there.
    pub what: String,
}

/// Time and peak memory at the end of a stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    pub name: String,
    /// Wall time, in seconds.
    pub seconds: f64,
    /// CPU time of all threads of the process, in seconds.
    pub cpu_seconds: f64,
    /// Largest resident memory of the process so far, in bytes; 0 where the system does not say.
    pub peak_bytes: u64,
}

/// Measures a stage from its beginning.
#[derive(Clone, Copy, Debug)]
pub struct Watch {
    begin: Instant,
    cpu: Duration,
}

impl Watch {
    /// Starts now.
    #[must_use]
    pub fn start() -> Self {
        Self { begin: Instant::now(), cpu: cpu::process() }
    }

    /// CPU seconds of the process since its start, and starts it again.
    pub fn lap(&mut self) -> f64 {
        let seconds = cpu::process().saturating_sub(self.cpu).as_secs_f64();
        *self = Self::start();
        seconds
    }

    /// Wall time since its start.
    #[must_use]
    pub fn elapsed(&self) -> Duration {
        self.begin.elapsed()
    }

    /// The stage that ends now.
    #[must_use]
    pub fn stage(&self, name: &str) -> Stage {
        Stage {
            name: name.to_owned(),
            seconds: self.begin.elapsed().as_secs_f64(),
            cpu_seconds: cpu::process().saturating_sub(self.cpu).as_secs_f64(),
            peak_bytes: peak_memory(),
        }
    }
}

/// CPU seconds of the shading stage by part, summed over threads. The parts are timed by the clock on the wall, which a point can afford, and
/// scaled tile by tile to the CPU time of the tile's thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Parts {
    pub fragments: f64,
    pub gamma: f64,
    pub lambda: f64,
    pub direct: f64,
}

/// The error that a render claims: relative root mean square error of the beauty over the pixels in which something is seen, noise and bias together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// What was asked for; none where the time was.
    pub asked: Option<f64>,
    pub error: f64,
    /// 95 times in 100 the error lies between these; `high` is infinite (null in JSON) where a single pixel tells none.
    pub low: f64,
    pub high: f64,
    /// Pixels that it was found at.
    pub pixels: usize,
    /// The settings' name, and what they are.
    pub settings: String,
    pub set: Vec<String>,
    /// Whether it is what was asked for.
    pub reached: bool,
}

/// What is lost because a ray or a photon meets no more than `indirect.specular_depth` mirrors and glass, as shares of all that meets such surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SpecularCut {
    /// Of what rays see there, by their weights.
    pub seen: f64,
    /// Of the power of caustics.
    pub caustics: f64,
}

/// Statistics of a render.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    pub segments: u64,
    pub triangles: u64,
    pub hair_fragments: u64,
    pub hair_points: u64,
    pub surface_points: u64,
    pub threads: usize,
    pub stages: Vec<Stage>,
    pub cpu_seconds: Parts,
    /// How many shading points gave a value that is not finite.
    pub non_finite: u64,
    /// The first few of them.
    pub non_finite_examples: Vec<NonFinite>,
    pub effects: Vec<Effect>,
    /// What each of them took.
    pub costs: Vec<Cost>,
    /// CPU seconds that were expected in all, loading and writing left out; none unless asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planned_cpu_seconds: Option<f64>,
    /// Work that was done, of all kinds.
    pub work: Counts,
    /// What was worth telling about the files that the scene names.
    pub notes: Vec<String>,
    /// How hair occlusion was found, where its accuracy decided.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occlusion: Option<Settled>,
    /// Passes whose mean the picture is.
    pub passes: u32,
    /// The error of the picture, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub claim: Option<Claim>,
    /// The shadow maps of lights that asked for them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shadow_maps: Vec<Made>,
    /// What of the light in mirrors and glass was cut off; none without such surfaces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specular: Option<SpecularCut>,
    /// Mean of the picture, linear Rec.709.
    pub mean: [f32; 3],
}

impl Statistics {
    /// How many examples of values that are not finite are kept.
    pub const EXAMPLES: usize = 16;

    /// Notes that a stage ended; a stage that was there before goes on.
    pub fn stage(&mut self, name: &str, watch: &Watch) {
        let stage = watch.stage(name);
        match self.stages.iter_mut().find(|before| before.name == name) {
            Some(before) => {
                before.seconds += stage.seconds;
                before.cpu_seconds += stage.cpu_seconds;
                before.peak_bytes = before.peak_bytes.max(stage.peak_bytes);
            }
            None => self.stages.push(stage),
        }
    }

    /// Seconds that a stage took; 0 if there was none.
    pub fn seconds_of(&self, name: &str) -> f64 {
        self.stages.iter().find(|stage| stage.name == name).map_or(0.0, |stage| stage.seconds)
    }

    /// Adds time, in seconds of the wall and of the CPU, to a stage that there is.
    pub(super) fn add_to(&mut self, name: &str, seconds: f64, cpu_seconds: f64) {
        for stage in self.stages.iter_mut().filter(|stage| stage.name == name) {
            stage.seconds += seconds;
            stage.cpu_seconds += cpu_seconds;
        }
    }

    /// CPU time of all stages, in seconds.
    pub fn all_cpu_seconds(&self) -> f64 {
        self.stages.iter().map(|stage| stage.cpu_seconds).sum()
    }

    /// Wall time of all stages, in seconds.
    pub fn seconds(&self) -> f64 {
        self.stages.iter().map(|stage| stage.seconds).sum()
    }
}

/// The largest resident memory that this process has had, in bytes; 0 where the system does not say.
pub fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kib = line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok());
    kib.unwrap_or(0) * 1024
}
