//! The way of a picture: structures, tiles in parallel, film.

use std::time::Instant;

use rayon::prelude::*;
use thiserror::Error;

use super::calibration::settle;
use super::film::Film;
use super::lighting::{Clock, Lighting};
use super::progress::Progress;
use super::statistics::Statistics;
use super::tile::{Frame, TileSpace};
use crate::effects::Effects;
use crate::embree;
use crate::fragment::{BinError, Bins, PixelRect, TileGrid, assign};
use crate::scene::Scene;
use crate::shadow::MapError;

/// Pixels along a tile's side.
const TILE: u32 = 16;

/// Why a render came to no picture.
#[derive(Debug, Error)]
pub enum RenderError {
    #[error("cancelled")]
    Cancelled,
    #[error(transparent)]
    Embree(#[from] embree::Error),
    #[error(transparent)]
    Bins(#[from] BinError),
    #[error("{light}: {source}")]
    ShadowMap { light: String, source: MapError },
    #[error("cannot start {threads} threads: {message}")]
    Threads { threads: usize, message: String },
}

/// How a scene is rendered, beside what the scene says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Only these pixels; all where none.
    pub window: Option<PixelRect>,
    /// Number of threads; one a processor where none. The picture does not depend on it.
    pub threads: Option<usize>,
}

/// Renders a scene. The scene comes back without its surfaces, which went into the structures that rays meet.
///
/// # Errors
/// Cancelled work, Embree's errors, and memory that is not to be had.
pub fn render(
    scene: &mut Scene,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Film, Statistics), RenderError> {
    with_threads(options.threads, || render_here(scene, options, progress))?
}

/// Does work with a number of threads of its own; one a processor where none.
///
/// # Errors
/// The system's, when it does not give the threads.
pub fn with_threads<T: Send>(threads: Option<usize>, work: impl FnOnce() -> T + Send) -> Result<T, RenderError> {
    let threads = threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| RenderError::Threads { threads, message: e.to_string() })?;
    Ok(pool.install(work))
}

/// The tiles of a picture, or of a part of it, and the hair segments that may touch each.
pub(super) fn tiles(frame: &Frame<'_>, window: PixelRect) -> Result<(TileGrid, Bins), RenderError> {
    let grid = TileGrid::new(window, TILE);
    let segments = frame.scene.hair.segments() as u32;
    let bins = assign(&grid, &frame.scene.camera.projection(), segments, |index| frame.segment(index))?;
    Ok((grid, bins))
}

fn render_here(
    scene: &mut Scene,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Film, Statistics), RenderError> {
    let begin = Instant::now();
    progress.stage("building", 0);
    let effects = Effects::of(scene);
    let mut statistics = Statistics {
        segments: scene.hair.segments() as u64,
        triangles: scene.surfaces.triangles() as u64,
        threads: rayon::current_num_threads(),
        effects: effects.list(),
        notes: scene.notes.clone(),
        ..Statistics::default()
    };
    let mut lighting = Lighting::new(scene, effects)?;
    statistics.shadow_maps = lighting.maps().to_vec();
    statistics.stage("building", begin.elapsed());
    let begin = Instant::now();
    statistics.occlusion = settle(&mut lighting, progress)?;
    if effects.calibration {
        statistics.stage("calibrating", begin.elapsed());
    }
    let begin = Instant::now();
    let scene = lighting.scene();
    let frame = Frame::new(&lighting);
    let full_size = scene.camera.resolution();
    let window = options.window.unwrap_or(PixelRect::image(full_size));
    let (grid, bins) = tiles(&frame, window)?;
    statistics.stage("binning", begin.elapsed());

    let begin = Instant::now();
    progress.stage("rendering", grid.count() as u64);
    let mut film = Film::new(window, full_size);
    let tiles: Vec<_> = (0..grid.count())
        .into_par_iter()
        // Tiles differ in time by orders of magnitude: each is a job of its own.
        .with_max_len(1)
        .map_init(TileSpace::default, |space, index| {
            let tile = frame.render(&grid.tile(index), bins.tile(index), space, progress);
            progress.advance(1);
            tile
        })
        .collect();
    let mut clock = Clock::default();
    let mut marked = Vec::new();
    for (index, tile) in tiles.into_iter().enumerate() {
        let tile = tile.ok_or(RenderError::Cancelled)?;
        film.place(&grid.tile(index), &tile.pixels);
        statistics.hair_fragments += tile.fragments;
        statistics.hair_points += tile.hair_points;
        statistics.surface_points += tile.surface_points;
        statistics.cpu_seconds.fragments += tile.fragment_time.as_secs_f64();
        clock.add(&tile.clock);
        marked.extend(tile.non_finite.iter().map(|n| n.pixel));
        statistics.non_finite += tile.non_finite.len() as u64;
        let room = Statistics::EXAMPLES.saturating_sub(statistics.non_finite_examples.len());
        statistics.non_finite_examples.extend(tile.non_finite.into_iter().take(room));
    }
    film.mend(&marked);
    statistics.cpu_seconds.gamma = clock.gamma.as_secs_f64();
    statistics.cpu_seconds.lambda = clock.lambda.as_secs_f64();
    statistics.cpu_seconds.direct = clock.direct.as_secs_f64();
    statistics.mean = film.mean_beauty().to_array();
    statistics.stage("rendering", begin.elapsed());
    Ok((film, statistics))
}
