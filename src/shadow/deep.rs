//! Deep shadow maps: a transmittance function of depth a pixel (Lokovic and Veach 2000).

use glam::{DVec2, Vec3};
use rayon::prelude::*;

use super::cells::{Piece, Source};
use super::compress::{Node, compress, value};
use super::filter;
use super::own::Step;
use super::receiver::Point;
use super::view::{Seen, View};
use super::{MapError, Settings, Size};
use crate::fragment::{PixelRect, TileGrid, assign};
use crate::hair::{HairModel, OnStrand};
use crate::occlusion::Transmittance;
use crate::tally::{self, Work};

/// Pixels along a tile's side.
const TILE: u32 = 16;
/// Bounds of a resolution that is chosen.
pub(super) const CHOSEN: [f64; 2] = [64.0, 1024.0];
/// Pieces of hair that one thread holds at a time, where it can do with so few: 80 MB.
const MOST_PIECES: usize = 4 << 20;

/// How much of what a point's own strand covers is taken to be as free of other hair as what is before it.
const PRIOR: f64 = 0.1;

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
    rule: Transmittance,
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
        let mut map = Self { view, rule, settings: *settings, resolution: first, halvings: 0, tiles: Vec::new() };
        while !map.fill(model, cancelled)? {
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
    fn fill(&mut self, model: &HairModel, cancelled: &(impl Fn() -> bool + Sync)) -> Result<bool, MapError> {
        self.tiles.clear();
        let per_side = self.settings.per_side();
        let cells = self.resolution * per_side;
        let grid = TileGrid::new(PixelRect::image([cells; 2]), TILE * per_side);
        let pixels = TileGrid::new(PixelRect::image([self.resolution; 2]), TILE);
        for image in 0..self.view.images() {
            let source = Source::new(&self.view, image, [self.resolution, per_side], model, self.rule);
            let segment = |index| self.view.segment(image, model, index);
            let bins = assign(&grid, &source.projection, model.segments() as u32, segment)?;
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
    ///
    /// What lies before the point's own strand in a pixel is before it everywhere. What lies beside or behind its parts is known where the strand does
    /// not cover the pixel, and taken to be the same where it does.
    pub fn transmittance(&self, model: &HairModel, point: &Point) -> f32 {
        let Some(seen) = self.view.see(point.position) else { return 1.0 };
        let depth = seen.depth as f32;
        let (mut left, mut pixels) = (0.0, PixelRect { min: [u32::MAX; 2], max: [0; 2] });
        self.around(&seen, |x, y, weight| {
            left += weight * f64::from(value(self.function(seen.image, x, y), depth));
            pixels.min = [pixels.min[0].min(x), pixels.min[1].min(y)];
            pixels.max = [pixels.max[0].max(x + 1), pixels.max[1].max(y + 1)];
        });
        let left = match point.on {
            Some(on) => self.without(model, on, &seen, &pixels, left),
            None => left,
        };
        left.clamp(0.0, 1.0) as f32
    }

    /// What is left at a point on a strand without what the strand itself takes near the point, of `left` with it.
    ///
    /// How much light each step of the strand takes is read off the functions: another strand may be before it. It goes on from there as what the
    /// strand leaves free does, which says more the more that is.
    fn without(&self, model: &HairModel, on: OnStrand, seen: &Seen, pixels: &PixelRect, left: f64) -> f64 {
        let depth = seen.depth as f32;
        let fineness = [self.resolution, self.settings.per_side()];
        let source = Source::new(&self.view, seen.image, fineness, model, self.rule);
        let Some(own) = source.own(on, pixels, depth) else { return left };
        let mut before = 0.0;
        self.around(seen, |x, y, weight| {
            before += weight * f64::from(value(self.function(seen.image, x, y), own.nearest));
        });
        // All that is there between is less than the map knows.
        if before - left < f64::from(self.settings.error) {
            return left;
        }
        let steps = source.steps_of(&own, pixels);
        let (mut before, mut taken, mut counts) = (0.0, 0.0, 0.0);
        self.around(seen, |x, y, weight| {
            let function = self.function(seen.image, x, y);
            let pixel = pixels.index([x, y]) as u32;
            let first = steps.partition_point(|step| step.pixel < pixel);
            let own = &steps[first..first + steps[first..].partition_point(|step| step.pixel == pixel)];
            before += weight * f64::from(value(function, own.first().map_or(depth, |step| step.depth)));
            for same in own.chunk_by(|a, b| a.depth == b.depth) {
                let fall = weight * self.fall(function, same);
                let sum = |of: fn(&Step) -> f32| same.iter().map(|step| f64::from(of(step))).sum::<f64>();
                // A step may be so small that its share is no number.
                if fall > 0.0 {
                    taken += fall;
                    counts += fall * (sum(|step| step.counts) / sum(|step| step.taken));
                }
            }
        });
        let prior = PRIOR * taken;
        let free = before - taken + prior;
        let beside = if free > 0.0 { ((left + prior) / free).min(1.0) } else { 1.0 };
        (before - counts) * beside
    }

    /// What steps at one depth take of a function, as it says itself; where they may be too small for it to know, what they take of its value.
    fn fall(&self, function: &[Node], steps: &[Step]) -> f64 {
        let depth = steps[0].depth;
        let most: f32 = steps.iter().map(|step| step.taken).sum();
        let before = value(function, depth);
        let fall = if most > 4.0 * self.settings.error {
            (before - value(function, depth.next_up())).clamp(0.0, most)
        } else {
            most * before
        };
        fall.into()
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
