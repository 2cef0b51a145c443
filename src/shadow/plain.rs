//! Plain shadow maps: the depth of the nearest hair a pixel (Williams 1978), looked up with percentage-closer filtering. For comparison only:
//! a pixel is either lit or dark, by the chance of what hair blocks there: the mean is right, but transparency and hair thinner than a pixel come out as noise.

use rayon::prelude::*;

use super::cells::Source;
use super::deep::first_resolution;
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
    filter: f32,
    resolution: u32,
    halvings: u32,
    /// By image, tile and pixel, each row by row; infinite where no hair is.
    depths: Vec<f32>,
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
        let projection = view.projection(resolution);
        let grid = TileGrid::new(PixelRect::image([resolution; 2]), TILE);
        let mut depths = Vec::new();
        for image in 0..view.images() {
            let source = Source { model, rule, view: &view, image, projection, per_side: 1 };
            let bins = assign(&grid, &projection, model.segments() as u32, |index| view.segment(image, model, index))?;
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
            depths.extend(tiles.into_iter().flatten());
        }
        Ok(Self { view, filter: settings.filter, resolution, halvings, depths })
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

    /// The share of the pixels around a point whose hair is not before it.
    pub fn transmittance(&self, point: &Point) -> f32 {
        let Some(seen) = self.view.see(point.position) else { return 1.0 };
        let size = f64::from(self.resolution);
        let own = point.own(&self.view, &seen);
        let columns = self.resolution / TILE;
        let mut sum = 0.0;
        filter::around(seen.at * size, f64::from(self.filter), self.resolution, |x, y, weight| {
            let tile = (seen.image as u32 * columns + y / TILE) * columns + x / TILE;
            let nearest = self.depths[(tile * TILE * TILE + y % TILE * TILE + x % TILE) as usize];
            let depth = seen.depth - own.map_or(0.0, |own| seen.of_pixel(self.resolution, x, y, |o, h| own.bias(o, h)));
            sum += if f64::from(nearest) < depth { 0.0 } else { weight };
        });
        sum as f32
    }
}
