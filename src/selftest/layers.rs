//! Layers: coverage beyond 1, transparencies of 0, 1 and 1e-38, thousands of them in one pixel, and the order of sums.

use super::{Draw, Measured, Property, U32};
use crate::fragment::{HairFragment, PixelLayers, Rank, Shaded};
use crate::occlusion::Transmittance;
use crate::occlusion::layer::optical_depth;

pub const PROPERTIES: &[Property] = &[
    Property { name: "layer: optical depth", quick: 20_000, check: depth },
    Property { name: "layer: transparency by length", quick: 20_000, check: by_length },
    Property { name: "pixel: alpha of many layers", quick: 60, check: alpha },
    Property { name: "pixel: weights add up to 1", quick: 60, check: weights },
    Property { name: "pixel: order of fragments", quick: 200, check: order },
    Property { name: "pixel: selection keeps the weight", quick: 200, check: selection },
];

/// Numbers that a transparency or a coverage may be.
fn share(draw: &mut Draw) -> f32 {
    let kind = draw.pick(&[0, 1, 2, 3, 4]);
    let value = match kind {
        0 => draw.unit(),
        1 => draw.scale(1e-44, 1.0),
        2 => 1.0 - draw.scale(1e-7, 1.0),
        3 => draw.pick(&[0.0, 1.0, 1e-38, 1e-45, 1.0 - 6e-8]),
        _ => draw.scale(0.5, 1e6),
    };
    value as f32
}

/// -ln(1 - x) to 3e-7 of itself: the series' first term left out is x⁴/5 of the sum, 1.7e-7 at .03, and three roundoffs; ln_1p is good to one ulp, its
/// argument is exact.
fn depth(draw: &mut Draw) -> Measured {
    let coverage = share(draw);
    let opacity = 1.0 - share(draw).min(1.0);
    let got = f64::from(optical_depth(coverage, opacity));
    let x = coverage.clamp(0.0, 1.0) * opacity;
    let want = -(-f64::from(x)).ln_1p();
    if want.is_infinite() {
        return Measured { error: if got == want { 0.0 } else { f64::INFINITY }, bound: 0.0 };
    }
    // A denormal result has no relative precision: half of the least number.
    Measured { error: (got - want).abs(), bound: 4e-7 * want + 1e-45 }
}

/// 1 - σ^(L/unit) as -expm1(L/unit ln σ): to 8 roundoffs of itself, also where the power is nearly 1.
fn by_length(draw: &mut Draw) -> Measured {
    let transparency = share(draw).min(1.0);
    let length = draw.pick(&[0.0, 1.0, 1.0, 1.0]) * draw.scale(1e-12, 10.0);
    let unit = draw.scale(1e-3, 10.0) as f32;
    let got = f64::from(Transmittance::SegmentLength { unit }.opacity(transparency, length as f32));
    let exponent = f64::from(length as f32) / f64::from(unit);
    let want = match (exponent, transparency) {
        (0.0, _) | (_, 1.0) => 0.0,
        (_, 0.0) => 1.0,
        (exponent, t) => -(exponent * f64::from(t).ln()).exp_m1(),
    };
    Measured { error: (got - want).abs(), bound: 8.0 * U32 * want + 1e-45 }
}

/// Up to ten thousand fragments of coverages from 1e-12 to beyond 1.
fn fragments(draw: &mut Draw) -> Vec<HairFragment> {
    let count = draw.scale(1.0, 10_000.0) as u32;
    let least = draw.scale(1e-12, 1.0);
    let key = (draw.unit() * 4e9) as u32;
    let one = |i| {
        let random = |axis| crate::hash::unit(&[key, i, axis]);
        let coverage = (least.ln() * random(0)).exp() as f32;
        // Depths coincide often.
        let depth = 1.0 + (random(1) * 50.0).floor() as f32 / 10.0;
        HairFragment { depth, coverage, segment: i, u: 0.5, span: 1.0 }
    };
    (0..count).map(one).collect()
}

fn transparency(fragment: &HairFragment) -> f32 {
    [0.0, 0.5, 1e-38, 0.999][fragment.segment as usize % 4]
}

fn composited(fragments: &[HairFragment]) -> PixelLayers {
    let mut pixel = PixelLayers::default();
    pixel.composite(fragments, transparency, &[], 0);
    pixel
}

/// 1 - Π γ by a sum of logarithms with Kahan's compensation. The program's own sum of n products errs by n roundoffs of `f64` of itself.
fn alpha(draw: &mut Draw) -> Measured {
    let fragments = fragments(draw);
    let got = composited(&fragments).alpha;
    let (mut sum, mut lost) = (0.0_f64, 0.0_f64);
    for fragment in &fragments {
        let x = f64::from(fragment.coverage).min(1.0) * (1.0 - f64::from(transparency(fragment)));
        let term = (-x).ln_1p() - lost;
        let next = sum + term;
        lost = if next.is_finite() { (next - sum) - term } else { 0.0 };
        sum = next;
    }
    let want = -sum.exp_m1();
    Measured { error: (got - want).abs(), bound: 4.0 * fragments.len() as f64 * f64::EPSILON * want }
}

fn weights(draw: &mut Draw) -> Measured {
    let fragments = fragments(draw);
    let pixel = composited(&fragments);
    let sum: f64 = pixel.layers.iter().map(|layer| layer.weight).sum();
    let sane = pixel.layers.iter().all(|l| (0.0..=1.0).contains(&l.weight)) && (0.0..=1.0).contains(&pixel.alpha);
    let error = if sane { (sum + pixel.background() - 1.0).abs() } else { f64::INFINITY };
    Measured { error, bound: 4.0 * fragments.len() as f64 * f64::EPSILON }
}

/// Whatever the order of the fragments, the bits are the same: layers are sorted by depth, then by segment.
fn order(draw: &mut Draw) -> Measured {
    let mut fragments = fragments(draw);
    let here = composited(&fragments);
    fragments.reverse();
    let middle = fragments.len() / 3;
    fragments.rotate_left(middle);
    let there = composited(&fragments);
    let weight = |pixel: &PixelLayers| pixel.layers.iter().map(|l| (l.segment, l.weight.to_bits())).collect::<Vec<_>>();
    let same = here.alpha.to_bits() == there.alpha.to_bits() && weight(&here) == weight(&there);
    Measured { error: f64::from(u8::from(!same)), bound: 0.0 }
}

fn selection(draw: &mut Draw) -> Measured {
    let fragments = fragments(draw);
    let rank = draw.pick(&[Rank::Seen, Rank::Gamma]);
    let count = draw.scale(1.0, 100.0) as usize;
    let mut pixel = composited(&fragments);
    let mut shaded: Vec<Shaded> = Vec::new();
    pixel.select(count, rank, crate::fragment::MIN_WEIGHT, &mut shaded);
    let kept: f64 = shaded.iter().map(|s| s.weight).sum();
    let want: f64 = pixel.layers.iter().map(|l| l.weight).sum();
    Measured { error: (kept - want).abs(), bound: 4.0 * fragments.len() as f64 * f64::EPSILON * want }
}
