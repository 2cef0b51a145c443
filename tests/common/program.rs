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

/// CPU time that it has taken, in seconds: unlike the clock, a busy machine does not stretch it.
fn cpu_seconds(child: &Child) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", child.id())).expect("a process");
    // After its name, which ends with a parenthesis, user and system time are the twelfth and thirteenth field, in hundredths.
    let fields = stat.rsplit(')').next().expect("fields").split_whitespace();
    fields.skip(11).take(2).map(|ticks| ticks.parse::<f64>().expect("a number")).sum::<f64>() / 100.0
}

/// Interrupts what runs on two threads once it has worked for a while, and sees that it ends within a second's work of both, and without waiting for
/// anything: its exit code.
pub fn interrupt_at_work(child: &mut Child) -> Option<i32> {
    let begin = Instant::now();
    while cpu_seconds(child) < 2.0 {
        assert!(child.try_wait().expect("a child").is_none(), "it ended too early");
        kill_unless(child, begin.elapsed() < Duration::from_secs(120), "it does not work");
        std::thread::sleep(Duration::from_millis(10));
    }
    interrupt(child);
    let (begin, before) = (Instant::now(), cpu_seconds(child));
    loop {
        let more = cpu_seconds(child) - before;
        if let Some(status) = child.try_wait().expect("a child") {
            assert!(more <= 2.0, "it worked for {more} s after it was interrupted");
            return status.code();
        }
        kill_unless(child, more <= 2.0, "it goes on working after it was interrupted");
        // A machine that is fifteen times too busy gets so long for two seconds of work.
        kill_unless(
            child,
            begin.elapsed() < Duration::from_secs(30),
            "it waits for something after it was interrupted",
        );
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Leaves nothing running behind when an assertion fails.
fn kill_unless(child: &mut Child, holds: bool, what: &str) {
    if !holds {
        child.kill().expect("a child");
        panic!("{what}");
    }
}
