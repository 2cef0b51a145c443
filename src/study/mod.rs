//! Studies of a scene: what the renderer's estimators are worth on it. They look at a few shading points closely and make no picture.

pub mod crosscheck;
pub mod plot;
pub mod report;
pub mod statistics;

pub use crosscheck::{Settings, crosscheck};
pub use report::{Report, Verdict};
