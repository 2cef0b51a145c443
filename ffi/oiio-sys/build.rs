//! Finds OpenImageIO with pkg-config and compiles the C++ shim against it.

use std::path::Path;

/// The oldest release whose interface the shim is written for.
const OLDEST: &str = "2.4";

fn main() {
    for file in ["shim.cpp", "shim.h"] {
        println!("cargo:rerun-if-changed={file}");
    }
    // Cargo's link lines are held back until the shim is compiled: a static library must precede what it needs.
    let mut config = pkg_config::Config::new();
    let library = match config.atleast_version(OLDEST).cargo_metadata(false).env_metadata(false).probe("OpenImageIO") {
        Ok(library) => library,
        Err(error) => stop(&reason(&error)),
    };
    let mut build = cc::Build::new();
    build.cpp(true).std("c++17").file("shim.cpp").warnings(true).extra_warnings(true);
    // As a system folder a second time, /usr/include hides the standard library's own headers from #include_next.
    for path in library.include_paths.iter().filter(|path| path.as_path() != Path::new("/usr/include")) {
        // System folders, so that warnings inside OpenImageIO's headers stay out of our output.
        build.flag("-isystem").flag(path);
    }
    if let Err(error) = build.try_compile("oiio_shim") {
        stop(&format!("the C++ shim over OpenImageIO {} does not compile: {error}", library.version));
    }
    for path in &library.link_paths {
        println!("cargo:rustc-link-search=native={}", path.display());
    }
    for name in &library.libs {
        println!("cargo:rustc-link-lib=dylib={name}");
    }
    for variable in ["PKG_CONFIG", "PKG_CONFIG_PATH", "PKG_CONFIG_LIBDIR", "PKG_CONFIG_SYSROOT_DIR"] {
        println!("cargo:rerun-if-env-changed={variable}");
    }
    println!("cargo:version={}", library.version);
}

/// pkg-config's reports run over many lines; the first says which case it is.
fn reason(error: &pkg_config::Error) -> String {
    match error {
        pkg_config::Error::Command { .. } => "pkg-config cannot be run".to_owned(),
        pkg_config::Error::EnvNoPkgConfig(variable) => format!("the variable {variable} forbids asking pkg-config"),
        pkg_config::Error::CrossCompilation => "pkg-config is not set up for cross compilation".to_owned(),
        _ => format!("pkg-config finds no OpenImageIO of version {OLDEST} or newer"),
    }
}

/// Ends the build without the stack trace that a panic would add.
fn stop(reason: &str) -> ! {
    eprintln!("\nerror: {reason}.\nRun ffi/setup.sh from the project's root: it installs what Tress links to.\n");
    std::process::exit(1)
}
