//! What is off executes nothing: instructions counted by Valgrind's callgrind, source file by source file.

#[path = "common/everything.rs"]
mod everything;
#[path = "common/program.rs"]
mod program;

use std::collections::HashMap;
use std::path::Path;
use std::process::Command;

use rayon::prelude::*;

/// Instructions of one render of the scene by source file, under a name of its own; files that were inlined elsewhere count under their own name.
fn instructions(folder: &Path, name: &str, overrides: &[&str]) -> HashMap<String, u64> {
    let file = folder.join(format!("{name}.callgrind"));
    let out = format!("--callgrind-out-file={}", file.display());
    let picture = format!("{name}.exr");
    let arguments = ["render", "scene.toml", "-q", "-o", &picture, "--threads", "1"];
    let command = Command::new("valgrind")
        .current_dir(folder)
        .args(["--tool=callgrind", &out, program::TRESS])
        .args(arguments)
        .args(overrides)
        .output();
    let (code, _, said) = program::told(&command.expect("valgrind runs"));
    assert_eq!(code, Some(0), "{said}");
    by_file(&std::fs::read_to_string(&file).expect("what callgrind wrote"))
}

/// Sums the lines of a profile: `fl`, `fi` and `fe` name the file of what follows, the line after `calls` is the called function's.
fn by_file(profile: &str) -> HashMap<String, u64> {
    let (mut names, mut sums) = (HashMap::new(), HashMap::<String, u64>::new());
    let (mut file, mut called) = (String::new(), false);
    for line in profile.lines() {
        let keys = ["fl=", "fi=", "fe=", "cfl=", "cfi="];
        if let Some((key, name)) = keys.iter().find_map(|key| Some((key, line.strip_prefix(key)?))) {
            // A number, and at its first use the name.
            let (number, name) = name.split_once(' ').unwrap_or((name, ""));
            if !name.is_empty() {
                names.insert(number.to_owned(), name.to_owned());
            }
            // The file of a called function is that of one line only, which does not count here.
            if !key.starts_with('c') {
                file = names.get(number).cloned().unwrap_or_default();
            }
        } else if line.starts_with("calls=") {
            called = true;
        } else if line.starts_with(|c: char| c.is_ascii_digit() || "+-*".contains(c)) && !std::mem::take(&mut called) {
            let count = line.split(' ').nth(1).and_then(|count| count.parse::<u64>().ok());
            *sums.entry(file.clone()).or_default() += count.unwrap_or(0);
        }
    }
    sums
}

fn of(sums: &HashMap<String, u64>, file: &str) -> u64 {
    let is_it = |name: &&String| name.ends_with(file) || file.ends_with('/') && name.contains(file);
    sums.keys().filter(is_it).map(|name| sums[name]).sum()
}

#[test]
fn profiles_are_summed() {
    let profile = "positions: line\nevents: Ir\nfl=(1) /a/src/one.rs\nfn=(1) f\n10 5\n+2 7\nfi=(2) /a/src/two.rs\n3 100\n\
                   fe=(1)\n* 1\ncfi=(3) /a/src/three.rs\ncfn=(2) g\ncalls=3 20\n4 1000\n5 2\n\nfl=(2)\nfn=(2)\n20 30\n\n\
                   fl=(3)\nfn=(3)\n7 4\n";
    let sums = by_file(profile);
    assert_eq!(["src/one.rs", "src/two.rs", "src/three.rs", "/src/"].map(|file| of(&sums, file)), [15, 130, 4, 149]);
}

/// What is made empty and dropped, once a render or a thread, and is not asked for again: less than an instruction a point.
const NOTHING: u64 = 500;

/// Each: what takes an effect away, and the source files that are its own.
const OWN: [(&[&str], &[&str]); 11] = [
    (&["--without", "surfaces"], &["src/embree/triangles.rs"]),
    // Caustics have maps of the same kind.
    (&["--without", "more-than-one-reflection", "--without", "caustics"], &["src/illumination/photon/"]),
    (
        &["--without", "caustics"],
        &["src/illumination/photon/aimed.rs", "src/illumination/photon/beams.rs", "src/illumination/photon/caustic.rs"],
    ),
    (&["--without", "light-reflected-by-surfaces"], &["src/illumination/photon/", "src/illumination/guide.rs"]),
    (&["--set", "indirect.sharing=0"], &["src/render/lighting/shared.rs"]),
    (&["--without", "deep-shadow-maps"], &["src/shadow/compress.rs"]),
    (&["--without", "shadow-maps"], &["src/shadow/plain.rs"]),
    (
        &["--without", "hair-occlusion-by-projection"],
        &["src/occlusion/clusters.rs", "src/occlusion/walk.rs", "src/occlusion/lanes.rs", "src/occlusion/query.rs"],
    ),
    (&["--set", "occlusion.mode=igloo", "--set", "occlusion.opening=1"], &["src/occlusion/accuracy.rs"]),
    (&["--set", "hair[1].shading=kajiya-kay"], &["src/shading/marschner/"]),
    (&["--set", "environment.sources=none"], &["src/illumination/sources.rs"]),
];

#[test]
#[ignore = "slow: eleven renders under valgrind"]
fn what_is_off_executes_nothing() {
    if Command::new("valgrind").arg("--version").output().is_err() {
        return eprintln!("skipped: there is no valgrind");
    }
    let folder = program::folder(&everything::full());
    let all = instructions(folder.path(), "all", &[]);
    let total = |sums: &HashMap<String, u64>| sums.values().sum::<u64>() as f64 / 1e6;
    eprintln!("everything: {:.1} million instructions", total(&all));
    let count = |(number, (overrides, _)): (usize, &(&[&str], _))| {
        instructions(folder.path(), &format!("without{number}"), overrides)
    };
    let renders: Vec<HashMap<String, u64>> = OWN.par_iter().enumerate().map(count).collect();
    let mut failed = Vec::new();
    for ((overrides, files), without) in OWN.into_iter().zip(renders) {
        eprintln!("{}: {:.1} million", overrides.join(" "), total(&without));
        for file in files {
            let (on, off) = (of(&all, file), of(&without, file));
            eprintln!("  {file}: {on} before, {off} now");
            // A profile without source lines would show nothing in either.
            assert!(on > 1000, "{file} is not in the profile: {on}");
            if off > NOTHING {
                failed.push(format!("{overrides:?}: {off} instructions of {file}"));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}
