//! Every estimator of Γ on every hard case.

use tress::selftest::{Outcome, estimators};

use crate::all_hold;

#[test]
fn estimators_keep_to_the_truth_on_hard_cases() {
    all_hold(&estimators::against_truth(5_000).expect("Embree"));
}

#[test]
#[ignore = "slow: 200,000 directions of brute force a point"]
fn estimators_keep_to_a_finer_truth_on_hard_cases() {
    all_hold(&estimators::against_truth(200_000).expect("Embree"));
}

#[test]
fn a_hair_more_never_brightens() {
    all_hold(&[Outcome::one("a hair more", estimators::brighter().expect("Embree"))]);
}
