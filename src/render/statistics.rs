//! What a render did, and what it took.

use std::time::Duration;

use serde::Serialize;

use super::calibration::Settled;
use super::shadows::Made;
use crate::effects::Effect;

/// A value that was not finite, and where.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NonFinite {
    /// Column and row of the pixel.
    pub pixel: [u32; 2],
    /// What was shaded there.
    pub what: String,
}

/// Time and peak memory at the end of a stage.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stage {
    pub name: String,
    /// Wall time, in seconds.
    pub seconds: f64,
    /// Largest resident memory of the process so far, in bytes; 0 where the system does not say.
    pub peak_bytes: u64,
}

/// CPU seconds of the shading stage by part, summed over threads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Parts {
    pub fragments: f64,
    pub gamma: f64,
    pub lambda: f64,
    pub direct: f64,
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
    /// What was worth telling about the files that the scene names.
    pub notes: Vec<String>,
    /// How hair occlusion was found, where its accuracy decided.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occlusion: Option<Settled>,
    /// The shadow maps of lights that asked for them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shadow_maps: Vec<Made>,
    /// Mean of the picture, linear Rec.709.
    pub mean: [f32; 3],
}

impl Statistics {
    /// How many examples of values that are not finite are kept.
    pub const EXAMPLES: usize = 16;

    /// Notes that a stage ended.
    pub fn stage(&mut self, name: &str, time: Duration) {
        let stage = Stage { name: name.to_owned(), seconds: time.as_secs_f64(), peak_bytes: peak_memory() };
        self.stages.push(stage);
    }

    /// Wall time of all stages, in seconds.
    pub fn seconds(&self) -> f64 {
        self.stages.iter().map(|stage| stage.seconds).sum()
    }
}

/// The largest resident memory that this process has had, in bytes; 0 where the system does not say.
fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kib = line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok());
    kib.unwrap_or(0) * 1024
}
