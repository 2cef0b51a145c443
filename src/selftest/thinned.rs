//! Thinned hair (5.1, 5.2): one strand more never brightens a face.
//!
//! What can be proved. Whether a strand is kept depends on its number, which gives its hash, and on its distance; so does the factor that stands for those left
//! out, 1 / share. Neither depends on how many strands there are. So a strand added *behind* all others leaves the kept set and its factors as they were, and
//! adds depths that are not negative, or nothing where it is not kept: τ does not fall, Γ = exp(-τ) does not rise, in no face, whatever the thinning. Summed
//! in `f32`, n terms may err by n roundoffs of τ, and τ exp(-τ) is below 1/e; a strand that is not kept changes no bit.
//!
//! What is not so: a strand put *before* others gives them other numbers, and another set is kept; and a smaller share, though its strands are among
//! those of a larger one, is not brighter or darker in every face: its factors are larger.

use glam::{Mat3, Vec3};

use super::{Draw, Measured, Property, U32, hard};
use crate::hair::HairModel;
use crate::hash::unit;
use crate::occlusion::{Igloo, Projection, Receiver, Span, ThinnedSegments, Thinning, Transmittance, layer};

pub const PROPERTIES: &[Property] =
    &[Property { name: "Γ, thinned: a hair more never brightens", quick: 400, check: brighter }];

/// Purpose of the random numbers of strands.
const STRAND: u32 = 0x5448_494E;
const FACES: u32 = 64;

/// Strands of four segments around the origin, bent at random.
fn strands(key: u32, count: u32) -> Vec<Vec<Vec3>> {
    let strand = |index: u32| {
        let at = |point: u32| {
            Vec3::from_array([0, 1, 2].map(|axis| (unit(&[STRAND, key, index, point, axis]) - 0.5) as f32))
        };
        let (from, to) = (at(0) * 2.0, at(1) * 2.0);
        (0..=4).map(|i| from.lerp(to, i as f32 / 4.0) + 0.1 * at(2 + i)).collect()
    };
    (0..count).map(strand).collect()
}

fn gamma(model: &HairModel, receiver: &Receiver, thinning: &Thinning, on: Projection) -> (Vec<f32>, usize) {
    let igloo = Igloo::new(Span::Sphere, FACES);
    let far = vec![f32::INFINITY; igloo.len()];
    let segments = ThinnedSegments::build(model, Transmittance::Crossing);
    let (mut depth, mut pieces) = (vec![0.0; igloo.len()], Vec::new());
    segments.optical_depths(receiver, &igloo, thinning, on, &far, &mut depth, model, &mut pieces);
    layer::transmittances(&mut depth);
    let mut kept = 0;
    segments.selected(model, receiver.position, thinning, |_, _| kept += 1);
    (depth, kept)
}

/// What one strand more does to the faces of a case.
struct More {
    /// Segments that are used, without it and with it.
    kept: [usize; 2],
    /// The largest rise and the largest fall of a face.
    rise: f64,
    fall: f64,
}

fn more(draw: &mut Draw) -> More {
    let key = (draw.unit() * 1e6) as u32;
    let count = draw.scale(2.0, 60.0) as u32;
    let width = draw.scale(1e-4, 0.3) as f32;
    let transparency = draw.pick(&[0.0, 0.3, 0.9, 1.0]);
    let thinning = Thinning {
        fraction: draw.pick(&[1.0, 0.5, draw.clone().scale(0.05, 1.0) as f32]),
        distance_unit: draw.pick(&[f32::INFINITY, 0.5, 0.1, 0.03]),
    };
    let on = draw.pick(&[Projection::Sphere, Projection::TangentPlane]);
    let all = hard::model(&strands(key, count + 1), |_| width, transparency);
    let before = hard::model(&strands(key, count), |_| width, transparency);
    // On hair or beside it.
    let position = draw.direction().as_vec3() * draw.between(0.0, 1.0) as f32;
    let receiver = if draw.unit() < 0.5 {
        let sample = before.sample((draw.unit() * before.segments() as f64) as usize, draw.unit() as f32);
        Receiver { position: sample.position, on: Some(sample.on), frame: Mat3::IDENTITY }
    } else {
        Receiver { position, on: None, frame: Mat3::IDENTITY }
    };
    let [(a, less), (b, kept)] = [&before, &all].map(|model| gamma(model, &receiver, &thinning, on));
    let change = |sign: f32| a.iter().zip(&b).map(|(a, b)| f64::from(sign * (b - a))).fold(0.0, f64::max);
    More { kept: [less, kept], rise: change(1.0), fall: change(-1.0) }
}

fn brighter(draw: &mut Draw) -> Measured {
    let More { kept: [less, kept], rise, fall } = more(draw);
    if kept == less {
        return Measured { error: rise.max(fall), bound: 0.0 };
    }
    Measured { error: rise, bound: (kept as f64 + 8.0) * U32 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selftest::numbers;

    #[test]
    fn strands_are_kept_and_left_out_and_those_kept_darken() {
        let cases: Vec<More> = (0..200).map(|index| more(&mut Draw::new(&numbers(index)))).collect();
        let kept = cases.iter().filter(|case| case.kept[1] > case.kept[0]).count();
        let darker = cases.iter().filter(|case| case.fall > 1e-3).count();
        assert!(kept > 40 && kept < 180 && darker > 30, "{kept} kept, {darker} darker, of 200");
    }
}
