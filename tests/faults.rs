//! Writing where it cannot be done, and work that is broken off: never a damaged image, never a good one lost, and a message
//! with the exit code that says what happened.

#[path = "common/program.rs"]
mod program;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use program::{TRESS, start, told};
use tress::hash::unit;
use tress::image::{self, Limits};

const SCENE: &str = r#"
camera = { position = [0, 1, 4], resolution = [40, 32] }
environment.color = [0.8, 0.9, 1.0]
hair = [{ grow = { on = "ball", count = 300, length = 0.4, width_root = 0.02 } }]
[[surface]]
name = "ball"
sphere = { radius = 0.8 }
[output]
compression = "none"
pixel_type = "float"
reproducible = true
[occlusion]
opening = 1
"#;

fn folder() -> tempfile::TempDir {
    program::folder(SCENE)
}

/// Exit code and standard error.
fn tress(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let (code, _, said) = program::tress(folder, arguments);
    (code, said)
}

fn said(output: &Output) -> (Option<i32>, String) {
    let (code, _, said) = told(output);
    (code, said)
}

/// Runs a shell script in a folder; `$TRESS` is the program.
fn shell(folder: &Path, script: &str) -> Output {
    Command::new("sh").current_dir(folder).args(["-ec", script]).env("TRESS", TRESS).output().expect("a shell")
}

/// The same where the script may mount what nobody else sees; none, with a message, where that is not allowed.
fn with_mounts(folder: &Path, script: &str) -> Option<Output> {
    let may = Command::new("unshare").args(["-m", "sh", "-c", "mount -t tmpfs none /mnt"]).output();
    if !may.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: mounting is not allowed here");
        return None;
    }
    let mut command = Command::new("unshare");
    command.current_dir(folder).args(["-m", "sh", "-ec", script]).env("TRESS", TRESS);
    Some(command.output().expect("unshare"))
}

/// The temporary files in a folder.
fn left_over(folder: &Path) -> Vec<PathBuf> {
    let paths = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    paths.filter(|path| path.file_name().unwrap().to_string_lossy().starts_with(".tress-")).collect()
}

/// Whether an image can be read whole.
fn assert_whole(path: &Path) {
    image::read(path, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn a_full_disk_leaves_the_old_image() {
    let folder = folder();
    fs::create_dir(folder.path().join("disk")).unwrap();
    for ending in ["exr", "png", "jpg", "tif"] {
        let script = format!(
            "mount -t tmpfs -o size=128k none disk\n\
             head -c 5000 /dev/urandom > old; cp old disk/a.{ending}\n\
             cat /dev/zero > disk/fill 2> /dev/null || true\n\
             code=0; $TRESS render scene.toml -q -o disk/a.{ending} || code=$?\n\
             cmp old disk/a.{ending}; ls -A disk; exit $code"
        );
        let Some(output) = with_mounts(folder.path(), &script) else { return };
        let (code, text) = said(&output);
        assert_eq!(code, Some(4), "{ending}: {text}");
        // A library that does not look at what its last write returns is found out when the file is read back.
        let told = text.contains("cannot write") || text.contains("is the disk full?");
        assert!(text.contains("error: disk/a.") && told, "{text}");
        let names = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(!names.contains(".tress-") && names.contains("fill"), "{names}");
    }
}

#[test]
fn a_full_disk_is_told_by_the_commands_that_write_other_files() {
    let folder = folder();
    fs::create_dir(folder.path().join("disk")).unwrap();
    for command in ["grow scene.toml -o disk/a.hair", "crosscheck scene.toml --points 16 --rays 2 --json disk/a.json"] {
        let script = format!(
            "mount -t tmpfs -o size=128k none disk\n\
             cat /dev/zero > disk/fill 2> /dev/null || true\n\
             code=0; $TRESS {command} -q || code=$?; ls -A disk; exit $code"
        );
        let Some(output) = with_mounts(folder.path(), &script) else { return };
        let (code, text) = said(&output);
        assert_eq!(code, Some(4), "{command}: {text}");
        assert!(text.contains("disk/a.") && text.contains("No space left"), "{text}");
        assert_eq!(String::from_utf8_lossy(&output.stdout), "fill\n");
    }
}

/// The system sends a signal that ends a program which does not expect it.
#[test]
fn the_largest_file_that_a_shell_allows_is_an_error_like_others() {
    let folder = folder();
    let image = folder.path().join("a.exr");
    fs::write(&image, b"old").unwrap();
    let output = shell(folder.path(), "ulimit -f 8; exec $TRESS render scene.toml -q -o a.exr");
    let (code, text) = said(&output);
    assert_eq!(code, Some(4), "{:?}: {text}", output.status);
    assert!(text.contains("error: a.exr"), "{text}");
    assert_eq!(fs::read(&image).unwrap(), b"old");
    assert_eq!(left_over(folder.path()), [] as [PathBuf; 0]);
}

#[test]
fn a_read_only_folder_is_told_before_the_work() {
    let folder = folder();
    fs::create_dir(folder.path().join("disk")).unwrap();
    fs::write(folder.path().join("disk/a.exr"), b"old").unwrap();
    let script = "mount --bind disk disk; mount -o remount,ro,bind disk\n\
                  exec $TRESS render scene.toml -o disk/a.exr";
    let Some(output) = with_mounts(folder.path(), script) else { return };
    let (code, text) = said(&output);
    assert_eq!(code, Some(4), "{text}");
    assert!(text.contains("Read-only file system") && !text.contains("wrote"), "{text}");
    assert_eq!(fs::read(folder.path().join("disk/a.exr")).unwrap(), b"old");
}

#[test]
fn what_cannot_be_replaced_is_refused_before_the_work() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("folder.exr")).unwrap();
    fs::write(path("kept.exr"), b"good").unwrap();
    fs::set_permissions(path("kept.exr"), PermissionsExt::from_mode(0o444)).unwrap();
    std::os::unix::fs::symlink("/dev/full", path("device.exr")).unwrap();
    fs::write(path("kept.json"), b"good").unwrap();
    fs::set_permissions(path("kept.json"), PermissionsExt::from_mode(0o444)).unwrap();
    for (arguments, name, part) in [
        (["-o", "folder.exr", "-o", "b.png"], "folder.exr", "folder"),
        (["-o", "kept.exr", "-o", "b.png"], "kept.exr", "read-only"),
        (["-o", "device.exr", "-o", "b.png"], "device.exr", "regular file"),
        (["-o", "b.png", "--stats", "kept.json"], "kept.json", "read-only"),
    ] {
        let (code, text) = tress(folder.path(), &[&["render", "scene.toml"][..], &arguments].concat());
        assert_eq!(code, Some(4), "{text}");
        assert!(text.contains(name) && text.contains(part), "{text}");
        assert!(!path("b.png").exists(), "nothing was rendered");
    }
    assert_eq!(
        (fs::read(path("kept.exr")).unwrap(), fs::read(path("kept.json")).unwrap()),
        (b"good".into(), b"good".into())
    );
    let output = shell(folder.path(), "exec $TRESS check scene.toml > /dev/full");
    let (code, text) = said(&output);
    assert_eq!(code, Some(4), "{text}");
    assert!(text.contains("standard output"), "{text}");
}

/// What was done before is kept, and what is missing is named.
#[test]
fn a_missing_file_ends_a_range_of_frames_where_it_is_missing() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let scene =
        SCENE.replace("grow = { on = \"ball\", count = 300, length = 0.4, width_root = 0.02 }", "file = 'h.##.txt'");
    fs::write(path("frames.toml"), scene).unwrap();
    for frame in [1, 3] {
        fs::write(path(&format!("h.0{frame}.txt")), "0 0 1 0.05\n0 1 1 0.05\n").unwrap();
    }
    let arguments = ["render", "frames.toml", "--frames", "1-3", "-o", "a.#.png", "--stats", "s.json"];
    let (code, text) = tress(folder.path(), &arguments);
    assert_eq!(code, Some(3), "{text}");
    assert!(text.lines().any(|line| line.starts_with("error: ") && line.contains("h.02.txt")), "{text}");
    assert_whole(&path("a.1.png"));
    assert!(!path("a.2.png").exists() && !path("a.3.png").exists());
    let statistics: serde_json::Value = serde_json::from_slice(&fs::read(path("s.json")).unwrap()).unwrap();
    assert_eq!(statistics.as_array().map(Vec::len), Some(1));
    assert_eq!(left_over(folder.path()), [] as [PathBuf; 0]);
}

/// Each writes a file of its own; the last one's stays.
#[test]
fn two_renders_to_one_file_leave_a_whole_one() {
    let folder = folder();
    for _ in 0..3 {
        let run = || {
            let mut command = Command::new(TRESS);
            command.current_dir(folder.path()).args(["render", "scene.toml", "-q", "-o", "a.exr", "--threads", "1"]);
            command.spawn().expect("tress runs")
        };
        let children = [run(), run(), run()];
        assert!(children.into_iter().all(|mut child| child.wait().unwrap().success()));
        assert_whole(&folder.path().join("a.exr"));
    }
    assert_eq!(left_over(folder.path()), [] as [PathBuf; 0]);
}

/// Killed at any moment, a render leaves the old image or the new one, and beside it at most a file whose name says whose it is.
#[test]
#[ignore = "slow: fifty renders that are killed"]
fn a_killed_render_leaves_a_whole_image() {
    let folder = folder();
    let image = folder.path().join("a.exr");
    let arguments = ["render", "scene.toml", "-q", "-o", "a.exr", "--resolution", "160x128"];
    let begun = std::time::Instant::now();
    assert_eq!(tress(folder.path(), &arguments).0, Some(0));
    let whole = begun.elapsed();
    let good = fs::read(&image).unwrap();
    let (mut killed, mut left) = (0, 0);
    for run in 0..50 {
        let mut child = start(folder.path(), &arguments);
        // Most of them near the end, where the file is written.
        let share = if run % 5 == 0 { unit(&[run]) } else { 0.7 + 0.4 * unit(&[run]) };
        std::thread::sleep(Duration::from_secs_f64(whole.as_secs_f64() * share));
        child.kill().expect("a signal");
        killed += u32::from(!child.wait().unwrap().success());
        // The scene is the same, and so is its image to the bit, whichever run wrote it.
        assert_eq!(fs::read(&image).unwrap(), good, "run {run}");
        left += left_over(folder.path()).len();
    }
    eprintln!("{killed} of 50 were killed, {left} times a temporary file was there");
    assert!(killed >= 10, "{killed}");
    // Young ones stay: somebody may be at work. Old ones go with the next write.
    for path in left_over(folder.path()) {
        let file = fs::File::options().write(true).open(&path).unwrap();
        file.set_modified(std::time::SystemTime::now() - Duration::from_secs(2 * 3600)).unwrap();
    }
    assert_eq!(tress(folder.path(), &arguments).0, Some(0));
    assert_eq!(left_over(folder.path()), [] as [PathBuf; 0]);
}
