//! The way of a picture: structures, tiles in parallel, film.

use thiserror::Error;

use super::film::Film;
use super::mean::Mean;
use super::pass::Pass;
use super::passes::{Earlier, Prepared};
use super::progress::Progress;
use super::shadows::ShadowMaps;
use super::statistics::Statistics;
use super::tile::Frame;
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
    render_again(scene, options, Earlier { photons: None, maps: &mut ShadowMaps::default() }, progress)
}

/// The same with what other renders of the scene made.
///
/// # Errors
/// As [`render`].
pub fn render_again(
    scene: &mut Scene,
    options: &Options,
    earlier: Earlier<'_>,
    progress: &dyn Progress,
) -> Result<(Film, Statistics), RenderError> {
    with_threads(options.threads, || render_here(scene, options, earlier, progress))?
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
    earlier: Earlier<'_>,
    progress: &dyn Progress,
) -> Result<(Film, Statistics), RenderError> {
    let (seed, passes) = (scene.description().sampling.seed, scene.description().passes());
    let mut prepared = Prepared::again(scene, options, earlier, progress)?;
    let mut film = prepared.pass(Pass::of(seed, 0), progress)?;
    if passes > 1 {
        let mut mean = Mean::new(film);
        for pass in 1..passes {
            mean.add(&prepared.pass(Pass::of(seed, pass), progress)?);
        }
        film = mean.film();
    }
    let mut statistics = prepared.statistics().clone();
    statistics.mean = film.mean_beauty().to_array();
    Ok((film, statistics))
}
