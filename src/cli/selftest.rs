//! `tress selftest`: the numbers of this program on this machine, against independent truths.

use super::exit::print;
use super::{Failure, Verbosity};
use crate::selftest::{self, Error, Outcome};

/// Check the program's numbers on this machine against independent truths: hard cases, the estimators of hair occlusion, pictures that must not change
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Print the outcomes as JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let table = !arguments.json && !verbosity.quiet;
    if table {
        print(format!("{:<52} {:>7} {:>9} {:>9}\n", "check", "cases", "error", "bound").as_bytes())?;
    }
    let mut printed = Ok(());
    let outcomes = selftest::run(|outcome| {
        if table && printed.is_ok() {
            printed = print(line(outcome).as_bytes());
        }
    })?;
    printed?;
    if arguments.json {
        let text = serde_json::to_string_pretty(&outcomes).map_err(|e| Failure::Bug(e.to_string()))?;
        print(format!("{text}\n").as_bytes())?;
    }
    verdict(&outcomes)?;
    if table {
        print(format!("all {} checks keep their bounds\n", outcomes.len()).as_bytes())?;
    }
    Ok(())
}

fn line(outcome: &Outcome) -> String {
    let Outcome { name, cases, error, bound, ok, .. } = outcome;
    // Counts the letters, not the bytes, of Γ.
    format!("{name:<52} {cases:>7} {error:>9.1e} {bound:>9.1e} {}\n", if *ok { "ok" } else { "BROKEN" })
}

fn verdict(outcomes: &[Outcome]) -> Result<(), Failure> {
    let broken: Vec<&Outcome> = outcomes.iter().filter(|outcome| !outcome.ok).collect();
    if broken.is_empty() {
        return Ok(());
    }
    let mut text = format!("{} of {} checks exceed their bounds:", broken.len(), outcomes.len());
    for outcome in broken {
        let case = outcome.worst.map_or_else(String::new, |case| format!(" (case {case})"));
        text += &format!("\n  {}: {:e}, more than {:e}{case}", outcome.name, outcome.error, outcome.bound);
    }
    text += "\nThis machine or this build gives other numbers than it should: please report the table with the processor's name.";
    Err(Failure::Unsound(text))
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::Folder(_) => Failure::Output(error.to_string()),
            Error::Render(error) => error.into(),
            Error::Embree(_) | Error::Scene(_) => Failure::Bug(error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selftest::Measured;

    #[test]
    fn a_broken_bound_is_named_with_its_case() {
        let sound = Outcome::one("a", Measured { error: 1.0, bound: 2.0 });
        assert_eq!(verdict(std::slice::from_ref(&sound)), Ok(()));
        let broken = Outcome { worst: Some(7), ..Outcome::one("b", Measured { error: f64::NAN, bound: 2.0 }) };
        assert!(line(&broken).contains("BROKEN"));
        let failure = verdict(&[sound, broken]).unwrap_err();
        assert_eq!(failure.code(), 7);
        assert!(failure.to_string().contains("b: NaN, more than 2e0 (case 7)"), "{failure}");
    }
}
