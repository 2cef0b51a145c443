//! From what a scene says of a hair object to the model by which it reflects.

use crate::scene::{HairShading, description};
use crate::shading::{Fibre, KajiyaKayFibre, Marschner, marschner};

/// The model of reflection that a hair object asks for.
pub(super) fn fibre(shading: &HairShading, face_width: f32) -> Box<dyn Fibre> {
    match *shading {
        HairShading::KajiyaKay { specular, exponent } => Box::new(KajiyaKayFibre::new(specular, exponent, face_width)),
        HairShading::Marschner { color_is, roughness: [longitudinal, azimuthal], tilt, ior } => {
            let color_is = match color_is {
                description::ColorIs::Strand => marschner::ColorIs::Strand,
                description::ColorIs::DenseHair => marschner::ColorIs::DenseHair,
            };
            let parameters = marschner::Parameters { longitudinal, azimuthal, tilt, ior, color_is };
            Box::new(Marschner::new(parameters, face_width))
        }
    }
}
