//! Γ: how much of each face of an igloo the hair lets through.

pub mod igloo;
pub mod projection;
