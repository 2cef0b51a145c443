//! Ctrl-C, in a process of its own: signals and their flag belong to the whole process.

use std::process::Command;

use signal_hook::consts::SIGINT;
use signal_hook::low_level::raise;
use tress::cli::interrupt;

/// The child is this test again, told by this variable.
const CHILD: &str = "TRESS_TEST_INTERRUPT_CHILD";

#[test]
fn the_first_asks_and_the_second_ends() {
    if std::env::var_os(CHILD).is_some() {
        interrupt::install().unwrap();
        interrupt::install().unwrap();
        assert!(!interrupt::requested());
        raise(SIGINT).unwrap();
        assert!(interrupt::requested());
        println!("asked");
        raise(SIGINT).unwrap();
        unreachable!("the second signal ends the process");
    }
    let test = std::env::current_exe().unwrap();
    let arguments = ["--exact", "the_first_asks_and_the_second_ends", "--nocapture"];
    let output = Command::new(test).args(arguments).env(CHILD, "1").output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("asked"), "{said}{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(130));
}
