//! `--memory-limit`: a run that would take more than it may is refused before it begins.

use std::path::Path;

use super::{Failure, values};
use crate::render::memory::{OverLimit, Work, estimate};
use crate::scene::Document;

/// The share of the memory that is free, in percent, where no limit is given.
const SHARE: u64 = 90;

/// `--memory-limit`, for the subcommands that load a scene.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(super) struct Memory {
    /// Refuse work that would take more memory than this, as in 2GiB; none for no limit. 90 % of what the machine has free unless given
    #[arg(long = "memory-limit", value_name = "SIZE", value_parser = limit, display_order = 800)]
    limit: Option<Limit>,
}

/// What is given with `--memory-limit`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Limit {
    None,
    Bytes(u64),
}

fn limit(text: &str) -> Result<Limit, String> {
    if text == "none" { Ok(Limit::None) } else { values::size(text).map(Limit::Bytes) }
}

impl Memory {
    /// An error where `work` on the scene would take more than it may.
    pub fn check(self, document: &Document, work: Work) -> Result<(), Failure> {
        let (limit, limit_is) = match self.limit {
            Some(Limit::None) => return Ok(()),
            Some(Limit::Bytes(bytes)) => (bytes, "--memory-limit"),
            None => match available() {
                Some(bytes) => (bytes / 100 * SHARE, "90 % of what the machine has free; --memory-limit sets another"),
                // Nothing to hold it against.
                None => return Ok(()),
            },
        };
        Ok(estimate(document, work).within(limit, limit_is, &document.path)?)
    }
}

impl From<OverLimit> for Failure {
    fn from(error: OverLimit) -> Self {
        Failure::Input(error.to_string())
    }
}

/// Threads that a run will have.
pub(super) fn thread_count(asked: Option<usize>) -> usize {
    asked.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
}

/// Memory that can be had without taking it from others, in bytes: the system's, and no more than the process's group may have.
/// None where the system does not say.
fn available() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let system = line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.saturating_mul(1024);
    Some(group_limit(Path::new("/sys/fs/cgroup")).map_or(system, |group| group.min(system)))
}

/// The limit of the process's control group and of those around it.
fn group_limit(root: &Path) -> Option<u64> {
    let groups = std::fs::read_to_string("/proc/self/cgroup").ok()?;
    let own = groups.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let folder = root.join(own);
    let limits = folder.ancestors().take_while(|folder| folder.starts_with(root));
    limits.filter_map(|folder| std::fs::read_to_string(folder.join("memory.max")).ok()?.trim().parse().ok()).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read() {
        assert_eq!((limit("none"), limit("2GiB")), (Ok(Limit::None), Ok(Limit::Bytes(2 << 30))));
        assert!(limit("much").unwrap_err().contains("as in 2GiB"));
    }

    #[test]
    fn the_machine_says_what_it_has() {
        let Some(bytes) = available() else { return eprintln!("skipped: the system does not say") };
        assert!(bytes > 1 << 20, "{bytes}");
    }
}
