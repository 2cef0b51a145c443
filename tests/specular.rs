//! Mirrors, glass and caustics, as whole scenes show them.

mod common;

use common::{block_difference, film, load, mean, whole};
use glam::Vec3;
use tress::effects::Effects;
use tress::fragment::PixelRect;
use tress::render::{Film, Options};

/// Strands around the origin as a hair file's text: some upright, some lying across.
fn strands() -> String {
    let mut text = String::new();
    for i in 0..60 {
        let turn = f64::from(i) * 2.4;
        let root = 0.5 * (f64::from(i) / 60.0).sqrt();
        for k in 0..6 {
            let along = f64::from(k) / 5.0;
            let (sin, cos) = (turn + 0.8 * along).sin_cos();
            let radius = root + 0.25 * along;
            text += &format!("{} {} {} {}\n", radius * cos, 0.3 + 0.5 * along, radius * sin, 0.02 * (1.2 - along));
        }
        text.push('\n');
    }
    text
}

const LOOK: &str = "[camera]\nposition = [-1, 0.3, 6]\ntarget = [2, 0, 0]\nfov = 18\nresolution = [64, 64]\n[indirect]\nmode = \"none\"\n";

#[test]
fn a_mirror_shows_the_mirrored_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("hair.txt");
    std::fs::write(&file, strands()).expect("a hair file");
    let hair = |transform: &str| {
        format!(
            "[[hair]]\nfile = \"{}\"\nformat = \"text\"\ncolor = [0.7, 0.5, 0.3]\ntransparency = 0.2\n{transform}\n",
            file.display()
        )
    };
    // The plane x = 1 is the mirror: x becomes 2 - x.
    let seen = |hair: &str| {
        format!(
            "{LOOK}[[surface]]\nsphere = {{ radius = 0.45 }}\ncolor = [0.6, 0.5, 0.4]\n{hair}\
             [[surface]]\nplane = {{ center = [1, 0, 0], normal = [-1, 0, 0], size = [12, 12] }}\nmaterial = \"mirror\"\n\
             reflectance = [0.8, 0.6, 0.4]\n\
             [[light.point]]\nposition = [-2, 3, 3]\nintensity = [40, 40, 40]\n"
        )
    };
    let straight = |hair: &str| {
        format!(
            "{LOOK}[[surface]]\nsphere = {{ center = [2, 0, 0], radius = 0.45 }}\ncolor = [0.6, 0.5, 0.4]\n{hair}\
             [[light.point]]\nposition = [4, 3, 3]\nintensity = [40, 40, 40]\n"
        )
    };
    let mirrored = hair("transform = { scale = [-1, 1, 1], translate = [2, 0, 0] }");
    // Hair in a mirror is crossed by a ray a sample; seen straight it is drawn, its layers independent of each other. That differs by a per cent where strands
    // are as wide as a pixel. Surfaces are sampled in both.
    for (what, hair, other, bounds) in [("ball", "", "", [0.003, 0.02]), ("hair", &*hair(""), &*mirrored, [0.02, 0.05])]
    {
        let (seen, _) = whole(&seen(hair), &["sampling.layers=16"]);
        let (mut straight, _) = whole(&straight(other), &["sampling.layers=16"]);
        straight.pixels.iter_mut().for_each(|pixel| pixel.beauty *= Vec3::new(0.8, 0.6, 0.4));
        let sums = |film: &Film| film.pixels.iter().map(|pixel| pixel.beauty.as_dvec3()).sum::<glam::DVec3>();
        let (ratio, blocks) = (sums(&seen) / sums(&straight), block_difference(&straight, &seen));
        println!("{what}: means {ratio}, blocks {blocks:.4}");
        assert!((ratio - 1.0).abs().max_element() < bounds[0], "{what}: {ratio}");
        assert!(blocks < bounds[1], "{what}: {blocks}");
        // A mirror is opaque, at its own distance.
        assert!(seen.pixels.iter().all(|pixel| (pixel.alpha - 1.0).abs() < 1e-6 && pixel.depth < 8.0));
    }
}

/// A box with a tuft of hair, lit by a lamp; `ball` stands between them.
fn room(ball: &str) -> String {
    format!(
        "[camera]\nposition = [0, 0, 4.85]\nfov = 30\nresolution = [40, 40]\n\
         [occlusion]\naccuracy = 0.02\n\
         [[light.point]]\nposition = [0.1, 0.85, 0.1]\nintensity = [2, 1.8, 1.6]\n\
         [[surface]]\nplane = {{ center = [0, -1, 0], normal = [0, 1, 0], size = [2, 2] }}\ncolor = [0.7, 0.7, 0.7]\n\
         [[surface]]\nplane = {{ center = [0, 1, 0], normal = [0, -1, 0], size = [2, 2] }}\ncolor = [0.7, 0.7, 0.7]\n\
         [[surface]]\nplane = {{ center = [0, 0, -1], normal = [0, 0, 1], size = [2, 2] }}\ncolor = [0.7, 0.7, 0.7]\n\
         [[surface]]\nplane = {{ center = [-1, 0, 0], normal = [1, 0, 0], size = [2, 2] }}\ncolor = [0.6, 0.1, 0.1]\n\
         [[surface]]\nplane = {{ center = [1, 0, 0], normal = [-1, 0, 0], size = [2, 2] }}\ncolor = [0.1, 0.5, 0.1]\n\
         [[surface]]\nname = \"head\"\nsphere = {{ center = [0, -0.8, 0], radius = 0.2 }}\ncolor = [0.5, 0.4, 0.3]\n\
         [[hair]]\ncolor = [0.7, 0.5, 0.4]\ntransparency = 0.3\n\
         grow = {{ on = \"head\", slope = [0, 1], count = 1500, length = 0.4, width_root = 0.008, width_tip = 0.005, gravity = 1 }}\n{ball}"
    )
}

#[test]
fn glass_of_index_one_is_not_there() {
    // It blocks shadow rays; that light comes as caustics, on walls, on hair and where gather rays look.
    let ball = "[[surface]]\nsphere = { center = [0.05, 0.1, 0.05], radius = 0.45 }\nmaterial = \"glass\"\nior = 1\n";
    for mode in ["photons", "single-bounce"] {
        let set = format!("indirect.mode=\"{mode}\"");
        let (with, _) = whole(&room(ball), &[&set, "indirect.caustic_photons=400000"]);
        let (without, _) = whole(&room(""), &[&set]);
        let (dark, _) = whole(&room(ball), &[&set, "effects.without=[\"caustics\"]"]);
        let ratio = mean(&with) / mean(&without);
        let blocks = block_difference(&without, &with);
        // The pixels in which there is hair.
        let hair = |film: &Film| {
            let pixels = without.pixels.iter().zip(&film.pixels).filter(|(a, _)| a.tangent != Vec3::ZERO);
            pixels.map(|(_, pixel)| f64::from(pixel.beauty.y)).sum::<f64>()
        };
        let [tuft, lost] = [&with, &dark].map(|film| hair(film) / hair(&without));
        println!(
            "{mode}: mean {ratio:.4}, blocks {blocks:.4}, hair {tuft:.4}; without caustics {:.3}, hair {lost:.3}",
            mean(&dark) / mean(&without)
        );
        assert!((ratio - 1.0).abs() < 0.02, "{mode}: {ratio}");
        assert!(blocks < 0.04, "{mode}: {blocks}");
        assert!((tuft - 1.0).abs() < 0.05, "{mode}: hair {tuft}");
        assert!(lost < 0.8, "{mode}: the ball shades the hair: {lost}");
    }
}

#[test]
fn the_furnace_is_white_in_mirrors_and_behind_glass() {
    let scene = r#"
[camera]
position = [0, 0.4, 5]
fov = 34
resolution = [48, 40]
[environment]
color = [1, 1, 1]
[occlusion]
mode = "none"
faces = 200
[[surface]]
sphere = { center = [-1.2, 0, 0], radius = 0.55 }
material = "mirror"
reflectance = [1, 1, 1]
[[surface]]
sphere = { center = [1.2, 0, 0.3], radius = 0.55 }
material = "glass"
ior = 1.6
[[surface]]
plane = { center = [0, 0, -1.5], normal = [0, 0, 1], size = [3, 2] }
material = "mirror"
reflectance = [1, 1, 1]
[[surface]]
name = "root"
sphere = { radius = 0.25 }
visible = false
[[hair]]
color = [1, 1, 1]
specular = [0, 0, 0]
grow = { on = "root", count = 800, length = 0.3, width_root = 0.02, width_tip = 0.01 }
"#;
    let (film, statistics) = whole(scene, &["indirect.specular_depth=40"]);
    let worst = film.pixels.iter().map(|pixel| (pixel.beauty - 1.0).abs().max_element()).fold(0.0, f32::max);
    let cut = statistics.specular.expect("mirrors and glass");
    println!("worst {worst:.5}, cut {cut:?}, points {} {}", statistics.hair_points, statistics.surface_points);
    assert!(worst < 0.01, "{worst}");
    assert!(cut.seen < 1e-4, "{cut:?}");
    // Fewer steps cut more, and what they cut is what is missing.
    let missing = |depth: &str| {
        let (film, statistics) = whole(scene, &[depth, "effects.without=[\"hair\"]"]);
        (1.0 - mean(&film), statistics.specular.expect("mirrors and glass").seen)
    };
    let cuts = ["indirect.specular_depth=2", "indirect.specular_depth=3", "indirect.specular_depth=5"].map(missing);
    println!("missing, cut: {cuts:?}");
    assert!(cuts.windows(2).all(|pair| pair[1].0 < pair[0].0 && pair[1].1 < pair[0].1), "{cuts:?}");
    // The share of the picture that shows mirrors and glass is the same for all.
    let shares = cuts.map(|(missing, cut)| missing / cut);
    assert!(shares.iter().all(|share| (share / shares[0] - 1.0).abs() < 0.05 && *share < 1.0), "{shares:?}");
}

#[test]
fn pixels_do_not_depend_on_threads_or_crops() {
    let ball = "[[surface]]\nsphere = { center = [0.3, -0.3, 0.3], radius = 0.35 }\nmaterial = \"glass\"\n\
                [[surface]]\nsphere = { center = [-0.5, -0.5, 0.1], radius = 0.35 }\nmaterial = \"mirror\"\n";
    let set = ["indirect.photons=20000", "indirect.caustic_photons=20000", "occlusion.opening=1.5"];
    let (one, _) = film(&room(ball), &set, Options { threads: Some(1), window: None });
    let (three, _) = film(&room(ball), &set, Options { threads: Some(3), window: None });
    assert!(one.pixels == three.pixels);
    let window = PixelRect { min: [7, 19], max: [30, 33] };
    let (part, _) = film(&room(ball), &set, Options { threads: None, window: Some(window) });
    for (i, pixel) in part.pixels.iter().enumerate() {
        let [x, y] = [7 + i % 23, 19 + i / 23];
        assert!(*pixel == one.pixels[y * 40 + x], "pixel {x}, {y}");
    }
}

#[test]
fn what_is_not_there_costs_nothing_and_says_why() {
    let effects = |text: &str, set: &[&str]| {
        let scene = load(text, set);
        let effects = Effects::of(&scene);
        let list = effects.list(&scene.description().effects.without);
        let reason = |name: &str| list.iter().find(|effect| effect.name == name).expect("an effect").reason.clone();
        (effects.specular, effects.caustics, reason("caustics"))
    };
    let ball = "[[surface]]\nsphere = { center = [0, 0, 0], radius = 0.3 }\nmaterial = \"mirror\"\n";
    let without = "effects.without=[\"caustics\"]";
    assert_eq!(effects(&room(""), &[]), (false, false, "no surface has a mirror or glass material".into()));
    assert_eq!(effects(&room(ball), &[]), (true, true, "light falls on mirrors or glass".into()));
    assert_eq!(effects(&room(ball), &[without]), (true, false, "left out: effects.without names it".into()));
    let none = "no light falls on mirrors or glass, indirect.mode is none, or indirect.caustic_photons is 0";
    assert_eq!(effects(&room(ball), &["indirect.mode=\"none\""]), (true, false, none.into()));
    assert_eq!(effects(&room(ball), &["indirect.caustic_photons=0"]), (true, false, none.into()));
}

#[test]
fn glass_that_is_not_closed_is_noted() {
    let sheet = "[[surface]]\nplane = { size = [1, 1] }\nmaterial = \"glass\"\n[environment]\ncolor = [1, 1, 1]\n";
    let note = |text: &str| load(text, &[]).notes.iter().any(|note| note.contains("not closed (4 open edges)"));
    assert!(note(sheet));
    assert!(!note(&sheet.replace("plane = { size = [1, 1] }", "sphere = {}")));
    assert!(!note(&sheet.replace("\"glass\"", "\"mirror\"")));
}
