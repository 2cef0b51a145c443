//! The properties of `tress::selftest`, each with cases that proptest makes, and shrinks where one fails.

use std::path::Path;

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use tress::selftest::{Draw, NUMBERS, Property, hard, pictures, properties};

/// Cases of the slow suite, at least.
const MANY: u32 = 10_000;

/// Numbers of a case: uniform, and now and then one from the ends of the range or its middle.
fn numbers() -> impl Strategy<Value = Vec<f64>> {
    let number = prop_oneof![29 => 0.0..1.0_f64, 1 => Just(0.0), 1 => Just(1.0 - f64::EPSILON), 1 => Just(0.5)];
    prop::collection::vec(number, NUMBERS)
}

fn check(property: &Property, cases: u32) -> Result<(), String> {
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(
        config,
        prop::test_runner::TestRng::deterministic_rng(prop::test_runner::RngAlgorithm::ChaCha),
    );
    let outcome = runner.run(&numbers(), |numbers| {
        let measured = (property.check)(&mut Draw::new(&numbers));
        prop_assert!(measured.holds(), "error {:e}, bound {:e}", measured.error, measured.bound);
        Ok(())
    });
    outcome.map_err(|e| format!("{}: {e}", property.name))
}

fn check_all(cases: impl Fn(&Property) -> u32) {
    let broken: Vec<String> = properties().iter().filter_map(|p| check(p, cases(p)).err()).collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn every_property_holds() {
    check_all(|property| (property.quick / 4).clamp(20, 500));
}

#[test]
#[ignore = "slow: ten thousand cases of each property"]
fn every_property_holds_in_ten_thousand_cases() {
    check_all(|_| MANY);
}

#[test]
fn numbered_cases_hold() {
    for property in properties() {
        let outcome = property.outcome(property.quick);
        println!(
            "{:<40} {:>6} {:9.2e} {:9.2e} worst {:?}",
            outcome.name, outcome.cases, outcome.error, outcome.bound, outcome.worst
        );
    }
    let broken: Vec<_> = properties().iter().map(|p| p.outcome(p.quick)).filter(|o| !o.ok).collect();
    assert!(broken.is_empty(), "{broken:#?}");
}

#[test]
fn names_are_different() {
    let mut names: Vec<_> = properties().iter().map(|p| p.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), properties().len());
}

/// Every row of docs/numerics.md's catalogue names a check, and each check named is there: a property, a hard case, a picture or a test.
#[test]
fn the_catalogue_names_checks_that_are_there() {
    let read = |path: &str| std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).expect(path);
    let sources =
        ["estimators", "external", "machine", "multiprecision", "pictures", "pixel", "properties", "regressions"]
            .map(|name| format!("tests/numerics/{name}.rs"));
    let of_units =
        ["src/fragment/footprint.rs", "src/occlusion/ribbon/tests.rs", "src/illumination/photon/tests.rs"].map(read);
    let tests: String = sources.iter().map(|path| read(path)).chain(of_units).collect();
    let mut names: Vec<String> = properties().iter().map(|property| property.name.to_owned()).collect();
    names.extend(hard::all().iter().map(|case| format!("Γ, {}", case.name)));
    names.extend(pictures::changes().iter().map(|change| format!("picture, direct: {}", change.name)));
    let document = read("docs/numerics.md");
    let (_, catalogue) = document.split_once("## Catalogue").expect("a catalogue");
    let (catalogue, _) = catalogue.split_once("## Estimators").expect("its end");
    let mut rows = 0;
    for row in catalogue.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| **")) {
        let cells: Vec<&str> = row.trim_matches('|').split(" | ").collect();
        if cells[0].trim() == "place" {
            continue;
        }
        assert_eq!(cells.len(), 5, "{row}");
        let checks: Vec<&str> = cells[4].split('`').skip(1).step_by(2).collect();
        assert!(!checks.is_empty() || cells[4].contains("the same"), "no check: {row}");
        for check in checks {
            let there = names.iter().any(|name| name == check) || tests.contains(&format!("fn {check}("));
            assert!(there, "no such check: {check}");
        }
        rows += 1;
    }
    assert!(rows >= 38, "{rows}");
}
