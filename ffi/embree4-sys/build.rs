//! Finds Embree, binds its header, and tells the crates above where the library is.
//!
//! Header and library always come from one place: `EMBREE_DIR` if set, else `ffi/native` (filled by `ffi/setup.sh`), else the system.
//! Metadata for dependents: `DEP_EMBREE4_LIB_DIR` (absent when the dynamic linker finds the library anyway) and `DEP_EMBREE4_INCLUDE`.

use std::env;
use std::fs;
use std::os::unix::fs::symlink;
use std::panic;
use std::path::{Path, PathBuf};

/// The first version whose `RTCRayHit` has the layout that 4.4 has.
const OLDEST: u32 = 40300;

struct Embree {
    include: PathBuf,
    lib_dir: PathBuf,
    /// The dynamic linker looks in `lib_dir` unasked.
    system: bool,
}

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=EMBREE_DIR");
    if let Err(message) = run() {
        println!("cargo::error={}", message.replace('\n', " "));
    }
}

fn run() -> Result<(), String> {
    let out_dir = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    let embree = find()?;
    check_version(&embree.include)?;
    bind(&embree.include, &out_dir.join("embree4.rs"))?;

    println!("cargo::rerun-if-changed={}", embree.include.join("embree4/rtcore_config.h").display());
    println!("cargo::rerun-if-changed={}", embree.lib_dir.join("libembree4.so").display());
    println!("cargo::rustc-link-lib=dylib=embree4");
    println!("cargo::metadata=include={}", embree.include.display());
    if !embree.system {
        // Cargo puts link-search folders inside `target` into LD_LIBRARY_PATH of what it runs: so doctests, which take no link
        // arguments, find the library too.
        let links = out_dir.join("lib");
        link_libraries(&embree.lib_dir, &links)
            .map_err(|e| format!("cannot link {} into {}: {e}", embree.lib_dir.display(), links.display()))?;
        println!("cargo::rustc-link-search=native={}", links.display());
        println!("cargo::rustc-link-arg=-Wl,-rpath,{}", embree.lib_dir.display());
        println!("cargo::metadata=lib_dir={}", embree.lib_dir.display());
    }
    Ok(())
}

fn find() -> Result<Embree, String> {
    let arch = env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default();
    let lib_dirs = ["lib".to_string(), format!("lib/{arch}-linux-gnu"), "lib64".to_string()];
    let look = |root: &Path, system: bool| -> Option<Embree> {
        let include = root.join("include");
        include.join("embree4/rtcore.h").is_file().then_some(())?;
        let lib_dir = lib_dirs.iter().map(|d| root.join(d)).find(|d| d.join("libembree4.so").exists())?;
        Some(Embree { include, lib_dir, system })
    };

    if let Some(root) = env::var_os("EMBREE_DIR").filter(|v| !v.is_empty()) {
        let root = fs::canonicalize(&root).unwrap_or(PathBuf::from(root));
        return look(&root, false).ok_or_else(|| {
            format!(
                "EMBREE_DIR is {}, which does not hold include/embree4/rtcore.h and lib/libembree4.so. Correct it, or unset it and run ffi/setup.sh",
                root.display()
            )
        });
    }
    let native = Path::new(env!("CARGO_MANIFEST_DIR")).join("../native");
    let native = fs::canonicalize(&native).unwrap_or(native);
    look(&native, false).or_else(|| look(Path::new("/usr"), true)).ok_or_else(|| {
        "Embree 4 (header and library) is neither in ffi/native nor in /usr. Run ffi/setup.sh, or set EMBREE_DIR to the folder that holds include/embree4 and lib".to_string()
    })
}

fn check_version(include: &Path) -> Result<(), String> {
    let path = include.join("embree4/rtcore_config.h");
    let text =
        fs::read_to_string(&path).map_err(|e| format!("cannot read {}: {e}. Run ffi/setup.sh", path.display()))?;
    let version = text
        .lines()
        .find_map(|line| line.strip_prefix("#define RTC_VERSION ")?.trim().parse::<u32>().ok())
        .ok_or_else(|| format!("{} does not define RTC_VERSION. Run ffi/setup.sh", path.display()))?;
    if version < OLDEST {
        return Err(format!(
            "{} is Embree {}.{}.{}; Tress needs 4.3.0 or newer. Run ffi/setup.sh, or set EMBREE_DIR to a newer one",
            path.display(),
            version / 10000,
            version / 100 % 100,
            version % 100
        ));
    }
    Ok(())
}

fn bind(include: &Path, output: &Path) -> Result<(), String> {
    let generate = || {
        bindgen::Builder::default()
            .header(include.join("embree4/rtcore.h").to_string_lossy())
            .clang_arg(format!("-I{}", include.display()))
            .allowlist_function("rtc.*")
            .allowlist_type("RTC.*")
            .allowlist_var("RTC.*")
            .prepend_enum_name(false)
            .derive_default(true)
            .layout_tests(true)
            .generate_comments(false)
            .formatter(bindgen::Formatter::None)
            .generate()
    };
    // Bindgen panics when libclang cannot be loaded; that is the user's to mend, so say it without a backtrace.
    panic::set_hook(Box::new(|_| {}));
    let bindings = panic::catch_unwind(generate);
    let _ = panic::take_hook();
    bindings
        .map_err(|cause| {
            let cause = cause.downcast_ref::<String>().map_or("unknown cause", String::as_str);
            format!("libclang, which reads Embree's header, cannot be used: {cause}. Run ffi/setup.sh")
        })?
        .map_err(|e| format!("Embree's header in {} cannot be read: {e}. Run ffi/setup.sh", include.display()))?
        .write_to_file(output)
        .map_err(|e| format!("cannot write {}: {e}", output.display()))
}

/// Links Embree and the libraries that came with it into a folder of its own.
fn link_libraries(from: &Path, to: &Path) -> std::io::Result<()> {
    if to.exists() {
        fs::remove_dir_all(to)?;
    }
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let name = entry.file_name();
        let text = name.to_string_lossy();
        if text.starts_with("libembree4") || text.starts_with("libtbb") {
            symlink(entry.path(), to.join(&name))?;
        }
    }
    Ok(())
}
