//! The program as a process, for the tests that run it as a user does.
#![allow(dead_code, reason = "each test file uses a part")]

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

pub const TRESS: &str = env!("CARGO_BIN_EXE_tress");

/// A folder of its own with a scene in `scene.toml`.
pub fn folder(scene: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("scene.toml"), scene).expect("a scene");
    folder
}

/// Runs it in a folder: exit code (none after a signal), standard output and standard error.
pub fn tress(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    told(&Command::new(TRESS).current_dir(folder).args(arguments).output().expect("tress runs"))
}

/// Exit code, standard output and standard error of what has ended.
pub fn told(output: &Output) -> (Option<i32>, String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

/// Starts it in a folder, and lets it talk to nobody.
pub fn start(folder: &Path, arguments: &[&str]) -> Child {
    let mut command = Command::new(TRESS);
    command.current_dir(folder).args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().expect("tress runs")
}

/// What Ctrl-C sends.
pub fn interrupt(child: &Child) {
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill runs");
    assert!(sent.success());
}

/// Waits for its end, and kills it after the limit: its exit code.
pub fn wait(child: &mut Child, limit: Duration) -> Option<i32> {
    let begin = Instant::now();
    while begin.elapsed() < limit {
        if let Some(status) = child.try_wait().expect("a child") {
            return status.code();
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().expect("a child");
    panic!("it did not stop within {limit:?}");
}
