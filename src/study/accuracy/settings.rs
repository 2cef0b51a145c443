//! The settings that trade accuracy for time: which values are tried, and on which scenes.
//!
//! A new setting is a new line of [`SWEPT`].

use crate::effects::Effects;
use crate::scene::description::{Occlusion, OcclusionMode, Shadows};

/// What decides whether a setting matters on a scene.
#[derive(Clone, Debug)]
pub struct Facts {
    pub effects: Effects,
    pub occlusion: Occlusion,
    pub segments: usize,
    /// Size of the scene, in scene units.
    pub size: f64,
    /// Whether the environment is a picture whose small sources the scene leaves in it.
    pub sources_left: bool,
    /// Keys of the lights without extent, and how their shadows are found.
    pub lamps: Vec<(String, Shadows)>,
}

impl Facts {
    fn occluded(&self) -> bool {
        let e = &self.effects;
        e.hair && (e.environment || e.area_lights || e.reflection) && self.occlusion.mode != OcclusionMode::None
    }

    fn has_lamp(&self, with: fn(Shadows) -> bool) -> bool {
        self.lamps.iter().any(|(_, shadows)| with(*shadows))
    }

    /// A setting of lights, for each light that it is of.
    fn of_lamps(&self, key: &str, value: &str) -> Vec<String> {
        let of = |shadows: Shadows| match key {
            SHADOWS => shadows != Shadows::None,
            MAP_ERROR => shadows == Shadows::DeepMap,
            _ => shadows.is_map(),
        };
        let lamps = self.lamps.iter().filter(|(_, shadows)| of(*shadows));
        lamps.map(|(lamp, _)| format!("{lamp}.{key}={value}")).collect()
    }
}

/// Values that are tried.
#[derive(Clone, Copy, Debug)]
pub enum Values {
    /// As they are written after `--set key=`.
    Given(&'static [&'static str]),
    /// Lengths, in sizes of the scene.
    Sizes(&'static [f64]),
    /// The same value for every light without extent that has the key.
    OfLamps(&'static [&'static str]),
}

/// One setting of the sweep.
#[derive(Clone, Copy, Debug)]
pub struct Swept {
    /// Its key in a scene.
    pub key: &'static str,
    /// What it is, for readers.
    pub name: &'static str,
    /// From those that take least time to those that take most, as far as that is known.
    pub values: Values,
    /// Settings that it needs beside it.
    pub with: &'static [&'static str],
    /// Why it is without effect on a scene; none where it has one.
    pub idle: fn(&Facts) -> Option<&'static str>,
}

/// Segment by segment, a point of a larger model takes a good part of a second.
const MOST_SEGMENTS: usize = 100_000;

const IGLOO: &[&str] = &["occlusion.mode=igloo"];
const RAYS: &[&str] = &["occlusion.mode=raytraced"];
const NO_OCCLUSION: &str = "the scene has no hair occlusion";

fn unless(holds: bool, reason: &'static str) -> Option<&'static str> {
    (!holds).then_some(reason)
}

fn no_occlusion(facts: &Facts) -> Option<&'static str> {
    unless(facts.occluded(), NO_OCCLUSION)
}

fn no_lumps(facts: &Facts) -> Option<&'static str> {
    let by_segments = facts.occlusion.by_segments();
    no_occlusion(facts).or(unless(!by_segments, "the scene projects hair segment by segment"))
}

fn no_accuracy(facts: &Facts) -> Option<&'static str> {
    no_occlusion(facts).or(unless(
        facts.occlusion.wants_calibration(),
        "the scene says by hand how finely hair occlusion is found, in place of an accuracy",
    ))
}

fn no_thinning(facts: &Facts) -> Option<&'static str> {
    no_occlusion(facts).or(unless(
        facts.segments <= MOST_SEGMENTS,
        "thinned hair is projected segment by segment, and the scene has more than 100,000: that takes hours",
    ))
}

fn no_light_around(facts: &Facts) -> Option<&'static str> {
    let e = &facts.effects;
    unless(e.environment || e.area_lights || e.reflection, "no light comes from all around")
}

fn no_photons(facts: &Facts) -> Option<&'static str> {
    unless(facts.effects.photons, "no light is reflected more than once, or the scene asks for fewer reflections")
}

fn no_small_sources(facts: &Facts) -> Option<&'static str> {
    unless(
        facts.effects.small_sources || facts.sources_left,
        "the environment is no picture, or one without spots that the igloo's faces would blur too much",
    )
}

fn no_maps(facts: &Facts) -> Option<&'static str> {
    unless(facts.effects.hair && facts.has_lamp(Shadows::is_map), "no light's shadows of hair come from a map")
}

const SHADOWS: &str = "shadows";
const MAP_ERROR: &str = "map_error";
const MAP_RESOLUTION: &str = "map_resolution";

/// All settings of the sweep, one at a time around the scene's own.
pub const SWEPT: &[Swept] = &[
    Swept {
        key: "occlusion.mode",
        name: "estimator",
        values: Values::Given(&["igloo", "raytraced", "auto"]),
        with: &[],
        idle: no_occlusion,
    },
    Swept {
        key: "occlusion.accuracy",
        name: "accuracy",
        values: Values::Given(&["0.05", "0.02", "0.01", "0.005", "0.0025"]),
        with: &[],
        idle: no_accuracy,
    },
    Swept {
        key: "occlusion.faces",
        name: "faces",
        values: Values::Given(&["16", "36", "64", "128", "256"]),
        with: &[],
        idle: no_light_around,
    },
    Swept {
        key: "occlusion.opening",
        name: "opening",
        values: Values::Given(&["3", "1.5", "1", "0.5"]),
        with: IGLOO,
        idle: no_lumps,
    },
    Swept {
        key: "occlusion.rays",
        name: "rays a point",
        values: Values::Given(&["100", "400", "1600"]),
        with: RAYS,
        idle: no_occlusion,
    },
    Swept {
        key: "occlusion.crossings",
        name: "crossings of rays",
        values: Values::Given(&["multiply"]),
        with: RAYS,
        idle: no_occlusion,
    },
    Swept {
        key: "occlusion.thinning.fraction",
        name: "thinning: fraction",
        values: Values::Given(&["0.05", "0.2", "0.5"]),
        with: IGLOO,
        idle: no_thinning,
    },
    Swept {
        key: "occlusion.thinning.distance_unit",
        name: "thinning: distance unit",
        values: Values::Sizes(&[0.03, 0.1, 0.3]),
        with: IGLOO,
        idle: no_thinning,
    },
    Swept {
        key: "sampling.layers",
        name: "layers",
        values: Values::Given(&["1", "2", "4", "8", "16", "32"]),
        with: &[],
        idle: |facts| unless(facts.effects.hair, "the scene has no hair"),
    },
    Swept {
        key: "sampling.layer_choice",
        name: "choice of layers",
        values: Values::Given(&["seen", "gamma", "drawn"]),
        with: &[],
        idle: |facts| unless(facts.effects.hair, "the scene has no hair"),
    },
    Swept {
        key: "sampling.area_light_samples",
        name: "area light samples",
        values: Values::Given(&["1", "4", "16", "64"]),
        with: &[],
        idle: |facts| unless(facts.effects.area_lights, "the scene has no area light"),
    },
    Swept {
        key: "sampling.surface_samples",
        name: "surface samples",
        values: Values::Given(&["16", "64", "256"]),
        with: &[],
        idle: |facts| unless(facts.effects.surfaces, "the scene has no visible surface"),
    },
    Swept {
        key: "environment.sources",
        name: "small sources of the environment",
        values: Values::Given(&["none", "auto"]),
        with: &[],
        idle: no_small_sources,
    },
    Swept {
        key: "indirect.mode",
        name: "reflections",
        values: Values::Given(&["none", "single-bounce"]),
        with: &[],
        idle: no_photons,
    },
    Swept {
        key: "indirect.photons",
        name: "photons",
        values: Values::Given(&["20000", "60000", "600000", "2000000"]),
        with: &[],
        idle: no_photons,
    },
    Swept {
        key: "indirect.sharing",
        name: "light shared between points",
        values: Values::Given(&["0", "0.5", "1", "2"]),
        with: &[],
        idle: |facts| unless(facts.effects.reflection && facts.effects.hair, "no surface reflects light on hair"),
    },
    Swept {
        key: SHADOWS,
        name: "shadows of hair",
        values: Values::OfLamps(&["deep-map", "raytraced"]),
        with: &[],
        idle: |facts| {
            let shadowed = facts.has_lamp(|shadows| shadows != Shadows::None);
            unless(
                facts.effects.hair && shadowed,
                "no point, spot or directional light has shadows of hair, or effects.without leaves a way to find them out",
            )
        },
    },
    Swept {
        key: MAP_ERROR,
        name: "error of deep shadow maps",
        values: Values::OfLamps(&["0.03", "0.01", "0.004", "0.001"]),
        with: &[],
        idle: |facts| {
            let deep = facts.has_lamp(|shadows| shadows == Shadows::DeepMap);
            unless(facts.effects.hair && deep, "no light has a deep shadow map of hair")
        },
    },
    Swept {
        key: MAP_RESOLUTION,
        name: "pixels of shadow maps",
        values: Values::OfLamps(&["128", "512", "2048"]),
        with: &[],
        idle: no_maps,
    },
    Swept {
        key: "sampling.passes",
        name: "passes",
        values: Values::Given(&["2", "4"]),
        with: &[],
        idle: |facts| {
            let e = &facts.effects;
            unless(e.surfaces || e.raytraced_occlusion, "nothing is random here: all passes are alike")
        },
    },
];

/// All settings together, from coarse to fine: accuracy, faces, layers, area light samples, surface samples.
pub const KNOB: &[(&str, [&str; 5])] = &[
    ("draft", ["0.04", "25", "1", "4", "16"]),
    ("preview", ["0.02", "36", "2", "9", "16"]),
    ("standard", ["0.01", "64", "4", "16", "16"]),
    ("fine", ["0.005", "100", "8", "25", "36"]),
    ("very fine", ["0.0025", "144", "16", "36", "64"]),
    ("finest", ["0.0015", "256", "32", "64", "64"]),
];

/// Places of the knob in passes with layers drawn by chance, as `--max-error` renders: what one pass errs by at random they leave behind.
const IN_PASSES: [(usize, u32); 5] = [(1, 4), (1, 16), (2, 16), (3, 16), (3, 64)];

const KNOB_KEYS: [&str; 5] = [
    "occlusion.accuracy",
    "occlusion.faces",
    "sampling.layers",
    "sampling.area_light_samples",
    "sampling.surface_samples",
];

/// A place of the knob as settings after `--set`; those that are idle on the scene are left out.
#[must_use]
pub fn knob(values: &[&str; 5], facts: &Facts) -> Vec<String> {
    let idle = |key: &str| SWEPT.iter().any(|swept| swept.key == key && (swept.idle)(facts).is_some());
    let pairs = KNOB_KEYS.iter().zip(values).filter(|(key, _)| !idle(key));
    pairs.map(|(key, value)| format!("{key}={value}")).collect()
}

/// Faces a hemisphere, layers and photons of references, from coarse to fine; the finest that the time allows is taken. Layers are drawn: what few of them
/// miss is noise, and passes take it away.
pub const REFERENCES: [[u32; 3]; 3] = [[25, 16, 200_000], [64, 24, 400_000], [128, 32, 800_000]];

/// What a reference is rendered with, beside a seed and a number of passes.
#[must_use]
pub fn reference(facts: &Facts, [faces, layers, photons]: [u32; 3]) -> Vec<String> {
    let mut set = Vec::new();
    if no_light_around(facts).is_none() {
        set.push(format!("occlusion.faces={faces}"));
    }
    if facts.occluded() {
        set.push("occlusion.mode=raytraced".to_owned());
        // A ray a face: more passes are worth more than more rays, as they draw everything else anew, too.
        set.push(format!("occlusion.rays={}", 2 * faces));
    }
    set.push(format!("sampling.layers={layers}"));
    set.push("sampling.layer_choice=drawn".to_owned());
    if facts.effects.area_lights {
        set.push("sampling.area_light_samples=64".to_owned());
    }
    if facts.effects.surfaces {
        set.push("sampling.surface_samples=64".to_owned());
    }
    if facts.effects.reflection {
        set.push("indirect.sharing=0".to_owned());
    }
    if no_photons(facts).is_none() {
        set.push(format!("indirect.photons={photons}"));
    }
    if no_maps(facts).is_none() {
        set.extend(facts.of_lamps(SHADOWS, "raytraced"));
    }
    if facts.sources_left {
        set.push("environment.sources=auto".to_owned());
    }
    set
}

/// One render of the sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name of the setting; "default" for the scene as it is, "knob" for all together.
    pub setting: String,
    pub value: String,
    /// Settings, as after `--set`.
    pub set: Vec<String>,
}

impl Case {
    /// Whether lights have other shadow maps than the scene as it is.
    pub fn has_other_maps(&self) -> bool {
        [SHADOWS, MAP_ERROR, MAP_RESOLUTION]
            .iter()
            .any(|key| self.set.iter().any(|set| set.contains(&format!(".{key}="))))
    }
}

/// A setting that is not swept, and why.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Skipped {
    pub setting: String,
    pub key: String,
    pub reason: String,
}

/// What is rendered on a scene, and what is not. The scene as it is comes first, then the knob.
#[must_use]
pub fn cases(facts: &Facts) -> (Vec<Case>, Vec<Skipped>) {
    let mut cases =
        vec![Case { setting: "default".to_owned(), value: "the scene as it is".to_owned(), set: Vec::new() }];
    let mut skipped = Vec::new();
    let modes: &[&str] = if facts.occluded() { &["igloo", "raytraced"] } else { &[""] };
    for (mode, (name, values)) in modes.iter().flat_map(|mode| KNOB.iter().map(move |level| (mode, level))) {
        let mut set = knob(values, facts);
        set.extend((!mode.is_empty()).then(|| format!("occlusion.mode={mode}")));
        cases.push(Case { setting: format!("knob {mode}").trim_end().to_owned(), value: (*name).to_owned(), set });
    }
    if facts.effects.hair || facts.effects.surfaces {
        for (place, passes) in IN_PASSES {
            let (name, values) = &KNOB[place];
            let mut set = knob(values, facts);
            set.extend(facts.effects.hair.then(|| "sampling.layer_choice=drawn".to_owned()));
            set.push(format!("sampling.passes={passes}"));
            let (setting, value) = ("knob in passes".to_owned(), format!("{name}, {passes} passes"));
            cases.push(Case { setting, value, set });
        }
    }
    for swept in SWEPT {
        if let Some(reason) = (swept.idle)(facts) {
            let (setting, key) = (swept.name.to_owned(), swept.key.to_owned());
            skipped.push(Skipped { setting, key, reason: reason.to_owned() });
            continue;
        }
        let values: Vec<String> = match swept.values {
            Values::Given(values) | Values::OfLamps(values) => values.iter().map(|value| (*value).to_owned()).collect(),
            Values::Sizes(sizes) => sizes.iter().map(|size| format!("{:.4e}", size * facts.size)).collect(),
        };
        for value in values {
            let mut set: Vec<String> = swept.with.iter().map(|with| (*with).to_owned()).collect();
            if matches!(swept.values, Values::OfLamps(_)) {
                set.extend(facts.of_lamps(swept.key, &value));
            } else {
                set.push(format!("{}={value}", swept.key));
            }
            cases.push(Case { setting: swept.name.to_owned(), value, set });
        }
    }
    (cases, skipped)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_of_lights_are_of_those_that_have_them() {
        let lamps = [("light.point[0]", Shadows::Raytraced), ("light.spot[0]", Shadows::DeepMap)];
        let more = [("light.spot[1]", Shadows::Map), ("light.directional[0]", Shadows::None)];
        let lamps = lamps.into_iter().chain(more).map(|(key, shadows)| (key.to_owned(), shadows)).collect();
        let effects = Effects { hair: true, ..Effects::default() };
        let facts =
            Facts { effects, occlusion: Occlusion::default(), segments: 9, size: 1.0, sources_left: false, lamps };
        let (all, skipped) = cases(&facts);
        let of = |name: &str| all.iter().find(|case| case.setting == name).expect("a case");
        let rays =
            ["light.point[0].shadows=raytraced", "light.spot[0].shadows=raytraced", "light.spot[1].shadows=raytraced"];
        let error = of("error of deep shadow maps");
        assert_eq!(error.set, ["light.spot[0].map_error=0.03"]);
        assert_eq!(
            of("pixels of shadow maps").set,
            ["light.spot[0].map_resolution=128", "light.spot[1].map_resolution=128"]
        );
        assert!(error.has_other_maps() && !all[0].has_other_maps());
        let reference = reference(&facts, REFERENCES[0]);
        assert!(rays.iter().all(|ray| reference.iter().any(|set| set == ray)), "{reference:?}");
        assert!(skipped.iter().all(|skipped| skipped.key != MAP_ERROR));
        let passes = all.iter().rfind(|case| case.setting == "knob in passes").expect("a case");
        assert_eq!(passes.value, "fine, 64 passes");
        for set in ["sampling.layers=8", "sampling.layer_choice=drawn", "sampling.passes=64"] {
            assert!(passes.set.iter().any(|s| s == set), "{passes:?}");
        }
        let facts = Facts { lamps: Vec::new(), ..facts };
        assert!([SHADOWS, MAP_ERROR, MAP_RESOLUTION].iter().all(|key| cases(&facts).1.iter().any(|s| s.key == *key)));
    }
}
