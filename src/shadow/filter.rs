//! The pixels that count at a place of an image, with weights that fall off as a tent and add up to 1.

use glam::DVec2;

/// Calls `take` with column, row and weight of each pixel around a place (in pixels, from the upper left corner) of an image of
/// `resolution` pixels a side. With a radius of 1 these are the four of bilinear interpolation; what lies outside goes to the edge.
pub(super) fn around(at: DVec2, radius: f64, resolution: u32, mut take: impl FnMut(u32, u32, f64)) {
    let range = |x: f64| ((x - 0.5 - radius).floor() as i64 + 1)..=((x - 0.5 + radius).ceil() as i64 - 1);
    let weight = |x: f64, pixel: i64| (1.0 - (x - 0.5 - pixel as f64).abs() / radius).max(0.0);
    let total = |x: f64| range(x).map(|pixel| weight(x, pixel)).sum::<f64>();
    let scale = 1.0 / (total(at.x) * total(at.y));
    let clamped = |pixel: i64| pixel.clamp(0, i64::from(resolution) - 1) as u32;
    for row in range(at.y) {
        let across = weight(at.y, row) * scale;
        for column in range(at.x) {
            take(clamped(column), clamped(row), weight(at.x, column) * across);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_bilinear_and_add_up_to_one() {
        let mut found = Vec::new();
        around(DVec2::new(3.75, 2.0), 1.0, 8, |x, y, w| found.push((x, y, w)));
        assert_eq!(found, [(3, 1, 0.375), (4, 1, 0.125), (3, 2, 0.375), (4, 2, 0.125)]);
        for (at, radius) in [([0.0, 8.0], 1.0), ([3.5, 3.5], 1.0), ([4.2, 0.1], 2.5), ([7.9, 7.9], 16.0)] {
            let mut sum = 0.0;
            around(DVec2::from(at), radius, 8, |x, y, w| {
                assert!(x < 8 && y < 8 && w >= 0.0);
                sum += w;
            });
            assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        }
    }
}
