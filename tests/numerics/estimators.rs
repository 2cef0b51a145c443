//! Every estimator of Γ on every hard case.

use tress::selftest::{Outcome, estimators, hard, maps};

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
fn deep_maps_and_shadow_rays_keep_to_the_truth_on_hard_cases() {
    all_hold(&maps::quick().expect("Embree"));
}

#[test]
#[ignore = "slow: 24 suns and lamps outside and among the hair"]
fn deep_maps_and_shadow_rays_keep_to_the_truth_in_all_lights() {
    all_hold(&maps::against_truth().expect("Embree"));
}

#[test]
fn deep_maps_come_nearer_to_the_truth_with_more_pixels() {
    // Of hair that lets light through; mean over the cases of the squares.
    let cases: Vec<_> =
        hard::all().into_iter().filter(|case| ["end-on", "segments below a digit"].contains(&case.name)).collect();
    assert_eq!(cases.len(), 2);
    let error = |resolution| {
        let squares = cases
            .iter()
            .map(|case| maps::compare(case, maps::Kind::Suns, Some(resolution)).expect("Embree").rms.powi(2));
        squares.sum::<f64>().sqrt()
    };
    let errors = [16, 32, 64, 128, 256].map(error);
    println!("{errors:.4?}");
    assert!(errors.windows(2).all(|e| e[1] < e[0]) && errors[4] < 0.25 * errors[0], "{errors:?}");
}

#[test]
fn a_hair_more_never_brightens() {
    all_hold(&[Outcome::one("a hair more", estimators::brighter().expect("Embree"))]);
}
