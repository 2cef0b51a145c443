//! What `ffi/setup.sh` says where it cannot help. None of these cases gets as far as installing anything.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../setup.sh");

/// A folder of this test's own, with an `os-release` in it.
fn system(name: &str, os_release: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("os-release"), os_release).unwrap();
    folder
}

fn program(folder: &Path, name: &str, body: &str) {
    let path = folder.join(name);
    fs::write(&path, format!("#!/bin/sh\n{body}\n")).unwrap();
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
}

/// Runs the script on that system, with the folder's programs before the usual ones; returns what it says when it fails.
fn complaint(folder: &Path) -> String {
    let output = Command::new("bash")
        .arg(SCRIPT)
        .env("TRESS_OS_RELEASE", folder.join("os-release"))
        .env("PATH", format!("{}:/usr/bin:/bin", folder.display()))
        .env("HOME", folder)
        .env_remove("CARGO_HOME")
        .env_remove("SUDO_USER")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(text.matches("setup: failed while").count(), 1, "{text}");
    text
}

#[test]
fn other_systems_are_named() {
    for (name, id, version) in [("ubuntu", "ubuntu", "24.04"), ("old", "debian", "11"), ("sid", "debian", "")] {
        let folder = system(name, &format!("ID={id}\nVERSION_ID=\"{version}\"\n"));
        let text = complaint(&folder);
        let version = if version.is_empty() { "unknown" } else { version };
        assert!(text.contains(&format!("this is '{id} {version}', not Debian 12 or 13")), "{text}");
        assert!(text.contains("EMBREE_DIR"), "{text}");
    }
}

#[test]
fn a_system_without_os_release_is_told_what_to_do() {
    let folder = system("none", "");
    fs::remove_file(folder.join("os-release")).unwrap();
    let text = complaint(&folder);
    assert!(text.contains("os-release cannot be read") && text.contains("EMBREE_DIR"), "{text}");
}

#[test]
fn debian_12_on_another_processor_is_told_what_to_do() {
    let folder = system("arm", "ID=debian\nVERSION_ID=12\n");
    program(&folder, "uname", "echo aarch64");
    let text = complaint(&folder);
    assert!(text.contains("x86_64 only, this is aarch64") && text.contains("Debian 13"), "{text}");
}

#[test]
fn a_missing_cargo_is_named() {
    if Path::new("/usr/bin/cargo").exists() {
        eprintln!("skipped: cargo is installed for everyone here");
        return;
    }
    for version in ["12", "13"] {
        let folder = system(&format!("cargo{version}"), &format!("ID=debian\nVERSION_ID={version}\n"));
        program(&folder, "uname", "echo x86_64");
        assert!(complaint(&folder).contains("cargo was not found"));
    }
}

#[test]
fn missing_packages_are_named_where_nobody_may_install_them() {
    // With sudo around or as root the script would really install.
    let may_install = ["/usr/bin/sudo", "/bin/sudo"].iter().any(|p| Path::new(p).exists())
        || fs::metadata("/proc/self").is_ok_and(|m| std::os::unix::fs::MetadataExt::uid(&m) == 0);
    if may_install {
        eprintln!("skipped: here the script could install packages");
        return;
    }
    let folder = system("packages", "ID=debian\nVERSION_ID=13\n");
    program(&folder, "cargo", "");
    program(&folder, "dpkg-query", "exit 1");
    let text = complaint(&folder);
    assert!(text.contains("these are missing") && text.contains("libembree-dev"), "{text}");
}
