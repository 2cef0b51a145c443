//! A point's own strand in the pixels that a map is looked up in.
//!
//! By the rule of rays a strand does not count near its own point ([`OnStrand::excluded`]); a map holds it like any other. What it takes there is
//! scan-converted once more at the look-up, as the map did it, and taken out.

use std::ops::RangeInclusive;

use glam::DVec2;

use super::cells::{Piece, Source};
use crate::fragment::PixelRect;
use crate::hair::OnStrand;

/// A step of a pixel's function that is the own strand's near the point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step {
    /// Its pixel within the rectangle, row by row.
    pub pixel: u32,
    pub depth: f32,
    /// Share of the pixel's light that it takes in the map, where nothing else is before it.
    pub taken: f32,
    /// How much of that it takes by the rule of rays.
    pub counts: f32,
}

/// Where a point's own strand makes such steps.
#[derive(Clone, Debug)]
pub(super) struct Own {
    on: OnStrand,
    segments: RangeInclusive<u32>,
    cells: PixelRect,
    /// No such step is before this depth.
    pub nearest: f32,
    /// Of the point.
    depth: f32,
}

impl Source<'_> {
    /// Where the strand of a point may make steps before the point's depth though it does not count there; nothing where it cannot.
    pub fn own(&self, on: OnStrand, pixels: &PixelRect, depth: f32) -> Option<Own> {
        let segments = self.near(&on);
        let (cells, nearest) = self.before(segments.clone(), &on, pixels, depth)?;
        Some(Own { on, segments, cells, nearest, depth })
    }

    /// The own strand's steps in a rectangle of pixels, by pixel and depth: those of which a part does not count.
    pub fn steps_of(&self, own: &Own, pixels: &PixelRect) -> Vec<Step> {
        let mut pieces: Vec<(Piece, f32)> = Vec::new();
        let Own { on, segments, cells, depth, .. } = own;
        let [low, high] = on.excluded();
        for index in segments.clone() {
            let [a, b] = self.model.arcs(index as usize);
            // The share of a piece that does not count: a strand that leans to the lamp shows much of its length in a cell.
            let excluded = |u: f32, span: f32| {
                let [from, to] = [u - 0.5 * span, u + 0.5 * span].map(|u| a + (b - a) * u.clamp(0.0, 1.0));
                let length = to - from;
                if length > 0.0 { (to.min(high) - from.max(low)).max(0.0) / length } else { 1.0 }
            };
            self.scan(index, pixels, cells, |piece, [u, span]| pieces.push((piece, excluded(u, span))));
        }
        pieces.sort_unstable_by_key(|(piece, _)| (piece.pixel, piece.cell, piece.segment));
        let count = (self.per_side * self.per_side) as f32;
        // As the map joins them: pieces that follow each other are one, at one depth.
        let step = |chain: &[(Piece, f32)]| {
            let mut joined = chain[0].0;
            chain[1..].iter().for_each(|(piece, _)| joined.join(piece));
            let excluded: f32 = chain.iter().map(|(piece, share)| piece.blocked * share).sum();
            let taken = joined.taken() / count;
            let rest = Piece { blocked: (joined.blocked - excluded).max(0.0), ..joined };
            let counts = rest.taken() / count;
            let step = Step { pixel: joined.pixel, depth: joined.depth, taken, counts };
            (excluded > 0.0 && joined.depth < *depth).then_some(step)
        };
        let chains = pieces.chunk_by(|(last, _), (piece, _)| self.follows(last, piece));
        let mut steps: Vec<Step> = chains.filter_map(step).collect();
        steps.sort_unstable_by(|a, b| a.pixel.cmp(&b.pixel).then(a.depth.total_cmp(&b.depth)));
        steps
    }

    /// The segments of a strand of which a part does not count at a point on one of them, and one more at either end, with which they may be joined.
    fn near(&self, on: &OnStrand) -> RangeInclusive<u32> {
        let model = self.model;
        let [low, high] = on.excluded();
        let same = |index: &u32| model.strand.get(*index as usize) == Some(&on.strand);
        let (mut first, mut last) = (on.segment, on.segment);
        while let Some(before) = first.checked_sub(1).filter(same) {
            first = before;
            if model.arcs(first as usize)[1] <= low {
                break;
            }
        }
        while let Some(after) = last.checked_add(1).filter(same) {
            last = after;
            if model.arcs(last as usize)[0] >= high {
                break;
            }
        }
        first..=last
    }

    /// The cells of some pixels in which pieces of the segments may be before a depth within the arc that does not count, and the least depth of such a
    /// piece. Most of a strand's cells near its point lie behind it, and all of them where it does not lean to the lamp.
    fn before(
        &self,
        segments: RangeInclusive<u32>,
        on: &OnStrand,
        pixels: &PixelRect,
        depth: f32,
    ) -> Option<(PixelRect, f32)> {
        let all = self.cells(pixels);
        let (mut low, mut high, mut nearest) = (DVec2::INFINITY, DVec2::NEG_INFINITY, f64::INFINITY);
        for index in segments {
            let [a, b] = self.view.ends(self.image, self.model, index);
            let [from, to] = self.model.arcs(index as usize).map(f64::from);
            let [begin, end] = on.excluded().map(|arc| (f64::from(arc) - from) / (to - from));
            // A piece is held up to a width behind its depth, by the cosine of its ray: no ray of an image has less than half.
            let width = f64::from(self.model.widths(index as usize).into_iter().fold(0.0, f32::max));
            let before = f64::from(depth) - 0.5 * width;
            let crossing = (before - a.z) / (b.z - a.z);
            let (begin, end) = match b.z - a.z {
                rise if rise > 0.0 => (begin, end.min(crossing)),
                rise if rise < 0.0 => (begin.max(crossing), end),
                _ if a.z < before => (begin, end),
                _ => continue,
            };
            let [begin, end] = [begin, end].map(|u| u.clamp(0.0, 1.0));
            if begin >= end {
                continue;
            }
            for u in [begin, end] {
                let at = a + (b - a) * u;
                nearest = nearest.min(at.z);
                let Some((place, scale)) = self.view.place(&self.projection, at) else {
                    return Some((all, f32::NEG_INFINITY));
                };
                // Twice the half width: ribbons are widened off the axis. A cell more for those that are touched.
                let around = DVec2::splat(width * scale + 1.0);
                (low, high) = (low.min(place - around), high.max(place + around));
            }
        }
        let [low, high] = [low.floor(), high.ceil()].map(|place| [place.x, place.y]);
        let min = [0, 1].map(|i| (low[i].max(0.0) as u32).max(all.min[i]));
        let max = [0, 1].map(|i| (high[i].max(0.0) as u32).min(all.max[i]));
        (min[0] < max[0] && min[1] < max[1]).then_some((PixelRect { min, max }, nearest as f32))
    }
}
