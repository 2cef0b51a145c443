//! `tress man`: manual pages.

use clap::CommandFactory;

use super::{Cli, Failure, exit};

/// Print the manual page in roff, as for `man -l -`
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The subcommand whose page is wanted; that of the whole program unless given
    command: Option<String>,
}

pub(crate) fn run(arguments: Arguments) -> Result<(), Failure> {
    let mut whole = Cli::command();
    // Built first, so that subcommands know the global options and their full names.
    whole.build();
    let command = match &arguments.command {
        None => whole,
        Some(name) => whole.find_subcommand(name).cloned().ok_or_else(|| {
            let names: Vec<&str> = whole.get_subcommands().map(clap::Command::get_name).collect();
            Failure::Usage(format!("no subcommand is called \"{name}\"; there are {}", names.join(", ")))
        })?,
    };
    let mut page = Vec::new();
    clap_mangen::Man::new(command).render(&mut page).map_err(|e| Failure::Bug(format!("manual page: {e}")))?;
    exit::print(&page)
}
