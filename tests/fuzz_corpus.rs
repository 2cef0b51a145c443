//! The fuzz targets' corpora, run through the same functions as an ordinary test: what once went wrong stays right.

#[path = "../fuzz/src/lib.rs"]
mod targets;

use std::path::Path;

/// Runs a target on each file of its corpus; how many there are.
fn replay(name: &str, target: fn(&[u8])) -> usize {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(name);
    let mut files: Vec<_> = std::fs::read_dir(&folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    for file in &files {
        let bytes = std::fs::read(file).unwrap();
        // A panic names the target's file, not the input's.
        let run = std::panic::catch_unwind(|| target(&bytes));
        assert!(run.is_ok(), "{}", file.display());
    }
    files.len()
}

macro_rules! corpora {
    ($($name:ident)*) => {
        $(
            #[test]
            fn $name() {
                let count = replay(stringify!($name), targets::$name);
                assert!(count >= 5, "{count} files");
            }
        )*

        #[test]
        fn every_corpus_has_a_target_and_all_are_small() {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus");
            let mut bytes = 0;
            for entry in std::fs::read_dir(&folder).unwrap() {
                let entry = entry.unwrap();
                let name = entry.file_name().into_string().unwrap();
                assert!([$(stringify!($name)),*].contains(&&*name), "{name} is replayed by no test");
                let files = std::fs::read_dir(entry.path()).unwrap();
                bytes += files.map(|file| file.unwrap().metadata().unwrap().len()).sum::<u64>();
            }
            assert!(bytes < 1 << 20, "{bytes} bytes");
        }
    };
}

corpora! { hair obj scene_toml scene_json options figure igloo image }
