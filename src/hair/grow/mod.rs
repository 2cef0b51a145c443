//! Hair grown on a surface.
//!
//! Every random number is a hash of the seed, the strand's index and a purpose, so that a strand is the same for any
//! number of threads and, without clumping, for any number of strands: a larger `count` adds strands and moves none.
//! With clumping the number of clumps is `count / clump_size`; raise both alike to keep the clumps.
//!
//! The steps, one file each: where strands stand (`roots`), which of them belong together (`clump`), and how each one
//! runs (`shape`).

mod clump;
mod roots;
mod shape;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use thiserror::Error;

use super::strands::{Attribute, DEFAULT_COLOR, DEFAULT_TRANSPARENCY, Strands};
use crate::hash;
use crate::scene::description::Grow;
use crate::surface::{Mesh, mesh};
use clump::Clumps;
use roots::{Root, Roots};
use shape::Shape;

/// More points than this are not grown: 12 GiB of positions alone.
pub const MAX_POINTS: u64 = 1 << 30;

/// A curl is smooth from this many segments a turn.
const SEGMENTS_A_TURN: f64 = 8.0;

/// Strands this much shorter than `length` are the shortest: a strand of no length would have no direction.
const SHORTEST: f64 = 0.01;

/// Why hair could not be grown.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum GrowError {
    #[error("`grow.{key}` is {value}; it must be {allowed}")]
    Value { key: &'static str, value: String, allowed: &'static str },
    #[error("the up axis has no direction")]
    Up,
    #[error("`grow.count` strands of `grow.segments` segments have {points} points, more than {MAX_POINTS}")]
    TooMany { points: u64 },
    #[error("the surface of `grow.on` cannot be used: {0}")]
    Surface(#[from] mesh::Flaw),
    #[error("the surface of `grow.on` has no area")]
    NoArea,
    #[error("no part of the surface of `grow.on`, or next to none, has a slope of {low} to {high} (`grow.slope`)")]
    NoSlope { low: f64, high: f64 },
}

/// What a random number is for: the third word of its key.
#[derive(Clone, Copy)]
#[repr(u32)]
enum Purpose {
    Triangle,
    Across,
    Along,
    Side,
    Lean,
    Length,
    Phase,
    Hand,
    Brightness,
}

/// The source of random numbers of one strand or of one clump's guide.
#[derive(Clone, Copy)]
struct Key {
    seed: u32,
    /// Strands and guides are different streams of numbers.
    stream: u32,
    index: u32,
}

impl Key {
    const STRAND: u32 = 0;
    const GUIDE: u32 = 1;

    /// A uniform number in [0, 1).
    fn unit(self, purpose: Purpose) -> f64 {
        self.attempt(purpose, 0)
    }

    /// The same, one for each attempt at a thing that may fail.
    fn attempt(self, purpose: Purpose, attempt: u32) -> f64 {
        hash::unit(&[self.seed, self.stream, purpose as u32, self.index, attempt])
    }
}

/// Grows hair on a surface that stands in world space; the strands are in world space, too.
///
/// Roots are spread evenly over the area of the surface where its slope is in range. `up` needs no unit length.
/// `base_color` is the diffuse reflectance, linear Rec.709, brown unless given; `color_variation` changes it from strand
/// to strand. Curls wind around the strand's axis, whose length is the strand's `length`, so a curled strand is longer.
///
/// # Errors
/// Values out of range, a surface that is not sound or has no area in the range of slopes, or too many points.
pub fn grow(grow: &Grow, surface: &Mesh, up: Vec3, base_color: Option<[f64; 3]>) -> Result<Strands, GrowError> {
    check(grow)?;
    surface.validate()?;
    let up = up.as_dvec3().try_normalize().ok_or(GrowError::Up)?;
    let points_each = grow.segments as usize + 1;
    let points = u64::from(grow.count) * points_each as u64;
    if points > MAX_POINTS {
        return Err(GrowError::TooMany { points });
    }
    if grow.curl_radius > 0.0 && f64::from(grow.segments) < SEGMENTS_A_TURN * grow.curl_frequency {
        let (segments, turns) = (grow.segments, grow.curl_frequency);
        tracing::warn!("{segments} segments are few for {turns} turns of a curl: {SEGMENTS_A_TURN} a turn look smooth");
    }

    let roots = Roots::new(surface, grow.slope, up)?;
    let clumps = match grow.clumping > 0.0 {
        true => Some(Clumps::new(grow, &roots)?),
        false => None,
    };
    let mut positions = vec![Vec3::ZERO; points as usize];
    positions.par_chunks_exact_mut(points_each).enumerate().try_for_each(|(i, strand)| {
        let key = Key { seed: grow.seed, stream: Key::STRAND, index: i as u32 };
        grow_strand(grow, key, roots.sample(key)?, up, clumps.as_ref(), strand);
        Ok::<(), GrowError>(())
    })?;
    Ok(Strands {
        points: positions,
        first: (0..=grow.count).map(|i| i * points_each as u32).collect(),
        width: widths(grow),
        color: colors(grow, base_color),
        transparency: Attribute::Uniform(DEFAULT_TRANSPARENCY),
    })
}

/// The points of one strand.
fn grow_strand(grow: &Grow, key: Key, root: Root, up: DVec3, clumps: Option<&Clumps>, out: &mut [Vec3]) {
    let vary = grow.length_variation * (2.0 * key.unit(Purpose::Length) - 1.0);
    let length = grow.length * (1.0 + vary).max(SHORTEST);
    let last = (out.len() - 1) as f64;
    let Some(clumps) = clumps else {
        let phase = key.unit(Purpose::Phase);
        Shape::new(grow, key, &root, up, phase).trace(length, out.len(), |k, p| out[k] = p.as_vec3());
        return;
    };

    // The guide is grown as long as the strand itself, so that both reach the tip together.
    let guide = clumps.nearest(&root);
    let guide_key = Key { seed: key.seed, stream: Key::GUIDE, index: guide };
    let guide_phase = guide_key.unit(Purpose::Phase);
    // Curls out of step would cancel on the way to the guide; the closer the clump, the more they share its phase.
    let phase = guide_phase + (1.0 - grow.clumping) * (key.unit(Purpose::Phase) - 0.5);
    let mut hand_key = key;
    (hand_key.stream, hand_key.index) = (guide_key.stream, guide_key.index);
    let own = Shape::new(grow, key, &root, up, phase).with_hand(hand_key);
    own.trace(length, out.len(), |k, p| out[k] = p.as_vec3());
    Shape::new(grow, guide_key, clumps.root(guide), up, guide_phase).trace(length, out.len(), |k, p| {
        let s = k as f64 / last;
        // Leaves the root without a bend and closes up steadily.
        let weight = grow.clumping * s * s.sqrt();
        out[k] = out[k].as_dvec3().lerp(p, weight).as_vec3();
    });
}

fn widths(grow: &Grow) -> Attribute<f32> {
    if grow.width_root == grow.width_tip {
        return Attribute::Uniform(grow.width_root as f32);
    }
    let last = f64::from(grow.segments);
    let one: Vec<f32> = (0..=grow.segments)
        .map(|k| {
            let s = f64::from(k) / last;
            (grow.width_root + (grow.width_tip - grow.width_root) * s) as f32
        })
        .collect();
    Attribute::PerPoint(one.repeat(grow.count as usize))
}

fn colors(grow: &Grow, base: Option<[f64; 3]>) -> Attribute<Vec3> {
    let base = base.map_or(DEFAULT_COLOR, |c| DVec3::from(c).as_vec3());
    if grow.color_variation == 0.0 {
        return Attribute::Uniform(base);
    }
    let color = |index: u32| {
        let key = Key { seed: grow.seed, stream: Key::STRAND, index };
        let factor = 1.0 + grow.color_variation * (2.0 * key.unit(Purpose::Brightness) - 1.0);
        (base * factor as f32).clamp(Vec3::ZERO, Vec3::ONE)
    };
    Attribute::PerStrand((0..grow.count).into_par_iter().map(color).collect())
}

/// The ranges that the scene's schema states, for callers that did not go through it.
fn check(grow: &Grow) -> Result<(), GrowError> {
    let positive = "a positive number";
    let share = "0 to 1";
    let size = "0 or a positive number";
    let unit = 0.0..=1.0;
    let rules: [(&'static str, f64, bool, &'static str); 13] = [
        ("count", grow.count.into(), grow.count > 0, positive),
        ("segments", grow.segments.into(), grow.segments > 0, positive),
        ("length", grow.length, grow.length > 0.0, positive),
        ("width_root", grow.width_root, grow.width_root >= 0.0, size),
        ("width_tip", grow.width_tip, grow.width_tip >= 0.0, size),
        ("length_variation", grow.length_variation, unit.contains(&grow.length_variation), share),
        ("lean", grow.lean, grow.lean >= 0.0, size),
        ("gravity", grow.gravity, true, "a finite number"),
        ("curl_radius", grow.curl_radius, grow.curl_radius >= 0.0, size),
        ("curl_frequency", grow.curl_frequency, grow.curl_frequency >= 0.0, size),
        ("clumping", grow.clumping, unit.contains(&grow.clumping), share),
        ("clump_size", grow.clump_size.into(), grow.clump_size > 0, positive),
        ("color_variation", grow.color_variation, unit.contains(&grow.color_variation), share),
    ];
    if let Some((key, value, _, allowed)) = rules.into_iter().find(|(_, value, ok, _)| !(*ok && value.is_finite())) {
        return Err(GrowError::Value { key, value: value.to_string(), allowed });
    }
    let [low, high] = grow.slope;
    if !(-1.0..=high).contains(&low) || high > 1.0 {
        let allowed = "two cosines from -1 to 1, the lower first";
        return Err(GrowError::Value { key: "slope", value: format!("[{low}, {high}]"), allowed });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
