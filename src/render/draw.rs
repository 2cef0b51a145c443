//! Shading points drawn from a picture, for studies that look at a few of them closely.
//!
//! Every point that a render asks for its Γ has the same chance, whatever it counts in its pixel: the accuracy of Γ is a promise for
//! each of them. Hair and surfaces are drawn apart, as one kind may be rare. The points with the least hash are taken; which
//! they are depends on nothing but the picture and its seed.

use std::collections::BinaryHeap;

use rayon::prelude::*;

use super::RenderError;
use super::lighting::{Lighting, on_hair, on_surface};
use super::pipeline::tiles;
use super::progress::Progress;
use super::tile::{Frame, TileSpace, What};
use crate::fragment::{Bins, PixelRect, TileGrid};
use crate::hash::hash64;
use crate::occlusion::Receiver;

/// Purpose of the random numbers that choose points.
const DRAW: u32 = 0x4452_4157;
/// Purpose of those that choose tiles.
const TILES: u32 = 0x5449_4C45;

/// What a shading point lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// Indices in the scene's hair.
    Hair { strand: u32, segment: u32 },
    /// Index in the scene's surfaces.
    Surface { triangle: u32 },
}

/// A point that a render shades.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint {
    /// Column and row of its pixel in the whole picture.
    pub pixel: [u32; 2],
    pub place: Place,
    /// Where Γ is asked, in render space.
    pub receiver: Receiver,
    /// Names its random numbers, as in a render.
    pub key: u32,
}

/// Points drawn from a picture.
#[derive(Clone, Debug, Default)]
pub struct Drawn {
    /// The points on hair, then those on surfaces; each kind row by row of the picture.
    pub points: Vec<ShadingPoint>,
    /// How many points on hair and on surfaces they were drawn from.
    pub population: [u64; 2],
}

/// Draws `count` points of a picture or of a part of it, half of them on hair; where one kind has not enough the other makes up for it.
///
/// # Errors
/// Cancelled work, and memory that is not to be had.
pub fn draw(
    lighting: &Lighting<'_>,
    window: Option<PixelRect>,
    count: usize,
    progress: &dyn Progress,
) -> Result<Drawn, RenderError> {
    let frame = Frame::new(lighting);
    let full = PixelRect::image(frame.scene.camera.resolution());
    let (grid, bins) = tiles(&frame, window.unwrap_or(full))?;
    let all: Vec<usize> = (0..grid.count()).collect();
    draw_from(&frame, &grid, &bins, &all, count, progress)
}

/// Tiles chosen evenly by a hash, at most `count`: three in four of them where there is hair.
pub(super) fn some_tiles(frame: &Frame<'_>, grid: &TileGrid, bins: &Bins, count: usize) -> Vec<usize> {
    let (mut hair, mut bare): (Vec<usize>, Vec<usize>) =
        (0..grid.count()).partition(|&index| !bins.tile(index).is_empty());
    let rank = |index: &usize| (hash64(&[TILES, frame.pass.seed, *index as u32]), *index);
    hair.sort_unstable_by_key(rank);
    bare.sort_unstable_by_key(rank);
    bare.truncate((count / 4).max(count.saturating_sub(hair.len())));
    hair.truncate(count - bare.len());
    hair.extend(bare);
    hair
}

/// As [`draw`], from some tiles of a picture.
pub(super) fn draw_from(
    frame: &Frame<'_>,
    grid: &TileGrid,
    bins: &Bins,
    chosen: &[usize],
    count: usize,
    progress: &dyn Progress,
) -> Result<Drawn, RenderError> {
    progress.stage("drawing points", chosen.len() as u64);
    let empty = || [Lowest::new(count), Lowest::new(count)];
    // Which points have the least hash does not depend on the order in which threads come together.
    let [hair, surface] = chosen
        .par_iter()
        .try_fold(
            || (empty(), TileSpace::default()),
            |(mut lowest, mut space), &index| {
                if progress.cancelled() {
                    return Err(RenderError::Cancelled);
                }
                offer(frame, &grid.tile(index), bins.tile(index), &mut space, &mut lowest);
                progress.advance(1);
                Ok((lowest, space))
            },
        )
        .map(|result| result.map(|(lowest, _)| lowest))
        .try_reduce(empty, |[a, b], [c, d]| Ok([a.join(c), b.join(d)]))?;
    let population = [hair.seen, surface.seen];
    let [hairs, surfaces] = [hair.heap.len(), surface.heap.len()];
    let half = count.div_ceil(2);
    let first = half.max(count.saturating_sub(surfaces)).min(hairs);
    let mut points = hair.into_points(first);
    points.extend(surface.into_points(count - first));
    Ok(Drawn { points, population })
}

/// Offers the points of one tile.
fn offer(frame: &Frame<'_>, rect: &PixelRect, segments: &[u32], space: &mut TileSpace, lowest: &mut [Lowest; 2]) {
    let (mut pixel, mut index) = (u32::MAX, 0);
    for point in frame.points(rect, segments, space) {
        index = if point.pixel == pixel { index + 1 } else { 0 };
        pixel = point.pixel;
        let (kind, place, receiver) = match &point.what {
            What::Hair { segment, sample } => {
                (0, Place::Hair { strand: sample.on.strand, segment: *segment }, on_hair(sample))
            }
            // Nothing is asked about the light on what reflects none.
            What::Surface(hit) if hit.albedo == glam::Vec3::ZERO => continue,
            What::Surface(hit) => (1, Place::Surface { triangle: hit.triangle }, on_surface(hit)),
        };
        let place_in_picture @ [x, y] = point.place(rect);
        let rank = (hash64(&[DRAW, frame.pass.seed, x, y, index]), [y, x, index]);
        let key = frame.key(rect, point).own;
        lowest[kind].offer(Candidate { rank, point: ShadingPoint { pixel: place_in_picture, place, receiver, key } });
    }
}

/// A point and what decides whether it is taken: its hash, and its place where two hashes are equal.
struct Candidate {
    rank: (u64, [u32; 3]),
    point: ShadingPoint,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.rank == other.rank
    }
}

impl Eq for Candidate {}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.rank.cmp(&other.rank)
    }
}

/// The candidates of least rank among those seen.
struct Lowest {
    room: usize,
    seen: u64,
    heap: BinaryHeap<Candidate>,
}

impl Lowest {
    fn new(room: usize) -> Self {
        Self { room, seen: 0, heap: BinaryHeap::new() }
    }

    fn offer(&mut self, candidate: Candidate) {
        self.seen += 1;
        self.keep(candidate);
    }

    fn keep(&mut self, candidate: Candidate) {
        if self.heap.len() < self.room {
            self.heap.push(candidate);
        } else if let Some(mut worst) = self.heap.peek_mut()
            && candidate < *worst
        {
            *worst = candidate;
        }
    }

    fn join(mut self, other: Self) -> Self {
        self.seen += other.seen;
        other.heap.into_iter().for_each(|candidate| self.keep(candidate));
        self
    }

    /// The `count` points of least rank, in the order of the picture.
    fn into_points(self, count: usize) -> Vec<ShadingPoint> {
        let mut candidates = self.heap.into_sorted_vec();
        candidates.truncate(count);
        candidates.sort_unstable_by_key(|candidate| candidate.rank.1);
        candidates.into_iter().map(|candidate| candidate.point).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Mat3, Vec3};

    fn lowest(range: std::ops::Range<u32>, room: usize) -> Lowest {
        let mut lowest = Lowest::new(room);
        for i in range {
            let receiver = Receiver { position: Vec3::ZERO, on: None, frame: Mat3::IDENTITY };
            let point = ShadingPoint { pixel: [i, 0], place: Place::Surface { triangle: i }, receiver, key: i };
            lowest.offer(Candidate { rank: (hash64(&[7, i]), [0, i, 0]), point });
        }
        lowest
    }

    fn pixels(lowest: Lowest, count: usize) -> Vec<u32> {
        lowest.into_points(count).iter().map(|point| point.pixel[0]).collect()
    }

    #[test]
    fn the_draw_does_not_depend_on_how_the_work_is_cut() {
        let whole = pixels(lowest(0..1000, 50), 50);
        for cut in [1, 300, 999] {
            let joined = lowest(0..cut, 50).join(lowest(cut..1000, 50));
            assert_eq!(joined.seen, 1000);
            assert_eq!(pixels(joined, 50), whole);
        }
        assert!(whole.is_sorted() && whole.len() == 50);
        // Fewer are some of those.
        assert!(pixels(lowest(0..1000, 50), 20).iter().all(|pixel| whole.contains(pixel)));
    }

    #[test]
    fn every_point_has_the_same_chance() {
        // Ten of a hundred, each time other hashes; how often each tenth is taken.
        let mut counts = [0_u32; 10];
        for trial in 0..1000 {
            pixels(lowest(trial * 100..trial * 100 + 100, 10), 10)
                .iter()
                .for_each(|p| counts[(p % 100 / 10) as usize] += 1);
        }
        // A tenth of 10,000, give or take five deviations.
        assert!(counts.iter().all(|&count| (850..1150).contains(&count)), "{counts:?}");
    }
}
