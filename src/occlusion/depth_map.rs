//! A square map of all directions from a point, in which optical depth is gathered, and the way from it to the faces of an igloo.
//!
//! The octahedral map (Engelhardt and Dachsbacher 2008) takes a sphere of directions to a square, or a hemisphere of them to another.
//! A lump of hair is spread over the four cells around its direction by a tent as wide as two cells: lumps about as wide as a cell then
//! join to an even depth, where each given to one cell would leave gaps. There is a border of one cell around the square, so that no tent
//! has to look where it falls; what falls there on a sphere is folded back over the octahedron's edges, and dropped below the
//! horizon of a hemisphere.
//!
//! Γ̄ of a face is the mean of exp(-τ) over the cells that it covers, by solid angle (paper, Eq. 8).

use glam::Vec3;

use super::lanes::{LANES, Lanes, exponentials};
use crate::igloo::{Igloo, Span};

/// Points along a cell's side at which its solid angle and its faces are looked up.
const SAMPLES: usize = 8;

/// The part of its largest share in a face below which a cell's share is left out.
const SLIVER: f32 = 0.05;

/// The largest side of a map: 4 MiB.
pub const LARGEST_SIDE: u32 = 1024;

/// Where a direction falls: what the kernels need of a map.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    pub hemisphere: bool,
    /// Half the side, in cells.
    pub half: f32,
    /// Cells from one row to the next.
    pub stride: u32,
}

/// What lumps gave at a cell: for it, the cell right of it, the one below it and the one below that to the right.
pub type Corners = [f32; 4];

/// The map of an igloo's directions. It holds tables: make it once for many points.
#[derive(Clone, Debug)]
pub struct DepthMap {
    span: Span,
    side: usize,
    /// 1 / solid angle that a cell's tent gathers from an even sky, border included; 0 there.
    weight: Vec<f32>,
    /// The face under the middle of each cell, border included.
    face: Vec<u32>,
    /// Cells of face `i`: `first[i]..first[i + 1]` in `cells`, each with its share of the face.
    first: Vec<u32>,
    cells: Vec<(u32, f32)>,
    /// Mean width of a cell, in radians.
    cell_width: f32,
    middles: Vec<Middles>,
}

/// Sixteen cells: directions of their middles in the igloo's frame, and their widths in radians; 0 in the border and beyond the last cell.
#[derive(Clone, Debug)]
pub struct Middles {
    pub direction: [Lanes; 3],
    pub width: Lanes,
}

impl DepthMap {
    /// A map of `side` cells a side (made even, at most [`LARGEST_SIDE`]) for the faces of an igloo.
    pub fn new(igloo: &Igloo, side: u32) -> Self {
        let side = (side.clamp(4, LARGEST_SIDE).div_ceil(2) * 2) as usize;
        let span = igloo.span();
        let solid_angle = if span == Span::Sphere { 4.0 } else { 2.0 } * std::f32::consts::PI;
        let mut map = Self {
            span,
            side,
            weight: weights(span, side),
            face: vec![0; (side + 2) * (side + 2)],
            first: Vec::new(),
            cells: Vec::new(),
            cell_width: solid_angle.sqrt() / side as f32,
            middles: Vec::new(),
        };
        map.share_faces(igloo);
        map.face_cells();
        map
    }

    fn stride(&self) -> usize {
        self.side + 2
    }

    /// Which faces each cell covers, and how much of them.
    fn share_faces(&mut self, igloo: &Igloo) {
        let side = self.side;
        let mut shares: Vec<Vec<(u32, f32)>> = vec![Vec::new(); igloo.len()];
        for row in 0..side {
            for column in 0..side {
                let cell = ((row + 1) * self.stride() + column + 1) as u32;
                self.face[cell as usize] = igloo.face_of(direction(self.span, side, column, row, 0.5, 0.5).0) as u32;
                for i in 0..SAMPLES * SAMPLES {
                    let [x, y] = [i % SAMPLES, i / SAMPLES].map(|k| (k as f64 + 0.5) / SAMPLES as f64);
                    let (toward, weight) = direction(self.span, side, column, row, x, y);
                    let list = &mut shares[igloo.face_of(toward)];
                    match list.last_mut() {
                        Some((last, share)) if *last == cell => *share += weight as f32,
                        _ => list.push((cell, weight as f32)),
                    }
                }
            }
        }
        let home = home(self.span, side);
        self.face = home.iter().map(|&cell| self.face[cell as usize]).collect();
        for (face, list) in shares.iter_mut().enumerate() {
            if list.is_empty() {
                // Faces smaller than the samples are apart: the cell that holds the face's middle.
                list.push((self.cell_of(igloo.center(face)), 1.0));
            }
            // Slivers of cells cost as much as whole ones, and say next to nothing.
            let whole = list.iter().map(|(_, share)| *share).fold(0.0, f32::max);
            list.retain(|(_, share)| *share > SLIVER * whole);
            self.first.push(self.cells.len() as u32);
            let sum: f32 = list.iter().map(|(_, share)| share).sum();
            self.cells.extend(list.iter().map(|&(cell, share)| (cell, share / sum)));
        }
        self.first.push(self.cells.len() as u32);
    }

    /// Where each cell lies.
    fn face_cells(&mut self) {
        let inside = |cell: usize| self.weight.get(cell).is_some_and(|&weight| weight > 0.0);
        let toward = |cell: usize| {
            let (row, column) = (cell / self.stride(), cell % self.stride());
            if inside(cell) { direction(self.span, self.side, column - 1, row - 1, 0.5, 0.5).0 } else { Vec3::ZERO }
        };
        let width = |cell: usize| if inside(cell) { 1.0 / self.weight[cell].sqrt() } else { 0.0 };
        let middles = |chunk: usize| Middles {
            direction: [0, 1, 2].map(|axis| std::array::from_fn(|lane| toward(chunk * LANES + lane)[axis])),
            width: std::array::from_fn(|lane| width(chunk * LANES + lane)),
        };
        self.middles = (0..self.len().div_ceil(LANES)).map(middles).collect();
    }

    /// All cells, sixteen at a time, by index in the buffer.
    pub fn middles(&self) -> &[Middles] {
        &self.middles
    }

    /// The cell of a unit direction in the igloo's frame; the nearest one below a hemisphere's horizon.
    pub fn cell_of(&self, direction: Vec3) -> u32 {
        let side = self.side;
        let [u, v] = square(self.span, direction);
        let place = |x: f32| ((0.5 * (x + 1.0) * side as f32) as usize).min(side - 1);
        ((place(v) + 1) * self.stride() + place(u) + 1) as u32
    }

    /// Which directions it covers.
    pub fn span(&self) -> Span {
        self.span
    }

    /// Cells a side.
    pub fn side(&self) -> u32 {
        self.side as u32
    }

    /// Mean width of a cell, in radians.
    pub fn cell_width(&self) -> f32 {
        self.cell_width
    }

    /// Number of cells, border included.
    pub fn len(&self) -> usize {
        self.stride() * self.stride()
    }

    /// Never true: a map has cells.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// The face under each cell's middle, by index in the buffer.
    pub fn faces(&self) -> &[u32] {
        &self.face
    }

    /// 1 / solid angle of a cell, by index in the buffer; 0 in the border.
    pub fn weights(&self) -> &[f32] {
        &self.weight
    }

    /// What the kernels need.
    pub fn grid(&self) -> Grid {
        Grid { hemisphere: self.span == Span::Hemisphere, half: 0.5 * self.side as f32, stride: self.stride() as u32 }
    }

    /// The four cells that a tent reaches whose upper left cell is this one; at the square's edge, those there are.
    pub fn corners(&self, cell: usize) -> [usize; 4] {
        let stride = self.stride();
        [cell, cell + 1, cell + stride, cell + stride + 1].map(|corner| corner.min(self.len() - 1))
    }

    /// From what lumps gave at each cell to what each cell has.
    #[inline(always)]
    fn collect(&self, corners: &[Corners], buffer: &mut [f32]) {
        let stride = self.stride();
        for row in 0..stride {
            let target = &mut buffer[row * stride..][..stride];
            let here = &corners[row * stride..][..stride];
            let left = &here[..stride - 1];
            if row == 0 {
                target[0] = here[0][0];
                for ((target, here), left) in target[1..].iter_mut().zip(&here[1..]).zip(left) {
                    *target = here[0] + left[1];
                }
                continue;
            }
            let above = &corners[(row - 1) * stride..][..stride];
            target[0] = here[0][0] + above[0][2];
            let all = target[1..].iter_mut().zip(&here[1..]).zip(left).zip(&above[1..]).zip(&above[..stride - 1]);
            for ((((target, here), left), above), above_left) in all {
                *target = here[0] + left[1] + above[2] + above_left[3];
            }
        }
    }

    /// From gathered solid angle times opacity to Γ̄ of each face.
    ///
    /// `corners` has [`len`](Self::len) entries. After, `buffer` holds the transmittance of each cell. Where there are surfaces, `far[face]`
    /// is the distance of the first one.
    #[inline(always)]
    pub fn finish(&self, corners: &[Corners], far: Option<&[f32]>, buffer: &mut Vec<f32>, gamma: &mut [f32]) {
        buffer.resize(self.len(), 0.0);
        self.collect(corners, buffer);
        if self.span == Span::Sphere {
            fold(self.side, buffer);
        }
        for (depth, weight) in buffer.iter_mut().zip(&self.weight) {
            *depth *= weight;
        }
        exponentials(buffer);
        for (face, gamma) in gamma.iter_mut().enumerate() {
            let cells = &self.cells[self.first[face] as usize..self.first[face + 1] as usize];
            *gamma = match far {
                None => mean(cells, buffer),
                Some(far) => self.mean_of_kind(cells, far, face, buffer),
            };
        }
    }

    /// Γ̄ of a face over those of its cells that end as it does, at a surface or not at all.
    ///
    /// In a cell that ends otherwise, because its middle lies in a neighbour, other hair counts: all of it instead of that in front of
    /// the surface, or the reverse.
    #[inline(always)]
    fn mean_of_kind(&self, cells: &[(u32, f32)], far: &[f32], face: usize, buffer: &[f32]) -> f32 {
        let open = far[face] == f32::INFINITY;
        let same = |cell: u32| (far[self.face[cell as usize] as usize] == f32::INFINITY) == open;
        if cells.iter().all(|&(cell, _)| same(cell)) {
            return mean(cells, buffer);
        }
        let (mut sum, mut weight) = (0.0, 0.0);
        for &(cell, share) in cells {
            let share = if same(cell) { share } else { 0.0 };
            sum += buffer[cell as usize] * share;
            weight += share;
        }
        if weight > 0.0 { (sum / weight).min(1.0) } else { mean(cells, buffer) }
    }
}

/// The mean over some cells, each with its share.
#[inline(always)]
fn mean(cells: &[(u32, f32)], buffer: &[f32]) -> f32 {
    // Four sums: in one each addition would wait for the one before. Shares add up to 1 to rounding only.
    let mut sums = [0.0_f32; 4];
    let fours = cells.chunks_exact(4);
    for (sum, &(cell, share)) in sums.iter_mut().zip(fours.remainder()) {
        *sum = buffer[cell as usize] * share;
    }
    for four in fours {
        for (sum, &(cell, share)) in sums.iter_mut().zip(four) {
            *sum += buffer[cell as usize] * share;
        }
    }
    ((sums[0] + sums[1]) + (sums[2] + sums[3])).min(1.0)
}

/// 1 / solid angle that each cell gathers from an even sky; 0 in the border.
fn weights(span: Span, side: usize) -> Vec<f32> {
    let stride = side + 2;
    let mut gathered = vec![0.0_f64; stride * stride];
    // A hemisphere's tents reach below the horizon, as the hair there does.
    let beyond = if span == Span::Hemisphere { SAMPLES / 2 } else { 0 };
    let count = side * SAMPLES + 2 * beyond;
    let place = |k: usize| (k as f64 + 0.5 - beyond as f64) / SAMPLES as f64;
    for row in 0..count {
        for column in 0..count {
            let (x, y) = (place(column), place(row));
            let weight = solid_angle(span, side, x, y);
            let (x, y) = (x + 0.5, y + 0.5);
            let (i, j) = (x.floor(), y.floor());
            let (u, v) = (x - i, y - j);
            let cell = j as usize * stride + i as usize;
            for (cell, share) in [
                (cell, (1.0 - u) * (1.0 - v)),
                (cell + 1, u * (1.0 - v)),
                (cell + stride, (1.0 - u) * v),
                (cell + stride + 1, u * v),
            ] {
                gathered[cell] += weight * share;
            }
        }
    }
    if span == Span::Sphere {
        fold(side, &mut gathered);
    }
    let inside = |k: usize| (1..=side).contains(&k);
    let weight = |(cell, &gathered): (usize, &f64)| {
        if inside(cell / stride) && inside(cell % stride) { (1.0 / gathered) as f32 } else { 0.0 }
    };
    gathered.iter().enumerate().map(weight).collect()
}

/// The cell that each one stands for. Below a hemisphere's horizon a border's cell stands for the nearest inside.
fn home(span: Span, side: usize) -> Vec<u32> {
    let stride = side + 2;
    let cell = |cell: usize| {
        let (mut row, mut column) = (cell / stride, cell % stride);
        let inside = |k: usize| k.clamp(1, side);
        if span == Span::Sphere && inside(column) != column {
            (row, column) = (stride - 1 - row, inside(column));
        }
        if span == Span::Sphere && inside(row) != row {
            (row, column) = (inside(row), stride - 1 - column);
        }
        (inside(row) * stride + inside(column)) as u32
    };
    (0..stride * stride).map(cell).collect()
}

/// Adds the border of a sphere's square to the cells across the octahedron's edges.
#[inline(always)]
fn fold<T: Copy + Default + std::ops::AddAssign>(side: usize, cells: &mut [T]) {
    let stride = side + 2;
    for row in 0..stride {
        for (border, inside) in [(0, 1), (side + 1, side)] {
            let amount = std::mem::take(&mut cells[row * stride + border]);
            cells[(stride - 1 - row) * stride + inside] += amount;
        }
    }
    for column in 1..=side {
        for (border, inside) in [(0, 1), (side + 1, side)] {
            let amount = std::mem::take(&mut cells[border * stride + column]);
            cells[inside * stride + stride - 1 - column] += amount;
        }
    }
}

/// The point of the square [-1, 1]² of a direction; beyond it below a hemisphere's horizon.
fn square(span: Span, d: Vec3) -> [f32; 2] {
    let (ax, ay) = (d.x.abs(), d.y.abs());
    match span {
        Span::Sphere => {
            let scale = 1.0 / (ax + ay + d.z.abs());
            let (u, v) = (d.x * scale, d.y * scale);
            if d.z >= 0.0 { [u, v] } else { [(1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)] }
        }
        Span::Hemisphere => {
            let scale = 1.0 / (ax + ay + d.z).max(1e-6);
            [(d.x + d.y) * scale, (d.x - d.y) * scale]
        }
    }
}

/// The direction at (`x`, `y`) of the cell in `column` and `row`, and a weight in proportion to the solid angle there.
fn direction(span: Span, side: usize, column: usize, row: usize, x: f64, y: f64) -> (Vec3, f64) {
    let (x, y) = (column as f64 + x, row as f64 + y);
    let [p, q, r] = octahedron(span, side, x, y);
    let length = (p * p + q * q + r * r).sqrt();
    (Vec3::new((p / length) as f32, (q / length) as f32, (r / length) as f32), solid_angle(span, side, x, y))
}

/// The point of the octahedron |x| + |y| + |z| = 1 of a point of the square, in cells.
fn octahedron(span: Span, side: usize, x: f64, y: f64) -> [f64; 3] {
    let [u, v] = [x, y].map(|k| 2.0 * k / side as f64 - 1.0);
    match span {
        Span::Sphere => {
            let z = 1.0 - u.abs() - v.abs();
            if z >= 0.0 { [u, v, z] } else { [(1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v), z] }
        }
        Span::Hemisphere => {
            let (p, q) = (0.5 * (u + v), 0.5 * (u - v));
            [p, q, 1.0 - p.abs() - q.abs()]
        }
    }
}

/// Solid angle of one sample at a point of the square: the octahedron's faces lie 1/√3 from the middle.
fn solid_angle(span: Span, side: usize, x: f64, y: f64) -> f64 {
    let [p, q, r] = octahedron(span, side, x, y);
    let length2 = p * p + q * q + r * r;
    // dω = cos / r² dA with cos = (1/√3) / r and dA = √3 du dv (half of that on a hemisphere, whose square is turned and larger).
    let step = 2.0 / (side * SAMPLES) as f64;
    let area = step * step * if span == Span::Sphere { 1.0 } else { 0.5 };
    area / (length2 * length2.sqrt())
}

#[cfg(test)]
mod tests;
