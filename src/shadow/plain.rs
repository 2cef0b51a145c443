//! Plain shadow maps: the depth of the nearest hair a pixel (Williams 1978), looked up with percentage-closer filtering. For comparison only:
//! a pixel is either lit or dark, by the chance of what hair blocks there: the mean is right, but transparency and hair thinner than a pixel come out as noise.

use rayon::prelude::*;

use super::cells::Source;
use super::deep::{CHOSEN, first_resolution};
use super::filter;
use super::receiver::Point;
use super::view::View;
use super::{MapError, Settings, Size};
use crate::fragment::{PixelRect, TileGrid, assign};
use crate::hair::HairModel;
use crate::hash::{hash, to_unit};
use crate::occlusion::Transmittance;
use crate::tally::{self, Work};

/// Purpose of the random numbers that decide whether hair that covers a part of a pixel is in it.
const COVERED: u32 = 0x434F_5645;
/// Pixels along a tile's side.
const TILE: u32 = 16;

/// Depth of the hair nearest to a lamp.
#[derive(Debug)]
pub struct ShadowMap {
    view: View,
    rule: Transmittance,
    filter: f32,
    resolution: u32,
    halvings: u32,
    /// By image, tile and pixel, each row by row; infinite where no hair is.
    depths: Vec<f32>,
}

/// Bytes that a map takes at most, of the six images that it may have, before any hair is seen.
pub fn bytes_at_most(settings: &Settings) -> u64 {
    let resolution = settings.resolution.map_or(CHOSEN[1] as u32, |resolution| resolution.clamp(1, 8192));
    (6 * 4 * u64::from(resolution.next_multiple_of(TILE)).pow(2)).min(settings.most_bytes as u64)
}

impl ShadowMap {
    /// Builds the map of a lamp's view: a piece of hair is in a pixel with the chance of what it blocks there.
    ///
    /// # Errors
    /// Memory.
    pub fn build(
        view: View,
        model: &HairModel,
        rule: Transmittance,
        settings: &Settings,
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Result<Self, MapError> {
        tally::add(Work::PlainMaps, 1);
        let mut resolution = first_resolution(&view, model, settings);
        let mut halvings = 0;
        while resolution as usize * resolution as usize * view.images() * 4 > settings.most_bytes && resolution > TILE {
            resolution = (resolution / 2).next_multiple_of(TILE);
            halvings += 1;
        }
        let mut map = Self { view, rule, filter: settings.filter, resolution, halvings, depths: Vec::new() };
        let grid = TileGrid::new(PixelRect::image([resolution; 2]), TILE);
        for image in 0..map.view.images() {
            let source = Source::new(&map.view, image, [resolution, 1], model, rule);
            let segment = |index| map.view.segment(image, model, index);
            let bins = assign(&grid, &source.projection, model.segments() as u32, segment)?;
            let tile = |pieces: &mut Vec<_>, index: usize| {
                let mut depths = vec![f32::INFINITY; (TILE * TILE) as usize];
                for run in bins.tile(index).chunks(1024).take_while(|_| !cancelled()) {
                    source.pieces(run, &grid.tile(index), usize::MAX, pieces);
                    for piece in pieces.iter() {
                        let key = [COVERED, image as u32, index as u32, piece.pixel, piece.segment];
                        if to_unit(hash(&key)) < piece.blocked {
                            let depth = &mut depths[piece.pixel as usize];
                            *depth = depth.min(piece.depth);
                        }
                    }
                }
                depths
            };
            let tiles: Vec<Vec<f32>> =
                (0..grid.count()).into_par_iter().with_max_len(1).map_init(Vec::new, tile).collect();
            if cancelled() {
                return Err(MapError::Cancelled);
            }
            map.depths.extend(tiles.into_iter().flatten());
        }
        Ok(map)
    }

    /// What it is and takes.
    pub fn size(&self) -> Size {
        Size {
            images: self.view.images(),
            resolution: self.resolution,
            halvings: self.halvings,
            nodes: self.depths.len(),
            bytes: size_of_val(&self.depths[..]),
        }
    }

    /// The share of the pixels around a point whose hair is not before it, its own strand left out where it lies before all other hair.
    pub fn transmittance(&self, model: &HairModel, point: &Point) -> f32 {
        let Some(seen) = self.view.see(point.position) else { return 1.0 };
        let size = f64::from(self.resolution);
        let columns = self.resolution / TILE;
        let depth = seen.depth as f32;
        let mut sum = 0.0;
        filter::around(seen.at * size, f64::from(self.filter), self.resolution, |x, y, weight| {
            let tile = (seen.image as u32 * columns + y / TILE) * columns + x / TILE;
            let nearest = self.depths[(tile * TILE * TILE + y % TILE * TILE + x % TILE) as usize];
            let from = || match point.on {
                Some(on) => {
                    let pixel = PixelRect { min: [x, y], max: [x + 1, y + 1] };
                    let source = Source::new(&self.view, seen.image, [self.resolution, 1], model, self.rule);
                    let own = source.own(on, &pixel, depth);
                    let steps = own.map(|own| source.steps_of(&own, &pixel)).unwrap_or_default();
                    steps.first().map_or(f32::INFINITY, |step| step.depth)
                }
                None => f32::INFINITY,
            };
            sum += if nearest < depth && nearest < from() { 0.0 } else { weight };
        });
        sum as f32
    }
}
