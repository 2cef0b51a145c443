//! Safe, typed Embree: ray queries against triangles and against hair segments.
//!
//! A scene comes into being committed and is immutable from then on, so every scene that exists can be traced, by any number of threads.
//! Units: `distance`, `near` and `far` count in lengths of `direction`; with a unit direction they are in the unit of the vertices.
//!
//! Embree works in single precision: move a model to the origin and scale it to about unit size before building a scene of it.
//!
//! ```
//! use glam::Vec3;
//! use tress::embree::{Device, TriangleScene};
//!
//! let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
//! let scene = TriangleScene::build(&Device::new()?, corners, vec![[0, 1, 2]])?;
//! let hit = scene.closest(Vec3::new(0.25, 0.25, 2.0), Vec3::NEG_Z, 0.0, f32::INFINITY);
//! // Embree's reciprocals are rounded otherwise on each kind of processor.
//! assert!(hit.is_some_and(|hit| (hit.distance - 2.0).abs() < 1e-6));
//! # Ok::<(), tress::embree::Error>(())
//! ```

mod crossings;
mod curves;
mod device;
mod scene;
mod triangles;

pub use crossings::{Crossing, PACKET};
pub use curves::CurveScene;
pub use device::Device;
pub use triangles::{TriangleHit, TriangleScene};

use embree4_sys as sys;
use glam::Vec3;

/// Embree takes coordinates beyond this for invalid and drops what uses them without a word.
pub const LARGEST_COORDINATE: f32 = 1.8e18;

/// What can go wrong with Embree or with what it is given.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("Embree cannot start: {message}")]
    Start { message: String },
    #[error("the Embree library found at run time is version {}, Tress needs 4.3.0 or newer; check LD_LIBRARY_PATH, or run ffi/setup.sh", dotted(*.found))]
    Version { found: isize },
    #[error("Embree failed while {during}: {message} ({code})")]
    Library { during: &'static str, code: String, message: String },
    #[error("vertex {index} is {value}; coordinates must be finite and below {LARGEST_COORDINATE:e}")]
    Vertex { index: usize, value: String },
    #[error("vertex {index} has radius {radius}; a radius must be finite and not negative")]
    Radius { index: usize, radius: f32 },
    #[error("triangle {index} uses vertices {vertices:?}, but there are only {count}")]
    Triangle { index: usize, vertices: [u32; 3], count: usize },
    #[error("segment {index} runs from vertex {first} to the next, but there are only {count}")]
    Segment { index: usize, first: u32, count: usize },
    #[error("{count} {what} in one scene are more than Embree can number")]
    TooMany { what: &'static str, count: usize },
}

fn dotted(version: isize) -> String {
    format!("{}.{}.{}", version / 10000, version / 100 % 100, version % 100)
}

/// A ray as Embree wants it, or none where a query could not hit anything by rights: what is not finite, no direction, an empty range.
fn embree_ray(origin: Vec3, direction: Vec3, near: f32, far: f32) -> Option<sys::RTCRay> {
    let sound = origin.is_finite() && direction.is_finite() && direction != Vec3::ZERO && near >= 0.0 && near <= far;
    sound.then_some(sys::RTCRay {
        org_x: origin.x,
        org_y: origin.y,
        org_z: origin.z,
        tnear: near,
        dir_x: direction.x,
        dir_y: direction.y,
        dir_z: direction.z,
        time: 0.0,
        tfar: far,
        mask: u32::MAX,
        id: 0,
        flags: 0,
    })
}

fn check_coordinates(index: usize, position: Vec3) -> Result<(), Error> {
    // Written so that NaN fails.
    if position.abs().max_element() < LARGEST_COORDINATE && position.is_finite() {
        return Ok(());
    }
    Err(Error::Vertex { index, value: position.to_string() })
}

fn check_count(what: &'static str, count: usize) -> Result<(), Error> {
    // u32::MAX itself means "none".
    if count < u32::MAX as usize { Ok(()) } else { Err(Error::TooMany { what, count }) }
}
