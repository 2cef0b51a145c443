//! The paper's figures as scenes: each shows what the paper's shows. Small pictures of `scenes/paper/`.

use std::path::PathBuf;

use tress::image::RgbImage;
use tress::render::progress::Unwatched;
use tress::study::figure::{Drawn, Figure};

fn draw(number: u32, side: [u32; 2], set: &[&str]) -> Drawn {
    let path = PathBuf::from(format!("{}/scenes/paper/figure{number:02}.toml", env!("CARGO_MANIFEST_DIR")));
    let figure = Figure::read(&path).unwrap_or_else(|e| panic!("{e}"));
    let size = format!("camera.resolution=[{},{}]", side[0], side[1]);
    let set: Vec<String> = std::iter::once(size).chain(set.iter().map(|s| (*s).to_owned())).collect();
    figure.draw(&path, &set, None, &Unwatched).unwrap_or_else(|e| panic!("{e}"))
}

/// The pixels of a part of a picture, given in shares of its sides: x0, y0, x1, y1.
fn part(picture: &RgbImage, [x0, y0, x1, y1]: [f64; 4]) -> Vec<[f64; 3]> {
    let (width, height) = (picture.width as f64, picture.height as f64);
    let mut pixels = Vec::new();
    for y in (y0 * height) as usize..(y1 * height) as usize {
        for x in (x0 * width) as usize..(x1 * width) as usize {
            pixels.push(picture.pixels[y * picture.width as usize + x].map(f64::from));
        }
    }
    pixels
}

fn mean(pixels: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|channel| pixels.iter().map(|p| p[channel]).sum::<f64>() / pixels.len() as f64)
}

/// Standard deviation over squares of 3x3 pixels, in shares of their mean, averaged over a part: contrast at the scale of strands.
fn contrast(picture: &RgbImage, [x0, y0, x1, y1]: [f64; 4]) -> f64 {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let (mut sum, mut count) = (0.0, 0.0);
    for y in (y0 * height as f64) as usize..(y1 * height as f64) as usize - 2 {
        for x in (x0 * width as f64) as usize..(x1 * width as f64) as usize - 2 {
            let square: Vec<f64> =
                (0..9).map(|i| f64::from(picture.pixels[(y + i / 3) * width + x + i % 3][1])).collect();
            let mean = square.iter().sum::<f64>() / 9.0;
            let variance = square.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 9.0;
            if mean > 1e-4 {
                sum += variance.sqrt() / mean;
                count += 1.0;
            }
        }
    }
    sum / f64::max(count, 1.0)
}

#[test]
#[ignore = "slow: whole pictures with photons"]
fn in_the_cornell_box_walls_colour_the_hair_and_occlusion_keeps_its_structure() {
    let drawn = draw(1, [90, 90], &["indirect.photons=50000"]);
    let [direct, free, ours] = [0, 1, 2].map(|n| &drawn.panels[n]);
    // What gathering adds, on the hair's left and right.
    let gain = |region| {
        let (a, b) = (mean(&part(ours, region)), mean(&part(direct, region)));
        [0, 1].map(|channel| a[channel] - b[channel])
    };
    let [left, right] = [gain([0.28, 0.5, 0.36, 0.72]), gain([0.64, 0.5, 0.72, 0.72])];
    println!("gain left {left:?}, right {right:?}");
    assert!(left.iter().chain(&right).all(|gain| *gain > 0.0));
    assert!(left[0] / left[1] > 1.3 * right[0] / right[1], "red on the left, green on the right");
    let middle = [0.4, 0.42, 0.6, 0.7];
    let [flat, structured] = [free, ours].map(|picture| contrast(picture, middle));
    println!("contrast {flat} without, {structured} with occlusion");
    assert!(structured > 1.2 * flat, "{structured} against {flat}");
}

#[test]
#[ignore = "slow: whole pictures"]
fn coloured_lamps_colour_the_sides_that_see_them() {
    let drawn = draw(12, [80, 80], &[]);
    let lamps = &drawn.panels[1];
    let (left, right) = (mean(&part(lamps, [0.2, 0.4, 0.35, 0.6])), mean(&part(lamps, [0.65, 0.4, 0.8, 0.6])));
    let top = mean(&part(lamps, [0.55, 0.08, 0.75, 0.16]));
    println!("left {left:?}, right {right:?}, top {top:?}");
    assert!(left[0] > 2.0 * left[2] && right[2] > 2.0 * right[0], "red from the left, blue from the right");
    assert!(top[1] > top[0].max(top[2]), "green from behind");
}

#[test]
#[ignore = "slow: whole pictures"]
fn a_lock_softens_as_its_strands_let_light_through() {
    let drawn = draw(14, [64, 100], &[]);
    let contrasts: Vec<f64> = drawn.panels.iter().map(|panel| contrast(panel, [0.35, 0.2, 0.65, 0.8])).collect();
    println!("contrast {contrasts:?}");
    assert!(contrasts.windows(2).all(|pair| pair[1] < pair[0]), "{contrasts:?}");
    assert!(contrasts[4] < 0.6 * contrasts[0], "{contrasts:?}");
}

#[test]
#[ignore = "slow: whole pictures"]
fn under_a_white_sky_only_occlusion_shows_the_teapot() {
    let drawn = draw(15, [100, 100], &["hair[0].grow.count=20000"]);
    let spread = |picture: &RgbImage| {
        let pixels = part(picture, [0.3, 0.45, 0.7, 0.75]);
        let mean = mean(&pixels)[1];
        (pixels.iter().map(|p| (p[1] - mean).powi(2)).sum::<f64>() / pixels.len() as f64).sqrt() / mean
    };
    let [flat, formed] = [0, 1].map(|n| spread(&drawn.panels[n]));
    println!("spread {flat} without, {formed} with occlusion");
    assert!(formed > 1.5 * flat, "{formed} against {flat}");
}

#[test]
#[ignore = "slow: every segment by itself"]
fn the_papers_assumptions_save_time_and_clusters_save_more() {
    // Of a smaller model: in that of the figure every segment is looked at from thousands of points.
    let fewer = ["hair[0].grow.count=1200", "hair[0].grow.width_root=0.012", "hair[0].grow.width_tip=0.008"];
    let drawn = draw(7, [400, 400], &[&fewer[..], &["indirect.mode=single-bounce"]].concat());
    let gamma = |panel: usize| drawn.reports[panel].statistics.as_ref().expect("a picture").cpu_seconds.gamma;
    let levels = |panel: usize| drawn.reports[panel].difference.expect("a difference");
    println!("hair occlusion: all {} s, thinned {} s, clusters {} s", gamma(1), gamma(2), gamma(5));
    println!("differences: {:?}, {:?}", levels(3), levels(6));
    assert!(gamma(1) > 5.0 * gamma(2) && gamma(1) > 20.0 * gamma(5));
    // Clusters are both quicker and nearer; few strands are left of a tenth of so small a model.
    let (thinned, clusters) = (levels(3).mean, levels(6).mean);
    assert!(clusters.iter().zip(&thinned).all(|(clusters, thinned)| *clusters < 8.0 && 2.0 * clusters < *thinned));
}
