//! Deep shadow maps: a transmittance function of depth a pixel (Lokovic and Veach 2000).

use glam::{DVec2, Vec3};
use rayon::prelude::*;

use super::cells::{Piece, Source};
use super::compress::{Node, compress, value};
use super::filter;
use super::receiver::Point;
use super::view::{Seen, View};
use super::{MapError, Settings, Size};
use crate::fragment::{PixelRect, TileGrid, assign};
use crate::hair::HairModel;
use crate::occlusion::Transmittance;
use crate::tally::{self, Work};

/// Pixels along a tile's side.
const TILE: u32 = 16;
/// Bounds of a resolution that is chosen.
pub(super) const CHOSEN: [f64; 2] = [64.0, 1024.0];
/// Pieces of hair that one thread holds at a time, where it can do with so few: 80 MB.
const MOST_PIECES: usize = 4 << 20;

/// Bytes that a map takes at most, of the six images that it may have, before any hair is seen: no more than its settings allow, nor than functions of so many
/// pixels can. A function falls by 1 in all and one of its lines ends where it has fallen by about its error, so that it has some 2 / error nodes; twice
/// that is counted.
pub fn bytes_at_most(settings: &Settings) -> u64 {
    let Some(resolution) = settings.resolution else { return settings.most_bytes as u64 };
    let pixels = 6 * u64::from(resolution.clamp(1, 8192).next_multiple_of(TILE)).pow(2);
    let nodes = (4.0 / f64::from(settings.error).max(1e-6)) as u64 + 8;
    pixels.saturating_mul(nodes * size_of::<Node>() as u64 + 4).min(settings.most_bytes as u64)
}

/// Bytes that each thread takes while a map is made.
pub const BYTES_A_THREAD: u64 = (MOST_PIECES * size_of::<Piece>()) as u64;

/// What hair leaves of a lamp's light, everywhere.
#[derive(Debug)]
pub struct DeepMap {
    view: View,
    settings: Settings,
    resolution: u32,
    halvings: u32,
    /// For each image each tile: its functions; none where no hair is.
    tiles: Vec<Option<Tile>>,
}

/// The functions of a tile's pixels, row by row: those of pixel i are `nodes[first[i]..first[i + 1]]`.
#[derive(Debug)]
struct Tile {
    first: Vec<u32>,
    nodes: Vec<Node>,
}

/// A place from which a ray to the lamp sees a part of what a map knows of a point, and how much of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footing {
    /// In render space.
    pub origin: Vec3,
    pub weight: f64,
}

/// The resolution that a map starts with.
pub(super) fn first_resolution(view: &View, model: &HairModel, settings: &Settings) -> u32 {
    let mean_width = model.width.iter().map(|&w| f64::from(w)).sum::<f64>() / model.width.len().max(1) as f64;
    let natural = view.natural_resolution(mean_width.max(1e-9)).clamp(CHOSEN[0], CHOSEN[1]) as u32;
    settings.resolution.unwrap_or(natural).clamp(1, 8192).next_multiple_of(TILE)
}

impl DeepMap {
    /// Builds the map of a lamp's view, unless `cancelled` says to stop. The same to the bit for any number of threads.
    ///
    /// # Errors
    /// Memory: lists that do not fit, or a map that is too large even when small. Cancelled work.
    pub fn build(
        view: View,
        model: &HairModel,
        rule: Transmittance,
        settings: &Settings,
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Result<Self, MapError> {
        tally::add(Work::DeepMaps, 1);
        let first = first_resolution(&view, model, settings);
        let mut map = Self { view, settings: *settings, resolution: first, halvings: 0, tiles: Vec::new() };
        while !map.fill(model, rule, cancelled)? {
            if map.resolution <= TILE {
                let most_bytes = settings.most_bytes;
                return Err(MapError::Memory { resolution: map.resolution, most_bytes });
            }
            map.resolution = (map.resolution / 2).next_multiple_of(TILE);
            map.halvings += 1;
        }
        Ok(map)
    }

    /// Makes all tiles; false if they take too much memory.
    fn fill(
        &mut self,
        model: &HairModel,
        rule: Transmittance,
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Result<bool, MapError> {
        self.tiles.clear();
        let per_side = self.settings.per_side();
        let cells = self.resolution * per_side;
        let grid = TileGrid::new(PixelRect::image([cells; 2]), TILE * per_side);
        let pixels = TileGrid::new(PixelRect::image([self.resolution; 2]), TILE);
        let projection = self.view.projection(cells);
        for image in 0..self.view.images() {
            let source = Source { model, rule, view: &self.view, image, projection, per_side };
            let segment = |index| self.view.segment(image, model, index);
            let bins = assign(&grid, &projection, model.segments() as u32, segment)?;
            // Row by row: what is over the bound is found before all is made.
            for row in 0..grid.dimensions()[1] as usize {
                let columns = grid.dimensions()[0] as usize;
                let tiles: Vec<_> = (row * columns..(row + 1) * columns)
                    .into_par_iter()
                    .with_max_len(1)
                    .map_init(Buffers::default, |buffers, index| {
                        let segments = bins.tile(index);
                        (!segments.is_empty() && !cancelled())
                            .then(|| buffers.tile(&source, segments, &pixels.tile(index), &self.settings))
                    })
                    .collect();
                if cancelled() {
                    return Err(MapError::Cancelled);
                }
                self.tiles.extend(tiles);
                if self.bytes() > self.settings.most_bytes {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    fn bytes(&self) -> usize {
        let of = |tile: &Tile| size_of_val(&tile.first[..]) + size_of_val(&tile.nodes[..]);
        size_of_val(&self.tiles[..]) + self.tiles.iter().flatten().map(of).sum::<usize>()
    }

    /// What it is and takes.
    pub fn size(&self) -> Size {
        Size {
            images: self.view.images(),
            resolution: self.resolution,
            halvings: self.halvings,
            nodes: self.tiles.iter().flatten().map(|tile| tile.nodes.len()).sum(),
            bytes: self.bytes(),
        }
    }

    /// The lamp's view.
    pub fn view(&self) -> &View {
        &self.view
    }

    fn function(&self, image: usize, x: u32, y: u32) -> &[Node] {
        let columns = self.resolution.div_ceil(TILE);
        let tile = (image as u32 * columns + y / TILE) * columns + x / TILE;
        let Some(tile) = &self.tiles[tile as usize] else { return &[] };
        let pixel = (y % TILE * TILE + x % TILE) as usize;
        &tile.nodes[tile.first[pixel] as usize..tile.first[pixel + 1] as usize]
    }

    fn around(&self, seen: &Seen, take: impl FnMut(u32, u32, f64)) {
        let at = seen.at * f64::from(self.resolution);
        filter::around(at, f64::from(self.settings.filter), self.resolution, take);
    }

    /// What hair leaves of the lamp's light at a point: the mean over the pixels around it.
    pub fn transmittance(&self, point: &Point) -> f32 {
        let Some(seen) = self.view.see(point.position) else { return 1.0 };
        let own = point.own(&self.view, &seen);
        let mut sum = 0.0;
        self.around(&seen, |x, y, weight| {
            let depth = seen.depth - own.map_or(0.0, |own| seen.of_pixel(self.resolution, x, y, |o, h| own.bias(o, h)));
            sum += weight * f64::from(value(self.function(seen.image, x, y), depth as f32));
        });
        sum as f32
    }

    /// Where rays to the lamp begin that together see what the map says of a point: at its depth, `per_side`² strata in each pixel that counts, with weights that
    /// add up to 1; none where the point is not in the map. `jitter(pixel, stratum, axis)` are numbers from 0 to 1.
    pub fn footing(
        &self,
        position: Vec3,
        per_side: u32,
        jitter: impl Fn(u32, u32, u32) -> f64,
    ) -> Option<Vec<Footing>> {
        let seen = self.view.see(position)?;
        let (side, strata) = (1.0 / f64::from(self.resolution), f64::from(per_side));
        let mut places = Vec::new();
        let mut pixel = 0;
        self.around(&seen, |x, y, weight| {
            let corner = DVec2::new(x.into(), y.into()) * side;
            for stratum in 0..per_side * per_side {
                let cell = DVec2::new((stratum % per_side).into(), (stratum / per_side).into());
                let within = DVec2::new(jitter(pixel, stratum, 0), jitter(pixel, stratum, 1));
                let at = corner + (cell + within) / strata * side;
                let origin = self.view.point(seen.image, at, seen.depth);
                places.push(Footing { origin, weight: weight / (strata * strata) });
            }
            pixel += 1;
        });
        Some(places)
    }
}

/// Buffers that one thread keeps from tile to tile.
#[derive(Debug, Default)]
struct Buffers {
    pieces: Vec<Piece>,
    one: Vec<Piece>,
    cells: Vec<f64>,
    steps: Vec<Node>,
}

impl Buffers {
    fn tile(&mut self, source: &Source<'_>, segments: &[u32], pixels: &PixelRect, settings: &Settings) -> Tile {
        let mut tile = Tile { first: vec![0], nodes: Vec::new() };
        self.part(source, segments, pixels, settings, &mut tile);
        tile.nodes.shrink_to_fit();
        tile
    }

    /// Adds the pixels of a rectangle, row by row. Where it holds too much hair its halves are done one after the other.
    fn part(
        &mut self,
        source: &Source<'_>,
        segments: &[u32],
        pixels: &PixelRect,
        settings: &Settings,
        tile: &mut Tile,
    ) {
        let [columns, rows] = [0, 1].map(|i| pixels.max[i] - pixels.min[i]);
        let most = if columns * rows == 1 { usize::MAX } else { MOST_PIECES };
        if !source.pieces(segments, pixels, most, &mut self.pieces) {
            // Rows first, to keep the order of the pixels.
            let axis = usize::from(rows > 1);
            let middle = (pixels.min[axis] + pixels.max[axis]) / 2;
            let (mut before, mut after) = (*pixels, *pixels);
            before.max[axis] = middle;
            after.min[axis] = middle;
            self.part(source, segments, &before, settings, tile);
            return self.part(source, segments, &after, settings, tile);
        }
        let pieces = std::mem::take(&mut self.pieces);
        let mut rest = &pieces[..];
        for pixel in 0..columns * rows {
            let (here, behind) = rest.split_at(rest.partition_point(|piece| piece.pixel <= pixel));
            rest = behind;
            if !here.is_empty() {
                self.one.clear();
                self.one.extend_from_slice(here);
                source.join(&mut self.one);
                source.steps(&self.one, &mut self.cells, &mut self.steps);
                compress(&self.steps, settings.error, &mut tile.nodes);
            }
            tile.first.push(tile.nodes.len() as u32);
        }
        self.pieces = pieces;
    }
}
