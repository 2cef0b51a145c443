//! Λ: the light that arrives at a point from the rest of the scene, hair left out.

pub mod distribution;
pub mod environment;
pub mod gather;
pub mod guide;
pub mod lights;
pub mod map;
pub mod photon;
pub mod sources;
pub mod specular;

pub use environment::{Environment, Radiance};
pub use gather::Illumination;
pub use lights::{DirectLight, Lamp, RectLight};
pub use map::{Map, Mapping};
pub use photon::{Caustics, PhotonMap};
pub use sources::Sources;
