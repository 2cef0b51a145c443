//! Gives the fuzz targets the folder of the native libraries to look in at run time.

use std::env;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // Absent when the libraries are the system's.
    if let Some(folder) = env::var_os("DEP_EMBREE4_LIB_DIR") {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{}", folder.display());
    }
}
