//! Scan conversion of hair segments: which share of each pixel a segment covers (Eq. 7), and where along the segment.
//!
//! What a pixel gets is a function of the segment and the pixel alone, never of the pixels before it on the way: the crossing of column i is
//! (i - x0) / dx wherever the walk began. So tiles and crop windows give the same bits as the whole image.

use super::footprint::{Footprint, interval};
use crate::camera::Projection;
use glam::{DVec2, Vec3};

/// A piece of a strand, straight, in camera space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HairSegment {
    /// Its two end points; z is the depth.
    pub ends: [Vec3; 2],
    /// Widths (diameters) there, in the units of the end points. Linear in between; a negative width counts as zero.
    pub widths: [f32; 2],
    /// Its number, passed on to its fragments.
    pub index: u32,
}

/// What a hair segment leaves in a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HairFragment {
    /// Depth (camera z) at the middle of the piece of the segment that lies in the pixel.
    pub depth: f32,
    /// Share of the pixel that it covers, above 0 to 1.
    pub coverage: f32,
    /// Which segment.
    pub segment: u32,
    /// Where the middle of the piece lies on the segment, 0 at its first end and 1 at its second.
    pub u: f32,
    /// The piece's share of the segment's length in space: times that length it is L of Eq. 7.
    pub span: f32,
}

/// Pixels from `min` up to but without `max`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRect {
    pub min: [u32; 2],
    pub max: [u32; 2],
}

impl PixelRect {
    /// All pixels of an image of some width and height.
    pub fn image(resolution: [u32; 2]) -> Self {
        Self { min: [0, 0], max: resolution }
    }

    /// How many pixels it has.
    pub fn pixels(&self) -> u64 {
        [0, 1].map(|i| u64::from(self.max[i].saturating_sub(self.min[i]))).iter().product()
    }

    /// The number of one of its pixels, row by row.
    pub fn index(&self, [x, y]: [u32; 2]) -> usize {
        (y - self.min[1]) as usize * (self.max[0] - self.min[0]) as usize + (x - self.min[0]) as usize
    }

    /// Column and row of a pixel by its number.
    pub fn at(&self, index: usize) -> [u32; 2] {
        let width = (self.max[0] - self.min[0]) as usize;
        [self.min[0] + (index % width) as u32, self.min[1] + (index / width) as u32]
    }
}

/// Gives `emit` the column, row and fragment of each pixel in `rect` that the segment covers a part of, at most one fragment a pixel, by rows
/// from the top and from left to right.
///
/// A segment narrower than 1/√2 pixels covers length x width of each pixel that its middle line runs through; on a line between two pixels it
/// belongs to the right or lower one. A wider one covers the exact area of its ribbon in each pixel. A segment that is seen end-on or has no
/// width covers nothing. Ribbons end square: at a joint where a wide strand bends, two overlap on one side and gape on the other.
///
/// The work is proportional to the pixels touched and the rows of `rect` between them.
pub fn scan_convert(
    segment: &HairSegment,
    projection: &Projection,
    rect: &PixelRect,
    mut emit: impl FnMut(u32, u32, HairFragment),
) {
    let Some(shape) = Footprint::new(segment, projection) else { return };
    let mut fragment = |x, y, enter: f64, leave: f64, area: f64| {
        let coverage = area.min(1.0) as f32;
        if coverage > 0.0 {
            let middle = 0.5 * (enter + leave);
            emit(
                x,
                y,
                HairFragment {
                    depth: shape.depth_at(middle) as f32,
                    coverage,
                    segment: segment.index,
                    u: shape.parameter_at(middle) as f32,
                    // Rounding can reverse a piece that is shorter than the last digit.
                    span: (shape.parameter_at(leave) - shape.parameter_at(enter)).max(0.0) as f32,
                },
            );
        }
    };
    if shape.is_wide() {
        walk_ribbon(&shape, rect, |x, y, area, [enter, leave]| fragment(x, y, enter, leave, area));
    } else {
        walk_line(&shape, rect, |x, y, enter, leave| {
            let width = shape.width_at(0.5 * (enter + leave));
            fragment(x, y, enter, leave, (leave - enter) * shape.length * width);
        });
    }
}

/// The pixels of the middle line, each with the shares of the way at which the line enters and leaves it.
fn walk_line(shape: &Footprint, rect: &PixelRect, mut visit: impl FnMut(u32, u32, f64, f64)) {
    for y in shape.rows(rect) {
        let (top, bottom) = (f64::from(y), f64::from(y) + 1.0);
        let Some((row_enter, row_leave)) = interval(shape.start.y, shape.delta.y, top, bottom) else { continue };
        for x in shape.columns(top, bottom, rect) {
            let column = interval(shape.start.x, shape.delta.x, f64::from(x), f64::from(x) + 1.0);
            let Some((enter, leave)) = column.map(|(a, b)| (a.max(row_enter), b.min(row_leave))) else { continue };
            if enter < leave {
                visit(x, y, enter, leave);
            }
        }
    }
}

/// The pixels of a ribbon, each with the area covered and the range of s in it.
fn walk_ribbon(shape: &Footprint, rect: &PixelRect, mut visit: impl FnMut(u32, u32, f64, [f64; 2])) {
    for y in shape.rows(rect) {
        for x in shape.columns(f64::from(y), f64::from(y) + 1.0, rect) {
            let (area, along) = ribbon_in_pixel(shape, DVec2::new(x.into(), y.into()));
            if area > 0.0 {
                visit(x, y, area, along);
            }
        }
    }
}

/// Area of the ribbon inside the pixel whose upper left corner is `pixel`, and the range of s there.
///
/// The pixel's square is cut by the ribbon's four edges, each of them the zero line of a function that is linear over the image.
fn ribbon_in_pixel(shape: &Footprint, pixel: DVec2) -> (f64, [f64; 2]) {
    let along = shape.delta / (shape.length * shape.length);
    let across = shape.delta.perp() / shape.length;
    let origin = pixel - shape.start;
    let s_at = |v: DVec2| (origin + v).dot(along);
    let off_at = |v: DVec2| (origin + v).dot(across);
    let half_at = |v: DVec2| 0.5 * shape.width_at(s_at(v));
    let mut polygon = Polygon::square();
    if let Some(corners) = shape.leaning() {
        for i in 0..4 {
            let (from, edge) = (corners[i], corners[(i + 1) % 4] - corners[i]);
            polygon.cut(|v| (pixel + v - from).perp_dot(edge));
        }
    } else {
        polygon.cut(s_at);
        polygon.cut(|v| 1.0 - s_at(v));
        polygon.cut(|v| half_at(v) - off_at(v));
        polygon.cut(|v| half_at(v) + off_at(v));
    }
    let shares = polygon.corners().iter().map(|&v| s_at(v).clamp(0.0, 1.0));
    let range = shares.fold([1.0, 0.0], |[low, high]: [f64; 2], s| [low.min(s), high.max(s)]);
    (polygon.area(), range)
}

/// A convex polygon: a unit square after up to four cuts.
struct Polygon {
    corners: [DVec2; 8],
    count: usize,
}

impl Polygon {
    fn square() -> Self {
        let mut corners = [DVec2::ZERO; 8];
        corners[1] = DVec2::X;
        corners[2] = DVec2::ONE;
        corners[3] = DVec2::Y;
        Self { corners, count: 4 }
    }

    fn corners(&self) -> &[DVec2] {
        &self.corners[..self.count]
    }

    /// Keeps what is inside, where a linear function is not negative.
    fn cut(&mut self, inside: impl Fn(DVec2) -> f64) {
        let old = self.corners;
        let mut values = [0.0; 8];
        for (value, &corner) in values.iter_mut().zip(&old[..self.count]) {
            *value = inside(corner);
        }
        if values[..self.count].iter().all(|&v| v >= 0.0) {
            return;
        }
        let count = std::mem::take(&mut self.count);
        for i in 0..count {
            let j = (i + 1) % count;
            if values[i] >= 0.0 {
                self.push(old[i]);
            }
            if (values[i] >= 0.0) != (values[j] >= 0.0) {
                self.push(old[i] + (old[j] - old[i]) * (values[i] / (values[i] - values[j])));
            }
        }
    }

    /// A cut of a convex polygon adds one corner at most, so eight are enough; rounding that claims more is cut short.
    fn push(&mut self, corner: DVec2) {
        if let Some(slot) = self.corners.get_mut(self.count) {
            *slot = corner;
            self.count += 1;
        }
    }

    fn area(&self) -> f64 {
        let corners = self.corners();
        let Some(&first) = corners.first() else { return 0.0 };
        let fan = corners.windows(2).map(|pair| (pair[0] - first).perp_dot(pair[1] - first));
        0.5 * fan.sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fragment::bins::{TileGrid, assign};
    use proptest::prelude::*;

    /// One pixel is one unit at depth 1.
    const PLAIN: Projection = Projection { focal: 1.0, center: DVec2::ZERO, near: 1e-3 };
    const IMAGE: PixelRect = PixelRect { min: [0, 0], max: [64, 48] };

    #[test]
    fn pixels_are_numbered_row_by_row() {
        let rect = PixelRect { min: [5, 7], max: [8, 11] };
        assert_eq!([0, 2, 3, 11].map(|index| rect.at(index)), [[5, 7], [7, 7], [5, 8], [7, 10]]);
        assert!((0..12).all(|index| rect.index(rect.at(index)) == index));
    }

    /// A segment between two places in the image at depth 1.
    fn flat(from: [f32; 2], to: [f32; 2], width: f32) -> HairSegment {
        // The image of a width is widened off the axis; far from it these tests choose narrow hair.
        HairSegment { ends: [from, to].map(|[x, y]| Vec3::new(x, -y, 1.0)), widths: [width; 2], index: 7 }
    }

    /// Column, row and length of each pixel of the middle line.
    fn lengths(segment: &HairSegment, projection: &Projection, rect: &PixelRect) -> Vec<(u32, u32, f64)> {
        let mut all = Vec::new();
        if let Some(shape) = Footprint::new(segment, projection) {
            walk_line(&shape, rect, |x, y, enter, leave| all.push((x, y, (leave - enter) * shape.length)));
        }
        all
    }

    fn fragments(segment: &HairSegment, projection: &Projection, rect: &PixelRect) -> Vec<(u32, u32, [u32; 5])> {
        let mut all = Vec::new();
        scan_convert(segment, projection, rect, |x, y, f| {
            let bits = [f.depth.to_bits(), f.coverage.to_bits(), f.segment, f.u.to_bits(), f.span.to_bits()];
            all.push((y, x, bits));
        });
        all
    }

    /// Length of a line within a rectangle, by clipping against its four sides one after the other.
    fn clipped_length(mut a: DVec2, mut b: DVec2, rect: &PixelRect) -> f64 {
        for axis in 0..2 {
            for (bound, sign) in [(rect.min[axis], 1.0), (rect.max[axis], -1.0)] {
                let [da, db] = [a, b].map(|p| sign * (p[axis] - f64::from(bound)));
                match (da >= 0.0, db >= 0.0) {
                    (false, false) => return 0.0,
                    (true, false) => b = a + (b - a) * (da / (da - db)),
                    (false, true) => a += (b - a) * (da / (da - db)),
                    (true, true) => {}
                }
            }
        }
        a.distance(b)
    }

    #[test]
    fn a_line_on_a_pixel_edge_belongs_to_one_side() {
        assert_eq!(
            lengths(&flat([3.0, 1.5], [3.0, 3.5], 0.1), &PLAIN, &IMAGE),
            [(3, 1, 0.5), (3, 2, 1.0), (3, 3, 0.5)]
        );
        assert_eq!(
            lengths(&flat([3.5, 2.0], [1.5, 2.0], 0.1), &PLAIN, &IMAGE),
            [(1, 2, 0.5), (2, 2, 1.0), (3, 2, 0.5)]
        );
        // Through pixel corners: the pixels beside the corners get nothing.
        let diagonal = lengths(&flat([1.0, 1.0], [4.0, 4.0], 0.1), &PLAIN, &IMAGE);
        assert_eq!(diagonal.iter().map(|p| (p.0, p.1)).collect::<Vec<_>>(), [(1, 1), (2, 2), (3, 3)]);
        assert!(diagonal.iter().all(|p| (p.2 - 2f64.sqrt()).abs() < 1e-12));
    }

    #[test]
    fn segments_below_the_last_digit_stay_harmless() {
        let next = f32::from_bits(5f32.to_bits() + 1);
        let tiny = lengths(&flat([5.0, 5.0], [next, 5.0], 0.1), &PLAIN, &IMAGE);
        assert_eq!(tiny, [(5, 5, f64::from(next) - 5.0)]);
        assert!(lengths(&flat([5.0, 5.0], [5.0, 5.0], 0.1), &PLAIN, &IMAGE).is_empty());
        // Moves in x by less than an f64 of its pixel coordinate can hold.
        let projection = Projection { focal: 1.0, center: DVec2::splat(20.0), near: 1e-3 };
        let ends = [Vec3::new(0.0, 1.0, 1.0), Vec3::new(1e-30, -1.0, 1.0)];
        let still = lengths(&HairSegment { ends, widths: [0.1; 2], index: 0 }, &projection, &IMAGE);
        assert_eq!(still, [(20, 19, 1.0), (20, 20, 1.0)]);
    }

    #[test]
    fn end_points_far_outside_lose_nothing() {
        for (from, to) in [([-1e9, -1e9], [1e9, 1e9]), ([-1e9, 20.25], [1e9, 20.25]), ([30.5, 1e9], [30.5, -1e9])] {
            let sum: f64 = lengths(&flat(from, to, 0.1), &PLAIN, &IMAGE).iter().map(|p| p.2).sum();
            let [a, b] = [from, to].map(|p| DVec2::new(p[0].into(), p[1].into()));
            let exact = clipped_length(a, b, &IMAGE);
            assert!((sum / exact - 1.0).abs() < 1e-6, "{sum} {exact}");
        }
        // From behind the eye through the near plane: 1e6 pixels long, and only the image is walked.
        let ends = [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 0.0, 1.0)];
        let projection = Projection { focal: 1000.0, center: DVec2::new(32.0, 24.5), near: 1e-6 };
        assert_eq!(lengths(&HairSegment { ends, widths: [0.0; 2], index: 0 }, &projection, &IMAGE).len(), 0);
        let ends = [Vec3::new(0.0, 0.01, -1.0), Vec3::new(0.01, 0.0, 1.0)];
        let found = lengths(&HairSegment { ends, widths: [0.0; 2], index: 0 }, &projection, &IMAGE);
        let shape = Footprint::new(&HairSegment { ends, widths: [0.0; 2], index: 0 }, &projection).unwrap();
        let exact = clipped_length(shape.start, shape.start + shape.delta, &IMAGE);
        assert!((found.iter().map(|p| p.2).sum::<f64>() / exact - 1.0).abs() < 1e-6 && exact > 10.0);
    }

    #[test]
    fn the_fragment_holds_the_middle_of_its_piece() {
        // Pixels are 0.1 wide at depth 1; the ends lie at pixels 20 and 60, at depths 1 and 4.
        let projection = Projection { focal: 10.0, center: DVec2::new(20.0, 0.5), near: 0.1 };
        let ends = [Vec3::new(0.0, 0.0, 1.0), Vec3::new(16.0, 0.0, 4.0)];
        let mut spans = 0.0;
        let mut last = (0.0, 0.0);
        scan_convert(&HairSegment { ends, widths: [0.01; 2], index: 3 }, &projection, &IMAGE, |x, _, f| {
            let point = ends[0] + f.u * (ends[1] - ends[0]);
            assert!((projection.pixel(point.as_dvec3()).x - (f64::from(x) + 0.5)).abs() < 1e-4);
            assert!((f.depth - point.z).abs() < 1e-5 && f.depth > last.0 && f.u > last.1);
            assert!((f.coverage * f.depth - 0.1).abs() < 1e-6, "Eq. 7");
            last = (f.depth, f.u);
            spans += f.span;
        });
        assert!((spans - 1.0).abs() < 1e-5, "the pieces make up the segment");
    }

    #[test]
    fn a_wide_ribbon_fills_pixels() {
        // From far away, where a ribbon's edges are as far from its middle line as its width says.
        let ribbon = flat([-3.0, 20.0], [100.0, 20.0], 10.0);
        let projection = Projection { focal: 1e6, center: DVec2::new(0.0, 0.0), near: 1e-3 };
        let ribbon = HairSegment { ends: ribbon.ends.map(|end| end.with_z(1e6)), ..ribbon };
        let mut full = 0;
        scan_convert(&ribbon, &projection, &IMAGE, |_, y, f| {
            // Single precision makes it reach 1e-7 pixels into its neighbours.
            if f.coverage < 1e-5 {
                return;
            }
            assert!((15..25).contains(&y), "row {y} has {}", f.coverage);
            assert!((f.coverage - 1.0).abs() < 1e-5);
            full += 1;
        });
        assert_eq!(full, 64 * 10);
    }

    #[test]
    fn ribbons_cover_what_points_in_them_say() {
        let projection = Projection { focal: 50.0, center: DVec2::new(8.0, 8.0), near: 0.1 };
        let image = PixelRect::image([16, 16]);
        for (p, q, widths) in [
            ([-0.3, 0.1, 3.0], [0.2, -0.2, 5.0], [0.3, 0.1]),
            ([-0.3, -0.3, 2.0], [0.5, 0.4, 2.0], [0.06, 0.0]),
            ([0.0, 1.0, 2.0], [0.01, -1.0, 2.0], [0.05, 0.3]),
        ] {
            let segment = HairSegment { ends: [Vec3::from(p), Vec3::from(q)], widths, index: 0 };
            let shape = Footprint::new(&segment, &projection).unwrap();
            assert!(shape.is_wide());
            let mut coverage = vec![0.0; 256];
            scan_convert(&segment, &projection, &image, |x, y, f| coverage[(y * 16 + x) as usize] += f.coverage);
            for (pixel, &covered) in coverage.iter().enumerate() {
                let side = 40;
                let inside = (0..side * side).filter(|i| {
                    let place = DVec2::new((i % side) as f64 + 0.5, (i / side) as f64 + 0.5) / side as f64;
                    let v = DVec2::new((pixel % 16) as f64, (pixel / 16) as f64) + place - shape.start;
                    let s = v.dot(shape.delta) / shape.length.powi(2);
                    let off = v.perp_dot(shape.delta) / shape.length;
                    (0.0..=1.0).contains(&s) && off.abs() <= 0.5 * shape.width_at(s)
                });
                let share = inside.count() as f32 / (side * side) as f32;
                assert!((share - covered).abs() < 0.02, "pixel {pixel}: {covered} against {share}");
            }
        }
    }

    #[test]
    fn narrow_and_wide_hair_cover_their_whole_area() {
        let projection = Projection { focal: 1e6, center: DVec2::new(30.0, 30.0), near: 1e-3 };
        let ends = [Vec3::new(-9.3, -5.2, 1e6), Vec3::new(11.9, 16.0, 1e6)];
        for width in [0.01, 0.5, 0.6, 0.65, 0.9, 1.0, 2.3] {
            let segment = HairSegment { ends, widths: [width; 2], index: 0 };
            let shape = Footprint::new(&segment, &projection).unwrap();
            let mut sum = 0.0;
            scan_convert(&segment, &projection, &IMAGE, |_, _, f| sum += f64::from(f.coverage));
            let area = shape.length * shape.width_at(0.5);
            assert!((sum / area - 1.0).abs() < 1e-6, "width {width}: {sum} {area}");
        }
    }

    fn any_segment() -> impl Strategy<Value = HairSegment> {
        let snap = prop_oneof![3 => Just(false), 1 => Just(true)];
        let scale = prop_oneof![4 => Just(1f32), 1 => Just(100f32), 1 => Just(1e6f32), 1 => Just(1e-6f32)];
        let end = || prop::array::uniform3(-1f32..1.0);
        (end(), end(), scale, snap, prop::array::uniform2(0f32..0.1), 0u32..3).prop_map(
            |(p, q, scale, snap, widths, wide)| {
                let place = |[x, y, z]: [f32; 3]| {
                    // On a grid of half pixels at depth 1, so that edges and corners are met exactly.
                    let snapped = |v: f32| if snap { (v * 64.0).round() / 64.0 } else { v * scale };
                    Vec3::new(snapped(x), snapped(y), if snap { 1.0 } else { 1.0 + 1.2 * z })
                };
                let widths = widths.map(|w| w * [0.1, 1.0, 20.0][wide as usize]);
                HairSegment { ends: [place(p), place(q)], widths, index: 5 }
            },
        )
    }

    const VIEW: Projection = Projection { focal: 32.0, center: DVec2::new(32.0, 24.0), near: 0.01 };

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn lengths_add_up_to_the_clipped_segment(segment in any_segment()) {
            if let Some(shape) = Footprint::new(&HairSegment { widths: [0.0; 2], ..segment }, &VIEW) {
                let sum: f64 = lengths(&HairSegment { widths: [0.0; 2], ..segment }, &VIEW, &IMAGE).iter().map(|p| p.2).sum();
                let exact = clipped_length(shape.start, shape.start + shape.delta, &IMAGE);
                // A line along the image's right or lower edge belongs to the pixels outside.
                let end = shape.start + shape.delta;
                let on_edge = (0..2).any(|i| shape.delta[i] == 0.0 && end[i] == f64::from(IMAGE.max[i]));
                prop_assert!(on_edge || (sum - exact).abs() <= 1e-4 * exact + 1e-9, "{} {}", sum, exact);
            }
        }

        #[test]
        fn any_numbers_give_fragments_within_bounds(bits in prop::array::uniform8(any::<u32>())) {
            let [x0, y0, z0, x1, y1, z1, w0, w1] = bits.map(f32::from_bits);
            let segment = HairSegment { ends: [Vec3::new(x0, y0, z0), Vec3::new(x1, y1, z1)], widths: [w0, w1], index: 0 };
            let mut wrong = None;
            scan_convert(&segment, &VIEW, &IMAGE, |x, y, f| {
                let share = 0.0..=1.0;
                let right = x < 64 && y < 48 && f.coverage > 0.0 && share.contains(&f.coverage) && share.contains(&f.u);
                if !(right && f.depth >= 0.01 && share.contains(&f.span)) {
                    wrong = Some(f);
                }
            });
            prop_assert_eq!(wrong, None);
        }

        #[test]
        fn tiles_give_the_bits_of_the_whole_image(segment in any_segment(), size in 1u32..40, crop in prop::array::uniform4(0u32..64)) {
            let whole = fragments(&segment, &VIEW, &IMAGE);
            let grid = TileGrid::new(IMAGE, size);
            let bins = assign(&grid, &VIEW, 1, |_| segment).unwrap();
            let mut tiled: Vec<_> = (0..grid.count())
                .filter(|&tile| !bins.tile(tile).is_empty())
                .flat_map(|tile| fragments(&segment, &VIEW, &grid.tile(tile)))
                .collect();
            tiled.sort_unstable();
            prop_assert_eq!(&tiled, &whole);
            // Any crop window.
            let [x0, x1, y0, y1] = crop;
            let rect = PixelRect { min: [x0.min(x1), y0.min(y1).min(48)], max: [x0.max(x1), y0.max(y1).min(48)] };
            let inside: Vec<_> = (whole.into_iter())
                .filter(|&(y, x, _)| (rect.min[0]..rect.max[0]).contains(&x) && (rect.min[1]..rect.max[1]).contains(&y))
                .collect();
            prop_assert_eq!(fragments(&segment, &VIEW, &rect), inside);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn lengths_in_pixels_are_those_of_points_along_the_line(segment in any_segment()) {
            let thin = HairSegment { widths: [0.0; 2], ..segment };
            if let Some(shape) = Footprint::new(&thin, &VIEW).filter(|shape| shape.length < 500.0) {
                let points = 20_000;
                let mut counts = std::collections::HashMap::new();
                for i in 0..points {
                    let place = shape.start + (f64::from(i) + 0.5) / f64::from(points) * shape.delta;
                    *counts.entry((place.x.floor() as i64, place.y.floor() as i64)).or_insert(0u32) += 1;
                }
                let found = lengths(&thin, &VIEW, &IMAGE);
                let step = shape.length / f64::from(points);
                for &(x, y, length) in &found {
                    let count = counts.remove(&(i64::from(x), i64::from(y))).unwrap_or(0);
                    prop_assert!((length - f64::from(count) * step).abs() <= 1.01 * step + 1e-12);
                }
                for ((x, y), count) in counts {
                    prop_assert!(count <= 1 || !(0..64).contains(&x) || !(0..48).contains(&y), "missed {} {}", x, y);
                }
            }
        }
    }
}
