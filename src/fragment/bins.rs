//! Which hair segments touch which tile of the image.

use super::footprint::Footprint;
use super::hair::{HairSegment, PixelRect};
use crate::camera::Projection;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};
use thiserror::Error;

/// Why segments cannot be assigned to tiles.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum BinError {
    #[error(
        "the hair touches {entries} image tiles in total, and a list of {} MiB does not fit into memory; \
         render a smaller image or crop window, or move the camera away from the hair", entries.div_ceil(1 << 18)
    )]
    OutOfMemory { entries: u64 },
}

/// A rectangle of pixels cut into square tiles, numbered by rows from the top; those at the right and lower edge may be smaller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileGrid {
    rect: PixelRect,
    size: u32,
}

impl TileGrid {
    /// Tiles of `size` x `size` pixels, at least one.
    pub fn new(rect: PixelRect, size: u32) -> Self {
        Self { rect, size: size.max(1) }
    }

    /// The rectangle that is cut.
    pub fn rect(&self) -> PixelRect {
        self.rect
    }

    /// Numbers of tiles in a row and in a column.
    pub fn dimensions(&self) -> [u32; 2] {
        [0, 1].map(|i| self.rect.max[i].saturating_sub(self.rect.min[i]).div_ceil(self.size))
    }

    /// Number of tiles.
    pub fn count(&self) -> usize {
        let [columns, rows] = self.dimensions();
        columns as usize * rows as usize
    }

    /// The pixels of a tile.
    pub fn tile(&self, index: usize) -> PixelRect {
        let columns = self.dimensions()[0].max(1) as usize;
        let place = [index % columns, index / columns];
        let min = [0, 1].map(|i| self.rect.min[i] + place[i] as u32 * self.size);
        PixelRect { min, max: [0, 1].map(|i| min[i].saturating_add(self.size).min(self.rect.max[i])) }
    }

    /// The tile that a pixel of the rectangle lies in.
    pub fn index_at(&self, x: u32, y: u32) -> usize {
        let [column, row] = [x - self.rect.min[0], y - self.rect.min[1]].map(|v| (v / self.size) as usize);
        row * self.dimensions()[0] as usize + column
    }

    /// Calls `visit` with each tile that a segment may touch.
    fn touched(&self, shape: &Footprint, mut visit: impl FnMut(usize)) {
        let rows = shape.rows(&self.rect);
        if rows.is_empty() {
            return;
        }
        let [origin_x, origin_y] = self.rect.min;
        let row_of = |y: u32| (y - origin_y) / self.size;
        for row in row_of(rows.start)..=row_of(rows.end - 1) {
            let top = f64::from(origin_y) + f64::from(row) * f64::from(self.size);
            let columns = shape.columns(top, top + f64::from(self.size), &self.rect);
            if columns.is_empty() {
                continue;
            }
            let first = row as usize * self.dimensions()[0] as usize;
            let column_of = |x: u32| ((x - origin_x) / self.size) as usize;
            (column_of(columns.start)..=column_of(columns.end - 1)).for_each(|column| visit(first + column));
        }
    }
}

/// For each tile the segments that may leave a fragment in it, in ascending order: four bytes an entry and eight a tile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bins {
    offsets: Vec<usize>,
    segments: Vec<u32>,
}

impl Bins {
    /// The segments of a tile, ascending.
    pub fn tile(&self, index: usize) -> &[u32] {
        &self.segments[self.offsets[index]..self.offsets[index + 1]]
    }

    /// Number of entries over all tiles.
    pub fn entries(&self) -> usize {
        self.segments.len()
    }

    /// Memory held, in bytes.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.offsets[..]) + size_of_val(&self.segments[..])) as u64
    }
}

/// Assigns the segments 0 to `count`, which `segment` gives in camera space, to the tiles of a grid. Parallel, with the same result for any
/// number of threads. `segment` is called twice for each.
///
/// # Errors
/// The lists do not fit into memory.
pub fn assign(
    grid: &TileGrid,
    projection: &Projection,
    count: u32,
    segment: impl Fn(u32) -> HairSegment + Sync,
) -> Result<Bins, BinError> {
    let tiles = grid.count();
    // A few runs of neighbouring segments a thread; each needs one counter a tile.
    let run = count.div_ceil(4 * rayon::current_num_threads() as u32).max(4096);
    let runs: Vec<_> =
        (0..count).step_by(run as usize).map(|first| first..count.min(first.saturating_add(run))).collect();
    let visit = |index: u32, visit: &mut dyn FnMut(usize)| {
        if let Some(shape) = Footprint::new(&segment(index), projection) {
            grid.touched(&shape, visit);
        }
    };

    let mut counters: Vec<Vec<u32>> = (runs.par_iter())
        .map(|run| {
            let mut counter = vec![0u32; tiles];
            run.clone().for_each(|index| visit(index, &mut |tile| counter[tile] += 1));
            counter
        })
        .collect();

    // From counts to the place of each run within its tile, and of each tile in the whole.
    let mut offsets = Vec::with_capacity(tiles + 1);
    let mut total = 0u64;
    for tile in 0..tiles {
        offsets.push(total as usize);
        let mut within = 0;
        for counter in &mut counters {
            within += std::mem::replace(&mut counter[tile], within);
        }
        total += u64::from(within);
    }
    offsets.push(total as usize);

    let mut entries: Vec<AtomicU32> = Vec::new();
    entries.try_reserve_exact(total as usize).map_err(|_| BinError::OutOfMemory { entries: total })?;
    entries.resize_with(total as usize, AtomicU32::default);
    // Every place is written once. Atomics make that safe to share and cost the same as plain stores.
    runs.par_iter().zip(counters).for_each(|(run, mut place)| {
        run.clone().for_each(|index| {
            visit(index, &mut |tile| {
                entries[offsets[tile] + place[tile] as usize].store(index, Ordering::Relaxed);
                place[tile] += 1;
            });
        });
    });
    Ok(Bins { offsets, segments: entries.into_iter().map(AtomicU32::into_inner).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fragment::hair::scan_convert;
    use crate::hash::{hash, to_unit};
    use glam::{DVec2, Vec3};

    const VIEW: Projection = Projection { focal: 200.0, center: DVec2::new(100.0, 75.0), near: 0.01 };

    /// Short hair in and around the view, some of it wide, some of it behind the eye.
    fn segment(index: u32) -> HairSegment {
        let random = |k: u32| to_unit(hash(&[index, k])) - 0.5;
        let from = Vec3::new(3.0 * random(0), 2.0 * random(1), 1.0 + 2.4 * random(2));
        let to = from + 0.2 * Vec3::new(random(3), random(4), random(5));
        let width = if index.is_multiple_of(50) { 0.1 } else { 0.001 };
        HairSegment { ends: [from, to], widths: [width, 0.5 * width], index }
    }

    #[test]
    fn each_tile_lists_in_order_all_segments_that_touch_it() {
        let grid = TileGrid::new(PixelRect { min: [3, 5], max: [190, 141] }, 32);
        assert_eq!(grid.dimensions(), [6, 5]);
        let count = 20_000;
        let bins = assign(&grid, &VIEW, count, segment).unwrap();
        let (mut used, mut touched) = (0, 0);
        for tile in 0..grid.count() {
            let list = bins.tile(tile);
            assert!(list.is_sorted_by(|a, b| a < b));
            let rect = grid.tile(tile);
            for index in 0..count {
                let mut any = false;
                scan_convert(&segment(index), &VIEW, &rect, |_, _, _| any = true);
                if any {
                    assert!(list.binary_search(&index).is_ok(), "segment {index} is missing in tile {tile}");
                    touched += 1;
                }
            }
            used += list.len();
        }
        assert_eq!(used, bins.entries());
        assert!(touched > 1000 && used <= touched + touched / 100, "{used} entries for {touched} touches");
    }

    #[test]
    fn threads_make_no_difference() {
        let grid = TileGrid::new(PixelRect::image([200, 150]), 16);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| assign(&grid, &VIEW, 30_000, segment).unwrap())
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn tiles_make_up_the_rectangle() {
        let grid = TileGrid::new(PixelRect { min: [3, 5], max: [100, 37] }, 32);
        let area: u32 =
            (0..grid.count()).map(|i| grid.tile(i)).map(|t| (t.max[0] - t.min[0]) * (t.max[1] - t.min[1])).sum();
        assert_eq!(area, 97 * 32);
        assert_eq!(TileGrid::new(PixelRect { min: [5, 5], max: [5, 9] }, 32).count(), 0);
        let none = assign(&TileGrid::new(PixelRect::image([0, 0]), 32), &VIEW, 10, segment).unwrap();
        assert_eq!(none.entries(), 0);
    }
}
