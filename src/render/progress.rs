//! How long work tells its caller how far it is, and learns that it should stop.

/// Watches long work; called from any of its threads, so all methods must be cheap.
pub trait Progress: Sync {
    /// A new stage begins, of `total` steps (0: not known).
    fn stage(&self, name: &str, total: u64);
    /// `n` more steps of the stage are done.
    fn advance(&self, n: u64);
    /// Something worth a line of its own.
    fn message(&self, text: &str);
    /// Whether the work should stop as soon as it can, keeping what it has.
    fn cancelled(&self) -> bool;
}

/// Nobody watches, and nobody stops the work.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Progress for Unwatched {
    fn stage(&self, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn message(&self, _: &str) {}
    fn cancelled(&self) -> bool {
        false
    }
}
