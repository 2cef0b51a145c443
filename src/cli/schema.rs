//! `tress schema`: the scene file's JSON schema.

use super::{Failure, exit};

/// Print the JSON schema of a scene file: every key with its meaning, unit, range and default
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Print a reference for readers instead, in Markdown
    #[arg(long)]
    markdown: bool,
}

pub(crate) fn run(arguments: Arguments) -> Result<(), Failure> {
    if arguments.markdown {
        return exit::print(crate::scene::reference::markdown().as_bytes());
    }
    let mut text = serde_json::to_vec_pretty(crate::scene::schema()).map_err(|e| Failure::Bug(e.to_string()))?;
    text.push(b'\n');
    exit::print(&text)
}
