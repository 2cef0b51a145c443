//! The program as its users see it: exit codes, standard output and standard error.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Output, Stdio};

fn tress() -> std::process::Command {
    std::process::Command::new(assert_cmd::cargo::cargo_bin!("tress"))
}

/// Runs in a folder; gives exit code, standard output and standard error.
fn run(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let Output { status, stdout, stderr } = tress().current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (status.code().expect("no signal"), text(stdout), text(stderr))
}

fn folder(scene: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.toml"), scene).unwrap();
    folder
}

const SOUND: &str = "environment.color = [1, 1, 1]\n[[surface]]\nname = 'ball'\nsphere = {}\n";

#[test]
fn check_accepts_a_sound_scene() {
    let folder = folder(SOUND);
    let (code, out, err) = run(folder.path(), &["check", "scene.toml"]);
    assert_eq!((code, err.as_str()), (0, ""));
    assert!(out.starts_with("scene.toml: sound, 0 warnings\n"), "{out}");
    for line in
        ["  picture      512x512 pixels", "  hair         0 objects", "  environment  radiance 1 1 1 everywhere"]
    {
        assert!(out.lines().any(|found| found.starts_with(line)), "{line} in {out}");
    }
    assert_eq!(run(folder.path(), &["check", "-q", "scene.toml"]), (0, String::new(), String::new()));
}

#[test]
fn check_counts_what_is_left() {
    let lamp = "[[light.rect]]\ncenter = [0, 5, 0]\nedge_u = [1, 0, 0]\nedge_v = [0, 0, 1]\nradiance = [1, 1, 1]\n";
    let folder = folder(&format!("{SOUND}{lamp}"));
    let triangles = |arguments: &[&str]| {
        let (code, out, err) = run(folder.path(), &[&["check", "scene.toml"], arguments].concat());
        assert_eq!(code, 0, "{err}");
        let line = out.lines().find(|line| line.starts_with("  surfaces")).expect("a line").to_owned();
        line.rsplit_once(": ").expect("a number").1.to_owned()
    };
    let all = triangles(&[]);
    // A lamp is no surface, whether or not it shines.
    assert_eq!(triangles(&["--without", "area-lights"]), all);
    assert_eq!(triangles(&["--without", "surfaces"]), "0 triangles");
}

#[test]
fn a_plan_tells_what_is_left_out() {
    let folder = folder(&format!("{SOUND}[[light.point]]\nposition = [0, 3, 0]\nintensity = [1, 1, 1]\n"));
    let arguments = ["plan", "scene.toml", "--no-probe", "--without", "point-and-directional-lights"];
    let (code, out, err) = run(folder.path(), &arguments);
    assert_eq!(code, 0, "{err}");
    for kind in ["point lights", "spot lights", "directional lights"] {
        let line = out.lines().find(|line| line.contains(kind)).expect("a line");
        assert!(line.contains("off:") && line.contains("effects.without names it"), "{line}");
    }
}

#[test]
fn a_plan_tells_what_is_forced_on() {
    let folder = folder(SOUND);
    let forced = ["--with", "hair", "--with", "area-lights"];
    let (code, out, err) = run(folder.path(), &[&["plan", "scene.toml", "--no-probe"], &forced[..]].concat());
    assert_eq!(code, 0, "{err}");
    for name in ["hair", "area lights"] {
        let line = out.lines().find(|line| {
            line.split_once(": ").is_some_and(|(_, rest)| rest.trim_start().starts_with(&format!("{name}  ")))
        });
        let line = line.expect("a line");
        assert!(line.trim_start().starts_with("on:") && line.contains("forced: effects.with names it"), "{line}");
    }
    // And in the scene file, with a plan as JSON, times and all.
    std::fs::write(folder.path().join("a.toml"), format!("{SOUND}[effects]\nwith = ['area-lights']\n"))
        .expect("a scene");
    let (code, out, err) = run(folder.path(), &["plan", "a.toml", "--json", "--resolution", "32x32", "-q"]);
    assert_eq!(code, 0, "{err}");
    let plan: serde_json::Value = serde_json::from_str(&out).expect("JSON");
    let effects = plan["effects"].as_array().expect("effects");
    let area = effects.iter().find(|effect| effect["key"] == "area-lights").expect("area lights");
    assert_eq!((&area["on"], &area["forced"], &area["left_out"]), (&true.into(), &true.into(), &false.into()));
    let seconds: f64 =
        plan["cpu_seconds"].as_array().expect("times").iter().map(|part| part["seconds"].as_f64().expect("s")).sum();
    assert!(seconds > 0.0 && plan["structures"].is_array() && plan["memory"].is_array(), "{plan}");
}

#[test]
fn effects_that_make_no_sense_are_refused() {
    let folder = folder(SOUND);
    for (arguments, part) in [
        (&["--with", "hair", "--without", "hair"][..], "effects.with and effects.without both have hair"),
        (&["--with", "spot-lights", "--without", "point-and-directional-lights"], "both have spot-lights"),
        (&["--with", "hair-occlusion", "--without", "hair-occlusion-by-rays"], "both have hair-occlusion-by-rays"),
        (&["--without", "rays-through-hair"], "rays-through-hair cannot be left out"),
        (&["--without", "settings-by-accuracy"], "occlusion.opening"),
        (&["--without", "marschner"], "hair[].shading says how"),
        (&["--with", "area-light"], "did you mean \"area-lights\"?"),
    ] {
        for command in ["plan", "check"] {
            let (code, _, err) = run(folder.path(), &[&[command, "scene.toml"], arguments].concat());
            assert_eq!(code, 3, "{command} {arguments:?}: {err}");
            assert!(err.contains(part), "{command} {arguments:?}: {err}");
        }
    }
}

#[test]
fn check_lists_every_fault() {
    let folder = folder("fov = 3\n[camera]\nfov = 500\n[[hair]]\nwidht = 1\n");
    let (code, out, err) = run(folder.path(), &["check", "scene.toml", "--set", "occlusion.mode=raytrace"]);
    assert_eq!((code, out.as_str()), (3, ""));
    let lines: Vec<&str> = err.lines().collect();
    assert_eq!(
        lines,
        [
            "error: scene.toml:1:1: unknown key \"fov\" at the top level; did you mean camera.fov?",
            "error: scene.toml:3:7: camera.fov is 500, outside 0.01 to 179 degrees (Vertical field of view)",
            "error: scene.toml:5:1: unknown key \"widht\" in hair[0]; did you mean \"width\"?",
            "error: --set occlusion.mode=raytrace: occlusion.mode is \"raytrace\"; did you mean \"raytraced\"? known: igloo, raytraced, auto, none",
        ]
    );
}

#[test]
fn check_looks_at_every_scene_that_it_is_given() {
    let folder = folder("environment.color = [1, 1, 1]\nsurface = [{ sphere = {} }]\n");
    fs::write(folder.path().join("bad.toml"), "camera.fov = 500\n").unwrap();
    let (code, out, err) = run(folder.path(), &["check", "bad.toml", "none.toml", "scene.toml"]);
    assert_eq!(code, 3);
    assert!(out.starts_with("scene.toml: sound") && out.matches(": sound").count() == 1, "{out}");
    let errors: Vec<&str> = err.lines().filter(|line| line.starts_with("error: ")).collect();
    assert!(errors.len() == 2 && errors[0].contains("bad.toml:1:14") && errors[1].contains("none.toml"), "{err}");
    // Of several scenes it must be told which one an override does not fit.
    fs::write(folder.path().join("bald.toml"), "environment.color = [1, 1, 1]\n").unwrap();
    let (code, out, err) =
        run(folder.path(), &["check", "-q", "scene.toml", "bald.toml", "--set", "surface[0].color=[1, 1, 1]"]);
    assert_eq!((code, out.as_str()), (3, ""));
    assert!(err.starts_with("error: bald.toml: --set surface[0].color") && err.lines().count() == 1, "{err}");
}

#[test]
fn warnings_are_printed_unless_quiet() {
    let folder = folder("");
    let (code, out, err) = run(folder.path(), &["check", "scene.toml"]);
    assert_eq!(code, 0);
    assert!(out.starts_with("scene.toml: sound, 2 warnings\n"), "{out}");
    assert!(err.lines().all(|line| line.starts_with("warning: scene.toml:1:1: the scene has n")), "{err}");
    assert_eq!(run(folder.path(), &["--quiet", "check", "scene.toml"]), (0, String::new(), String::new()));
}

#[test]
fn check_looks_into_the_files_of_a_scene() {
    let folder = folder("environment.color = [1, 1, 1]\n[[surface]]\nfile = 'a.obj'\n[[hair]]\nfile = 'a.txt'\n");
    fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nl 1 2\n").unwrap();
    fs::write(folder.path().join("a.txt"), "0 0 0 0.1\n0 1 0 0.1\n0 2 0 0.1\n").unwrap();
    let (code, out, err) = run(folder.path(), &["check", "scene.toml"]);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("1 object: 1 strand, 2 segments\n") && out.contains("1 object: 2 triangles\n"), "{out}");
    assert!(err.contains("note: ./a.obj: 1 lines and points are left out"), "{err}");
    // The place is that of the key which names the file.
    fs::write(folder.path().join("a.txt"), "0 0 0 0.1\n0 1 0 x\n").unwrap();
    let (code, _, err) = run(folder.path(), &["check", "scene.toml"]);
    assert_eq!(code, 3);
    assert!(err.starts_with("error: scene.toml:5:8: hair[0].file: ") && err.contains("a.txt: line 2"), "{err}");
}

const FUR: &str = "environment.color = [1, 1, 1]
[[surface]]
name = 'ball'
sphere = { center = [100, 0, 0], radius = 2 }
[[hair]]
name = 'fur'
grow = { on = 'ball', count = 50, segments = 4, length = 1, length_variation = 0, lean = 0, gravity = 0 }
transform.translate = [0, 10, 0]
[[hair]]
grow = { on = 'ball', count = 7, segments = 2, width_root = 0.5, width_tip = 0.25 }
";

#[test]
fn grown_hair_is_written_in_the_space_of_the_scene() {
    let folder = folder(FUR);
    let (code, out, err) = run(folder.path(), &["grow", "scene.toml", "-o", "out.hair"]);
    assert_eq!(code, 0, "{err}");
    assert_eq!(out, "out.hair: 57 strands, 214 segments\n  fur: 50 strands\n  hair[1]: 7 strands\n");
    let path = folder.path().join("out.hair");
    let strands = tress::hair::formats::read(&path, Default::default(), &Default::default()).unwrap().strands;
    assert_eq!((strands.strand_count(), strands.segment_count()), (57, 214));
    for strand in 0..50 {
        // Straight out of the ball of radius 2, moved up by 10.
        let center = glam::Vec3::new(100.0, 10.0, 0.0);
        let [root, tip] = [strands.strand(strand)[0], strands.strand(strand)[4]];
        assert!(
            (root.distance(center) - 2.0).abs() < 0.01 && (tip.distance(center) - 3.0).abs() < 0.02,
            "{root} {tip}"
        );
    }
    assert_eq!(strands.width.at(56, strands.point_count() - 1), 0.25);
    // Written over itself, and nothing else is left.
    assert_eq!(run(folder.path(), &["grow", "-q", "scene.toml", "-o", "out.hair"]), (0, String::new(), String::new()));
    let mut names: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["out.hair", "scene.toml"]);
}

#[test]
fn hair_that_cannot_be_written_is_exit_code_4() {
    let folder = folder(FUR);
    std::os::unix::fs::symlink("/dev/null", folder.path().join("null.hair")).unwrap();
    fs::create_dir(folder.path().join("folder.hair")).unwrap();
    for (file, code, part) in [
        ("out.txt", 2, "end in .hair"),
        ("no/out.hair", 4, "folder no does not exist"),
        ("folder.hair", 4, "folder"),
        ("null.hair", 4, "no regular file"),
    ] {
        let (found, _, err) = run(folder.path(), &["grow", "scene.toml", "-o", file]);
        assert_eq!(found, code, "{file}: {err}");
        assert!(err.contains(file) && err.contains(part), "{err}");
    }
    let (code, _, err) =
        run(folder.path(), &["grow", "scene.toml", "-o", "a.hair", "--set", "hair[0].grow.slope=[2,3]"]);
    assert_eq!(code, 3, "{err}");
}

#[test]
fn info_tells_what_is_in_each_kind_of_file() {
    let folder = folder(FUR);
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("a.txt", "0 0 0 0.1\n0 1 0 0.1\n0 1 0 0.1\n");
    write("mesh", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nf 1 1 2\n");
    write("bad.hair", "HAIR?");
    let image = tress::image::ImageSpec::new(2, 1, vec![("Y".to_owned(), tress::image::PixelFormat::Float)]);
    tress::image::write_atomic(&folder.path().join("a.exr"), &image, &[-1.5, f32::NAN]).unwrap();
    let files = ["a.txt", "bad.hair", "mesh", "a.exr", "none.obj", "scene.toml"];
    let (code, out, err) = run(folder.path(), &[&["info"], &files[..]].concat());
    assert_eq!(code, 3);
    let errors: Vec<&str> = err.lines().collect();
    assert!(errors.len() == 2 && errors[0].contains("bad.hair") && errors[1].contains("none.obj"), "{err}");
    for part in [
        "a.txt: hair (text)\n  strands        1\n  segments       2\n",
        "  bounds         0 0 0 .. 0 1 0\n",
        "  suspicious     1 segments have no length\n",
        "mesh: mesh\n  triangles      2\n",
        "  suspicious     1 triangles have no area\n",
        "a.exr: image (openexr)\n  size           2x1 pixels\n",
        "  Y              -1.5 to -1.5, mean -1.5, 1 NaN, 1 negative (float)\n",
        "  suspicious     1 values are not numbers (NaN)\n",
        "scene.toml: scene\n  picture        512x512 pixels\n  hair           2 objects\n",
    ] {
        assert!(out.contains(part), "{part} in {out}");
    }
    let (code, out, _) = run(folder.path(), &["info", "--json", "a.txt", "a.exr"]);
    assert_eq!(code, 0);
    let json: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!((&json[0]["kind"], &json[0]["facts"]["segments"]), (&"hair".into(), &2.into()));
    assert_eq!((&json[1]["kind"], &json[1]["facts"]["channels"][0]["nan"]), (&"image".into(), &1.into()));
}

#[test]
fn a_wrong_command_line_is_exit_code_2() {
    let folder = folder(SOUND);
    for (arguments, part) in [
        (&["frobnicate"][..], "unrecognized subcommand"),
        (&[], "Usage"),
        (&["render"], "required"),
        (&["render", "scene.toml"], "-o FILE"),
        (&["render", "scene.toml", "-o", "a.exr", "--resolution", "12"], "WIDTHxHEIGHT"),
        (&["render", "scene.toml", "-o", "a.exr", "--frames", "9-1"], "runs backwards"),
        (&["render", "scene.toml", "-o", "a.exr", "--frames", "0-9"], "####"),
        (&["render", "scene.toml", "-o", "a.exr", "--frames", "-9"], "no run of frames"),
        (&["render", "scene.toml", "-o", "a.exr", "--crop", "-9,0,1,1"], "x0,y0,x1,y1"),
        (
            &["render", "scene.toml", "-o", "a.exr", "--occlusion", "x"],
            "[possible values: igloo, raytraced, auto, none]",
        ),
        (&["render", "scene.toml", "-o", "a.exr", "--threads", "0"], "threads"),
        (&["render", "scene.toml", "-o", "a.exr", "--set", "nothing"], "key.path=value"),
        (&["render", "scene.toml", "-o", "a.exr", "--seed", "-1"], "--seed"),
        (&["check", "scene.toml", "-q", "-v"], "cannot be used with"),
        (&["man", "frobnicate"], "no subcommand"),
        (&["completions", "tcsh"], "possible values"),
    ] {
        let (code, out, err) = run(folder.path(), arguments);
        assert_eq!((code, out.as_str()), (2, ""), "{arguments:?}: {err}");
        assert!(err.contains(part), "{arguments:?}: {err}");
    }
}

#[test]
fn what_is_missing_is_exit_code_3_or_4() {
    let folder = folder(SOUND);
    for (arguments, expected, part) in [
        (&["check", "none.toml"][..], 3, "none.toml: cannot read the scene"),
        (&["check", "scene.txt"], 3, "must be .toml or .json"),
        (&["info", "none.hair"], 3, "none.hair: cannot read it"),
        (&["info", "."], 3, "folder"),
        (&["grow", "scene.toml", "-o", "a.hair"], 3, "no hair of this scene is grown"),
        (&["render", "scene.toml", "-o", "no/a.exr"], 4, "the folder no does not exist"),
        (&["render", "scene.toml", "-o", "a.exr", "--stats", "no/s.json"], 4, "the folder no does not exist"),
    ] {
        let (code, _, err) = run(folder.path(), arguments);
        assert_eq!(code, expected, "{arguments:?}: {err}");
        assert!(err.contains(part), "{arguments:?}: {err}");
    }
}

#[test]
fn the_schema_is_printed_as_json() {
    let (code, out, _) = run(Path::new("."), &["schema"]);
    let schema: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, schema["title"].as_str()), (0, Some("Tress scene")));
}

#[test]
fn manual_pages_and_completions_are_printed() {
    let (code, out, _) = run(Path::new("."), &["man"]);
    assert_eq!(code, 0);
    assert!(out.contains(".TH tress 1") && out.contains(".SH \"EXIT STATUS\"") && out.contains("130"), "{out}");
    let (code, out, _) = run(Path::new("."), &["man", "render"]);
    assert_eq!(code, 0);
    assert!(out.contains("occlusion") && out.contains("quiet"), "{out}");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let (code, out, _) = run(Path::new("."), &["completions", shell]);
        assert!(code == 0 && out.contains("tress"), "{shell}");
    }
}

#[test]
fn help_and_version_are_no_errors() {
    let (code, out, _) = run(Path::new("."), &["--help"]);
    assert!(code == 0 && out.contains("Exit status") && out.contains("render"), "{out}");
    let (code, out, _) = run(Path::new("."), &["--version"]);
    assert_eq!((code, out), (0, format!("tress {}\n", env!("CARGO_PKG_VERSION"))));
}

#[test]
fn a_closed_pipe_is_no_error_and_a_full_disk_is() {
    for arguments in [&["schema"][..], &["man"], &["completions", "bash"], &["--help"]] {
        let mut child = tress().args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let mut err = String::new();
        child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
        let status = child.wait().unwrap();
        assert_eq!((status.code(), err.as_str()), (Some(0), ""), "{arguments:?}");
    }
    if Path::new("/dev/full").exists() {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = tress().arg("schema").stdout(full).output().unwrap();
        assert_eq!(output.status.code(), Some(4));
        assert!(String::from_utf8_lossy(&output.stderr).contains("cannot write to standard output"));
    }
}
