//! What the schema cannot say: keys that exclude each other, names, degenerate geometry, files that are missing.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::check::{Finding, MAX_FINDINGS};
use super::description::*;
use super::document::MAX_PROBLEMS;
use super::frame;
use super::keypath::{KeyPath, clip};
use super::schema::nearest;
use super::spans::Spans;

/// What was found.
#[derive(Debug, Default)]
pub(crate) struct Findings {
    pub errors: Vec<Finding>,
    pub warnings: Vec<Finding>,
}

/// Checks a description that fits the schema. `spans` tells what was given, `base_dir` what paths are relative to.
pub(crate) fn validate(description: &Description, spans: &Spans, base_dir: &Path) -> Findings {
    let mut validator = Validator { description, spans, base_dir, found: Findings::default() };
    validator.camera();
    validator.surfaces();
    validator.hair();
    validator.environment();
    validator.lights();
    validator.occlusion();
    validator.output();
    validator.effects();
    validator.whole();
    validator.found
}

struct Validator<'a> {
    description: &'a Description,
    spans: &'a Spans,
    base_dir: &'a Path,
    found: Findings,
}

/// The direction of a vector; none where it is zero. Scaled first, so that no length under- or overflows.
fn direction(v: Triple) -> Option<DVec3> {
    let v = DVec3::from(v);
    let largest = v.abs().max_element();
    (largest > 0.0).then(|| (v / largest).normalize())
}

/// Whether two directions differ by so little (a ten-millionth) that their cross product has no sure direction.
fn parallel(a: DVec3, b: DVec3) -> bool {
    a.cross(b).length() < 1e-7
}

/// The unit vector of an axis.
fn axis(axis: Axis) -> DVec3 {
    match axis {
        Axis::X => DVec3::X,
        Axis::Y => DVec3::Y,
        Axis::Z => DVec3::Z,
    }
}

impl Validator<'_> {
    fn error(&mut self, path: &KeyPath, message: String) {
        if self.found.errors.len() < MAX_FINDINGS {
            self.found.errors.push(Finding::value(path.clone(), message));
        }
    }

    fn warn(&mut self, path: &KeyPath, message: String) {
        if self.found.warnings.len() < MAX_FINDINGS {
            self.found.warnings.push(Finding { path: path.clone(), about_key: true, message });
        }
    }

    /// Warns of keys of the table at `path` that were given but have no effect.
    fn no_effect(&mut self, path: &KeyPath, keys: &[&str], why: &str) {
        for key in keys.iter().map(|key| path.key(key)) {
            if self.spans.given(&key) {
                self.warn(&key, format!("{key} has no effect {why}"));
            }
        }
    }

    /// An error unless one of these keys is given: `(key, given)`. With `optional`, none of them is fine too.
    fn one_of(&mut self, path: &KeyPath, keys: &[(&str, bool)], optional: bool) {
        let names: Vec<&str> = keys.iter().map(|(name, _)| *name).collect();
        let given: Vec<&str> = keys.iter().filter(|(_, given)| *given).map(|(name, _)| *name).collect();
        match given[..] {
            [] if !optional => self.error(path, format!("{path} needs one of {}", names.join(", "))),
            [_, second, ..] => {
                let message = format!("{path} has {}: they exclude each other, keep one", given.join(" and "));
                self.error(&path.key(second), message);
            }
            _ => {}
        }
    }

    fn file(&mut self, path: &KeyPath, file: &Option<PathBuf>) {
        let Some(file) = file else { return };
        if frame::is_numbered(file) {
            // Which file that is depends on the frame.
            return;
        }
        let whole = self.base_dir.join(file);
        match std::fs::metadata(&whole) {
            _ if file.as_os_str().is_empty() => self.error(path, format!("{path} is empty; give the path of a file")),
            Ok(metadata) if metadata.is_dir() => self.error(path, format!("{path}: {} is a folder", whole.display())),
            Ok(_) => {}
            Err(e) => {
                let hint = "; paths are relative to the scene file";
                self.error(path, format!("{path}: cannot find {}: {e}{hint}", whole.display()));
            }
        }
    }

    fn camera(&mut self) {
        let camera = &self.description.camera;
        let path = KeyPath::root().key("camera");
        let (position, target) = (DVec3::from(camera.position), DVec3::from(camera.target));
        let size = position.abs().max(target.abs()).max_element();
        let offset = target - position;
        // A view shorter than this share of the coordinates is lost in the rounding of single precision.
        if offset.length() <= 1e-6 * size || size == 0.0 {
            let key = if self.spans.given(&path.key("target")) { "target" } else { "position" };
            let message = format!(
                "{} and camera.{} are the same point: the camera looks nowhere",
                path.key(key),
                if key == "target" { "position" } else { "target" }
            );
            return self.error(&path.key(key), message);
        }
        let view = offset.normalize();
        let key = path.key("up");
        match camera.up.map(direction) {
            Some(None) => self.error(&key, format!("{key} has length zero; give a direction such as [0, 1, 0]")),
            Some(Some(up)) if parallel(up, view) => {
                self.error(&key, format!("{key} is parallel to the view; give another direction"));
            }
            None if parallel(axis(self.description.up), view) => {
                self.error(&path, "the camera looks along the scene's up axis; give camera.up".to_owned());
            }
            _ => {}
        }
    }

    fn transform(&mut self, path: &KeyPath, transform: &Transform) {
        let path = path.key("transform");
        let parts = [
            ("translate", transform.translate.is_some()),
            ("rotate", transform.rotate.is_some()),
            ("scale", transform.scale.is_some()),
        ];
        let key = path.key("matrix");
        if let Some(matrix) = transform.matrix {
            if let Some((part, _)) = parts.iter().find(|(_, given)| *given) {
                self.error(&key, format!("{path} has matrix and {part}: a matrix says it all, keep one"));
            }
            if matrix[3] != [0.0, 0.0, 0.0, 1.0] {
                let message = format!(
                    "{key}: the last row must be 0 0 0 1 (points are columns, so translation is the last column)"
                );
                self.error(&key.index(3), message);
            }
            let column = |c: usize| direction([matrix[0][c], matrix[1][c], matrix[2][c]]);
            // The volume of the columns' directions: 1 at right angles, free of their lengths.
            let volume = match (column(0), column(1), column(2)) {
                (Some(a), Some(b), Some(c)) => a.cross(b).dot(c).abs(),
                _ => 0.0,
            };
            if volume < 1e-9 {
                self.error(&key, format!("{key} is singular: it flattens the object to nothing"));
            }
        }
        let key = path.key("scale");
        if let Some(n) = transform.scale.and_then(|scale| scale.iter().position(|&s| s == 0.0)) {
            self.error(&key.index(n), format!("{key} has a zero: it flattens the object to nothing"));
        }
    }

    fn surfaces(&mut self) {
        let mut names = HashMap::new();
        for (n, surface) in self.description.surface.iter().enumerate() {
            let path = KeyPath::root().key("surface").index(n);
            let forms = [
                ("file", surface.file.is_some()),
                ("sphere", surface.sphere.is_some()),
                ("plane", surface.plane.is_some()),
                ("teapot", surface.teapot.is_some()),
            ];
            self.one_of(&path, &forms, false);
            self.file(&path.key("file"), &surface.file);
            self.transform(&path, &surface.transform);
            if surface.plane.as_ref().and_then(|plane| plane.normal).is_some_and(|v| direction(v).is_none()) {
                let key = path.key("plane").key("normal");
                self.error(&key, format!("{key} has length zero; give a direction such as [0, 1, 0]"));
            }
            let Some(name) = surface.name.as_deref() else { continue };
            let key = path.key("name");
            if name.is_empty() {
                self.error(&key, format!("{key} is empty; give a name or leave it out"));
            } else if let Some(first) = names.insert(name, n) {
                self.error(&key, format!("{key}: surface[{first}] is already called \"{}\"", clip(name)));
            }
        }
    }

    fn hair(&mut self) {
        let names: BTreeSet<&str> = self.description.surface.iter().filter_map(|s| s.name.as_deref()).collect();
        for (n, hair) in self.description.hair.iter().enumerate() {
            let path = KeyPath::root().key("hair").index(n);
            self.one_of(&path, &[("file", hair.file.is_some()), ("grow", hair.grow.is_some())], false);
            self.file(&path.key("file"), &hair.file);
            self.transform(&path, &hair.transform);
            self.shading(&path, hair.shading);
            if let Some(grow) = &hair.grow {
                self.no_effect(&path, &["format", "thickness_is"], "on hair that is grown, not read from a file");
                self.grow(&path.key("grow"), grow, &names);
            }
        }
    }

    /// Keys of the model of reflection that was not chosen.
    fn shading(&mut self, path: &KeyPath, shading: Shading) {
        match shading {
            Shading::KajiyaKay => self.no_effect(
                path,
                &["color_is", "roughness", "azimuthal_roughness", "cuticle_tilt", "ior"],
                "on hair with shading = \"kajiya-kay\"; it belongs to \"marschner\"",
            ),
            Shading::Marschner => self.no_effect(
                path,
                &["specular", "exponent"],
                "on hair with shading = \"marschner\"; it belongs to \"kajiya-kay\"",
            ),
        }
    }

    fn grow(&mut self, path: &KeyPath, grow: &Grow, names: &BTreeSet<&str>) {
        let key = path.key("on");
        if grow.on.is_empty() {
            self.error(&key, format!("{path} needs the key on: the name of the surface that the hair grows on"));
        } else if !names.contains(grow.on.as_str()) {
            let known: Vec<String> = names.iter().take(10).map(|name| clip(name)).collect();
            // Not for findings that nobody sees: the search is long where there are many names.
            let searched = if self.found.errors.len() < MAX_PROBLEMS { names.len() } else { 0 };
            let hint = match (nearest(&grow.on, names.iter().copied().take(searched)), known.is_empty()) {
                (Some(near), _) => format!("did you mean \"{}\"?", clip(near)),
                (None, false) => format!("named surfaces: {}", known.join(", ")),
                (None, true) => "no surface of this scene has a name; give one its name".to_owned(),
            };
            self.error(&key, format!("{key}: no surface is called \"{}\"; {hint}", clip(&grow.on)));
        }
        let [least, most] = grow.slope;
        if least > most {
            let key = path.key("slope");
            self.error(&key, format!("{key} runs from {least} to {most}; write the smaller number first"));
        }
        if grow.clumping == 0.0 {
            self.no_effect(path, &["clump_size"], "while clumping is 0");
        }
        if grow.curl_radius == 0.0 {
            self.no_effect(path, &["curl_frequency"], "while curl_radius is 0");
        }
    }

    fn environment(&mut self) {
        let environment = &self.description.environment;
        let path = KeyPath::root().key("environment");
        let forms = [
            ("file", environment.file.is_some()),
            ("color", environment.color.is_some()),
            ("gradient", environment.gradient.is_some()),
        ];
        self.one_of(&path, &forms, true);
        self.file(&path.key("file"), &environment.file);
        if forms.iter().all(|(_, given)| !given) {
            self.no_effect(&path, &["scale", "rotate"], "without file, color or gradient");
        } else if environment.file.is_none() {
            self.no_effect(&path, &["rotate"], "on an environment that is the same all round");
        }
        if environment.file.is_none() {
            self.no_effect(&path, &["mapping", "sources"], "without environment.file");
        }
    }

    fn lights(&mut self) {
        let lights = &self.description.light;
        let path = KeyPath::root().key("light");
        for (n, light) in lights.directional.iter().enumerate() {
            if direction(light.direction).is_none() {
                let key = path.key("directional").index(n).key("direction");
                self.error(&key, format!("{key} has length zero; give the direction in which the light travels"));
            }
        }
        for (n, light) in lights.spot.iter().enumerate() {
            if direction(light.direction).is_none() {
                let key = path.key("spot").index(n).key("direction");
                self.error(&key, format!("{key} has length zero; give the direction in which the light shines"));
            }
        }
        let point = lights.point.iter().map(|light| light.shadows).enumerate().map(|(n, s)| ("point", n, s));
        let spot = lights.spot.iter().map(|light| light.shadows).enumerate().map(|(n, s)| ("spot", n, s));
        let directional = lights.directional.iter().map(|light| light.shadows).enumerate();
        for (kind, n, shadows) in point.chain(spot).chain(directional.map(|(n, s)| ("directional", n, s))) {
            let path = path.key(kind).index(n);
            match shadows {
                Shadows::DeepMap => {}
                Shadows::Map => self.no_effect(&path, &["map_error"], "unless shadows is \"deep-map\""),
                Shadows::Raytraced | Shadows::None => {
                    self.no_effect(&path, &["map_resolution", "map_error"], "where shadows is no map");
                }
            }
        }
        for (n, light) in lights.rect.iter().enumerate() {
            let path = path.key("rect").index(n);
            let flat = match (direction(light.edge_u), direction(light.edge_v)) {
                (None, _) => Some(("edge_u", "has length zero")),
                (_, None) => Some(("edge_v", "has length zero")),
                (Some(u), Some(v)) if parallel(u, v) => Some(("edge_v", "is parallel to edge_u")),
                _ => None,
            };
            if let Some((key, what)) = flat {
                let key = path.key(key);
                self.error(&key, format!("{key} {what}: the light has no area"));
            }
        }
    }

    fn occlusion(&mut self) {
        let occlusion = &self.description.occlusion;
        let path = KeyPath::root().key("occlusion");
        let (igloo, raytraced) = match occlusion.mode {
            OcclusionMode::Igloo => (true, false),
            OcclusionMode::Raytraced => (false, true),
            OcclusionMode::Auto => (true, true),
            OcclusionMode::None => (false, false),
        };
        if !raytraced {
            self.no_effect(&path, &["rays", "crossings", "roulette"], "unless occlusion.mode is \"raytraced\"");
        } else if occlusion.crossings != CrossingRule::Stochastic {
            self.no_effect(&path, &["roulette"], "unless occlusion.crossings is \"stochastic\"");
        }
        if occlusion.mode == OcclusionMode::Auto {
            self.no_effect(&path, &["rays", "opening"], "where occlusion.mode is \"auto\": the accuracy decides");
        }
        if !igloo {
            self.no_effect(&path, &["thinning", "projection"], "unless occlusion.mode is \"igloo\"");
        } else if occlusion.opening.is_some() && occlusion.thinning.is_some() {
            self.no_effect(&path, &["opening"], "beside occlusion.thinning: every segment is projected by itself");
        } else if occlusion.opening.is_some() && occlusion.projection == ProjectionRule::TangentPlane {
            self.no_effect(&path, &["opening"], "on the tangent plane: every segment is projected by itself");
        }
        if occlusion.transmittance != TransmittanceRule::SegmentLength {
            self.no_effect(&path, &["unit_length"], "unless occlusion.transmittance is \"segment-length\"");
        }
    }

    fn output(&mut self) {
        let output = &self.description.output;
        let path = KeyPath::root().key("output");
        let key = path.key("layers");
        if output.layers.is_empty() {
            self.error(&key, format!("{key} is empty: nothing would be written; name at least beauty"));
        }
        for (n, layer) in output.layers.iter().enumerate() {
            if output.layers[..n].contains(layer) {
                // Cheap to stop at the first: a hostile list repeats one name a million times.
                return self.error(&key.index(n), format!("{} repeats an earlier layer; name each once", key.index(n)));
            }
        }
        if output.layers.contains(&Layer::StandardError) && self.description.sampling.passes == Some(1) {
            let key = KeyPath::root().key("sampling").key("passes");
            let message = format!("{key} is 1, but output.layers has standard-error, which takes 2 passes or more");
            self.error(&key, message);
        }
        if output.layers.contains(&Layer::Cost) && output.reproducible {
            self.warn(
                &key,
                format!("{key} has cost, which differs from run to run, though output.reproducible is true"),
            );
        }
        if output.file.as_ref().is_some_and(|file| file.as_os_str().is_empty()) {
            let key = path.key("file");
            self.error(&key, format!("{key} is empty; give the path of a picture or leave it out"));
        }
    }

    fn effects(&mut self) {
        let choice = &self.description.effects;
        let path = KeyPath::root().key("effects").key("without");
        for (index, name) in choice.without.iter().enumerate() {
            let path = path.index(index);
            if let Some(instead) = name.not_left_out() {
                self.error(&path, format!("{path}: {name} cannot be left out: {instead}"));
            }
        }
        let both = |part: &&EffectName| choice.without.iter().flat_map(EffectName::parts).any(|other| other == *part);
        if let Some(part) = choice.forced.iter().flat_map(EffectName::parts).find(both) {
            let path = KeyPath::root().key("effects").key("with");
            self.error(&path, format!("{path} and effects.without both have {part}: force it on or leave it out"));
        }
    }

    fn whole(&mut self) {
        let root = KeyPath::root();
        let Description { hair, surface, environment, light, .. } = self.description;
        if hair.is_empty() && !surface.iter().any(|surface| surface.visible) {
            self.warn(&root, "the scene has neither hair nor a visible surface: the picture will be empty".to_owned());
        }
        let bright = |color: &Triple| color.iter().any(|&c| c > 0.0);
        let sky = environment.file.is_some()
            || environment.color.as_ref().is_some_and(bright)
            || environment.gradient.as_ref().is_some_and(|g| [g.zenith, g.horizon, g.nadir].iter().any(bright));
        let lit = (sky && environment.scale > 0.0)
            || light.point.iter().any(|light| bright(&light.intensity))
            || light.spot.iter().any(|light| bright(&light.intensity))
            || light.directional.iter().any(|light| bright(&light.irradiance))
            || light.rect.iter().any(|light| bright(&light.radiance));
        if !lit {
            self.warn(&root, "the scene has no light: the picture will be black; give environment or light".to_owned());
        }
    }
}
