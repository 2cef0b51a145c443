//! `tress grow`: grows a scene's hair and writes it to a file.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use super::check::{count, notes};
use super::memory::Memory;
use super::{Failure, Overrides, Verbosity, exit, interrupt, load, log, values};
use crate::hair::{Strands, formats, inspect, join};
use crate::render::memory::Work;
use crate::scene::{Document, GrownHair};

/// Grow the hair of a scene and write it to a HAIR file, in the scene's space
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The scene file (.toml or .json)
    scene: PathBuf,
    /// The file to write (.hair)
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    memory: Memory,
    /// The frame whose files are read, where names hold a run of #
    #[arg(long, value_name = "N", default_value_t = 1)]
    frame: u32,
}

pub(crate) fn run(arguments: Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let output = &arguments.output;
    if !output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("hair")) {
        let message = format!("{}: hair is written as HAIR files only; let the name end in .hair", output.display());
        return Err(Failure::Usage(message));
    }
    let document = load(&arguments.scene, &arguments.overrides.all(), verbosity)?.at_frame(arguments.frame);
    if !document.description.hair.iter().any(|hair| hair.grow.is_some()) {
        let scene = arguments.scene.display();
        return Err(Failure::Input(format!("{scene}: no hair of this scene is grown; give a [[hair]] the key grow")));
    }
    values::folder_exists(output)?;
    arguments.memory.check(&document, Work::Grow)?;
    interrupt::install().map_err(|e| Failure::Bug(format!("cannot catch Ctrl-C: {e}")))?;
    let (grown, strands) = unless_interrupted(move || grow(&document))??;
    // Not interrupted any more: an unfinished temporary file would stay behind.
    formats::write_hair(&strands, output).map_err(|e| Failure::Output(e.to_string()))?;
    if verbosity.quiet {
        return Ok(());
    }
    notes(&grown.notes);
    for oddity in inspect::inspect(&strands).suspicious {
        log::say(&format!("warning: {}: {oddity}", output.display()));
    }
    exit::print(summary(output, &grown, &strands).as_bytes())
}

/// The grown hair, object by object and all in one.
fn grow(document: &Document) -> Result<(GrownHair, Strands), Failure> {
    let mut grown = GrownHair::of(document)?;
    let scene = document.path.display();
    let parts: Vec<&Strands> = grown.objects.iter().map(|(_, strands)| strands).collect();
    let strands = join::join(&parts)
        .ok_or_else(|| Failure::Input(format!("{scene}: more than {} points in all; grow fewer strands", u32::MAX)))?;
    if strands.strand_count() == 0 {
        let notes = std::mem::take(&mut grown.notes).join("; ");
        return Err(Failure::Input(format!("{scene}: no sound strand was grown: {notes}")));
    }
    Ok((grown, strands))
}

/// What `work` returns, unless the user asks the program to stop before that: the work is then left to die with it.
fn unless_interrupted<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Failure> {
    let (sender, receiver) = mpsc::channel();
    let worker = std::thread::spawn(move || sender.send(work()).is_ok());
    loop {
        match receiver.recv_timeout(Duration::from_millis(50)) {
            Ok(result) => return Ok(result),
            Err(RecvTimeoutError::Timeout) if interrupt::requested() => return Err(Failure::Interrupted),
            Err(RecvTimeoutError::Timeout) => {}
            // It panicked: a bug like one on this thread.
            Err(RecvTimeoutError::Disconnected) => match worker.join() {
                Err(panic) => std::panic::resume_unwind(panic),
                Ok(_) => return Err(Failure::Bug("a worker ended without a result".to_owned())),
            },
        }
    }
}

fn summary(output: &Path, grown: &GrownHair, strands: &Strands) -> String {
    let mut text = format!(
        "{}: {}, {}\n",
        output.display(),
        count(strands.strand_count(), "strand"),
        count(strands.segment_count(), "segment")
    );
    for (name, strands) in &grown.objects {
        let strands = count(strands.strand_count(), "strand");
        text.push_str(&format!("  {name}: {strands}\n"));
    }
    text
}
