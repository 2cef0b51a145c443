//! `tress man`: manual pages.

use clap::CommandFactory;
use clap_mangen::Man;
use clap_mangen::roff::{Roff, bold, roman};

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
    write(&Man::new(command), &mut page).map_err(|e| Failure::Bug(format!("manual page: {e}")))?;
    exit::print(&page)
}

/// The page's sections; in place of the help's bottom, which roff would run together, a proper list of exit codes.
fn write(man: &Man, page: &mut Vec<u8>) -> std::io::Result<()> {
    man.render_title(page)?;
    man.render_name_section(page)?;
    man.render_synopsis_section(page)?;
    man.render_description_section(page)?;
    man.render_options_section(page)?;
    man.render_subcommands_section(page)?;
    let mut roff = Roff::new();
    roff.control("SH", ["EXIT STATUS"]);
    for (code, meaning) in exit::STATUS {
        roff.control("TP", []).text([bold(code.to_string())]).text([roman(meaning)]);
    }
    roff.to_writer(page)?;
    man.render_version_section(page)
}
