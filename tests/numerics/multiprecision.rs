//! The truths themselves, which are in `f64`, against 256 bits: a bound is worth no more than what it is measured against.

use astro_float::{BigFloat, Consts, RoundingMode};
use glam::DVec3;
use tress::hash::unit;
use tress::selftest::truth;

const BITS: usize = 256;
const NEAREST: RoundingMode = RoundingMode::ToEven;

fn big(x: f64) -> BigFloat {
    BigFloat::from_f64(x, BITS)
}

fn mul(a: &BigFloat, b: &BigFloat) -> BigFloat {
    a.mul(b, BITS, NEAREST)
}

fn sub(a: &BigFloat, b: &BigFloat) -> BigFloat {
    a.sub(b, BITS, NEAREST)
}

fn add(a: &BigFloat, b: &BigFloat) -> BigFloat {
    a.add(b, BITS, NEAREST)
}

fn div(a: &BigFloat, b: &BigFloat) -> BigFloat {
    a.div(b, BITS, NEAREST)
}

fn root(a: &BigFloat) -> BigFloat {
    a.sqrt(BITS, NEAREST)
}

/// |a - b| / |b| as a float; 256 bits hold any difference that matters.
fn relative(a: f64, b: &BigFloat) -> f64 {
    let off = div(&sub(&big(a), b), b);
    off.to_string().parse::<f64>().expect("a number").abs()
}

/// The narrow ribbon's closed form for two ends, 256 bits from the start: the foot by projection, the difference of sines straight.
fn solid_angle(a: DVec3, b: DVec3, width: f64, consts: &mut Consts) -> BigFloat {
    let vector = |v: DVec3| v.to_array().map(big);
    let dot =
        |a: &[BigFloat; 3], b: &[BigFloat; 3]| add(&add(&mul(&a[0], &b[0]), &mul(&a[1], &b[1])), &mul(&a[2], &b[2]));
    let (a, b) = (vector(a), vector(b));
    let along: [BigFloat; 3] = std::array::from_fn(|i| sub(&b[i], &a[i]));
    let length = root(&dot(&along, &along));
    let from = div(&dot(&a, &along), &length);
    let to = add(&from, &length);
    let h2 = sub(&dot(&a, &a), &mul(&from, &from));
    let h = root(&h2);
    let sine = |s: &BigFloat| div(s, &root(&add(&h2, &mul(s, s))));
    let x = div(&big(0.5 * width), &h);
    let angle = mul(&big(2.0), &x.asin(BITS, NEAREST, consts));
    mul(&angle, &sub(&sine(&to), &sine(&from)))
}

#[test]
fn the_truth_of_solid_angles_has_twelve_digits() {
    let mut consts = Consts::new().expect("memory");
    let mut worst = 0.0_f64;
    for key in 0..300 {
        let random = |i| 2.0 * unit(&[90, key, i]) - 1.0;
        // From 1e-6 to 1 beside the point; at a narrow ribbon all slices are alike but for α²/2, so the width is a millionth of the distance.
        let off = 10f64.powf(-6.0 * unit(&[91, key]));
        let along = DVec3::new(random(0), random(1), random(2)).normalize();
        let foot = along.any_orthonormal_vector() * off;
        let (a, b) = (foot + along * random(3), foot + along * (1.5 + random(4)));
        let h = a.cross((b - a).normalize()).length();
        let width = 1e-7 * h;
        let got = truth::solid_angle(a, b, width);
        worst = worst.max(relative(got, &solid_angle(a, b, width, &mut consts)));
    }
    println!("worst of the truth: {worst:e}");
    // Roundings of a and b in f64 move the foot by 2^-53 of |a|: 1e-16 of 1e-6 off, 1e-10; α² of the slices is 1e-14.
    assert!(worst < 2e-9, "{worst:e}");
}

#[test]
fn the_truth_of_layers_has_fifteen_digits() {
    let mut consts = Consts::new().expect("memory");
    for exponent in 0..300 {
        let x = 10f64.powf(-0.1 * f64::from(exponent)) * 0.999;
        let exact = sub(&big(1.0), &big(x)).ln(BITS, NEAREST, &mut consts).neg();
        assert!(relative(-(-x).ln_1p(), &exact) < 4.0 * f64::EPSILON, "{x:e}");
    }
}

#[test]
fn the_program_s_own_layers_are_those_of_256_bits() {
    let mut consts = Consts::new().expect("memory");
    for exponent in 0..300 {
        let x = (10f64.powf(-0.1 * f64::from(exponent)) * 0.999) as f32;
        let exact = sub(&big(1.0), &big(x.into())).ln(BITS, NEAREST, &mut consts).neg();
        let got = f64::from(tress::occlusion::layer::optical_depth(x, 1.0));
        assert!(relative(got, &exact) < 4e-7, "{x:e}: {got:e}");
    }
}

#[test]
fn thousands_of_layers_keep_their_alpha_to_twelve_digits() {
    use tress::fragment::{HairFragment, PixelLayers};
    let coverage = |i: u32| 10f32.powf(-9.0 * unit(&[92, i]) as f32 - 3.0);
    let fragment = |i| HairFragment { depth: i as f32, coverage: coverage(i), segment: i, u: 0.5, span: 1.0 };
    let fragments: Vec<HairFragment> = (0..5000).map(fragment).collect();
    let mut pixel = PixelLayers::default();
    pixel.composite(&fragments, |_| 0.25, &[], 0);
    let product = (0..5000).fold(big(1.0), |t, i| mul(&t, &sub(&big(1.0), &mul(&big(coverage(i).into()), &big(0.75)))));
    let error = relative(pixel.alpha, &sub(&big(1.0), &product));
    assert!(error < 5000.0 * f64::EPSILON, "{error:e}");
}
