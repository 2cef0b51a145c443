//! Light that neighbouring points on hair share, against rays of each point's own.

mod common;

use common::{film, whole};
use tress::fragment::PixelRect;
use tress::render::{Film, Options, Statistics};
use tress::tally::Work;

/// A tuft between a red and a green wall, under a lamp.
const ROOM: &str = r#"
[camera]
position = [0, 0.1, 3.4]
fov = 20
resolution = [40, 40]
[[surface]]
plane = { center = [0, -0.5, 0], normal = [0, 1, 0], size = [2, 2] }
[[surface]]
plane = { center = [-0.8, 0.3, 0], normal = [1, 0, 0], size = [2, 2] }
color = [0.7, 0.1, 0.1]
[[surface]]
plane = { center = [0.8, 0.3, 0], normal = [-1, 0, 0], size = [2, 2] }
color = [0.1, 0.6, 0.1]
[[surface]]
name = "ball"
sphere = { radius = 0.3 }
color = [0.5, 0.4, 0.3]
[[hair]]
color = [0.8, 0.8, 0.8]
specular = [0.1, 0.1, 0.1]
transparency = 0.5
grow = { on = "ball", count = 2500, length = 0.25, width_root = 0.008, width_tip = 0.004, curl_radius = 0.02 }
[[light.point]]
position = [0, 1.2, 0.4]
intensity = [4, 4, 4]
[occlusion]
faces = 50
opening = 1.5
[indirect]
photons = 50000
"#;

fn corners(statistics: &Statistics) -> u64 {
    statistics.work.of(Work::SharedCorners)
}

/// Root mean square over blocks of 5x5 pixels of the difference of light from around, and that light's mean; both over all channels.
fn difference(a: &Film, b: &Film) -> (f64, f64) {
    let (mut squares, mut mean, mut blocks) = (0.0, 0.0, 0.0);
    for (row, column) in (0..8).flat_map(|row| (0..8).map(move |column| (row, column))) {
        for channel in 0..3 {
            let pixels = (0..25).map(|i| (5 * row + i / 5) * 40 + 5 * column + i % 5);
            let (mut p, mut q) = (0.0, 0.0);
            for pixel in pixels {
                p += f64::from(a.pixels[pixel].environment[channel]);
                q += f64::from(b.pixels[pixel].environment[channel]);
            }
            squares += ((p - q) / 25.0).powi(2);
            mean += p / 25.0;
            blocks += 1.0;
        }
    }
    ((squares / blocks).sqrt(), mean / blocks)
}

/// The share of the mean by which pictures of these settings differ from one another with other random numbers, or from another's.
#[test]
#[ignore = "a minute"]
fn what_is_shared_errs_less_the_finer_it_is_asked_for() {
    let passes = "sampling.passes=8";
    let own = |seed: u32| whole(ROOM, &[passes, &format!("sampling.seed={seed}")]).0;
    let truth = own(1);
    let (noise, mean) = difference(&truth, &own(2));
    let errors = [4.0, 2.0, 1.0].map(|sharing| {
        let (film, statistics) = whole(ROOM, &[passes, "sampling.seed=3", &format!("indirect.sharing={sharing}")]);
        assert!(corners(&statistics) > 0);
        let (error, _) = difference(&truth, &film);
        println!("sharing {sharing}: {:.4} of the mean, {} corners in 8 passes", error / mean, corners(&statistics));
        error / mean
    });
    println!("own rays of other random numbers: {:.4}", noise / mean);
    assert!(errors[0] > errors[1] && errors[1] > errors[2], "{errors:?}");
    // At a face's width no more than twice what two pictures without sharing differ by.
    assert!(errors[2] < 2.0 * noise / mean, "{errors:?} for {}", noise / mean);
}

#[test]
fn pixels_do_not_depend_on_threads_or_crops() {
    let set = ["indirect.sharing=1"];
    let (one, statistics) = film(ROOM, &set, Options { threads: Some(1), window: None });
    assert!(corners(&statistics) > 0);
    let (three, _) = film(ROOM, &set, Options { threads: Some(3), window: None });
    assert!(one.pixels == three.pixels);
    let window = PixelRect { min: [7, 9], max: [30, 23] };
    let (part, _) = film(ROOM, &set, Options { threads: None, window: Some(window) });
    for (i, pixel) in part.pixels.iter().enumerate() {
        let [x, y] = [7 + i % 23, 9 + i / 23];
        assert!(*pixel == one.pixels[y * 40 + x], "pixel {x}, {y}");
    }
}

#[test]
fn nothing_is_shared_where_nothing_can_be() {
    let none = |set: &[&str]| {
        let set = [set, &["camera.resolution=[8,8]", "indirect.photons=1000"]].concat();
        assert_eq!(corners(&whole(ROOM, &set).1), 0, "{set:?}");
    };
    none(&[]);
    none(&["indirect.sharing=1", "indirect.mode=\"none\""]);
    none(&["indirect.sharing=1", "effects.without=[\"hair\"]"]);
    none(&["indirect.sharing=1", "effects.without=[\"surfaces\"]"]);
    none(&["indirect.sharing=1", "hair[0].gather=false"]);
}

/// Every picture of a bright room with a lamp is as bright, whether its points share rays or not: a mirror among the surfaces is seen by
/// each point itself.
#[test]
fn the_room_stays_as_bright() {
    let light = |set: &[&str]| {
        let set = [set, &["sampling.passes=4", "surface[1].material=\"mirror\""]].concat();
        let (film, _) = whole(ROOM, &set);
        film.pixels.iter().map(|pixel| f64::from(pixel.environment.element_sum())).sum::<f64>()
    };
    let (own, shared) = (light(&[]), light(&["indirect.sharing=1"]));
    assert!((shared / own - 1.0).abs() < 0.01, "{shared} against {own}");
}
