//! How each hair object reflects.

use glam::Vec3;

use crate::render::clock::Part;
use crate::scene::{HairShading, description};
use crate::shading::{DiffuseFibre, Fibre, KajiyaKayFibre, Marschner, marschner};

/// The model of reflection that a hair object asks for, and what its time counts as. A black highlight is none, unless it is forced.
pub(super) fn fibre(shading: &HairShading, face_width: f32, forced: bool) -> (Box<dyn Fibre>, Part) {
    match *shading {
        HairShading::KajiyaKay { specular: Vec3::ZERO, .. } if !forced => (Box::new(DiffuseFibre), Part::KajiyaKay),
        HairShading::KajiyaKay { specular, exponent } => {
            (Box::new(KajiyaKayFibre::new(specular, exponent, face_width)), Part::Highlight)
        }
        HairShading::Marschner { color_is, roughness: [longitudinal, azimuthal], tilt, ior } => {
            let color_is = match color_is {
                description::ColorIs::Strand => marschner::ColorIs::Strand,
                description::ColorIs::DenseHair => marschner::ColorIs::DenseHair,
            };
            let parameters = marschner::Parameters { longitudinal, azimuthal, tilt, ior, color_is };
            (Box::new(Marschner::new(parameters, face_width)), Part::Marschner)
        }
    }
}
