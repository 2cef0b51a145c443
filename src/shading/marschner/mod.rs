//! Light through a fibre: Marschner et al. 2003 with the lobes of d'Eon et al. 2011 and Chiang et al. 2016.
//!
//! The strand is a rough dielectric cylinder with a coloured inside, its scales tilted. Light leaves it by reflection (R), by
//! going through (TT), by one reflection inside (TRT), and by more of them. F = S cos θ_i with
//!
//! S = b(θ_i) b(θ_o) Σ_p M_p(θ_i, θ_o) D_p(φ, θ_d) / max(cos θ_i, cos θ_o) + e(θ_i) e(θ_o),
//!
//! M along the strand (`longitudinal`), D around it, with attenuation and averaged over the width (`azimuthal`), b and e for
//! energy and reciprocity (`balance`). θ is the inclination to the plane across the strand, positive towards the tip; φ the
//! azimuth between the two directions. Angles in radians unless named in degrees.
//!
//! Roughnesses are those of Chiang et al., 0 smooth to 1 rough. The absorption is that for a colour (`color`).

mod azimuthal;
mod balance;
mod color;
mod evaluate;
mod four;
mod longitudinal;
mod sample;

use std::sync::OnceLock;

use glam::Vec3;

use self::azimuthal::Azimuthal;
use self::balance::Balance;
use self::color::Lengths;
use self::evaluate::BLOCK;
use self::longitudinal::{Inclination, Longitudinal};
use super::fibre::{Faces, Fibre, Sampled, StrandPoint};
use crate::tally::{self, Work};

/// Standard deviations below which a lobe is not resolved, in radians: tables stay small and numbers finite.
const SHARPEST: f64 = 0.003;

/// What a strand is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Roughness along the strand, 0 to 1.
    pub longitudinal: f32,
    /// Roughness around the strand, 0 to 1.
    pub azimuthal: f32,
    /// Tilt of the scales, in degrees; positive where they open towards the tip, as those of real hair do.
    pub tilt: f32,
    /// Index of refraction, above 1.
    pub ior: f32,
    /// What the colour of a point is.
    pub color_is: ColorIs,
}

/// What a colour is the share of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorIs {
    /// Of the light of a uniform sky that enters one strand, what leaves it.
    Strand,
    /// Of the light that falls on dense hair, what leaves it after all scattering.
    DenseHair,
}

/// Hair that reflects as a fibre does.
#[derive(Debug)]
pub struct Marschner {
    parameters: Parameters,
    face_width: f32,
    /// As it is, for directions; made when first asked for.
    narrow: OnceLock<Lobes>,
    /// As seen through the igloo's faces.
    broad: OnceLock<Lobes>,
}

/// The tables of one strand.
#[derive(Debug)]
struct Lobes {
    longitudinal: Longitudinal,
    azimuthal: Azimuthal,
    balance: Balance,
    lengths: Lengths,
}

/// A view of a point: its frame, and what does not depend on the light.
struct View<'l> {
    lobes: &'l Lobes,
    /// Along the strand, across it towards the eye, and across both.
    frame: [Vec3; 3],
    sin: f32,
    cos: f32,
    turned: Inclination,
    /// b and e at the view's inclination.
    balance: [f32; 2],
    /// Absorption a radius.
    absorption: Vec3,
}

/// A direction of light in a view's frame.
#[derive(Clone, Copy, Debug, Default)]
struct Incoming {
    sin: f32,
    cos: f32,
    /// Pseudo-angle of φ.
    turn: f32,
    cos_d: f32,
}

impl Marschner {
    /// Such hair, seen through faces of this width in radians.
    pub fn new(parameters: Parameters, face_width: f32) -> Self {
        Self { parameters, face_width, narrow: OnceLock::new(), broad: OnceLock::new() }
    }

    fn narrow(&self) -> &Lobes {
        self.narrow.get_or_init(|| Lobes::new(&self.parameters, 0.0))
    }

    fn broad(&self) -> &Lobes {
        self.broad.get_or_init(|| Lobes::new(&self.parameters, f64::from(self.face_width)))
    }

    fn view<'l>(&self, lobes: &'l Lobes, at: &StrandPoint) -> View<'l> {
        let absorption = match self.parameters.color_is {
            ColorIs::Strand => lobes.lengths.absorption(at.color),
            ColorIs::DenseHair => color::of_dense_hair(at.color, self.parameters.azimuthal),
        };
        View::new(lobes, at, absorption)
    }

    /// F of each face before it is made to keep the energy on these faces, and the energy that it has without absorption.
    fn raw_faces(&self, at: &StrandPoint, faces: &Faces, reflected: &mut Vec<Vec3>) -> f32 {
        let view = self.view(self.broad(), at);
        reflected.clear();
        let mut white = 0.0;
        for chunk in faces.centers.chunks(BLOCK) {
            // The last block is filled up with what is not looked at.
            let mut centers = [chunk[0]; BLOCK];
            centers[..chunk.len()].copy_from_slice(chunk);
            let block = view.evaluate(&centers);
            let [r, g, b] = &block.color;
            reflected.extend((0..chunk.len()).map(|k| Vec3::new(r[k], g[k], b[k])));
            white += block.white[..chunk.len()].iter().sum::<f32>();
        }
        white * faces.solid_angle
    }
}

impl Fibre for Marschner {
    fn reflect(&self, at: &StrandPoint, incoming: Vec3) -> Vec3 {
        tally::add(Work::Marschner, 1);
        let view = self.view(self.narrow(), at);
        view.reflect(incoming)
    }

    fn reflect_faces(&self, at: &StrandPoint, faces: &Faces, reflected: &mut Vec<Vec3>) {
        tally::add(Work::Marschner, faces.centers.len() as u64);
        let energy = self.raw_faces(at, faces, reflected);
        // What absorbs nothing reflects all: the sum over the faces' middles is a quadrature of 1, and its error is known.
        let scale = 1.0 / energy.max(1e-6);
        reflected.iter_mut().for_each(|f| *f *= scale);
    }

    fn sample(&self, at: &StrandPoint, random: [f32; 4]) -> Option<Sampled> {
        let view = self.view(self.narrow(), at);
        let incoming = view.sample(random);
        let density = view.density(&view.incoming(incoming));
        let reflected = view.reflect(incoming);
        (density > 0.0).then_some(Sampled { incoming, reflected, density })
    }

    fn density(&self, at: &StrandPoint, incoming: Vec3) -> f32 {
        let view = self.view(self.narrow(), at);
        view.density(&view.incoming(incoming))
    }
}

impl Lobes {
    fn new(parameters: &Parameters, face_width: f64) -> Self {
        tally::add(Work::MarschnerTables, 1);
        // A face's variance along one axis: a square's.
        let face = face_width * face_width / 12.0;
        let rough = f64::from(parameters.longitudinal);
        let deviation = 0.726 * rough + 0.812 * rough * rough + 3.7 * rough.powi(20);
        // TT is half as wide as R, TRT and the rest twice.
        let own = [1.0, 0.5, 2.0, 2.0].map(|factor| (factor * deviation).max(SHARPEST));
        let variance = own.map(|own| own * own + face);
        let tilt = f64::from(parameters.tilt).to_radians();
        let longitudinal = Longitudinal::new(variance, [-2.0 * tilt, tilt, 4.0 * tilt, 0.0]);
        let scale = logistic_scale(f64::from(parameters.azimuthal)).max(SHARPEST);
        let azimuthal = Azimuthal::new(f64::from(parameters.ior), |cos| {
            // At the inclination θ a face spans 1/cos θ as much azimuth. The logistic's variance is (π s)² / 3.
            let face = face / (cos * cos).max(1e-4);
            (scale * scale + 3.0 * face / (std::f64::consts::PI * std::f64::consts::PI)).sqrt()
        });
        let narrowest = variance.into_iter().fold(f64::INFINITY, f64::min).sqrt();
        let (balance, rows) = Balance::new(&longitudinal, &azimuthal, narrowest);
        let lengths = Lengths::new(&azimuthal, &rows);
        Self { longitudinal, azimuthal, balance, lengths }
    }
}

/// Scale of the logistic distribution for an azimuthal roughness (Chiang et al. 2016, Eq. 8), in radians.
fn logistic_scale(rough: f64) -> f64 {
    (std::f64::consts::PI / 8.0).sqrt() * (0.265 * rough + 1.194 * rough * rough + 5.372 * rough.powi(22))
}

impl<'l> View<'l> {
    fn new(lobes: &'l Lobes, at: &StrandPoint, absorption: Vec3) -> Self {
        let along = at.tangent;
        let sin = along.dot(at.view).clamp(-1.0, 1.0);
        let across = at.view - along * sin;
        let cos = across.length();
        // Seen end on, one side is as good as another.
        let across = if cos > 1e-6 { across / cos } else { along.any_orthonormal_vector() };
        let turned = lobes.longitudinal.turned(sin, cos);
        let balance = lobes.balance.evaluate(sin, cos);
        Self { lobes, frame: [along, across, along.cross(across)], sin, cos, turned, balance, absorption }
    }
}

#[cfg(test)]
mod tests;
