//! The command line: one file a subcommand. Only this part of the program prints.

mod check;
mod completions;
mod crosscheck;
mod exit;
mod figure;
mod grow;
mod info;
pub mod interrupt;
mod log;
mod man;
mod memory;
mod pixel;
mod plan;
pub mod progress;
pub mod render;
mod schema;
mod selftest;
mod study;
mod summary;
pub mod values;

use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

pub use exit::Failure;

use crate::scene::{Document, SceneError};

/// Renders hair and fur in scenes with global illumination.
#[derive(Parser)]
#[command(name = "tress", version, about, after_long_help = exit::status_help(), propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    verbosity: Verbosity,
}

#[derive(Subcommand)]
enum Command {
    Render(render::Arguments),
    Check(check::Arguments),
    Crosscheck(crosscheck::Arguments),
    Figure(figure::Arguments),
    Plan(plan::Arguments),
    Study(study::Arguments),
    Info(info::Arguments),
    Grow(grow::Arguments),
    Schema(schema::Arguments),
    Selftest(selftest::Arguments),
    Man(man::Arguments),
    Completions(completions::Arguments),
}

/// How much is said on standard error.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct Verbosity {
    /// Print errors only: no warnings, no progress
    #[arg(long, short, global = true, conflicts_with = "verbose", display_order = 900)]
    pub quiet: bool,
    /// Say more: once for what is done, twice for details, three times for everything
    #[arg(long, short, global = true, action = clap::ArgAction::Count, display_order = 901)]
    pub verbose: u8,
}

/// `--set`, for the subcommands that read a scene.
#[derive(Args, Clone, Debug, Default)]
struct Overrides {
    #[arg(
        long,
        value_name = "KEY.PATH=VALUE",
        value_parser = values::setting,
        help = "Set a key of the scene, as in camera.fov=40 or hair[0].width=0.1"
    )]
    set: Vec<String>,
    /// Leave out an effect, whatever the scene calls for, as in --without area-lights; may be given several times. `tress plan` lists them
    #[arg(long, value_name = "EFFECT")]
    without: Vec<String>,
    /// Run an effect although the scene does not call for it, as in --with area-lights; may be given several times. It changes no pixel
    #[arg(long = "with", value_name = "EFFECT")]
    forced: Vec<String>,
}

impl Overrides {
    /// All of them as `key.path=value`.
    fn all(&self) -> Vec<String> {
        let mut all = self.set.clone();
        for (key, names) in [("without", &self.without), ("with", &self.forced)] {
            if !names.is_empty() {
                let names: Vec<String> = names.iter().map(|name| format!("{name:?}")).collect();
                all.push(format!("effects.{key}=[{}]", names.join(", ")));
            }
        }
        all
    }
}

/// Runs the program with the process's arguments.
pub fn main() -> ExitCode {
    exit::guard(|| match Cli::try_parse() {
        Ok(cli) => run(cli),
        Err(e) => {
            // Help and version come this way too. A closed pipe is no reason to complain.
            let _ = e.print();
            ExitCode::from(u8::try_from(e.exit_code()).unwrap_or(exit::USAGE))
        }
    })
}

fn run(cli: Cli) -> ExitCode {
    let verbosity = cli.verbosity;
    log::start(verbosity);
    let result = match cli.command {
        Command::Render(arguments) => render::run(arguments, verbosity),
        Command::Check(arguments) => check::run(arguments, verbosity),
        Command::Crosscheck(arguments) => crosscheck::run(arguments, verbosity),
        Command::Plan(arguments) => plan::run(arguments, verbosity),
        Command::Figure(arguments) => figure::run(arguments, verbosity),
        Command::Study(arguments) => study::run(arguments, verbosity),
        Command::Info(arguments) => info::run(arguments),
        Command::Grow(arguments) => grow::run(arguments, verbosity),
        Command::Schema(arguments) => schema::run(arguments),
        Command::Selftest(arguments) => selftest::run(&arguments, verbosity),
        Command::Man(arguments) => man::run(arguments),
        Command::Completions(arguments) => completions::run(arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            for line in failure.to_string().lines() {
                log::say(&format!("error: {line}"));
            }
            ExitCode::from(failure.code())
        }
    }
}

/// Reads a scene and prints its warnings.
fn load(scene: &std::path::Path, overrides: &[String], verbosity: Verbosity) -> Result<Document, Failure> {
    let document = crate::scene::load(scene, overrides)?;
    if !verbosity.quiet {
        for warning in &document.warnings {
            log::say(&format!("warning: {warning}"));
        }
    }
    Ok(document)
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        Failure::Input(error.to_string())
    }
}
