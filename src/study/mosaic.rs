//! Pictures put side by side, and the difference of two.

use super::figure::{Levels, levels};
use crate::image::RgbImage;
use crate::image::display::srgb_to_linear;

/// A picture of a mosaic.
#[derive(Clone, Copy, Debug)]
pub struct Tile<'a> {
    pub image: &'a RgbImage,
    /// Each pixel becomes this many along each side.
    pub enlarge: usize,
}

impl Tile<'_> {
    fn size(&self) -> [usize; 2] {
        [self.image.width, self.image.height].map(|side| (side as usize).saturating_mul(self.enlarge))
    }
}

/// The tiles in rows of `columns`, `gap` white pixels between them, each in the middle of its cell. None where a side has more than `limit` pixels.
pub fn mosaic(tiles: &[Tile], columns: usize, gap: usize, limit: usize) -> Option<RgbImage> {
    let columns = columns.clamp(1, tiles.len().max(1));
    let rows = tiles.len().div_ceil(columns);
    let largest =
        |axis: usize, tiles: &mut dyn Iterator<Item = &Tile>| tiles.map(|tile| tile.size()[axis]).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(|c| largest(0, &mut tiles.iter().skip(c).step_by(columns))).collect();
    let heights: Vec<usize> = tiles.chunks(columns).map(|row| largest(1, &mut row.iter())).collect();
    let side = |cells: &[usize]| cells.iter().fold((cells.len() - 1) * gap, |sum, cell| sum.saturating_add(*cell));
    if tiles.is_empty() || side(&widths).max(side(&heights)) > limit {
        return None;
    }
    let (width, height) = (side(&widths), side(&heights));
    let mut pixels = vec![[1.0; 3]; width * height];
    let start = |cells: &[usize], index: usize| cells[..index].iter().sum::<usize>() + index * gap;
    for row in 0..rows {
        for (column, tile) in tiles[row * columns..].iter().take(columns).enumerate() {
            let [w, h] = tile.size();
            let left = start(&widths, column) + (widths[column] - w) / 2;
            let top = start(&heights, row) + (heights[row] - h) / 2;
            for y in 0..h {
                let source = &tile.image.pixels[y / tile.enlarge * tile.image.width as usize..];
                for x in 0..w {
                    pixels[(top + y) * width + left + x] = source[x / tile.enlarge];
                }
            }
        }
    }
    Some(RgbImage { width: width as u32, height: height as u32, pixels })
}

/// |a - b| in the levels of a display, times `factor`, as a picture and in numbers; none where the sizes differ.
pub fn difference(a: &RgbImage, b: &RgbImage, factor: f32) -> Option<(RgbImage, Levels)> {
    if (a.width, a.height) != (b.width, b.height) {
        return None;
    }
    let (mut sum, mut max) = ([0_u64; 3], 0);
    let pixels = a
        .pixels
        .iter()
        .zip(&b.pixels)
        .map(|(a, b)| {
            let (a, b) = (levels(*a), levels(*b));
            std::array::from_fn(|channel| {
                let difference = a[channel].abs_diff(b[channel]);
                sum[channel] += u64::from(difference);
                max = max.max(difference);
                srgb_to_linear((f32::from(difference) * factor / 255.0).min(1.0))
            })
        })
        .collect();
    let picture = RgbImage { width: a.width, height: a.height, pixels };
    let count = a.pixels.len().max(1) as f64;
    Some((picture, Levels { mean: sum.map(|sum| sum as f64 / count), max }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::display::srgb_to_linear;

    fn grey(width: u32, height: u32, value: f32) -> RgbImage {
        RgbImage { width, height, pixels: vec![[value; 3]; (width * height) as usize] }
    }

    #[test]
    fn tiles_stand_in_rows_in_the_middle_of_their_cells() {
        let (small, large) = (grey(1, 1, 0.25), grey(4, 2, 0.5));
        let tiles = [
            Tile { image: &large, enlarge: 1 },
            Tile { image: &small, enlarge: 2 },
            Tile { image: &small, enlarge: 1 },
        ];
        let picture = mosaic(&tiles, 2, 1, 100).unwrap();
        assert_eq!((picture.width, picture.height), (4 + 1 + 2, 2 + 1 + 1));
        let row = |y: usize| picture.pixels[y * 7..y * 7 + 7].iter().map(|p| p[0]).collect::<Vec<_>>();
        assert_eq!(row(0), [0.5, 0.5, 0.5, 0.5, 1.0, 0.25, 0.25]);
        assert_eq!(row(2), [1.0; 7]);
        assert_eq!(row(3), [1.0, 0.25, 1.0, 1.0, 1.0, 1.0, 1.0]);
        assert!(mosaic(&tiles, 2, 1, 6).is_none());
    }

    #[test]
    fn a_difference_is_in_levels() {
        let level = |byte: u8| srgb_to_linear(f32::from(byte) / 255.0);
        let mut b = grey(2, 1, level(100));
        b.pixels[1] = [level(100), level(103), level(92)];
        let (picture, levels) = difference(&grey(2, 1, level(100)), &b, 16.0).unwrap();
        assert_eq!(levels, Levels { mean: [0.0, 1.5, 4.0], max: 8 });
        assert_eq!(super::levels(picture.pixels[1]), [0, 48, 128]);
        assert!(difference(&grey(1, 1, 0.0), &b, 1.0).is_none());
    }
}
