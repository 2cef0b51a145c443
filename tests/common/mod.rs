//! Shared by the tests that render whole scenes.
#![allow(dead_code, reason = "each test file uses a part")]

pub mod models;

use std::path::PathBuf;

use tress::render::progress::Unwatched;
use tress::render::{self, Film, Options, Statistics};
use tress::scene::{self, Scene};

/// Writes a scene file into a folder of its own and loads it with overrides.
pub fn load(text: &str, overrides: &[&str]) -> Scene {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).expect("a scene file");
    let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_owned()).collect();
    let document = scene::load(&path, &overrides).unwrap_or_else(|e| panic!("{e}"));
    Scene::load(document).unwrap_or_else(|e| panic!("{e}"))
}

/// Renders a scene given as text.
pub fn film(text: &str, overrides: &[&str], options: Options) -> (Film, Statistics) {
    let mut scene = load(text, overrides);
    render::render(&mut scene, &options, &Unwatched).unwrap_or_else(|e| panic!("{e}"))
}

/// Renders the whole picture.
pub fn whole(text: &str, overrides: &[&str]) -> (Film, Statistics) {
    film(text, overrides, Options::default())
}

/// The folder of real input, if it is there; says so if it is not.
pub fn data() -> Option<PathBuf> {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    if !folder.is_dir() {
        eprintln!("skipped: {} is not there", folder.display());
        return None;
    }
    Some(folder)
}

/// Mean over all pixels of the green channel.
pub fn mean(film: &Film) -> f64 {
    film.pixels.iter().map(|pixel| f64::from(pixel.beauty.y)).sum::<f64>() / film.pixels.len() as f64
}

/// Mean absolute difference of two films averaged over blocks of 8 x 8 pixels, as a share of the mean of the first.
pub fn block_difference(a: &Film, b: &Film) -> f64 {
    assert_eq!((a.width(), a.height()), (b.width(), b.height()));
    let (columns, rows) = (a.width().div_ceil(8), a.height().div_ceil(8));
    let mut differences = vec![(0.0_f64, 0.0_f64); columns * rows];
    for (i, (p, q)) in a.pixels.iter().zip(&b.pixels).enumerate() {
        let block = &mut differences[i / a.width() / 8 * columns + i % a.width() / 8];
        block.0 += f64::from(p.beauty.y - q.beauty.y);
        block.1 += 1.0;
    }
    let sum: f64 = differences.iter().map(|(sum, count)| (sum / count).abs()).sum();
    sum / differences.len() as f64 / mean(a)
}
