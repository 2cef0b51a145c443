//! Tests of scene files as a whole: messages, both formats, overrides.

mod hostile;

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::description::*;
use super::document::{Document, Format, SceneError, from_bytes};
use super::schema::schema;
use super::{check, document, load, parse};

fn read(text: &str, format: Format, overrides: &[&str]) -> Result<Document, SceneError> {
    let overrides: Vec<String> = overrides.iter().map(|&s| s.to_owned()).collect();
    let name = if format == Format::Toml { "scene.toml" } else { "scene.json" };
    from_bytes(text.as_bytes(), format, Path::new(name), PathBuf::from("."), &overrides)
}

fn toml(text: &str) -> Document {
    read(text, Format::Toml, &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// The error text of a faulty TOML scene.
fn fault(text: &str) -> String {
    read(text, Format::Toml, &[]).expect_err("must be refused").to_string()
}

fn set_fault(text: &str, overrides: &[&str]) -> String {
    read(text, Format::Toml, overrides).expect_err("must be refused").to_string()
}

const SCENE: &str = r#"
up = "z"
[camera]
position = [3, 4.5, 1]
target = [0, 0, 1]
fov = 30
resolution = [640, 480]
[[surface]]
name = "head"
sphere = { radius = 1.5 }
[[surface]]
name = "floor"
plane = { size = [20, 20] }
color = [0.2, 0.3, 0.4]
[[hair]]
name = "fur"
grow = { on = "head", count = 2e3, slope = [0, 1] }
transform.rotate = [0, 90, 0]
width = 0.01
[environment]
gradient = { zenith = [1, 1, 2], horizon = [1, 1, 1], nadir = [0.1, 0.1, 0.1] }
[[light.rect]]
center = [0, 0, 5]
edge_u = [1, 0, 0]
edge_v = [0, 1, 0]
radiance = [10, 10, 10]
[occlusion]
mode = "raytraced"
rays = 64
[output]
layers = ["beauty", "occlusion"]
"#;

#[test]
fn a_scene_is_read() {
    let document = toml(SCENE);
    let d = &document.description;
    assert_eq!((d.up, d.camera.fov, d.camera.resolution), (Axis::Z, 30.0, [640, 480]));
    assert_eq!(d.hair[0].grow.as_ref().unwrap().count, 2000);
    assert_eq!(d.hair[0].transform.rotate, Some([0.0, 90.0, 0.0]));
    assert_eq!(d.output.layers, [Layer::Beauty, Layer::Occlusion]);
    assert_eq!(document.warnings, []);
    assert_eq!(document.locate("hair[0].grow.count").to_string(), "scene.toml:17:31");
    assert_eq!(document.locate("hair[0].grow.width_tip").to_string(), "scene.toml:17:8");
    assert_eq!(document.locate("hair[0].exponent").to_string(), "scene.toml:15:1");
    // SHA-256 of nothing, a well-known number.
    assert_eq!(
        read("", Format::Toml, &[]).unwrap().source_hash,
        "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    );
}

#[test]
fn toml_and_json_say_the_same() {
    let from_toml = toml(SCENE).description;
    let json = serde_json::to_string_pretty(&from_toml).unwrap();
    let from_json = read(&json, Format::Json, &[]).unwrap();
    assert_eq!(from_json.description, from_toml);
    assert_eq!(from_json.locate("camera.fov").to_string(), "scene.json:15:12");
    // And back through TOML, which has no null: what is not given is left out.
    let mut value = serde_json::to_value(&from_toml).unwrap();
    drop_nulls(&mut value);
    assert_eq!(toml(&toml::to_string(&value).unwrap()).description, from_toml);
}

fn drop_nulls(value: &mut Value) {
    match value {
        Value::Object(map) => {
            map.retain(|_, inner| !inner.is_null());
            map.values_mut().for_each(drop_nulls);
        }
        Value::Array(items) => items.iter_mut().for_each(drop_nulls),
        _ => {}
    }
}

#[test]
fn numbers_are_the_same_in_both_formats() {
    for number in ["0.1", "1e-7", "2.2250738585072011e-308", "179", "33.333333333333336", "-0.0"] {
        let a = toml(&format!("output.exposure = {}", if number == "179" { "1.79" } else { number }));
        let b = format!("{{\"output\": {{\"exposure\": {}}}}}", if number == "179" { "1.79" } else { number });
        let b = read(&b, Format::Json, &[]).unwrap();
        assert_eq!(a.description.output.exposure.to_bits(), b.description.output.exposure.to_bits(), "{number}");
    }
}

#[test]
fn schema_faults_are_named_with_line_and_column() {
    for (text, expected) in [
        (
            "[[hair]]\nfile='a'\n  widht = 3",
            "scene.toml:3:3: unknown key \"widht\" in hair[0]; did you mean \"width\"?",
        ),
        ("fov = 3", "scene.toml:1:1: unknown key \"fov\" at the top level; did you mean camera.fov?"),
        (
            "[sampling]\nbanana = 3",
            "scene.toml:2:1: unknown key \"banana\" in sampling; known keys: area_light_samples, layer_choice, layers, passes, seed, surface_samples",
        ),
        (
            "[camera]\n\nfov = 500",
            "scene.toml:3:7: camera.fov is 500, outside 0.01 to 179 degrees (Vertical field of view)",
        ),
        (
            "[camera]\nposition = \"x\"",
            "scene.toml:2:12: camera.position: expected a list of 3 numbers, found a string (\"x\"); for example position = [0, 0, 5]",
        ),
        (
            "camera.position = [1, 2]",
            "scene.toml:1:19: camera.position: expected a list of 3 numbers, found a list of 2",
        ),
        (
            "camera.position = [1, 2e10, 3]",
            "scene.toml:1:23: camera.position[1] is 2e10, outside -1e9 to 1e9 scene units (Where the camera stands)",
        ),
        (
            "occlusion.mode = \"raytracd\"",
            "scene.toml:1:18: occlusion.mode is \"raytracd\"; did you mean \"raytraced\"? known: igloo, raytraced, auto, none",
        ),
        (
            "occlusion.mode = 3",
            "scene.toml:1:18: occlusion.mode: expected one of igloo, raytraced, auto, none, found the number 3; for example mode = \"igloo\"",
        ),
        (
            "occlusion.faces = 1.5",
            "scene.toml:1:19: occlusion.faces: expected a whole number, found the number 1.5; for example faces = 1 (allowed: 1 to 100000)",
        ),
        (
            "camera.background = 1",
            "scene.toml:1:21: camera.background: expected true or false, found the number 1; for example background = true",
        ),
        ("camera = 1", "scene.toml:1:10: camera: expected a table, found the number 1"),
        (
            "[hair]\nwidth = 1",
            "scene.toml:1:1: hair: expected a list of tables, found a table; in TOML each item starts with [[hair]], with two brackets",
        ),
        (
            "[[light.point]]\nposition = [1, 2, 3]",
            "scene.toml:1:1: light.point[0] lacks the key \"intensity\" (Radiant intensity, in W/sr with the scene unit as metre, linear Rec.709)",
        ),
        (
            "sampling.seed = 5000000000",
            "scene.toml:1:17: sampling.seed is 5e9, outside 0 to 4.294967295e9 (Seed of all random numbers)",
        ),
        (
            "sampling.seed = -1",
            "scene.toml:1:17: sampling.seed is -1, outside 0 to 4.294967295e9 (Seed of all random numbers)",
        ),
    ] {
        assert_eq!(fault(text), expected);
    }
}

#[test]
fn syntax_faults_are_named_with_line_and_column() {
    for (text, place, part) in [
        ("a = 1\nb = \n", "scene.toml:2:", ""),
        ("camera.fov = nan", "scene.toml:1:14:", "nan is not a finite number"),
        ("camera.fov = -inf", "scene.toml:1:14:", "-inf is not a finite number"),
        ("camera.fov = 1e999", "scene.toml:1:14:", "1e999 is not a finite number"),
        ("camera.fov = 99999999999999999999", "scene.toml:1:14:", "too large"),
        ("hair = 2020-01-01", "scene.toml:1:8:", "date or time"),
        ("up = 'x'\nup = 'y'", "scene.toml:2:1:", "duplicate"),
    ] {
        let error = fault(text);
        assert!(error.starts_with(place) && error.contains(part), "{text:?}: {error}");
    }
    for (text, place, part) in [
        ("{\n \"up\": \"x\",\n}", "scene.json:3:1:", "trailing comma"),
        ("{\"up\": \"x\" \"camera\": {}}", "scene.json:1:12:", "expected"),
        ("// no\n{}", "scene.json:1:1:", "expected"),
        ("{\"up\": 'x'}", "scene.json:1:8:", "expected"),
        ("{\"up\": NaN}", "scene.json:1:8:", "expected"),
        ("{\"camera\": {\"fov\": 1e999}}", "scene.json:1:", "range"),
        ("{\"up\": \"x\", \"up\": \"y\"}", "scene.json:1:13:", "given twice"),
        ("", "scene.json:1:1:", "EOF"),
        ("[]", "scene.json:1:1:", "the scene: expected a table, found a list of 0"),
    ] {
        let error = read(text, Format::Json, &[]).expect_err(text).to_string();
        assert!(error.starts_with(place) && error.contains(part), "{text:?}: {error}");
    }
    let error = from_bytes(b"\xef\xbb\xbfup = '\xff'", Format::Toml, Path::new("s.toml"), ".".into(), &[]).unwrap_err();
    assert_eq!(error.to_string(), "s.toml:1:7: the text is not UTF-8 from here on; save the file as UTF-8");
}

#[test]
fn all_faults_are_reported_in_order_and_their_number_is_capped() {
    let error = fault("[camera]\nfov = 0\nresolution = [0, 512]\nnaer = 3\n[occlusion]\nmode = 'x'\n");
    let lines: Vec<&str> = error.lines().collect();
    assert_eq!(lines.len(), 4, "{error}");
    for (line, n) in lines.iter().zip([2, 3, 4, 6]) {
        assert!(line.starts_with(&format!("scene.toml:{n}:")), "{error}");
    }
    let many: String = (0..50).map(|n| format!("zzzzz{n} = 1\n")).collect();
    let error = fault(&many);
    assert_eq!(error.lines().count(), document::MAX_PROBLEMS + 1);
    assert!(error.ends_with("and 30 more"), "{error}");
    let many = format!("output.layers = [{}]", "1,".repeat(100_000));
    assert!(fault(&many).ends_with("and many more"));
    // Thousands of hair objects and surfaces on one line: the search for near names must not take their product.
    let surfaces: Vec<String> = (0..20_000).map(|n| format!("{{name='surface{n}',sphere={{}}}}")).collect();
    let hair = "{grow={on='x'}},".repeat(20_000);
    let error = fault(&format!("surface=[{}]\nhair=[{hair}]", surfaces.join(",")));
    assert_eq!(error.lines().count(), document::MAX_PROBLEMS + 1);
}

#[test]
fn keys_of_other_materials_are_warned_of_and_values_have_bounds() {
    let keys = [("color", "[1, 1, 1]"), ("reflectance", "[1, 1, 1]"), ("ior", "1.4"), ("transmission", "[1, 1, 1]")];
    for (material, own) in
        [("diffuse", &["color"][..]), ("mirror", &["reflectance"]), ("glass", &["ior", "transmission"])]
    {
        for (key, value) in keys {
            let text = format!(
                "[[surface]]\nsphere = {{}}\nmaterial = \"{material}\"\n{key} = {value}\n[environment]\ncolor = [1, 1, 1]"
            );
            let said = toml(&text).warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
            let expected = format!("surface[0].{key} has no effect on a surface with material = \"{material}\"");
            assert_eq!(said.contains(&expected), !own.contains(&key), "{material}, {key}: {said}");
        }
    }
    for (line, said) in [
        ("material = \"glass\"\nior = 0.9", "surface[0].ior"),
        ("reflectance = [1, 2, 1]", "surface[0].reflectance[1]"),
        ("material = \"gold\"", "surface[0].material"),
    ] {
        let fault = fault(&format!("[[surface]]\nsphere = {{}}\n{line}"));
        assert!(fault.contains(said), "{fault}");
    }
}

#[test]
fn keys_of_the_other_model_of_reflection_are_warned_of() {
    let warnings = |keys: &str| {
        let text = format!(
            "[[hair]]\ngrow = {{ on = 'head' }}\n{keys}\n[[surface]]\nname = 'head'\nteapot = {{}}\n[environment]\ncolor = [1,1,1]"
        );
        let warnings = read(&text, Format::Toml, &[]).expect("sound").warnings;
        warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    for key in
        ["color_is = 'dense-hair'", "roughness = 0.3", "azimuthal_roughness = 0.3", "cuticle_tilt = 3", "ior = 1.5"]
    {
        let name = key.split(' ').next().expect("a name");
        let expected = format!("hair[0].{name} has no effect on hair with shading = \"kajiya-kay\"");
        assert!(warnings(key).contains(&expected), "{}", warnings(key));
        assert_eq!(warnings(&format!("shading = 'marschner'\n{key}")), "");
    }
    for key in ["specular = [0, 0, 0]", "exponent = 20"] {
        assert!(warnings(&format!("shading = 'marschner'\n{key}")).contains("belongs to \"kajiya-kay\""), "{key}");
        assert_eq!(warnings(key), "");
    }
}

#[test]
fn senseless_scenes_are_refused() {
    let with = |text: &str| format!("{text}\n[[surface]]\nname = \"head\"\nsphere = {{}}");
    for (text, expected) in [
        ("[[hair]]\nwidth = 1", "scene.toml:1:1: hair[0] needs one of file, grow"),
        (
            "[[surface]]\nsphere = {}\nplane = {}",
            "scene.toml:3:9: surface[0] has sphere and plane: they exclude each other, keep one",
        ),
        (
            "environment.color = [1, 1, 1]\nenvironment.gradient = { zenith = [1,1,1], horizon = [1,1,1], nadir = [1,1,1] }",
            "scene.toml:2:24: environment has color and gradient: they exclude each other, keep one",
        ),
        (
            "[camera]\nposition = [1, 2, 3]\ntarget = [1, 2, 3]",
            "scene.toml:3:10: camera.target and camera.position are the same point: the camera looks nowhere",
        ),
        (
            "camera.position = [0, 0, 0]",
            "scene.toml:1:19: camera.position and camera.target are the same point: the camera looks nowhere",
        ),
        ("camera.up = [0, 0, 0]", "scene.toml:1:13: camera.up has length zero; give a direction such as [0, 1, 0]"),
        ("camera.up = [0, 0, -3]", "scene.toml:1:13: camera.up is parallel to the view; give another direction"),
        (
            "[camera]\nposition = [0, 9, 0]",
            "scene.toml:1:1: the camera looks along the scene's up axis; give camera.up",
        ),
        (
            "[[light.directional]]\ndirection = [0, 0, 0]\nirradiance = [1, 1, 1]",
            "scene.toml:2:13: light.directional[0].direction has length zero; give the direction in which the light travels",
        ),
        (
            "[[light.rect]]\ncenter = [0, 0, 0]\nedge_u = [1, 0, 0]\nedge_v = [-2, 0, 0]\nradiance = [1, 1, 1]",
            "scene.toml:4:10: light.rect[0].edge_v is parallel to edge_u: the light has no area",
        ),
        (
            "[[surface]]\nplane = { normal = [0, 0, 0] }",
            "scene.toml:2:20: surface[0].plane.normal has length zero; give a direction such as [0, 1, 0]",
        ),
        (
            "[[surface]]\nsphere = {}\ntransform.scale = [1, 0, 1]",
            "scene.toml:3:23: surface[0].transform.scale has a zero: it flattens the object to nothing",
        ),
        (
            "[[surface]]\nsphere = {}\n[surface.transform]\nmatrix = [[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]",
            "scene.toml:4:10: surface[0].transform.matrix is singular: it flattens the object to nothing",
        ),
        (
            "[[surface]]\nsphere = {}\n[surface.transform]\nscale = [1, 1, 1]\nmatrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]",
            "scene.toml:5:10: surface[0].transform has matrix and scale: a matrix says it all, keep one",
        ),
        (
            "[[surface]]\nsphere = {}\n[surface.transform]\nmatrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [3, 0, 0, 1]]",
            "scene.toml:4:53: surface[0].transform.matrix: the last row must be 0 0 0 1 (points are columns, so translation is the last column)",
        ),
        (
            "[[surface]]\nname = 'a'\nsphere = {}\n[[surface]]\nname = 'a'\nsphere = {}",
            "scene.toml:5:8: surface[1].name: surface[0] is already called \"a\"",
        ),
        (
            "[[surface]]\nteapot = {}\nplane = {}",
            "scene.toml:2:10: surface[0] has plane and teapot: they exclude each other, keep one",
        ),
        (
            "output.layers = []",
            "scene.toml:1:17: output.layers is empty: nothing would be written; name at least beauty",
        ),
        (
            "output.layers = ['alpha', 'alpha']",
            "scene.toml:1:27: output.layers[1] repeats an earlier layer; name each once",
        ),
    ] {
        assert_eq!(fault(text), expected);
    }
    for (text, expected) in [
        (
            "[[hair]]\ngrow = { on = 'haed' }",
            "scene.toml:2:15: hair[0].grow.on: no surface is called \"haed\"; did you mean \"head\"?",
        ),
        (
            "[[hair]]\ngrow = { on = 'x' }",
            "scene.toml:2:15: hair[0].grow.on: no surface is called \"x\"; named surfaces: head",
        ),
        (
            "[[hair]]\ngrow = {}",
            "scene.toml:2:8: hair[0].grow needs the key on: the name of the surface that the hair grows on",
        ),
        (
            "[[hair]]\ngrow = { on = 'head', slope = [0.5, 0.2] }",
            "scene.toml:2:31: hair[0].grow.slope runs from 0.5 to 0.2; write the smaller number first",
        ),
    ] {
        assert_eq!(fault(&with(text)), expected);
    }
}

#[test]
fn extreme_directions_are_no_fault() {
    let tiny =
        "[[light.directional]]\ndirection = [0, 1e-300, 0]\nirradiance = [1, 1, 1]\n[camera]\nup = [0, 1e-320, 0]";
    assert_eq!(toml(tiny).description.camera.up, Some([0.0, 1e-320, 0.0]));
    let mirror = "[[surface]]\nsphere = {}\ntransform.matrix = [[1e-9, 0, 0, 0], [0, -1e-9, 0, 0], [0, 0, 1e-9, 0], [0, 0, 0, 1]]";
    assert!(toml(mirror).description.surface[0].transform.matrix.is_some());
}

#[test]
fn missing_files_are_named() {
    let error = fault("[[hair]]\nfile = 'no/such.hair'");
    assert!(error.starts_with("scene.toml:2:8: hair[0].file: cannot find ./no/such.hair: No such file"), "{error}");
    let error = fault("environment.file = 'src'");
    assert!(error.contains("is a folder"), "{error}");
    let error = fault("[[surface]]\nfile = ''");
    assert!(error.contains("surface[0].file is empty"), "{error}");
    assert!(fault("[[surface]]\nfile = \"a\\u0000b\"").starts_with("scene.toml:2:8: surface[0].file: cannot find"));
}

#[test]
fn oddities_are_warnings() {
    let warnings = |text: &str| -> Vec<String> { toml(text).warnings.iter().map(ToString::to_string).collect() };
    assert_eq!(
        warnings(""),
        [
            "scene.toml:1:1: the scene has neither hair nor a visible surface: the picture will be empty",
            "scene.toml:1:1: the scene has no light: the picture will be black; give environment or light",
        ]
    );
    let lit = "environment = { color = [1, 1, 1], rotate = 3 }\nocclusion.rays = 3\nocclusion.unit_length = 2\n";
    let scene = format!(
        "{lit}[[surface]]\nname = 'a'\nsphere = {{}}\n[[hair]]\ngrow = {{ on = 'a', clump_size = 3 }}\nformat = 'hair'"
    );
    assert_eq!(
        warnings(&scene),
        [
            "scene.toml:1:36: environment.rotate has no effect on an environment that is the same all round",
            "scene.toml:2:11: occlusion.rays has no effect unless occlusion.mode is \"raytraced\"",
            "scene.toml:3:11: occlusion.unit_length has no effect unless occlusion.transmittance is \"segment-length\"",
            "scene.toml:8:20: hair[0].grow.clump_size has no effect while clumping is 0",
            "scene.toml:9:1: hair[0].format has no effect on hair that is grown, not read from a file",
        ]
    );
    assert!(warnings("[[surface]]\nsphere = {}\n[environment]\ncolor = [0, 0, 0]")[0].contains("no light"));
    let by_itself = |keys: &str| warnings(&format!("[occlusion]\n{keys}")).concat();
    assert!(by_itself("projection = 'tangent-plane'\nopening = 0.5").contains("occlusion.opening has no effect on"));
    assert!(by_itself("thinning = {}\nopening = 0.5").contains("occlusion.opening has no effect beside"));
    assert!(by_itself("projection = 'tangent-plane'\nmode = 'none'").contains("occlusion.projection has no effect"));
}

#[test]
fn overrides_come_before_the_file() {
    let set = |overrides: &[&str]| read(SCENE, Format::Toml, overrides).unwrap_or_else(|e| panic!("{e}"));
    let d = set(&["hair[0].width=0.5", "occlusion.mode=igloo", "occlusion.thinning.fraction=0.5"]);
    assert_eq!(d.description.hair[0].width, Some(0.5));
    assert_eq!(d.description.occlusion.mode, OcclusionMode::Igloo);
    assert_eq!(d.description.occlusion.thinning, Some(Thinning { fraction: 0.5, distance_unit: None }));
    assert_eq!(d.warnings.len(), 1, "rays no longer matter: {:?}", d.warnings);
    assert_eq!(d.locate("hair[0].width").to_string(), "--set hair[0].width=0.5");
    let d = set(&["hair.0.grow.count=7", "camera.position[1] = 9", "camera.up=[0,1,0.5]", "surface[0].name='head'"]);
    assert_eq!(d.description.hair[0].grow.as_ref().unwrap().count, 7);
    assert_eq!(d.description.camera.position, [3.0, 9.0, 1.0]);
    assert_eq!(d.description.camera.up, Some([0.0, 1.0, 0.5]));
    // Names need no quotes, even when they look like something else; a list that the file lacks starts from its default.
    let d = read("", Format::Toml, &["surface[0].sphere={}", "surface[0].name=2020-01-01", "camera.position[2]=7"])
        .unwrap();
    assert_eq!(d.description.surface[0].name.as_deref(), Some("2020-01-01"));
    assert_eq!(d.description.camera.position, [0.0, 0.0, 7.0]);
    // The last one wins.
    assert_eq!(set(&["sampling.seed=1", "sampling.seed=2"]).description.sampling.seed, 2);
}

#[test]
fn faulty_overrides_name_themselves() {
    for (text, expected) in [
        ("camera.fovv=3", "--set camera.fovv=3: unknown key \"fovv\" in camera; did you mean \"fov\"?"),
        ("fov=3", "--set fov=3: unknown key \"fov\" at the top level; did you mean camera.fov?"),
        (
            "camera.fov=500",
            "--set camera.fov=500: camera.fov is 500, outside 0.01 to 179 degrees (Vertical field of view)",
        ),
        (
            "camera.fov=4O",
            "--set camera.fov=4O: camera.fov: expected a number, found a string (\"4O\"); for example fov = 35 (allowed: 0.01 to 179)",
        ),
        ("camera.fov=nan", "--set camera.fov=nan: nan is not a finite number; give one"),
        ("camera.fov.x=1", "--set camera.fov.x=1: camera.fov is a number: nothing is inside it"),
        ("hair.width=1", "--set hair.width=1: hair is a list: say which of its items is meant, as in hair[0].width"),
        ("hair[5].width=1", "--set hair[5].width=1: hair has 1 items, counted from 0: hair[5] does not exist"),
        ("camera[0]=1", "--set camera[0]=1: camera is a table, not a list"),
        ("camera", "--set camera: a value is missing; write key.path=value, as in camera.fov=40"),
        ("=3", "--set =3: \"\" is not a key path such as hair[0].width: a key is missing"),
        (
            "occlusion.mode=raytrace",
            "--set occlusion.mode=raytrace: occlusion.mode is \"raytrace\"; did you mean \"raytraced\"? known: igloo, raytraced, auto, none",
        ),
        ("camera.up=[0,0,0]", "--set camera.up=[0,0,0]: camera.up has length zero; give a direction such as [0, 1, 0]"),
        (
            "camera.position[3]=1",
            "--set camera.position[3]=1: camera.position has 3 items, counted from 0: camera.position[3] does not exist",
        ),
    ] {
        let error = set_fault(SCENE, &[text]);
        assert!(error.lines().any(|line| line == expected), "{text}: {error}");
    }
}

#[test]
fn files_are_read_within_limits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.TOML");
    std::fs::write(&path, "environment.color = [1, 1, 1]").unwrap();
    let document = load(&path, &[]).unwrap();
    assert_eq!(document.base_dir, folder.path());
    assert_eq!(document.resolve(Path::new("a.obj")), folder.path().join("a.obj"));

    let missing = load(&folder.path().join("none.toml"), &[]).unwrap_err().to_string();
    assert!(missing.contains("none.toml: cannot read the scene: No such file"), "{missing}");
    assert!(load(Path::new("scene.txt"), &[]).unwrap_err().to_string().contains("must be .toml or .json"));
    let directory = folder.path().join("d.json");
    std::fs::create_dir(&directory).unwrap();
    assert!(load(&directory, &[]).unwrap_err().to_string().contains("folder"));
    let huge = folder.path().join("huge.toml");
    std::fs::File::create(&huge).unwrap().set_len(document::MAX_BYTES + 1).unwrap();
    assert!(matches!(load(&huge, &[]), Err(SceneError::TooLarge { .. })));
}

#[test]
fn the_schema_takes_the_default_scene() {
    let validator = jsonschema::validator_for(schema()).unwrap();
    let value = serde_json::to_value(Description::default()).unwrap();
    assert!(validator.is_valid(&value));
    assert_eq!(check::check(&mut value.clone()), []);
    let value = serde_json::to_value(toml(SCENE).description).unwrap();
    assert!(validator.is_valid(&value));
}

#[test]
fn the_example_scenes_fit_the_schema() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        return eprintln!("skipped: there is no {}", folder.display());
    };
    let validator = jsonschema::validator_for(schema()).unwrap();
    for path in entries.map(|entry| entry.unwrap().path()) {
        let text = || std::fs::read_to_string(&path).unwrap();
        let (mut value, _) = match path.extension().and_then(|ending| ending.to_str()) {
            Some("toml") => parse::toml(&text()).unwrap(),
            Some("json") => parse::json(&text()).unwrap(),
            _ => continue,
        };
        assert_eq!(check::check(&mut value), [], "{}", path.display());
        assert!(validator.is_valid(&value), "{}", path.display());
    }
}
