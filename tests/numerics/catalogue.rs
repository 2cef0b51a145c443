//! The catalogue of docs/numerics.md names checks that exist.

use std::path::Path;

use tress::selftest::{hard, pictures};

/// All Rust source below a folder of the project, file by file.
fn sources(folder: &str) -> Vec<String> {
    let mut open = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)];
    let mut texts = Vec::new();
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                texts.push(std::fs::read_to_string(&path).unwrap());
            }
        }
    }
    texts
}

/// Names of all functions with the attribute `#[test]`, whatever other attributes stand between.
fn tests() -> Vec<String> {
    let mut names = Vec::new();
    for text in [sources("src"), sources("tests")].concat() {
        let mut marked = false;
        for line in text.lines().map(str::trim) {
            if line == "#[test]" {
                marked = true;
            } else if let Some(rest) = line.strip_prefix("fn ").filter(|_| marked) {
                names.extend(rest.split('(').next().map(str::to_owned));
                marked = false;
            }
        }
    }
    names
}

/// Names of `tress selftest`: those put together from a case, and those that stand in its source as they are.
fn outcome_exists(name: &str, source: &[String]) -> bool {
    let of_case = || hard::all().iter().any(|hard| name.strip_prefix("Γ, ") == Some(hard.name));
    let of_picture = || {
        let change = name.strip_prefix("picture, ").and_then(|rest| rest.split_once(": "));
        change.is_some_and(|(light, change)| {
            ["direct", "sky"].contains(&light) && pictures::changes().iter().any(|known| known.name == change)
        })
    };
    let quoted = format!("\"{name}\"");
    of_case() || of_picture() || source.iter().any(|text| text.contains(&quoted))
}

/// What stands between backquotes.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

#[test]
fn every_row_of_the_catalogue_names_a_check() {
    let document = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/numerics.md")).unwrap();
    let catalogue = document.split("## ").find(|part| part.starts_with("Catalogue")).expect("a catalogue");
    let (tests, selftest) = (tests(), sources("src/selftest"));
    let exists = |name: &str| {
        let of_selftest = name.contains(": ") || name.starts_with("Γ, ");
        if of_selftest { outcome_exists(name, &selftest) } else { tests.iter().any(|test| test == name) }
    };
    let rows: Vec<Vec<&str>> = catalogue
        .lines()
        .filter(|line| line.starts_with("| ") && !line.starts_with("| **"))
        .skip(1)
        .map(|line| line.trim_matches('|').split(" | ").map(str::trim).collect())
        .collect();
    assert!(rows.len() >= 38, "{} rows", rows.len());
    for row in rows {
        let [place, _, _, _, check] = row[..] else { panic!("not five columns: {row:?}") };
        assert!(check.starts_with("the same") || quoted(check).next().is_some(), "no check of {place}");
        for name in quoted(check) {
            assert!(exists(name), "{place}: there is no check {name}");
        }
    }
}
