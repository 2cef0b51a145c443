//! Exit codes, and what becomes of errors and bugs.

use std::io::{self, Write};
use std::panic::{self, AssertUnwindSafe};
use std::path::Path;
use std::process::ExitCode;

use crate::file::write_whole;

/// The command line was wrong.
pub(crate) const USAGE: u8 = 2;

/// Every exit code and its meaning, for the help and the manual page.
pub(crate) const STATUS: [(u8, &str); 9] = [
    (0, "done"),
    (1, "a bug in tress"),
    (USAGE, "the command line is wrong"),
    (3, "the scene, or a file that it names, is wrong"),
    (4, "the output cannot be written"),
    (5, "the two estimators of hair occlusion differ by more than the accuracy"),
    (6, "with --strict: values that are not finite were met"),
    (7, "selftest: a number differs from its truth by more than its bound"),
    (130, "interrupted (Ctrl-C)"),
];

/// The bottom of the help.
pub(crate) fn status_help() -> String {
    let lines: Vec<String> = STATUS.iter().map(|(code, meaning)| format!("  {code:<4} {meaning}")).collect();
    format!("Exit status:\n{}", lines.join("\n"))
}

/// Why a subcommand did not do its work; the display is what the user reads.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// The command line is wrong in a way that its parser cannot tell.
    #[error("{0}")]
    Usage(String),
    /// The scene or a file that it names is wrong.
    #[error("{0}")]
    Input(String),
    /// The output cannot be written.
    #[error("{0}")]
    Output(String),
    /// The two estimators of hair occlusion differ by more than the accuracy.
    #[error("{0}")]
    Disagreement(String),
    /// With `--strict`: values that are not finite were met.
    #[error("{0}")]
    NonFinite(String),
    /// The self-test found numbers beyond their bounds.
    #[error("{0}")]
    Unsound(String),
    /// The user stopped it.
    #[error("interrupted")]
    Interrupted,
    /// Our fault.
    #[error("{0}")]
    Bug(String),
}

impl Failure {
    /// The program's exit code.
    pub fn code(&self) -> u8 {
        match self {
            Failure::Bug(_) => 1,
            Failure::Usage(_) => USAGE,
            Failure::Input(_) => 3,
            Failure::Output(_) => 4,
            Failure::Disagreement(_) => 5,
            Failure::NonFinite(_) => 6,
            Failure::Unsound(_) => 7,
            Failure::Interrupted => 130,
        }
    }
}

/// Runs the program; a panic becomes a short message and exit code 1.
pub(crate) fn guard(program: impl FnOnce() -> ExitCode) -> ExitCode {
    let normal = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        // Not eprintln!, which panics when standard error is closed.
        let _ = writeln!(io::stderr(), "{}", bug_message(info));
        if std::env::var_os("RUST_BACKTRACE").is_some_and(|value| value != "0") {
            normal(info);
        }
    }));
    panic::catch_unwind(AssertUnwindSafe(program)).unwrap_or(ExitCode::from(1))
}

fn bug_message(info: &panic::PanicHookInfo<'_>) -> String {
    let payload = info.payload();
    let text = payload.downcast_ref::<&str>().copied().or(payload.downcast_ref::<String>().map(String::as_str));
    let place = info.location().map_or_else(String::new, |at| format!(" ({}:{})", at.file(), at.line()));
    format!(
        "this is a bug in tress {}: {}{place}\nPlease report it with the command and the scene. RUST_BACKTRACE=1 shows more.",
        env!("CARGO_PKG_VERSION"),
        text.unwrap_or("no message"),
    )
}

/// What a subcommand that looks at several files ends with: every fault that was found, or none.
pub(crate) fn unless_faulty(faults: &[String]) -> Result<(), Failure> {
    if faults.is_empty() { Ok(()) } else { Err(Failure::Input(faults.join("\n"))) }
}

/// Writes a file of text, whole or not at all; `what` is in the message, as in "cannot write statistics".
pub(crate) fn write_text(path: &Path, text: &str, what: &str) -> Result<(), Failure> {
    write_whole(path, |out| out.write_all(text.as_bytes()))
        .map_err(|e| Failure::Output(format!("{}: cannot write {what}: {e}", path.display())))
}

/// Writes to standard output. A reader that closed it early (`| head`) has what it wanted: that is no error.
pub(crate) fn print(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::Output(format!("cannot write to standard output: {e}")))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_exit_code_1() {
        assert_eq!(guard(|| panic!("on purpose")), ExitCode::from(1));
        assert_eq!(guard(|| ExitCode::from(3)), ExitCode::from(3));
    }

    #[test]
    fn the_help_lists_each_code() {
        let text = String::new;
        for failure in [
            Failure::Usage(text()),
            Failure::Input(text()),
            Failure::Output(text()),
            Failure::Disagreement(text()),
            Failure::NonFinite(text()),
            Failure::Unsound(text()),
            Failure::Interrupted,
            Failure::Bug(text()),
        ] {
            assert!(STATUS.iter().any(|(code, _)| *code == failure.code()), "{failure:?}");
        }
    }
}
