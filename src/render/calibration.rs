//! Settings of Γ for the accuracy that a scene asks for, found at points of its own picture.
//!
//! Points are drawn from some tiles of the whole picture, whatever part of it is rendered, and nothing is measured in seconds: what is
//! found depends on the scene alone, so that crops, threads and repeated runs give the same picture.

use serde::Serialize;

use super::RenderError;
use super::draw::{Drawn, ShadingPoint, draw_from, some_tiles};
use super::estimator::{Estimator, Fine, ray_settings};
use super::lighting::{Lighting, Workspace};
use super::pipeline::tiles;
use super::progress::Progress;
use super::tile::Frame;
use crate::fragment::PixelRect;
use crate::occlusion::{Calibration, Fineness, Igloo, Reference, Site, calibrate};
use crate::scene::description::OcclusionMode;
use crate::tally::{self, Work};

/// Points of each kind at which settings are judged.
const POINTS: usize = 64;

/// Tiles that points are drawn from, at the most.
const TILES: usize = 128;

/// Time of a ray at its start, and for each crossing that it meets, in lanes of the projection's kernels (4 ns each); measured on models of
/// 10^5 to 10^6 segments, good to a factor of two.
const RAY_START: f64 = 10.0;
const RAY_CROSSING: f64 = 30.0;

/// How Γ is found in a render, and how accurately.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settled {
    /// `igloo` or `raytraced`.
    pub estimator: &'static str,
    /// The accuracy asked for: root mean square error of sky visibility.
    pub accuracy: f64,
    /// What was found for points on hair, and on surfaces; none where the picture has no such points.
    pub hair: Option<Found>,
    pub surface: Option<Found>,
    /// Why this estimator.
    pub reason: String,
}

/// What was found for one kind of point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Found {
    /// Points that it was found at, and how many of the kind there are in the tiles that they were drawn from.
    pub points: usize,
    pub of: u64,
    /// Settings of the projection; none where it is not in question.
    pub projection: Option<FoundProjection>,
    /// Rays a point of the accuracy asked for.
    pub rays: u32,
    /// Expected time of these rays, in lanes of the projection's kernels.
    pub ray_work: f64,
}

/// Settings of the projection.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FoundProjection {
    /// Cells along a side of the map of directions.
    pub side: u32,
    /// Largest extent of a lump, in widths of a cell.
    pub opening: f32,
    /// Root mean square error of sky visibility at the points.
    pub error: f64,
    /// Whether that is within the accuracy asked for.
    pub reached: bool,
    /// Work of a query, in lanes of kernels.
    pub work: f64,
}

impl FoundProjection {
    fn fineness(&self) -> Fineness {
        Fineness { side: self.side, opening: self.opening }
    }
}

/// Finds the settings for the scene's accuracy and gives the lighting an estimator that has them; nothing where the scene says them itself.
///
/// # Errors
/// Cancelled work, and memory that is not to be had.
pub fn settle(lighting: &mut Lighting<'_>, progress: &dyn Progress) -> Result<Option<Settled>, RenderError> {
    let settings = &lighting.scene().description().occlusion;
    if !lighting.effects().calibration {
        return Ok(None);
    }
    let drawn = points(lighting, progress)?;
    progress.stage("calibrating", 0);
    let (hairs, surfaces): (Vec<_>, Vec<_>) = drawn.points.iter().partition(|point| point.receiver.on.is_some());
    let [all_hair, all_surface] = drawn.population;
    let hair = judge(lighting, &hairs, all_hair, settings.accuracy, progress)?;
    let surface = judge(lighting, &surfaces, all_surface, settings.accuracy, progress)?;
    if !lighting.called_for().calibration {
        // Forced on: the scene has settings of its own.
        return Ok(None);
    }
    let settled = choose(settings.mode, settings.accuracy, hair, surface);
    let estimator = match (settled.estimator, lighting.take_estimator()) {
        ("igloo", Estimator::Projected { tree, sphere, hemisphere }) => {
            let [on_hair, on_surface] = lighting.igloos();
            let fine = |found: Option<Found>, igloo: &Igloo, usual: Box<Fine>| {
                found
                    .and_then(|found| found.projection)
                    .map_or(usual, |found| Box::new(Fine::new(found.fineness(), igloo)))
            };
            let (sphere, hemisphere) = (fine(hair, on_hair, sphere), fine(surface, on_surface, hemisphere));
            Estimator::Projected { tree, sphere, hemisphere }
        }
        _ => {
            let rays = |found: Option<Found>| ray_settings(settings, found.map_or(1, |found| found.rays));
            Estimator::Raytraced { hair: rays(hair), surface: rays(surface) }
        }
    };
    lighting.set_estimator(estimator);
    Ok(Some(settled))
}

/// Points of the picture, as many of each kind.
fn points(lighting: &Lighting<'_>, progress: &dyn Progress) -> Result<Drawn, RenderError> {
    let frame = Frame::new(lighting);
    let (grid, bins) = tiles(&frame, PixelRect::image(frame.scene.camera.resolution()))?;
    draw_from(&frame, &grid, &bins, &some_tiles(&frame, &grid, &bins, TILES), 2 * POINTS, progress)
}

/// The settings for one kind of points, `of` of which there are; none without points.
fn judge(
    lighting: &Lighting<'_>,
    points: &[&ShadingPoint],
    of: u64,
    accuracy: f64,
    progress: &dyn Progress,
) -> Result<Option<Found>, RenderError> {
    let (Some(rays), false) = (lighting.hair_rays(), points.is_empty()) else { return Ok(None) };
    tally::add(Work::CalibrationPoints, points.len() as u64);
    let model = &lighting.scene().hair;
    let mut space = Workspace::default();
    let open = !lighting.effects().surfaces;
    let site = |point: &&ShadingPoint| {
        if progress.cancelled() {
            return Err(RenderError::Cancelled);
        }
        let (_, far) = lighting.surroundings(&point.receiver, point.key, &mut space);
        Ok(Site { receiver: point.receiver, far: (!open).then(|| far.to_vec()) })
    };
    let sites = points.iter().map(site).collect::<Result<Vec<Site>, _>>()?;
    let igloo = lighting.igloos()[usize::from(sites[0].receiver.on.is_none())];
    let cancelled = || progress.cancelled();
    let reference = Reference::for_accuracy(rays, model, &sites, igloo, accuracy, &cancelled);
    let reference = reference.ok_or(RenderError::Cancelled)?;
    let projection = match lighting.estimator() {
        Estimator::Projected { tree, .. } => {
            let found = calibrate(tree, model, &sites, igloo, &reference, accuracy, &cancelled);
            let Calibration { fineness, error, reached, work } = found.ok_or(RenderError::Cancelled)?;
            Some(FoundProjection { side: fineness.side, opening: fineness.opening, error, reached, work })
        }
        _ => None,
    };
    let rays = reference.rays_for(accuracy).next_multiple_of(igloo.len() as u32);
    let ray_work = f64::from(rays) * (RAY_START + RAY_CROSSING * reference.crossings);
    Ok(Some(Found { points: points.len(), of, projection, rays, ray_work }))
}

/// The estimator for a mode, and why.
fn choose(mode: OcclusionMode, accuracy: f64, hair: Option<Found>, surface: Option<Found>) -> Settled {
    let settled = |estimator, reason: String| Settled { estimator, accuracy, hair, surface, reason };
    let found = || hair.iter().chain(&surface);
    match mode {
        OcclusionMode::Raytraced => settled("raytraced", "occlusion.mode asks for it".to_owned()),
        OcclusionMode::Auto if found().all(|found| found.projection.is_none()) => {
            settled("raytraced", "the projection would take every segment by itself".to_owned())
        }
        OcclusionMode::Auto => {
            // By the numbers of points of each kind, as in the picture.
            let sum = |work: &dyn Fn(&Found) -> f64| found().map(|f| f.of as f64 * work(f)).sum::<f64>();
            let projected = sum(&|found| found.projection.map_or(0.0, |projection| projection.work));
            let ratio = sum(&|found| found.ray_work) / projected.max(1.0);
            let reached = found().all(|found| found.projection.is_none_or(|projection| projection.reached));
            if !reached {
                return settled("raytraced", format!("the projection does not reach an accuracy of {accuracy} here"));
            }
            let reason = |less: &str, more: &str, ratio: f64| {
                format!("for an accuracy of {accuracy}, {less} is expected to be {ratio:.1} times as fast as {more}")
            };
            if ratio > 1.0 {
                settled("igloo", reason("projection", "tracing rays", ratio))
            } else {
                settled("raytraced", reason("tracing rays", "projection", 1.0 / ratio))
            }
        }
        _ => settled("igloo", "occlusion.mode asks for it".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(of: u64, work: f64, ray_work: f64, reached: bool) -> Option<Found> {
        let projection = Some(FoundProjection { side: 16, opening: 1.3, error: 0.01, reached, work });
        Some(Found { points: 64, of, projection, rays: 100, ray_work })
    }

    #[test]
    fn auto_takes_what_costs_less_over_the_points_of_both_kinds() {
        let auto = |hair, surface| choose(OcclusionMode::Auto, 0.01, hair, surface);
        let slow_rays = found(1000, 500.0, 5_000.0, true);
        let quick_rays = found(1000, 5_000.0, 500.0, true);
        assert_eq!(auto(slow_rays, None).estimator, "igloo");
        assert!(
            auto(slow_rays, None).reason.contains("projection is expected to be 10.0 times as fast as tracing rays")
        );
        assert_eq!(auto(None, quick_rays).estimator, "raytraced");
        assert!(auto(None, quick_rays).reason.contains("tracing rays is expected to be 10.0 times as fast"));
        // The kind with more points decides.
        assert_eq!(auto(slow_rays, found(10, 5_000.0, 500.0, true)).estimator, "igloo");
        assert_eq!(auto(found(10, 500.0, 5_000.0, true), quick_rays).estimator, "raytraced");
        let too_coarse = auto(found(1000, 500.0, 5_000.0, false), None);
        assert!(too_coarse.estimator == "raytraced" && too_coarse.reason.contains("does not reach"), "{too_coarse:?}");
    }

    #[test]
    fn a_mode_that_is_asked_for_is_kept() {
        let any = found(1000, 5_000.0, 500.0, false);
        assert_eq!(choose(OcclusionMode::Igloo, 0.01, any, any).estimator, "igloo");
        assert_eq!(choose(OcclusionMode::Raytraced, 0.01, any, None).estimator, "raytraced");
        let no_tree = any.map(|found| Found { projection: None, ..found });
        assert_eq!(choose(OcclusionMode::Auto, 0.01, no_tree, None).estimator, "raytraced");
    }
}
