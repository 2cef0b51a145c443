//! A scene made ready once and rendered in passes: pictures of the same expectation that differ in their random numbers only.

use std::collections::{BTreeMap, HashMap};

use rayon::prelude::*;

use super::RenderError;
use super::calibration::settle;
use super::clock::Clock;
use super::costs::Measured;
use super::film::{Film, Pixel};
use super::lighting::Lighting;
use super::pass::Pass;
use super::photons::Photons;
use super::pipeline::{Options, tiles};
use super::progress::Progress;
use super::reflections::Reflections;
use super::shadows::ShadowMaps;
use super::statistics::{SpecularCut, Statistics, Watch};
use super::tile::{Frame, Tile, TileSpace};
use crate::effects::Effects;
use crate::fragment::{Bins, PixelRect, TileGrid, scan_convert};
use crate::scene::Scene;
use crate::tally;

/// A scene with all its structures built and its settings of Γ found.
#[derive(Debug)]
pub struct Prepared<'s> {
    lighting: Lighting<'s>,
    full_size: [u32; 2],
    grid: TileGrid,
    bins: Bins,
    statistics: Statistics,
    clock: Clock,
    marked: Vec<[u32; 2]>,
}

/// What other renders of a scene made that differ in settings alone.
#[derive(Debug)]
pub struct Earlier<'a> {
    /// Photons; taken where they are of the seed and faces that the scene has.
    pub photons: Option<Photons>,
    /// Shadow maps, and where those of this render go. The statistics count the time that each took when it was made.
    pub maps: &'a mut ShadowMaps,
}

/// Single pixels, and the hair in each.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    at: Vec<[u32; 2]>,
    segments: Vec<Vec<u32>>,
}

impl Selection {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.at.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.at.is_empty()
    }

    /// Only so many of them, the first.
    pub fn truncate(&mut self, count: usize) {
        self.at.truncate(count);
        self.segments.truncate(count);
    }

    /// In parts of so many, the last of them smaller.
    pub fn parts(&self, of: usize) -> impl Iterator<Item = Self> + '_ {
        let parts = self.at.chunks(of).zip(self.segments.chunks(of));
        parts.map(|(at, segments)| Self { at: at.to_vec(), segments: segments.to_vec() })
    }
}

/// Single pixels, and the work that they took.
#[derive(Clone, Debug, Default)]
pub struct Pixels {
    /// In the order in which they were asked for.
    pub pixels: Vec<Pixel>,
    pub hair_points: u64,
    pub surface_points: u64,
    /// Of hair.
    pub fragments: u64,
}

impl<'s> Prepared<'s> {
    /// Builds what the scene calls for. The scene loses its surfaces, which go into the structures that rays meet. Call it in the pool of threads
    /// that is to do the work ([`super::with_threads`]).
    ///
    /// # Errors
    /// As [`super::render`].
    pub fn new(scene: &'s mut Scene, options: &Options, progress: &dyn Progress) -> Result<Self, RenderError> {
        Self::again(scene, options, Earlier { photons: None, maps: &mut ShadowMaps::default() }, progress)
    }

    /// The same with what other renders of the scene made, as far as it is what this one calls for.
    ///
    /// # Errors
    /// As [`super::render`].
    pub fn again(
        scene: &'s mut Scene,
        options: &Options,
        Earlier { photons, maps }: Earlier<'_>,
        progress: &dyn Progress,
    ) -> Result<Self, RenderError> {
        // What was counted before is another's.
        let _ = tally::take();
        let watch = Watch::start();
        progress.stage("building", 0);
        let effects = Effects::of(scene);
        let mut statistics = Statistics {
            segments: scene.hair.segments() as u64,
            triangles: scene.surfaces.triangles() as u64,
            threads: rayon::current_num_threads(),
            effects: effects.list(&scene.description().effects),
            notes: scene.notes.clone(),
            ..Statistics::default()
        };
        let mut lighting = Lighting::new(scene, effects, maps, progress)?;
        let effects = lighting.effects();
        statistics.shadow_maps = lighting.maps().to_vec();
        statistics.stage("building", &watch);
        // What they took when they were made is what they take.
        for map in lighting.maps().iter().filter(|map| map.reused) {
            statistics.add_to("building", map.seconds, map.cpu_seconds);
        }
        let watch = Watch::start();
        statistics.occlusion = settle(&mut lighting, progress)?;
        if effects.calibration {
            statistics.stage("calibrating", &watch);
        }
        let photons = photons.filter(|photons| photons.name == Photons::name(lighting.scene(), &effects));
        if let Some(photons) = photons {
            lighting.set_photons(photons);
        } else if effects.photons || effects.caustics {
            let watch = Watch::start();
            progress.stage("tracing photons", 0);
            lighting.trace_photons(lighting.scene().description().sampling.seed, progress)?;
            statistics.stage("tracing photons", &watch);
        }
        lighting.force_estimators();
        let watch = Watch::start();
        let full_size = lighting.scene().camera.resolution();
        let window = options.window.unwrap_or(PixelRect::image(full_size));
        let (grid, bins) = tiles(&Frame::new(&lighting), window)?;
        statistics.stage("binning", &watch);
        statistics.work = tally::take();
        Ok(Self { lighting, full_size, grid, bins, statistics, clock: Clock::default(), marked: Vec::new() })
    }

    /// Its photons, for another picture of the same scene.
    pub fn into_photons(mut self) -> Photons {
        self.lighting.take_photons()
    }

    /// Photons in place of those that it has, or some of another seed where none of this scene are given; what it had comes back. None where the scene calls for
    /// none.
    ///
    /// # Errors
    /// Cancelled work.
    pub fn exchange_photons(
        &mut self,
        photons: Option<Photons>,
        seed: u32,
        progress: &dyn Progress,
    ) -> Result<Option<Photons>, RenderError> {
        let effects = self.lighting.effects();
        if !(effects.photons || effects.caustics) {
            return Ok(None);
        }
        let photons = photons.filter(|photons| photons.name == Photons::name(self.lighting.scene(), &effects));
        let watch = photons.is_none().then(Watch::start);
        let before = self.lighting.exchange_photons(photons, seed, progress)?;
        if let Some(watch) = watch {
            self.statistics.stage("tracing more photons", &watch);
        }
        Ok(Some(before))
    }

    /// The scene, its surfaces taken out.
    pub fn scene(&self) -> &'s Scene {
        self.lighting.scene()
    }

    /// What was done so far.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// What lights its points, and the segments that may touch each tile.
    pub(super) fn parts(&self) -> (&Lighting<'s>, &Bins) {
        (&self.lighting, &self.bins)
    }

    /// Begins to share light between points as a pass with the picture's own seed would.
    pub(super) fn begin_sharing(&mut self) {
        self.lighting.begin_sharing(self.lighting.scene().description().sampling.seed);
    }

    /// The pixels that are rendered.
    pub fn window(&self) -> PixelRect {
        self.grid.rect()
    }

    /// Adds to what was done: of stages outside of this one's reach.
    pub fn statistics_mut(&mut self) -> &mut Statistics {
        &mut self.statistics
    }

    /// Renders all pixels with the random numbers of a pass.
    ///
    /// # Errors
    /// Cancelled work.
    pub fn pass(&mut self, pass: Pass, progress: &dyn Progress) -> Result<Film, RenderError> {
        let watch = Watch::start();
        progress.stage("rendering", self.grid.count() as u64);
        self.lighting.begin_sharing(pass.seed);
        let frame = Frame { pass, ..Frame::new(&self.lighting) };
        let mut film = Film::new(self.grid.rect(), self.full_size);
        let tiles: Vec<_> = (0..self.grid.count())
            .into_par_iter()
            // Tiles differ in time by orders of magnitude: each is a job of its own.
            .with_max_len(1)
            .map_init(TileSpace::default, |space, index| {
                let tile = frame.render(&self.grid.tile(index), self.bins.tile(index), space, progress);
                progress.advance(1);
                tile
            })
            .collect();
        self.lighting.end_sharing();
        let (mut clock, mut specular) = (Clock::default(), Reflections::default());
        self.marked.clear();
        for (index, tile) in tiles.into_iter().enumerate() {
            let tile = tile.ok_or(RenderError::Cancelled)?;
            film.place(&self.grid.tile(index), &tile.pixels);
            film.place_cost(&self.grid.tile(index), &tile.costs);
            clock.add(&tile.clock);
            specular.add(&tile.specular);
            count(&mut self.statistics, &mut self.marked, tile);
        }
        film.mend(&self.marked);
        if self.lighting.effects().specular {
            let caustics = self.lighting.illumination().caustics().map_or(0.0, |caustics| f64::from(caustics.cut));
            self.statistics.specular = Some(SpecularCut { seen: specular.cut / specular.rays.max(1e-300), caustics });
        }
        let parts = &mut self.statistics.cpu_seconds;
        parts.gamma += clock.gamma().as_secs_f64();
        parts.lambda += clock.lambda().as_secs_f64();
        parts.direct += clock.direct().as_secs_f64();
        self.clock.add(&clock);
        self.statistics.mean = film.mean_beauty().to_array();
        self.statistics.passes += 1;
        self.statistics.stage("rendering", &watch);
        self.statistics.work.add(&tally::take());
        let measured = Measured {
            built: self.lighting.built(),
            clock: &self.clock,
            maps: self.lighting.maps(),
            hair: &self.lighting.scene().hair,
            bins: self.bins.bytes(),
            projects: self.lighting.estimator().projects(),
        };
        self.statistics.costs = measured.costs(&self.statistics);
        Ok(film)
    }

    /// Single pixels to be rendered: columns and rows in the whole picture, inside the window. They hold for any picture of the same hair by the same camera.
    pub fn select(&self, at: &[[u32; 2]]) -> Selection {
        let frame = Frame::new(&self.lighting);
        let mut by_tile: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (number, &[x, y]) in at.iter().enumerate() {
            by_tile.entry(self.grid.index_at(x, y)).or_default().push(number);
        }
        let by_tile: Vec<(usize, Vec<usize>)> = by_tile.into_iter().collect();
        let projection = frame.scene.camera.projection();
        let touching = |(tile, numbers): &(usize, Vec<usize>)| {
            let rect = self.grid.tile(*tile);
            let slots: HashMap<[u32; 2], usize> = numbers.iter().enumerate().map(|(slot, &n)| (at[n], slot)).collect();
            let mut lists = vec![Vec::new(); numbers.len()];
            for &segment in self.bins.tile(*tile) {
                scan_convert(&frame.segment(segment), &projection, &rect, |x, y, _| {
                    let list = slots.get(&[x, y]).map(|&slot| &mut lists[slot]);
                    if let Some(list) = list.filter(|list| list.last() != Some(&segment)) {
                        list.push(segment);
                    }
                });
            }
            lists
        };
        let found: Vec<Vec<Vec<u32>>> = by_tile.par_iter().with_max_len(1).map(touching).collect();
        let mut segments = vec![Vec::new(); at.len()];
        for ((_, numbers), lists) in by_tile.iter().zip(found) {
            numbers.iter().zip(lists).for_each(|(&number, list)| segments[number] = list);
        }
        Selection { at: at.to_vec(), segments }
    }

    /// Renders single pixels, each as [`Self::pass`] would if points shared no light.
    ///
    /// # Errors
    /// Cancelled work.
    pub fn pixels(&self, selection: &Selection, pass: Pass, progress: &dyn Progress) -> Result<Pixels, RenderError> {
        let frame = Frame { pass, ..Frame::new(&self.lighting) };
        let tiles: Option<Vec<Tile>> = selection
            .at
            .par_iter()
            .zip(&selection.segments)
            .with_max_len(1)
            .map_init(TileSpace::default, |space, (&[x, y], segments)| {
                let rect = PixelRect { min: [x, y], max: [x + 1, y + 1] };
                let tile = frame.render(&rect, segments, space, progress);
                progress.advance(1);
                tile
            })
            .collect();
        let mut all = Pixels::default();
        for tile in tiles.ok_or(RenderError::Cancelled)? {
            all.hair_points += tile.hair_points;
            all.surface_points += tile.surface_points;
            all.fragments += tile.fragments;
            all.pixels.extend(tile.pixels);
        }
        Ok(all)
    }
}

fn count(statistics: &mut Statistics, marked: &mut Vec<[u32; 2]>, tile: Tile) {
    statistics.hair_fragments += tile.fragments;
    statistics.hair_points += tile.hair_points;
    statistics.surface_points += tile.surface_points;
    statistics.cpu_seconds.fragments += tile.fragment_time.as_secs_f64();
    marked.extend(tile.non_finite.iter().map(|n| n.pixel));
    statistics.non_finite += tile.non_finite.len() as u64;
    let room = Statistics::EXAMPLES.saturating_sub(statistics.non_finite_examples.len());
    statistics.non_finite_examples.extend(tile.non_finite.into_iter().take(room));
}
