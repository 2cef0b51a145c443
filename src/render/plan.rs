//! What a render will take, from a small one: structures and settings take what they take, pixels in proportion to their number.

use super::costs::{Cost, Planned};
use super::pipeline::{Options, RenderError, render};
use super::progress::Progress;
use super::statistics::Statistics;
use crate::hair::Colors;
use crate::scene::Scene;

/// Pixels of the small picture.
const PROBE: f64 = 48.0 * 48.0;

/// What a render is expected to take.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What each effect took in the small picture, and is expected to take.
    pub costs: Vec<Cost>,
    /// CPU seconds that are no effect's own.
    pub rest: f64,
}

/// Renders a scene small. Takes the time of all structures and settings; the scene is as before.
///
/// # Errors
/// As [`render`].
pub fn probe(scene: &mut Scene, options: &Options, progress: &dyn Progress) -> Result<Plan, RenderError> {
    let full = scene.camera.resolution();
    let [width, height] = full.map(f64::from);
    let shrink = (width * height / PROBE).sqrt().max(1.0);
    let small = [width, height].map(|side| (side / shrink).round().max(1.0) as u32);
    let (camera, surfaces) = (scene.camera.clone(), scene.surfaces.clone());
    // A plan that forces colours on spreads them.
    let colors = match &scene.hair.color {
        Colors::PerObject(colors) => Some(Colors::PerObject(colors.clone())),
        Colors::PerPoint(_) => None,
    };
    scene.camera = scene.camera.with_resolution(small);
    let rendered = render(scene, &Options { window: None, ..*options }, progress);
    (scene.camera, scene.surfaces) = (camera, surfaces);
    if let Some(colors) = colors {
        scene.hair.color = colors;
    }
    let (_, statistics) = rendered?;
    let asked = options.window.map_or(width * height, |rect| rect.pixels() as f64);
    let pixels = asked / (f64::from(small[0]) * f64::from(small[1]));
    Ok(scaled(&statistics, pixels))
}

/// The plan for `pixels` times the pixels of a render.
fn scaled(statistics: &Statistics, pixels: f64) -> Plan {
    let planned = |cost: &Cost| Cost { planned: Some(cost.scaled(pixels)), ..cost.clone() };
    let own = |part: fn(&Cost) -> f64| statistics.costs.iter().map(part).sum::<f64>();
    let rendering =
        statistics.stages.iter().filter(|stage| stage.name == "rendering").map(|s| s.cpu_seconds).sum::<f64>();
    let building = statistics.all_cpu_seconds() - rendering;
    let rest =
        (building - own(|cost| cost.building)).max(0.0) + pixels * (rendering - own(|cost| cost.rendering)).max(0.0);
    Plan { costs: statistics.costs.iter().map(planned).collect(), rest }
}

impl Plan {
    /// CPU seconds in all.
    #[must_use]
    pub fn cpu_seconds(&self) -> f64 {
        self.rest + self.planned().map(|planned| planned.cpu_seconds).sum::<f64>()
    }

    fn planned(&self) -> impl Iterator<Item = Planned> {
        self.costs.iter().filter_map(|cost| cost.planned)
    }

    /// Notes in a render's statistics what was expected of it.
    pub fn note_in(&self, statistics: &mut Statistics) {
        for cost in &mut statistics.costs {
            cost.planned = self.costs.iter().find(|plan| plan.effect == cost.effect).and_then(|plan| plan.planned);
        }
        statistics.planned_cpu_seconds = Some(self.cpu_seconds());
    }
}
