//! Λ: the light that arrives at a point from the rest of the scene, hair left out.

pub mod environment;
pub mod gather;
pub mod lights;
pub mod photon;

pub use environment::{Environment, Radiance};
pub use gather::Illumination;
pub use lights::{DirectLight, RectLight};
pub use photon::PhotonMap;
