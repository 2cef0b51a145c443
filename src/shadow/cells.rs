//! Transmittance along depth in one pixel of a lamp's image.
//!
//! A pixel is cut in cells; in each, hair is scan-converted with exact coverage a, and each strand lets γ = 1 - a (1 - t) through (Eq. 7). A cell's
//! function is the product of its strands, which takes them as independent inside the cell; the pixel's is the mean of its cells. Finer cells
//! leave less to independence. Pieces of one strand that follow each other cover different parts of a cell: their shares add up.

use glam::DVec2;

use super::compress::Node;
use super::view::View;
use crate::camera::Projection;
use crate::fragment::{PixelRect, scan_convert};
use crate::hair::HairModel;
use crate::occlusion::Transmittance;

/// A piece of hair in a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Its pixel within the rectangle, row by row.
    pub pixel: u32,
    /// Its cell within the pixel, row by row.
    pub cell: u32,
    pub segment: u32,
    pub depth: f32,
    /// Share of the cell's light that it takes; where pieces are joined, the sum of theirs.
    pub blocked: f32,
    /// What it takes of the light that meets it; where pieces are joined, the most.
    pub opacity: f32,
}

impl Piece {
    /// Takes in the piece that follows it: their shares add up, at the depth that they have in the mean.
    pub fn join(&mut self, next: &Self) {
        self.blocked += next.blocked;
        self.depth += (next.depth - self.depth) * (next.blocked / self.blocked);
        self.opacity = self.opacity.max(next.opacity);
    }

    /// Share of the cell's light that it takes: what covers more than the cell lies over itself, as at the inside of a bend, and there takes twice.
    pub fn taken(&self) -> f32 {
        let over = (self.blocked - self.opacity).clamp(0.0, self.opacity);
        self.blocked.min(self.opacity) + over * (1.0 - self.opacity)
    }
}

/// What pieces are made from.
#[derive(Debug)]
pub(super) struct Source<'a> {
    pub model: &'a HairModel,
    pub rule: Transmittance,
    pub view: &'a View,
    pub image: usize,
    pub projection: Projection,
    /// Cells along a side of a pixel.
    pub per_side: u32,
}

impl<'a> Source<'a> {
    /// Of an image of `resolution` pixels a side, each of `per_side`² cells.
    pub fn new(
        view: &'a View,
        image: usize,
        [resolution, per_side]: [u32; 2],
        model: &'a HairModel,
        rule: Transmittance,
    ) -> Self {
        Self { model, rule, view, image, projection: view.projection(resolution * per_side), per_side }
    }

    /// The pieces of some segments in a rectangle of pixels, by pixel, cell and segment; false, and some are missing, if there are more than `most`.
    pub fn pieces(&self, segments: &[u32], pixels: &PixelRect, most: usize, pieces: &mut Vec<Piece>) -> bool {
        pieces.clear();
        let cells = self.cells(pixels);
        for &segment in segments {
            self.scan(segment, pixels, &cells, |piece, _| pieces.push(piece));
            if pieces.len() > most {
                return false;
            }
        }
        pieces.sort_unstable_by_key(|piece| (piece.pixel, piece.cell, piece.segment));
        true
    }

    /// The cells of a rectangle of pixels.
    pub fn cells(&self, pixels: &PixelRect) -> PixelRect {
        PixelRect { min: pixels.min.map(|x| x * self.per_side), max: pixels.max.map(|x| x * self.per_side) }
    }

    /// The pieces of one segment in some cells of a rectangle of pixels, with the place along the segment (0 to 1) of each and how much of it is seen.
    pub fn scan(&self, index: u32, pixels: &PixelRect, cells: &PixelRect, mut take: impl FnMut(Piece, [f32; 2])) {
        let [from, to] = self.model.arcs(index as usize);
        let opacity = self.rule.opacity(self.model.transparency[index as usize], to - from);
        if opacity <= 0.0 {
            return;
        }
        let n = self.per_side;
        // The image's middle is its centre.
        let side = 0.5 / self.projection.center.x;
        let segment = self.view.segment(self.image, self.model, index);
        scan_convert(&segment, &self.projection, cells, |x, y, fragment| {
            let pixel = pixels.index([x / n, y / n]) as u32;
            let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) * side;
            let depth = self.view.counted_from(self.image, self.model, &fragment, at);
            let cell = y % n * n + x % n;
            take(
                Piece { pixel, cell, segment: index, depth, blocked: fragment.coverage * opacity, opacity },
                [fragment.u, fragment.span],
            );
        });
    }

    /// Whether a piece goes on where another of its cell ends.
    pub fn follows(&self, last: &Piece, piece: &Piece) -> bool {
        let strand = |piece: &Piece| self.model.strand[piece.segment as usize];
        (last.pixel, last.cell) == (piece.pixel, piece.cell)
            && last.segment + 1 == piece.segment
            && strand(last) == strand(piece)
    }

    /// Joins pieces of one pixel that follow each other on their strand; then by depth.
    pub fn join(&self, pieces: &mut Vec<Piece>) {
        let mut kept = 0;
        let mut last = None;
        for i in 0..pieces.len() {
            let piece = pieces[i];
            let follows = last.is_some_and(|last| self.follows(&last, &piece));
            last = Some(piece);
            if follows {
                pieces[kept - 1].join(&piece);
            } else {
                pieces[kept] = piece;
                kept += 1;
            }
        }
        pieces.truncate(kept);
        pieces.sort_unstable_by(|a, b| a.depth.total_cmp(&b.depth).then((a.cell, a.segment).cmp(&(b.cell, b.segment))));
    }

    /// The function of a pixel from its joined pieces: a step each depth.
    pub fn steps(&self, pieces: &[Piece], cells: &mut Vec<f64>, steps: &mut Vec<Node>) {
        let count = (self.per_side * self.per_side) as usize;
        cells.clear();
        cells.resize(count, 1.0);
        steps.clear();
        let mut sum = count as f64;
        for piece in pieces {
            let cell = &mut cells[piece.cell as usize];
            let after = *cell * f64::from(1.0 - piece.taken());
            sum -= *cell - after;
            *cell = after;
            let left = (sum / count as f64).clamp(0.0, 1.0) as f32;
            match steps.last_mut() {
                Some(step) if step.depth == piece.depth => step.left = left,
                Some(step) if step.left <= left => {}
                _ => steps.push(Node { depth: piece.depth, left }),
            }
        }
    }
}
