//! Studies of a scene: what the renderer's estimators and settings are worth on it, at single shading points and in whole pictures.

pub mod accuracy;
pub mod controlled;
pub mod crosscheck;
pub mod figure;
pub mod mosaic;
pub mod plot;
pub mod report;
pub mod shadow_check;
pub mod statistics;

pub use crosscheck::{Settings, crosscheck};
pub use report::{Report, Verdict};
