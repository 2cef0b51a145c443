//! `tress schema`: the scene file's JSON schema.

use super::{Failure, exit};

/// Print the JSON schema of a scene file: every key with its meaning, unit, range and default
#[derive(clap::Args)]
pub(crate) struct Arguments {}

pub(crate) fn run(_: Arguments) -> Result<(), Failure> {
    let mut text = serde_json::to_vec_pretty(crate::scene::schema()).map_err(|e| Failure::Bug(e.to_string()))?;
    text.push(b'\n');
    exit::print(&text)
}
