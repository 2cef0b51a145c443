//! Effects: what is off does no work, and what is forced on changes no pixel.

mod common;
#[path = "common/everything.rs"]
mod everything;
#[path = "common/program.rs"]
mod program;

use std::path::{Path, PathBuf};

use everything::full;
use tress::effects::Effects;
use tress::render::costs::own_work;
use tress::render::progress::Unwatched;
use tress::render::{self, Film, Options, Statistics};
use tress::scene::description::EffectName;
use tress::scene::{self, Scene};
use tress::tally::Work;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Scenes in which effects are off for other reasons: nothing at all, all switched off by keys, and but for hair or a surface.
fn scenes_of_few_effects() -> [(&'static str, String); 5] {
    let ball = "camera = { position = [0, 1, 4], fov = 35, resolution = [14, 12] }\n\
                surface = [{ name = 'ball', sphere = {}, visible = true }]\n";
    let hair = "[[hair]]\ncolor = [0.5, 0.4, 0.3]\nspecular = [0, 0, 0]\n\
                grow = { on = 'ball', count = 150, segments = 4, length = 0.4, width_root = 0.03 }\n";
    let lamp = "[[light.point]]\nposition = [2, 2, 2]\nintensity = [5, 5, 5]\n";
    let keys = "[occlusion]\nmode = 'none'\n[indirect]\nmode = 'none'\n";
    let full_but_keys = full()
        .replace("mode = \"auto\"", "mode = \"none\"")
        .replace("[indirect]", "[indirect]\nmode = \"none\"")
        .replace("environment.file", "environment.sources = \"none\"\nenvironment.file")
        .replace("\"environment-unoccluded\", ", "");
    [
        ("nothing", "camera.resolution = [14, 12]\n".to_owned()),
        ("a ball", format!("{ball}environment.color = [0.5, 0.6, 0.7]\n")),
        ("hair and a lamp", format!("{}{hair}{lamp}", ball.replace("visible = true", "visible = false"))),
        ("all but by keys", full_but_keys),
        (
            "hair on a ball, by keys",
            format!("{ball}environment.color = [0.5, 0.6, 0.7]\n{hair}{lamp}shadows = 'map'\n{keys}"),
        ),
    ]
}

fn effects() -> Vec<EffectName> {
    let none = common::load("", &[]);
    Effects::of(&none).list(&none.description().effects).iter().map(|effect| effect.key).collect()
}

fn render(scene: &mut Scene) -> (Film, Statistics) {
    render::render(scene, &Options::default(), &Unwatched).unwrap_or_else(|e| panic!("{e}"))
}

/// The largest difference of what is written of two pictures, each number as a share of the larger of 1 and itself.
fn difference(a: &Film, b: &Film, unoccluded: bool) -> f32 {
    let numbers = |film: &Film| -> Vec<f32> {
        let of = |p: &tress::render::film::Pixel| {
            let hidden = if unoccluded { p.unoccluded } else { glam::Vec3::ZERO };
            let vectors = [p.beauty, p.direct, p.environment, hidden, p.normal, p.tangent];
            vectors.iter().flat_map(|v| v.to_array()).chain([p.alpha, p.occlusion, p.depth]).collect::<Vec<f32>>()
        };
        film.pixels.iter().flat_map(of).collect()
    };
    let apart = |(a, b): (&f32, &f32)| (a - b).abs() / a.abs().max(b.abs()).max(1.0);
    numbers(a).iter().zip(&numbers(b)).map(apart).fold(0.0, f32::max)
}

/// Forces each effect on in turn, and all at once: no pixel changes but by rounding. Renders of one scene, loaded once.
fn force_all(name: &str, mut scene: Scene) {
    let layers = &scene.description().output.layers;
    let unoccluded = layers.contains(&scene::description::Layer::EnvironmentUnoccluded);
    let (surfaces, colors) = (scene.surfaces.clone(), scene.hair.color.clone());
    let mut with = |forced: Vec<EffectName>| {
        scene.document.description.effects.forced = forced;
        (scene.surfaces, scene.hair.color) = (surfaces.clone(), colors.clone());
        render(&mut scene)
    };
    let (plain, before) = with(Vec::new());
    let each = effects().into_iter().map(|key| vec![key]);
    for forced in each.chain([effects()]) {
        let (film, statistics) = with(forced.clone());
        let apart = difference(&plain, &film, unoccluded);
        assert!(apart <= 2e-6, "{name}, {forced:?}: {apart}");
        for (effect, before) in statistics.effects.iter().zip(&before.effects) {
            assert_eq!(effect.on, before.on || forced.contains(&effect.key), "{name}: {effect:?}");
            assert_eq!(effect.forced, !before.on && forced.contains(&effect.key), "{name}: {effect:?}");
        }
    }
}

#[test]
fn what_is_forced_on_changes_no_pixel() {
    force_all("all", common::load(&full(), &[]));
    for (name, text) in scenes_of_few_effects() {
        force_all(name, common::load(&text, &[]));
    }
}

#[test]
#[ignore = "slow: renders each scene once for each effect"]
fn what_is_forced_on_changes_no_pixel_of_any_scene() {
    let folder = Path::new(ROOT).join("scenes");
    let paths = std::fs::read_dir(folder).expect("the folder scenes").map(|entry| entry.expect("an entry").path());
    let mut paths: Vec<PathBuf> = paths.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    paths.sort();
    assert!(paths.len() >= 5, "{paths:?}");
    for path in paths {
        let small = ["camera.resolution=[14, 10]", "indirect.photons=20000", "indirect.caustic_photons=10000"];
        let small = small.map(str::to_owned);
        let mut document = scene::load(&path, &small).unwrap_or_else(|e| panic!("{e}"));
        // A twentieth of the hair: what the pixels are asked for is the same.
        for grow in document.description.hair.iter_mut().filter_map(|hair| hair.grow.as_mut()) {
            grow.count = (grow.count / 20).max(1);
        }
        let name = path.display().to_string();
        force_all(&name, Scene::load(document).unwrap_or_else(|e| panic!("{e}")));
        eprintln!("{name}: sound");
    }
}

#[test]
fn what_is_forced_on_runs_over_what_there_is() {
    let (_, text) = &scenes_of_few_effects()[4];
    let work = |forced: &[&str], of: Work| {
        let with = format!("effects.with=[{}]", forced.join(", "));
        common::whole(text, &[&with]).1.work.of(of)
    };
    for (name, of) in [
        ("hair-occlusion-by-projection", Work::Projections),
        ("hair-occlusion-by-rays", Work::RaytracedPoints),
        ("light-reflected-by-surfaces", Work::Reflections),
        ("more-than-one-reflection", Work::Photons),
        ("settings-by-accuracy", Work::CalibrationPoints),
        ("rays-through-hair", Work::CurveGeometries),
        ("highlight", Work::Highlight),
        ("color-variation", Work::PointColors),
        ("unoccluded-layer", Work::UnoccludedFaces),
    ] {
        assert_eq!(work(&[], of), 0, "{name}");
        assert!(work(&[&format!("{name:?}")], of) > 0, "{name}");
    }
}

/// What takes an effect away from the full scene, and leaves the others as they are as far as can be.
fn taken_away(key: EffectName) -> Vec<String> {
    let keys: &[&str] = match key {
        // Not to be left out: a key of the scene has them go.
        EffectName::SettingsByAccuracy => &["occlusion.mode=igloo", "occlusion.opening=1"],
        EffectName::RaysThroughHair => &[
            "effects.without=[\"ray-traced-shadows\", \"hair-occlusion\", \"light-reflected-by-surfaces\"]",
            "surface[1].material=diffuse",
        ],
        EffectName::MirrorsAndGlass => &["surface[1].material=diffuse"],
        EffectName::KajiyaKay => &["hair[0].shading=marschner"],
        EffectName::Marschner => &["hair[1].shading=kajiya-kay"],
        _ => &[],
    };
    if keys.is_empty() {
        return vec![format!("effects.without=[\"{key}\"]")];
    }
    keys.iter().map(|&key| key.to_owned()).collect()
}

/// Does the work of what is off, and of nothing else, stay undone?
fn nothing_off_does_anything(name: &str, statistics: &Statistics) {
    for (effect, cost) in statistics.effects.iter().zip(&statistics.costs) {
        assert_eq!((effect.key, effect.on), (cost.effect, cost.on));
        if effect.on {
            continue;
        }
        for &work in own_work(effect.key) {
            assert_eq!(statistics.work.of(work), 0, "{name}: {} is off and has {}", effect.name, work.name());
        }
        assert_eq!((cost.bytes, cost.cpu_seconds()), (0, 0.0), "{name}: {}", effect.name);
    }
}

#[test]
fn what_is_off_does_nothing() {
    // By projection and by rays: auto takes one of them.
    let overrides = ["occlusion.mode=igloo", "occlusion.mode=raytraced"];
    let on: Vec<Statistics> = overrides.iter().map(|mode| common::whole(&full(), &[mode]).1).collect();
    let by_all: Vec<EffectName> = effects();
    for &key in &by_all {
        // Every count moves when its effect is on: else a zero would tell nothing.
        for &work in own_work(key) {
            let done = on.iter().map(|statistics| statistics.work.of(work)).max();
            assert!(done > Some(0), "{key}: {} is never done", work.name());
        }
        let away = taken_away(key);
        let (_, statistics) = common::whole(&full(), &away.iter().map(String::as_str).collect::<Vec<_>>());
        let effect = statistics.effects.iter().find(|effect| effect.key == key).expect("an effect");
        assert!(!effect.on, "{effect:?}");
        nothing_off_does_anything(&format!("all but {key}"), &statistics);
    }
    for (name, text) in scenes_of_few_effects() {
        nothing_off_does_anything(name, &common::whole(&text, &[]).1);
    }
}

#[test]
fn a_scene_without_hair_builds_nothing_of_it_and_one_without_reflections_no_photons() {
    let text = full();
    let (_, bald) = common::whole(&text, &["effects.without=[\"hair\"]"]);
    for work in [
        Work::CurveGeometries,
        Work::ClusterTrees,
        Work::HairRays,
        Work::DeepMaps,
        Work::PlainMaps,
        Work::HighlightTables,
        Work::MarschnerTables,
        Work::HairFragments,
        Work::CalibrationPoints,
    ] {
        if !matches!(work, Work::HighlightTables | Work::MarschnerTables) {
            assert_eq!(bald.work.of(work), 0, "{}", work.name());
        }
    }
    assert!(bald.work.of(Work::Photons) > 0 && bald.work.of(Work::GatherRays) > 0);
    let (_, straight) = common::whole(&text, &["indirect.mode=none"]);
    assert_eq!([Work::Photons, Work::PhotonLookups, Work::Reflections].map(|work| straight.work.of(work)), [0; 3]);
    assert!(straight.work.of(Work::CurveGeometries) == 1 && straight.work.of(Work::HairRays) > 0);
    // A lamp alone asks nothing about what is around.
    let (_, lamp) = common::whole(&scenes_of_few_effects()[2].1, &[]);
    assert_eq!([Work::ClusterTrees, Work::Projections, Work::CalibrationPoints].map(|w| lamp.work.of(w)), [0; 3]);
    assert_eq!((lamp.work.of(Work::TriangleGeometries), lamp.work.of(Work::CurveGeometries)), (0, 1));
}

#[test]
fn work_does_not_depend_on_threads_and_costs_are_parts_of_the_whole() {
    let folder = program::folder(&full());
    // A process of its own: its CPU time is this render's.
    let [one, two] = ["1", "2"].map(|threads| {
        let arguments =
            ["render", "scene.toml", "-q", "-o", "a.exr", "--resolution", "64x48", "--plan", "--occlusion", "igloo"];
        let more = ["--threads", threads, "--stats", "s.json"];
        let (code, _, said) = program::tress(folder.path(), &[&arguments[..], &more].concat());
        assert_eq!(code, Some(0), "{said}");
        let text = std::fs::read_to_string(folder.path().join("s.json")).expect("statistics");
        serde_json::from_str::<serde_json::Value>(&text).expect("JSON")[0].clone()
    });
    assert_eq!(one["work"], two["work"]);
    for statistics in [&one, &two] {
        let of = |name: &str| -> f64 {
            let costs = statistics["costs"].as_array().expect("costs");
            costs.iter().map(|cost| cost[name].as_f64().expect("seconds")).sum()
        };
        let stages = statistics["stages"].as_array().expect("stages");
        let stage = |wanted: &dyn Fn(&str) -> bool| -> f64 {
            let all = stages.iter().filter(|stage| wanted(stage["name"].as_str().expect("a name")));
            all.map(|stage| stage["cpu_seconds"].as_f64().expect("seconds")).sum()
        };
        let rendering = stage(&|name| name == "rendering");
        assert!(
            of("rendering") <= 1.02 * rendering && of("rendering") > 0.8 * rendering,
            "{}, {rendering}",
            of("rendering")
        );
        let building = stage(&|name| !matches!(name, "rendering" | "loading" | "writing"));
        assert!(of("building") <= 1.02 * building && of("building") > 0.7 * building, "{}, {building}", of("building"));
        // Each effect that is on has both: what was planned and what it took.
        for cost in statistics["costs"].as_array().expect("costs") {
            assert!(cost["planned"]["cpu_seconds"].is_number() && cost["bytes"].is_number(), "{cost}");
            let work = cost["work"].as_object().expect("work");
            assert_eq!(
                cost["on"] == true,
                work.values().any(|count| count.as_u64() > Some(0)) || work.is_empty(),
                "{cost}"
            );
        }
        assert!(statistics["planned_cpu_seconds"].as_f64() > Some(0.0));
    }
}

#[test]
fn shadows_of_hair_can_be_left_out_on_each_kind_of_thing() {
    let text = full();
    let lit = |without: &str| common::whole(&text, &[&format!("effects.without=[{without}]")]).0;
    let by_kind = |film: &Film, hair: bool| -> f64 {
        let of_kind = film.pixels.iter().filter(|pixel| (pixel.tangent != glam::Vec3::ZERO) == hair);
        of_kind.map(|pixel| f64::from(pixel.direct.y)).sum()
    };
    let (all, none) = (lit(""), lit("\"hair-shadows-on-hair\", \"hair-shadows-on-surfaces\""));
    let (no_hair, no_surface) = (lit("\"hair-shadows-on-hair\""), lit("\"hair-shadows-on-surfaces\""));
    // Without a shadow it is brighter, and where only the other kind is seen nothing changes.
    assert!(
        by_kind(&no_hair, true) > 1.001 * by_kind(&all, true),
        "{} {}",
        by_kind(&no_hair, true),
        by_kind(&all, true)
    );
    assert_eq!(by_kind(&no_hair, false), by_kind(&all, false));
    assert!(by_kind(&no_surface, false) > 1.001 * by_kind(&all, false));
    assert_eq!(by_kind(&none, false), by_kind(&no_surface, false));
    assert!(by_kind(&none, true) >= by_kind(&no_hair, true));
}
