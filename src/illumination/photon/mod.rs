//! Light that surfaces have reflected more than once, by photons (Jensen 1996, "Global Illumination using Photon Maps").
//!
//! Photons leave the lights, are stored where they arrive, and give the irradiance there: all of it, and that of light which was reflected at least
//! once. Where the map's blur would be seen, rays to the lights find what arrives straight from them. Power in W, in render units.

mod aimed;
mod beams;
mod caustic;
mod emission;
mod hot;
mod map;
mod trace;

pub use aimed::Aimed;
pub use beams::MOST as MOST_BEAMS;
pub use caustic::Caustics;
pub use emission::{Emission, Emitter};
pub use hot::HotSpots;
pub use map::{Irradiance, PhotonMap};
pub use trace::{MOST, Photon, reflects, trace};

/// How photons are traced and counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Photons that leave the lights.
    pub photons: u32,
    /// Reflections after which a photon's way ends. What would follow is lost.
    pub max_bounces: u32,
    /// Photons of an estimate of irradiance.
    pub neighbours: u32,
    pub seed: u32,
}

/// How the photons of caustics are traced and counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CausticSettings {
    /// Photons that leave the lamps.
    pub photons: u32,
    /// Mirrors and glass that a photon meets at the most. What would follow is lost.
    pub depth: u32,
    /// Photons of an estimate.
    pub neighbours: u32,
    pub seed: u32,
}

#[cfg(test)]
mod caustic_tests;
#[cfg(test)]
mod tests;
