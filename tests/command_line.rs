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
    assert_eq!(out, "scene.toml: sound: 0 hair objects, 1 surface, 0 lights; 0 warnings\n");
    assert_eq!(run(folder.path(), &["check", "-q", "scene.toml"]), (0, String::new(), String::new()));
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
            "error: --set occlusion.mode=raytrace: occlusion.mode is \"raytrace\"; did you mean \"raytraced\"? known: igloo, raytraced, none",
        ]
    );
}

#[test]
fn warnings_are_printed_unless_quiet() {
    let folder = folder("");
    let (code, out, err) = run(folder.path(), &["check", "scene.toml"]);
    assert_eq!(code, 0);
    assert!(out.ends_with("2 warnings\n"), "{out}");
    assert!(err.lines().all(|line| line.starts_with("warning: scene.toml:1:1: the scene has n")), "{err}");
    assert_eq!(run(folder.path(), &["--quiet", "check", "scene.toml"]), (0, String::new(), String::new()));
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
        (&["render", "scene.toml", "-o", "a.exr", "--occlusion", "x"], "[possible values: igloo, raytraced, none]"),
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
