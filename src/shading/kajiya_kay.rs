//! Kajiya and Kay's model of hair (1989), normalised to reflect what it receives.
//!
//! Diffuse: sin θ_i. Over the sphere of directions ∫ sin θ dω = π², so the factor 1/π² makes a white strand under a uniform
//! sky as bright as the sky. Specular: cos^p(θ_i - (π - θ_o)), a highlight on the mirror cone; it is divided by its integral over the
//! sphere, so that `specular` is its albedo at every angle of view.

use std::f32::consts::PI;
use std::f64::consts::{FRAC_PI_2, TAU};

use glam::Vec3;
use statrs::function::gamma::ln_gamma;

use super::fibre::{Faces, Fibre, Sampled, StrandPoint};
use crate::tally::{self, Work};

/// The highlight's shape for one exponent.
#[derive(Clone, Debug)]
pub struct Highlight {
    exponent: f32,
    /// 1 / integral of the lobe, over equal steps of the view's angle to the tangent from 0 to π/2.
    normalisation: Vec<f32>,
}

const STEPS: usize = 128;

impl Highlight {
    /// A highlight with this exponent (1 or more).
    pub fn new(exponent: f32) -> Self {
        tally::add(Work::HighlightTables, 1);
        let exponent = exponent.max(1.0);
        let normalisation = (0..=STEPS)
            .map(|i| {
                let theta_out = FRAC_PI_2 * i as f64 / STEPS as f64;
                (1.0 / lobe_integral(f64::from(exponent), theta_out)) as f32
            })
            .collect();
        Self { exponent, normalisation }
    }

    /// The highlight as seen through faces of this width in radians: its variance 1/p grows by a square's, w²/12.
    ///
    /// Evaluated at the middle of each face it then integrates to one, however narrow it is.
    pub fn over_faces(exponent: f32, face_width: f32) -> Self {
        Self::new(1.0 / (1.0 / exponent.max(1.0) + face_width * face_width / 12.0))
    }

    /// The exponent.
    pub fn exponent(&self) -> f32 {
        self.exponent
    }

    /// 1 / integral of the lobe for a view at this cosine to the tangent.
    fn scale(&self, cos_out: f32) -> f32 {
        let position = cos_out.abs().min(1.0).acos() * (STEPS as f32 / FRAC_PI_2 as f32);
        let step = (position as usize).min(STEPS - 1);
        let [here, next] = [self.normalisation[step], self.normalisation[step + 1]];
        here + (next - here) * (position - step as f32)
    }
}

/// ∫ max(0, cos(θ - (π - θ_o)))^p dω over the sphere, by Simpson's rule over the lobe's support.
fn lobe_integral(exponent: f64, theta_out: f64) -> f64 {
    let peak = std::f64::consts::PI - theta_out;
    // Beyond 9 standard deviations (variance 1/p) the lobe is below 1e-17 of its peak.
    let reach = (9.0 / exponent.sqrt()).min(FRAC_PI_2);
    let (from, to) = ((peak - reach).max(0.0), (peak + reach).min(std::f64::consts::PI));
    let n = 512;
    let h = (to - from) / f64::from(n);
    let f = |i: i32| {
        let theta = from + h * f64::from(i);
        (theta - peak).cos().max(0.0).powf(exponent) * theta.sin()
    };
    let inner: f64 = (1..n).map(|i| f(i) * if i % 2 == 1 { 4.0 } else { 2.0 }).sum();
    TAU * h / 3.0 * (f(0) + inner + f(n))
}

/// A point on a strand, ready to be lit.
#[derive(Clone, Copy, Debug)]
pub struct KajiyaKay<'a> {
    /// Unit tangent.
    pub tangent: Vec3,
    /// Diffuse reflectance.
    pub diffuse: Vec3,
    /// Albedo of the highlight.
    pub specular: Vec3,
    /// The highlight's shape.
    pub highlight: &'a Highlight,
    cos_out: f32,
    sin_out: f32,
    scale: f32,
}

impl<'a> KajiyaKay<'a> {
    /// A point with this tangent seen along the unit vector `view` (from the point towards the eye).
    pub fn new(tangent: Vec3, view: Vec3, diffuse: Vec3, specular: Vec3, highlight: &'a Highlight) -> Self {
        let cos_out = tangent.dot(view).clamp(-1.0, 1.0);
        let scale = highlight.scale(cos_out);
        Self { tangent, diffuse, specular, highlight, cos_out, sin_out: sine(cos_out), scale }
    }

    /// The same point with another highlight.
    pub fn with_highlight<'b>(&self, highlight: &'b Highlight) -> KajiyaKay<'b> {
        KajiyaKay {
            tangent: self.tangent,
            diffuse: self.diffuse,
            specular: self.specular,
            highlight,
            cos_out: self.cos_out,
            sin_out: self.sin_out,
            scale: highlight.scale(self.cos_out),
        }
    }

    /// Reflected radiance per incident radiance and steradian, for light from the unit direction `incoming` (towards the light).
    #[inline]
    pub fn evaluate(&self, incoming: Vec3) -> Vec3 {
        let cos_in = self.tangent.dot(incoming).clamp(-1.0, 1.0);
        let sin_in = sine(cos_in);
        let diffuse = diffuse(self.diffuse, sin_in);
        let cosine = sin_in * self.sin_out - cos_in * self.cos_out;
        if cosine <= 0.0 {
            return diffuse;
        }
        diffuse + self.specular * (cosine.powf(self.highlight.exponent) * self.scale)
    }
}

/// The diffuse term at a sine of the angle to the tangent.
#[inline]
fn diffuse(color: Vec3, sin_in: f32) -> Vec3 {
    color * (sin_in / (PI * PI))
}

/// Such hair without a highlight: the diffuse term alone, without tables and powers. The same bits as a [`KajiyaKayFibre`] whose highlight is black.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseFibre;

impl Fibre for DiffuseFibre {
    fn reflect(&self, at: &StrandPoint, incoming: Vec3) -> Vec3 {
        tally::add(Work::KajiyaKay, 1);
        diffuse(at.color, sine(at.tangent.dot(incoming).clamp(-1.0, 1.0)))
    }

    fn reflect_faces(&self, at: &StrandPoint, faces: &Faces, reflected: &mut Vec<Vec3>) {
        tally::add(Work::KajiyaKay, faces.centers.len() as u64);
        let point = |center: &Vec3| diffuse(at.color, sine(at.tangent.dot(*center).clamp(-1.0, 1.0)));
        reflected.clear();
        reflected.extend(faces.centers.iter().map(point));
    }

    fn sample(&self, at: &StrandPoint, random: [f32; 4]) -> Option<Sampled> {
        let incoming = around(at.tangent, coordinate(2.0, random[1], random[2]), random[3]);
        let density = self.density(at, incoming);
        (density > 0.0).then(|| Sampled { incoming, reflected: self.reflect(at, incoming), density })
    }

    fn density(&self, at: &StrandPoint, incoming: Vec3) -> f32 {
        let sin = sine(at.tangent.dot(incoming).clamp(-1.0, 1.0));
        if at.color == Vec3::ZERO { 0.0 } else { sin / (PI * PI) }
    }
}

/// The first coordinate of a uniform point on the sphere of p + 2 dimensions (Ulrich 1984): density (1 - t²)^((p-1)/2).
fn coordinate(p: f32, u: f32, v: f32) -> f32 {
    (1.0 - u.powf(2.0 / p)).max(0.0).sqrt() * (2.0 * PI * v).cos()
}

/// A direction at this cosine to the tangent, turned around it by a number in [0, 1).
fn around(tangent: Vec3, cos: f32, turn: f32) -> Vec3 {
    let sin = sine(cos.clamp(-1.0, 1.0));
    let (y, x) = (2.0 * PI * turn).sin_cos();
    let (across, aside) = tangent.any_orthonormal_pair();
    (tangent * cos + (across * x + aside * y) * sin).normalize()
}

/// Hair that reflects by Kajiya and Kay. A point's colour is its diffuse reflectance.
#[derive(Clone, Debug)]
pub struct KajiyaKayFibre {
    specular: Vec3,
    narrow: Highlight,
    /// As seen through the igloo's faces.
    broad: Highlight,
    /// ∫ cos^p δ dδ over [-π/2, π/2].
    lobe: f32,
}

impl KajiyaKayFibre {
    /// Such hair with a highlight of this albedo and exponent, seen through faces of this width in radians.
    pub fn new(specular: Vec3, exponent: f32, face_width: f32) -> Self {
        let (narrow, broad) = (Highlight::new(exponent), Highlight::over_faces(exponent, face_width));
        let p = f64::from(narrow.exponent);
        // √π Γ((p + 1)/2) / Γ(p/2 + 1)
        let ln_lobe = ln_gamma(0.5 * (p + 1.0)) - ln_gamma(0.5 * p + 1.0);
        let lobe = (std::f64::consts::PI.sqrt() * ln_lobe.exp()) as f32;
        Self { specular, narrow, broad, lobe }
    }

    fn at<'a>(&'a self, at: &StrandPoint, highlight: &'a Highlight) -> KajiyaKay<'a> {
        KajiyaKay::new(at.tangent, at.view, at.color, self.specular, highlight)
    }

    /// The chance that a sample is one of the diffuse term; none where nothing is reflected.
    fn diffuse_share(&self, at: &StrandPoint) -> Option<f32> {
        let [diffuse, specular] = [at.color, self.specular].map(|color| color.element_sum());
        let share = diffuse / (diffuse + specular);
        share.is_finite().then_some(share)
    }

    /// Density of the highlight's angle `theta` to the tangent, per radian, for a lobe around `peak`: what leaves [0, π] is folded back.
    fn lobe_density(&self, theta: f32, peak: f32) -> f32 {
        let lobe = |angle: f32| (angle - peak).cos().max(0.0).powf(self.narrow.exponent);
        let near = |angle: f32| if (angle - peak).abs() < PI / 2.0 { lobe(angle) } else { 0.0 };
        (near(theta) + near(-theta) + near(2.0 * PI - theta)) / self.lobe
    }
}

impl Fibre for KajiyaKayFibre {
    fn reflect(&self, at: &StrandPoint, incoming: Vec3) -> Vec3 {
        evaluated(1);
        self.at(at, &self.narrow).evaluate(incoming)
    }

    fn reflect_faces(&self, at: &StrandPoint, faces: &Faces, reflected: &mut Vec<Vec3>) {
        evaluated(faces.centers.len());
        let point = self.at(at, &self.broad);
        reflected.clear();
        reflected.extend(faces.centers.iter().map(|&center| point.evaluate(center)));
    }

    fn sample(&self, at: &StrandPoint, random: [f32; 4]) -> Option<Sampled> {
        let diffuse = random[0] < self.diffuse_share(at)?;
        let coordinate = |p: f32| coordinate(p, random[1], random[2]);
        let cos = if diffuse {
            // sin² θ dθ is √(1 - t²) dt in t = cos θ.
            coordinate(2.0)
        } else {
            // cos^p δ dδ is (1 - t²)^((p-1)/2) dt in t = sin δ. The cosine folds what leaves [0, π].
            let peak = PI - at.tangent.dot(at.view).clamp(-1.0, 1.0).acos();
            (peak + coordinate(self.narrow.exponent).asin()).cos()
        };
        let incoming = around(at.tangent, cos, random[3]);
        let density = self.density(at, incoming);
        (density > 0.0).then(|| Sampled { incoming, reflected: self.reflect(at, incoming), density })
    }

    fn density(&self, at: &StrandPoint, incoming: Vec3) -> f32 {
        let Some(share) = self.diffuse_share(at) else { return 0.0 };
        let cos = at.tangent.dot(incoming).clamp(-1.0, 1.0);
        let sin = sine(cos);
        let peak = PI - at.tangent.dot(at.view).clamp(-1.0, 1.0).acos();
        // Per steradian: dω = sin θ dθ dφ. Along the tangent both F and the diffuse density vanish.
        let specular = self.lobe_density(cos.acos(), peak) / (2.0 * PI * sin.max(1e-6));
        share * sin / (PI * PI) + (1.0 - share) * specular
    }
}

fn evaluated(directions: usize) {
    tally::add(Work::KajiyaKay, directions as u64);
    tally::add(Work::Highlight, directions as u64);
}

/// √(1 - c²) as √((1 - c)(1 + c)): no cancellation next to ±1.
#[inline]
fn sine(cosine: f32) -> f32 {
    ((1.0 - cosine) * (1.0 + cosine)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::igloo::{Igloo, Span};

    fn furnace(point: &KajiyaKay, faces: u32) -> f32 {
        let igloo = Igloo::new(Span::Sphere, faces);
        (0..igloo.len()).map(|face| point.evaluate(igloo.center(face)).x).sum::<f32>() * igloo.face_solid_angle()
    }

    #[test]
    fn a_white_strand_under_a_uniform_sky_is_as_bright_as_the_sky() {
        for faces in [50, 100, 1000] {
            for tangent in [Vec3::X, Vec3::Z, Vec3::new(0.3, -0.5, 0.7).normalize()] {
                let highlight = Highlight::new(50.0);
                let point = KajiyaKay::new(tangent, Vec3::Y, Vec3::ONE, Vec3::ZERO, &highlight);
                let sum = furnace(&point, faces);
                assert!((sum - 1.0).abs() < 0.01, "{faces} faces, {tangent:?}: {sum}");
            }
        }
    }

    #[test]
    fn the_highlight_reflects_its_albedo_at_every_angle() {
        for exponent in [1.0, 10.0, 60.0, 500.0] {
            let highlight = Highlight::new(exponent);
            for angle in [0.0_f32, 0.2, 0.7, 1.2, 1.5, 2.0, 3.1] {
                let view = Vec3::new(angle.cos(), angle.sin(), 0.0);
                let point = KajiyaKay::new(Vec3::X, view, Vec3::ZERO, Vec3::splat(0.5), &highlight);
                let sum = furnace(&point, 200_000);
                assert!((sum - 0.5).abs() < 0.005, "exponent {exponent}, angle {angle}: {sum}");
            }
        }
    }

    #[test]
    fn a_narrow_highlight_keeps_its_energy_on_coarse_faces() {
        for faces in [100, 400] {
            let igloo = Igloo::new(Span::Sphere, faces);
            for exponent in [30.0, 200.0, 5000.0] {
                let highlight = Highlight::over_faces(exponent, igloo.face_width());
                for angle in [0.9_f32, 1.3, 1.57, 2.1] {
                    let tangent = Vec3::new(0.6, 0.0, 0.8);
                    let side = Vec3::new(0.8, 0.0, -0.6);
                    let view = tangent * angle.cos() + side * angle.sin();
                    let point = KajiyaKay::new(tangent, view, Vec3::ZERO, Vec3::ONE, &highlight);
                    let sum = furnace(&point, faces);
                    // Sampled at its centres the broadened lobe (sigma about a third of a face) keeps its energy to a few per cent.
                    assert!((sum - 1.0).abs() < 0.12, "{faces} faces, exponent {exponent}, angle {angle}: {sum}");
                }
            }
        }
    }

    #[test]
    fn samples_fall_as_they_should_and_find_the_albedo() {
        use crate::shading::fibre::testing::*;
        let (brown, gloss) = (Vec3::new(0.6, 0.3, 0.1), Vec3::new(0.1, 0.15, 0.2));
        for (color, specular, exponent) in
            [(brown, Vec3::ZERO, 60.0), (Vec3::ZERO, gloss, 20.0), (brown, gloss, 1.0), (brown, gloss, 60.0)]
        {
            let fibre = KajiyaKayFibre::new(specular, exponent, 0.3);
            for angle in [0.0, 0.6, -1.2, 1.5] {
                let at = seen(angle, color);
                samples_follow_their_density(&fibre, &at);
                samples_find_the_albedo(&fibre, &at, integral(600, 60, |incoming| fibre.reflect(&at, incoming)));
            }
        }
        assert_eq!(KajiyaKayFibre::new(Vec3::ZERO, 60.0, 0.3).sample(&seen(0.1, Vec3::ZERO), [0.5; 4]), None);
        assert_eq!(DiffuseFibre.sample(&seen(0.1, Vec3::ZERO), [0.5; 4]), None);
    }

    #[test]
    fn a_black_highlight_and_none_are_the_same_to_the_bit() {
        use crate::shading::fibre::testing::seen;
        let black = KajiyaKayFibre::new(Vec3::ZERO, 60.0, 0.3);
        let igloo = Igloo::new(Span::Sphere, 50);
        let centers: Vec<Vec3> = (0..igloo.len()).map(|face| igloo.center(face)).collect();
        let faces = Faces { centers: &centers, solid_angle: igloo.face_solid_angle() };
        for (angle, color) in [(0.0, Vec3::ONE), (0.7, Vec3::new(0.6, 0.3, 0.1)), (-1.3, Vec3::ZERO)] {
            let at = seen(angle, color);
            let (mut with, mut without) = (Vec::new(), Vec::new());
            black.reflect_faces(&at, &faces, &mut with);
            DiffuseFibre.reflect_faces(&at, &faces, &mut without);
            assert_eq!(with, without);
            for &center in &centers {
                assert_eq!(black.reflect(&at, center), DiffuseFibre.reflect(&at, center));
                assert_eq!(black.density(&at, center), DiffuseFibre.density(&at, center));
            }
            for random in [[0.2, 0.3, 0.4, 0.5], [0.9, 0.01, 0.8, 0.99]] {
                assert_eq!(black.sample(&at, random), DiffuseFibre.sample(&at, random));
            }
        }
    }

    #[test]
    fn the_highlight_lies_on_the_mirror_cone() {
        let highlight = Highlight::new(100.0);
        let view = Vec3::new(0.6, 0.8, 0.0);
        let point = KajiyaKay::new(Vec3::X, view, Vec3::ZERO, Vec3::ONE, &highlight);
        let mirrored = Vec3::new(-0.6, 0.0, 0.8);
        assert!(point.evaluate(mirrored).x > 10.0 * point.evaluate(view).x);
    }
}
