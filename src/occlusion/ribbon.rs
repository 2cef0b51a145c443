//! A near segment: a ribbon that faces the viewer, taken in lumps of equal angle along it, and across it where it is wide.
//!
//! On the line q + s u (q the foot of the perpendicular from the viewer, h = |q|, r² = h² + s²) the ribbon is the silhouette of a
//! cylinder of diameter d. Cut along its half-planes by the angle α about the axis, |α| <= asin(d / 2h), a slice of angle dα from s1 to s2
//! covers dα (s2/r2 - s1/r1) steradians: exact, with the change of distance. Lumps are even in the angle β = atan(s / h), so that
//! each is as long as seen from the viewer, however near the ribbon passes.

use std::f32::consts::PI;

use glam::Vec3;

use super::DepthMap;
use super::depth_map::Corners;
use super::lanes::{LANES, saturation};
use super::layer::optical_depth;
use super::query::{Far, Scratch};
use super::raster;
use super::view::{Directions, View, add};
use crate::igloo::arctangent_unit;

/// Lumps along a ribbon, at most: half a turn in lumps a quarter of a degree long.
const MOST_LUMPS: f32 = 720.0;

/// Samples of a wide ribbon along a cell's width.
const SAMPLES: f32 = 2.0;

/// Width of a ribbon, in cells, from which on all cells of the map are looked at instead, if that is fewer than samples: the edges, over
/// which a cell's coverage is taken to fall evenly, are then a small part of it.
const RASTER: f32 = 4.0;

/// Optical depth at which nothing gets through.
const OPAQUE: f32 = 100.0;

/// Slices across a ribbon, at most.
const MOST_SLICES: f32 = 256.0;

/// Part of a segment, relative to the viewer, in render space's axes.
#[derive(Clone, Copy, Debug)]
pub struct Ribbon {
    foot: Vec3,
    axis: Vec3,
    h2: f32,
    from: f32,
    to: f32,
    /// Width at the foot, and its change along the axis.
    width: f32,
    taper: f32,
    opacity: f32,
}

impl Ribbon {
    /// The part `range` (0 to 1) of the segment from `a` to `b`; none where there is nothing to see.
    #[inline(always)]
    pub fn new(a: Vec3, b: Vec3, widths: [f32; 2], range: [f32; 2], opacity: f32) -> Option<Self> {
        let along = b - a;
        let length = along.length();
        if length <= 0.0 || range[1] <= range[0] {
            return None;
        }
        let axis = along / length;
        // The foot from the nearer end: the cancellation in a - (a·u) u then costs least.
        let (near, offset) = if a.length_squared() <= b.length_squared() { (a, 0.0) } else { (b, length) };
        let s_near = near.dot(axis);
        let foot = near - axis * s_near;
        let h2 = foot.length_squared();
        let start = s_near - offset;
        let (from, to) = (start + range[0] * length, start + range[1] * length);
        // End-on, a segment covers nothing; below this the foot is rounding error.
        if h2 <= 1e-12 * (h2 + from.abs().max(to.abs()).powi(2)) {
            return None;
        }
        let taper = (widths[1] - widths[0]) / length;
        Some(Self { foot, axis, h2, from, to, width: widths[0] - taper * start, taper, opacity })
    }

    #[inline(always)]
    fn width_at(&self, s: f32) -> f32 {
        self.width + self.taper * s
    }
}

/// Gathers a ribbon.
#[inline(always)]
pub fn gather<D: Directions>(ribbon: &Ribbon, view: &View<D>, map: &DepthMap, far: Option<Far>, scratch: &mut Scratch) {
    // Nothing nearer than the ribbon's own width counts; the width at the foot decides.
    let width = ribbon.width_at(ribbon.from.max(0.0).min(ribbon.to));
    let inner2 = width * width - ribbon.h2;
    if inner2 <= 0.0 {
        return part(ribbon, view, map, far, scratch);
    }
    let inner = inner2.sqrt();
    if ribbon.from < -inner {
        part(&Ribbon { to: ribbon.to.min(-inner), ..*ribbon }, view, map, far, scratch);
    }
    if ribbon.to > inner {
        part(&Ribbon { from: ribbon.from.max(inner), ..*ribbon }, view, map, far, scratch);
    }
}

#[inline(always)]
fn part<D: Directions>(ribbon: &Ribbon, view: &View<D>, map: &DepthMap, far: Option<Far>, scratch: &mut Scratch) {
    if ribbon.to <= ribbon.from {
        return;
    }
    let h = ribbon.h2.sqrt();
    let (start, end) = (arctangent(ribbon.from / h), arctangent(ribbon.to / h));
    let nearest = ribbon.from.max(0.0).min(ribbon.to);
    let distance2 = ribbon.h2 + nearest * nearest;
    let width = ribbon.width_at(ribbon.from).max(ribbon.width_at(ribbon.to));
    let wide = width * width >= view.wide2 * distance2;
    let lumps = (0.5 * (end - start) / view.stride2.sqrt()).ceil().clamp(1.0, MOST_LUMPS);
    if !wide {
        along(ribbon, view, [start, end], lumps as u32, far, &mut scratch.depth);
        return;
    }
    let apparent = 2.0 * half_angle(0.5 * width / h) * (ribbon.h2 / distance2).sqrt();
    let count = |angle: f32, most: f32| (SAMPLES * angle / map.cell_width()).ceil().clamp(1.0, most) as u32;
    let counts = [count(end - start, MOST_LUMPS), count(apparent, MOST_SLICES)];
    if apparent > RASTER * map.cell_width() && counts[0] * counts[1] > map.len() as u32 / 2 {
        let Ribbon { from, to, width, taper, opacity, .. } = *ribbon;
        let [foot, axis] = [ribbon.foot, ribbon.axis].map(|v| view.in_igloo(v));
        let near = raster::Near { foot, axis, from, to, width, taper, opacity };
        return raster::cover(&near, map, far, &mut scratch.depth);
    }
    across(ribbon, view, [start, end], counts, map, far, scratch);
}

/// A narrow ribbon: lumps along its middle. Its layer is that of the strand where it crosses a cell (see [`saturation`]).
#[inline(always)]
fn along<D: Directions>(
    ribbon: &Ribbon,
    view: &View<D>,
    range: [f32; 2],
    lumps: u32,
    far: Option<Far>,
    depth: &mut [Corners],
) {
    let h = ribbon.h2.sqrt();
    let step = (range[1] - range[0]) / lumps as f32;
    let middle = 0.5 * (ribbon.from + ribbon.to);
    let (sine, cosine) = if lumps == 1 {
        let distance = (ribbon.h2 + middle * middle).sqrt();
        (middle / distance, h / distance)
    } else {
        (0.0, 0.0)
    };
    // All of a piece's solid angle but its middle's cosine.
    let piece =
        if lumps == 1 { sine_difference(ribbon.h2, ribbon.from, ribbon.to) / cosine } else { 2.0 * (0.5 * step).sin() };
    let width = ribbon.width_at(middle);
    // What has no width covers nothing.
    let angle = if width > 0.0 { 2.0 * half_angle(0.5 * width / h) / width } else { 0.0 };
    let foot = ribbon.foot / h;
    for chunk in 0..lumps.div_ceil(LANES as u32) {
        let first = chunk * LANES as u32;
        let mut toward = [[0.0; LANES]; 3];
        let [mut amount, mut distance] = [[0.0; LANES]; 2];
        for lane in 0..LANES {
            let beta = range[0] + ((first + lane as u32) as f32 + 0.5) * step;
            let (s, c) = sine_cosine(beta);
            let (s, c) = if lumps == 1 { (sine, cosine) } else { (s, c) };
            let c = if c > 1e-6 { c } else { 1e-6 };
            let r = h / c;
            let width = positive(ribbon.width + ribbon.taper * r * s);
            let solid_angle = angle * width * c * piece;
            let share = ribbon.opacity * view.crossing(width / r);
            let share = if share < 0.95 { share } else { 0.95 };
            amount[lane] = solid_angle * ribbon.opacity * saturation(share);
            distance[lane] = r;
            toward[0][lane] = foot.x * c + ribbon.axis.x * s;
            toward[1][lane] = foot.y * c + ribbon.axis.y * s;
            toward[2][lane] = foot.z * c + ribbon.axis.z * s;
        }
        let splat = view.splat(&toward, &amount, None);
        let used = LANES.min((lumps - first) as usize);
        for ((&cell, amount), distance) in splat.cell.iter().zip(&splat.amount).zip(&distance).take(used) {
            let amount = far.map_or(*amount, |far| far.cut(cell as usize, amount, distance * distance));
            add(&mut depth[cell as usize], &amount);
        }
    }
}

/// A width that is not below 0, as rounding makes it next to a tip.
#[inline(always)]
fn positive(width: f32) -> f32 {
    if width > 0.0 { width } else { 0.0 }
}

/// Sine and cosine of an angle from -π/2 to π/2 by Taylor's series, each to 1e-7.
#[inline(always)]
fn sine_cosine(x: f32) -> (f32, f32) {
    let y = x * x;
    let sine =
        1.0 + y * (-1.0 / 6.0 + y * (1.0 / 120.0 + y * (-1.0 / 5040.0 + y * (1.0 / 362_880.0 - y / 39_916_800.0))));
    let cosine = 1.0
        + y * (-0.5
            + y * (1.0 / 24.0
                + y * (-1.0 / 720.0 + y * (1.0 / 40_320.0 + y * (-1.0 / 3_628_800.0 + y / 479_001_600.0)))));
    (x * sine, cosine)
}

/// A wide ribbon: its coverage is summed in each cell, each sample in the cell where it lies, then it is one layer there.
#[inline(always)]
fn across<D: Directions>(
    ribbon: &Ribbon,
    view: &View<D>,
    [start, end]: [f32; 2],
    [lumps, slices]: [u32; 2],
    map: &DepthMap,
    far: Option<Far>,
    scratch: &mut Scratch,
) {
    let h = ribbon.h2.sqrt();
    let step = (end - start) / lumps as f32;
    let side = ribbon.foot.cross(ribbon.axis);
    let Scratch { depth, layer, touched, .. } = scratch;
    layer.resize(depth.len(), 0.0);
    touched.clear();
    for chunk in 0..lumps.div_ceil(LANES as u32) {
        let first = chunk * LANES as u32;
        let [mut from, mut middle, mut to, mut half] = [[0.0; LANES]; 4];
        for lane in 0..LANES {
            let at = |places: f32| {
                let (s, c) = sine_cosine(start + (first as f32 + lane as f32 + places) * step);
                let c = if c > 1e-6 { c } else { 1e-6 };
                let s = h * s / c;
                let s = if s > ribbon.from { s } else { ribbon.from };
                if s < ribbon.to { s } else { ribbon.to }
            };
            (from[lane], middle[lane], to[lane]) = (at(0.0), at(0.5), at(1.0));
            half[lane] = 0.5 * positive(ribbon.width + ribbon.taper * middle[lane]) / h;
        }
        for half in &mut half {
            *half = half_angle(*half);
        }
        let used = LANES.min((lumps - first) as usize);
        for slice in 0..slices {
            let place = (2 * slice + 1) as f32 / slices as f32 - 1.0;
            let mut toward = [[0.0; LANES]; 3];
            let [mut amount, mut distance2] = [[0.0; LANES]; 2];
            for lane in 0..LANES {
                let (sin, cos) = sine_cosine(place * half[lane]);
                // The slice's own foot: the axis seen in its half-plane.
                let (along, beside) = (cos * cos, sin * cos);
                let (h2, s) = (ribbon.h2 * along, middle[lane]);
                amount[lane] = 2.0 * half[lane] / slices as f32 * sine_difference(h2, from[lane], to[lane]);
                distance2[lane] = h2 + s * s;
                toward[0][lane] = ribbon.foot.x * along + side.x * beside + ribbon.axis.x * s;
                toward[1][lane] = ribbon.foot.y * along + side.y * beside + ribbon.axis.y * s;
                toward[2][lane] = ribbon.foot.z * along + side.z * beside + ribbon.axis.z * s;
            }
            let cells = view.cells(&toward);
            for lane in 0..used {
                let cell = cells[lane] as usize;
                if far.is_some_and(|far| distance2[lane] >= far.cells[cell]) {
                    continue;
                }
                if layer[cell] == 0.0 {
                    touched.push(cells[lane]);
                }
                layer[cell] += amount[lane];
            }
        }
    }
    for &cell in touched.iter() {
        let covered = std::mem::take(&mut layer[cell as usize]);
        let weight = map.weights()[cell as usize];
        // Nothing comes from the border: it is below the horizon.
        if weight > 0.0 {
            depth[cell as usize][0] += optical_depth(covered * weight, ribbon.opacity).min(OPAQUE) / weight;
        }
    }
}

/// Arctangent, to 2e-6.
#[inline(always)]
fn arctangent(x: f32) -> f32 {
    let a = x.abs();
    let angle = if a <= 1.0 { arctangent_unit(a) } else { 0.5 * PI - arctangent_unit(1.0 / a) };
    angle.copysign(x)
}

/// s2/r2 - s1/r1 without cancellation: with both of one sign it is h² (s2² - s1²) / (r1 r2 (s2 r1 + s1 r2)).
#[inline(always)]
fn sine_difference(h2: f32, from: f32, to: f32) -> f32 {
    let r1 = (h2 + from * from).sqrt();
    let r2 = (h2 + to * to).sqrt();
    if from * to > 0.0 {
        h2 * (to - from) * (to + from) / (r1 * r2 * (to * r1 + from * r2))
    } else {
        to / r2 - from / r1
    }
}

/// Half the angle about the axis under which a cylinder is seen whose radius is `x` times the distance of its axis: the arcsine of x.
///
/// Without a branch or a call, so that loops over it are vector code: Abramowitz and Stegun 4.4.46, to 1e-7, and a series where that
/// is not good enough.
#[inline(always)]
fn half_angle(x: f32) -> f32 {
    let x2 = x * x;
    let small = x * (1.0 + x2 * (1.0 / 6.0 + x2 * (3.0 / 40.0)));
    let y = if x < 1.0 { x } else { 1.0 };
    let low = 0.5 * PI + y * (-0.214_598_8 + y * (0.088_978_99 + y * -0.050_174_305));
    let high = 0.030_891_88 + y * (-0.017_088_126 + y * (0.006_670_09 + y * -0.001_262_491_1));
    let y2 = y * y;
    let large = 0.5 * PI - (1.0 - y).sqrt() * (low + y2 * y2 * high);
    if x < 0.1 { small } else { large }
}

#[cfg(test)]
mod tests;
