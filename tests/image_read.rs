//! Reading images that others made, good and bad, and files cut short.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use std::{env, fs, thread};
use tress::image::{Encoding, Error, Image, ImageSpec, Limits, PixelFormat, info, read, write_atomic};

/// A file or folder of real input, or `None` with a message.
fn data(path: &str) -> Option<PathBuf> {
    let full = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")).join(path);
    if !full.exists() {
        eprintln!("skipped: {} is absent", full.display());
        return None;
    }
    Some(full)
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    let folders: Vec<_> = found.extract_if(.., |path| path.is_dir()).collect();
    found.extend(folders.iter().flat_map(|folder| files_below(folder)));
    found.sort();
    found
}

fn load(path: &Path) -> Image {
    read(path, &Limits::default()).unwrap()
}

fn extremes(values: impl Iterator<Item = f32>) -> (f32, f32) {
    values.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

const CHILD: &str = "TRESS_TEST_READ_BELOW";

/// Reads every file below the folder that the parent test names; an image or an error, but no panic and no crash.
#[test]
fn child_reads_files() {
    let Some(folder) = env::var_os(CHILD) else { return };
    for file in files_below(Path::new(&folder)) {
        println!("reading {}", file.display());
        match read(&file, &Limits::default()) {
            Ok(image) => {
                let count = image.width as usize * image.height as usize * image.channels.len();
                assert_eq!(image.pixels.len(), count);
                let _ = image.rgb();
            }
            Err(error) => assert!(error.to_string().starts_with(&file.display().to_string()), "{error}"),
        }
    }
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let peak = status.lines().find(|line| line.starts_with("VmHWM")).unwrap();
    let kilobytes: u64 = peak.split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!(kilobytes < 1 << 20, "{peak}");
}

/// In a process of its own: a crash or a hang of the library shall fail this test and not end all of them.
#[test]
fn damaged_files_neither_crash_nor_hang() {
    let Some(folder) = data("bad") else { return };
    let mut child = Command::new(env::current_exe().unwrap())
        .args(["--exact", "child_reads_files", "--nocapture"])
        .env(CHILD, folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let limit = Instant::now() + Duration::from_secs(60);
    while child.try_wait().unwrap().is_none() && Instant::now() < limit {
        thread::sleep(Duration::from_millis(20));
    }
    let _ = child.kill();
    let output = child.wait_with_output().unwrap();
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    assert!(output.status.success(), "{}: {text}", output.status);
    assert!(text.contains("memory_DOS_1"), "the child did not read the files: {text}");
}

#[test]
fn bombs_are_refused_by_their_headers() {
    let Some(folder) = data("bad") else { return };
    for file in ["hdr/bomb-40000.hdr", "exr/damaged/memory_DOS_2.2"] {
        let error = read(&folder.join(file), &Limits::default()).unwrap_err();
        assert!(matches!(error, Error::TooLarge { .. }), "{error}");
    }
    // Without our limit on memory the claim still exceeds what the file can hold.
    let error = read(&folder.join("hdr/bomb-40000.hdr"), &Limits { max_bytes: u64::MAX }).unwrap_err();
    assert!(matches!(error, Error::Implausible { width: 40_000, .. }), "{error}");
}

#[test]
fn the_limit_is_the_bytes_of_the_floats() {
    let Some(file) = data("env/uffizi_probe-128.exr") else { return };
    let bytes = 128 * 128 * 3 * 4;
    assert!(read(&file, &Limits { max_bytes: bytes }).is_ok());
    assert!(matches!(read(&file, &Limits { max_bytes: bytes - 1 }), Err(Error::TooLarge { .. })));
}

#[test]
fn radiance_equals_its_reference() {
    let Some(file) = data("bad/hdr/image-rs_image1.hdr") else { return };
    let reference = load(&file.with_file_name("image-rs_image1.hdr.reference.tiff"));
    let image = load(&file);
    assert_eq!(image.encoding, Encoding::Linear);
    assert_eq!(image.rgb().unwrap(), reference.rgb().unwrap());
    assert!(image.pixels.iter().any(|&value| value > 0.1));
}

#[test]
fn run_length_coding_that_cannot_be_read_is_an_error() {
    let Some(file) = data("bad/hdr/image-rs_old-rle.hdr") else { return };
    assert!(matches!(read(&file, &Limits::default()), Err(Error::Library { .. })));
}

#[test]
fn environments_have_their_known_size_and_range() {
    let Some(folder) = data("env") else { return };
    for (file, size, low, high) in [
        ("OrientationLatLong.exr", [1024, 512], None, None),
        ("StageEnvLatLong.exr", [1000, 500], None, Some(4096.0)),
        ("pmndrs_studio.hdr", [1024, 512], None, Some(3568.0)),
        ("pmndrs_venice.hdr", [1024, 512], None, Some(9.7)),
        ("uffizi_probe-128.exr", [128, 128], Some(-1.0_f32), None),
        ("uffizi_latlong_env-128.exr", [128, 64], None, None),
    ] {
        let image = load(&folder.join(file)).rgb().unwrap();
        assert_eq!([image.width, image.height], size, "{file}");
        let (lowest, highest) = extremes(image.pixels.into_iter().flatten());
        assert!(low.is_none_or(|low| (lowest - low).abs() < 0.05), "{file}: lowest {lowest}");
        assert!(high.is_none_or(|high| (highest / high - 1.0_f32).abs() < 0.01), "{file}: highest {highest}");
    }
}

#[test]
fn tiles_are_read_whole() {
    let Some(file) = data("env/StageEnvLatLong.exr") else { return };
    let tile = info(&file).unwrap().tile.unwrap();
    let image = load(&file).rgb().unwrap();
    // No tile is left at the zeros that the buffer started with.
    for y in (0..500).step_by(tile[1] as usize) {
        for x in (0..1000).step_by(tile[0] as usize) {
            let rows = y..(y + tile[1] as usize).min(500);
            let columns = x..(x + tile[0] as usize).min(1000);
            let lit = |y: usize| image.pixels[y * 1000..][columns.clone()].iter().any(|pixel| *pixel != [0.0; 3]);
            assert!(rows.clone().any(lit), "{x}, {y}");
        }
    }
}

/// The same pixels in four data windows: the picture must be cut or padded to the display window.
#[test]
fn data_windows_are_placed_in_display_windows() {
    let Some(folder) = data("bad/exr/windows") else { return };
    let whole = load(&folder.join("t01.exr")).rgb().unwrap();
    for (file, origin, size) in
        [("t05.exr", [-30, -20], [340, 260]), ("t09.exr", [-400, 0], [200, 300]), ("t16.exr", [40, 40], [481, 371])]
    {
        let image = load(&folder.join(file));
        assert_eq!((image.origin, image.full_size), (origin, size), "{file}");
        let image = image.rgb().unwrap();
        for (index, pixel) in image.pixels.iter().enumerate() {
            let x = (index % size[0] as usize) as i32 - origin[0];
            let y = (index / size[0] as usize) as i32 - origin[1];
            let inside = (0..400).contains(&x) && (0..300).contains(&y);
            let expected = if inside { whole.pixels[y as usize * 400 + x as usize] } else { [0.0; 3] };
            assert_eq!(*pixel, expected, "{file} {x} {y}");
        }
    }
}

#[test]
fn not_a_number_and_infinity_survive() {
    let Some(folder) = data("bad/exr/odd_values") else { return };
    let rings = load(&folder.join("BrightRingsNanInf.exr")).pixels;
    assert!(rings.iter().any(|value| value.is_nan()) && rings.iter().any(|value| value.is_infinite()));
    let every_half: std::collections::HashSet<u32> = load(&folder.join("AllHalfValues.exr"))
        .pixels
        .into_iter()
        .filter(|value| value.is_finite())
        .map(f32::to_bits)
        .collect();
    // Two signs, 31 finite exponents, 10 bits of mantissa.
    assert_eq!(every_half.len(), 2 * 31 * 1024);
    assert_eq!(load(&folder.join("WideFloatRange.exr")).channels, ["G"]);
}

#[test]
fn what_is_no_image_file_is_said_to_be_none() {
    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("text.exr");
    fs::write(&text, "a text").unwrap();
    let empty = folder.path().join("empty.png");
    fs::write(&empty, "").unwrap();
    for file in [text, empty] {
        assert!(matches!(info(&file), Err(Error::UnknownFormat { .. })), "{}", file.display());
    }
    assert!(matches!(info(folder.path()), Err(Error::NotAFile { .. })));
    assert!(matches!(info(Path::new("/dev/zero")), Err(Error::NotAFile { .. })));
    assert!(matches!(info(&folder.path().join("none.exr")), Err(Error::Io { .. })));
}

/// Noise, so that no compression can leave the end of a file without meaning.
fn noise(folder: &Path, name: &str, format: PixelFormat) -> PathBuf {
    let channels = ["R", "G", "B"].map(|name| (name.to_owned(), format)).to_vec();
    let hash = |i: u32| ((i ^ i >> 7).wrapping_mul(0x85EB_CA6B) >> 9).wrapping_mul(0xC2B2_AE35) >> 8;
    let values = (0..64_u32 * 64 * 3).map(|i| hash(i) as f32 / (1 << 24) as f32);
    let path = folder.join(name);
    write_atomic(&path, &ImageSpec::new(64, 64, channels), &values.collect::<Vec<_>>()).unwrap();
    path
}

#[test]
fn files_cut_short_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = vec![
        noise(folder.path(), "a.exr", PixelFormat::Half),
        noise(folder.path(), "a.png", PixelFormat::U8),
        noise(folder.path(), "a.jpg", PixelFormat::U8),
        noise(folder.path(), "a.tif", PixelFormat::U8),
    ];
    let real = ["env/StageEnvLatLong.exr", "bad/hdr/image-rs_image1.hdr", "env/uffizi_probe-128.exr"];
    files.extend(real.iter().filter_map(|file| data(file)));
    for file in files {
        let bytes = fs::read(&file).unwrap();
        let cut = folder.path().join(file.file_name().unwrap()).with_extension(format!("cut.{}", bytes.len()));
        for percent in [1, 10, 50, 90] {
            // The multi-resolution file ends with its smaller levels, which are not read.
            if percent == 90 && file.ends_with("StageEnvLatLong.exr") {
                continue;
            }
            fs::write(&cut, &bytes[..bytes.len() * percent / 100]).unwrap();
            let result = read(&cut, &Limits::default()).map(|image| image.width);
            assert!(result.is_err(), "{} cut to {percent} %: {result:?}", file.display());
        }
    }
}

/// One byte in a hundred is replaced: whatever comes of it, it is a result.
#[test]
fn scrambled_files_give_a_result() {
    let folder = tempfile::tempdir().unwrap();
    let files = [
        noise(folder.path(), "a.exr", PixelFormat::Half),
        noise(folder.path(), "a.png", PixelFormat::U8),
        noise(folder.path(), "a.tif", PixelFormat::U8),
    ];
    for file in files {
        let bytes = fs::read(&file).unwrap();
        for seed in 0..20_u64 {
            let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
            let mut scrambled = bytes.clone();
            for byte in scrambled.iter_mut().skip(8) {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                if state >> 57 == 0 {
                    *byte = (state >> 40) as u8;
                }
            }
            fs::write(&file, scrambled).unwrap();
            // Pixels that cannot be decoded are not what memory held before.
            let [a, b] = [0x55_u8, 0xAA].map(|byte| {
                drop(std::hint::black_box(vec![vec![byte; 1 << 14]; 64]));
                let image = read(&file, &Limits::default()).ok()?.rgb().ok()?;
                Some(image.pixels.into_iter().map(|rgb| rgb.map(f32::to_bits)).collect::<Vec<_>>())
            });
            assert_eq!(a, b, "{} {seed}", file.display());
        }
    }
}
