//! Hard cases stay numerically stable: the promises of docs/numerics.md, with more cases than `tress selftest` has time for.
//!
//! One file a theme. What a case is and what it must keep to stands in `tress::selftest`; what is only here needs real input, changes the
//! processor's mode, or takes minutes.

#[path = "../common/mod.rs"]
mod common;

mod estimators;
mod external;
mod machine;
mod multiprecision;
mod pictures;
mod pixel;
mod properties;
mod regressions;

use tress::selftest::Outcome;

/// Prints outcomes and fails where a bound is broken.
fn all_hold(outcomes: &[Outcome]) {
    for Outcome { name, cases, error, bound, .. } in outcomes {
        println!("{name:<52} {cases:>7} {error:9.2e} {bound:9.2e}");
    }
    let broken: Vec<&Outcome> = outcomes.iter().filter(|outcome| !outcome.ok).collect();
    assert!(broken.is_empty(), "{broken:#?}");
}
