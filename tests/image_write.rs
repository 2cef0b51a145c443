//! Writing images: what is written is what is read, and nothing that was there is lost when writing fails.

use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;
use tress::image::display::{srgb_to_linear, to_srgb8, write_srgb8};
use tress::image::{
    Encoding, Error, ImageSpec, Limits, MetaValue, PixelFormat, RgbImage, check_target, info, read, write_atomic,
};

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn channels(names: &[&str], format: PixelFormat) -> Vec<(String, PixelFormat)> {
    names.iter().map(|name| ((*name).to_owned(), format)).collect()
}

/// Values between -2 and 2 that do not compress.
fn noise(count: usize) -> Vec<f32> {
    let hash = |i: u32| {
        let i = (i ^ i >> 16).wrapping_mul(0x85EB_CA6B);
        let i = (i ^ i >> 13).wrapping_mul(0xC2B2_AE35);
        i ^ i >> 16
    };
    (1..=count as u32).map(|i| (hash(i) >> 8) as f32 / (1 << 22) as f32 - 2.0).collect()
}

fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Runs oiiotool; `None` where it is not installed.
fn oiiotool(arguments: &[&OsStr]) -> Option<(bool, String)> {
    let Ok(output) = Command::new("oiiotool").args(arguments).output() else {
        eprintln!("skipped: no oiiotool");
        return None;
    };
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    Some((output.status.success(), text))
}

/// A cropped image with layers in half and float, and metadata of every kind.
fn layered() -> (ImageSpec, Vec<f32>) {
    let mut all = channels(&["direct.R", "B", "R", "A", "G", "direct.G", "direct.B"], PixelFormat::Half);
    all.extend(channels(&["depth.Z", "variance.Y"], PixelFormat::Float));
    let mut spec = ImageSpec::new(37, 300, all);
    spec.origin = [11, -7];
    spec.full_size = [64, 290];
    spec.metadata = vec![
        ("tress:scene".into(), MetaValue::Str("hair & fur".into())),
        ("tress:samples".into(), MetaValue::Int(-3)),
        ("tress:seconds".into(), MetaValue::Float(1.5)),
        ("tress:budget".into(), MetaValue::Floats(vec![0.25, -1.0, 3e30])),
        ("worldtocamera".into(), MetaValue::Matrix(std::array::from_fn(|i| i as f32))),
    ];
    let values = noise(37 * 300 * 9);
    (spec, values)
}

#[test]
fn layers_windows_and_metadata_come_back() {
    let folder = folder();
    let (spec, values) = layered();
    for compression in [None, Some("none"), Some("rle"), Some("zips"), Some("zip"), Some("piz")] {
        let path = folder.path().join("a.exr");
        let spec = ImageSpec { compression: compression.map(str::to_owned), ..spec.clone() };
        let written = write_atomic(&path, &spec, &values).unwrap();
        assert_eq!((written.saturated, written.non_finite), (0, 0));
        assert_eq!(written.bytes, fs::metadata(&path).unwrap().len());
        let header = info(&path).unwrap();
        assert_eq!(header.compression(), Some(compression.unwrap_or("zip")));
        for (name, value) in &spec.metadata {
            assert_eq!(header.meta(name), Some(value), "{name}");
        }
        assert!(
            matches!(header.meta("chromaticities"), Some(MetaValue::Floats(xy)) if xy[..2] == [0.64, 0.33] && xy.len() == 8)
        );
        for (name, format) in &header.channels {
            assert!(spec.channels.contains(&(name.clone(), *format)), "{name} {format:?}");
        }
        let image = read(&path, &Limits::default()).unwrap();
        assert_eq!((image.origin, image.full_size), (spec.origin, spec.full_size));
        let (from, to) = (7, image.channel("depth.Z").unwrap());
        assert!(values[from..].iter().step_by(9).eq(image.pixels[to..].iter().step_by(9)));
        let direct = image.rgb_layer("direct").unwrap();
        let nearest = |value: f32| value.abs() / 2048.0 + 1e-7;
        // Row 20 of the display window is row 27 of the data.
        for x in 11..48 {
            let stored = &values[((20 + 7) * 37 + x - 11) * 9..][..9];
            let found = direct.pixels[20 * 64 + x];
            for (found, wanted) in found.into_iter().zip([stored[0], stored[5], stored[6]]) {
                assert!((found - wanted).abs() <= nearest(wanted), "{found} {wanted}");
            }
        }
    }
    assert_eq!(names_in(folder.path()), ["a.exr"]);
}

#[test]
fn equal_images_make_equal_files() {
    let folder = folder();
    let (spec, values) = layered();
    let files = ["a.exr", "b.exr"].map(|name| {
        let path = folder.path().join(name);
        write_atomic(&path, &spec, &values).unwrap();
        fs::read(path).unwrap()
    });
    assert!(files[0] == files[1]);
    let date = "2024:02:29 12:00:00";
    let spec = ImageSpec { metadata: vec![("DateTime".into(), MetaValue::Str(date.into()))], ..spec };
    let path = folder.path().join("c.exr");
    write_atomic(&path, &spec, &values).unwrap();
    assert_eq!(info(&path).unwrap().meta("DateTime"), Some(&MetaValue::Str(date.into())));
}

#[test]
fn lossy_compression_is_near() {
    let folder = folder();
    for compression in ["dwaa:10", "dwab", "b44", "b44a", "pxr24"] {
        let path = folder.path().join("a.exr");
        let mut spec = ImageSpec::new(64, 64, channels(&["R", "G", "B"], PixelFormat::Half));
        spec.compression = Some(compression.into());
        let smooth: Vec<f32> = (0..64 * 64 * 3).map(|i| (i / 3 % 64) as f32 / 64.0 + 0.1).collect();
        write_atomic(&path, &spec, &smooth).unwrap();
        let image = read(&path, &Limits::default()).unwrap();
        let error = image.pixels.iter().zip(&smooth).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(error < 0.05, "{compression}: {error}");
    }
}

#[test]
fn values_beyond_a_format_are_kept_at_its_bounds_and_counted() {
    let folder = folder();
    let path = folder.path().join("a.exr");
    let odd = [1e5, -1e30, f32::NAN, f32::INFINITY, 65_504.0, 6e-8];
    let written = write_atomic(&path, &ImageSpec::new(6, 1, channels(&["Y"], PixelFormat::Half)), &odd).unwrap();
    assert_eq!((written.saturated, written.non_finite), (2, 2));
    let pixels = read(&path, &Limits::default()).unwrap().pixels;
    assert_eq!(pixels[..2], [65_504.0, -65_504.0]);
    assert!(pixels[2].is_nan() && pixels[3] == f32::INFINITY && pixels[4] == 65_504.0 && pixels[5] > 0.0);

    let path = folder.path().join("a.png");
    let odd = [-1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.5, 0.5];
    let written = write_atomic(&path, &ImageSpec::new(6, 1, channels(&["Y"], PixelFormat::U8)), &odd).unwrap();
    assert_eq!((written.saturated, written.non_finite), (2, 3));
    let pixels = read(&path, &Limits::default()).unwrap().pixels;
    assert_eq!(pixels[..5], [0.0, 0.0, 1.0, 0.0, 1.0]);
}

#[test]
fn display_files_hold_the_bytes_and_read_as_linear_light() {
    let folder = folder();
    let pixels: Vec<[f32; 3]> =
        (0..256).map(|i| [i as f32 / 255.0, (i as f32 / 100.0).powi(3), srgb_to_linear(i as f32 / 255.0)]).collect();
    let image = RgbImage { width: 16, height: 16, pixels };
    for (name, tolerance) in [("a.png", 0), ("a.tif", 0), ("a.TIFF", 0), ("a.jpg", 40)] {
        let path = folder.path().join(name);
        write_srgb8(&path, &image, -1.0).unwrap();
        let found = read(&path, &Limits::default()).unwrap();
        assert_eq!(found.encoding, Encoding::Srgb);
        let linear = found.rgb().unwrap();
        for (index, wanted) in image.pixels.iter().map(|&pixel| to_srgb8(pixel, -1.0)).enumerate() {
            let bytes = &found.pixels[index * 3..][..3];
            for channel in 0..3 {
                let byte = (bytes[channel] * 255.0).round() as i32;
                assert!((byte - i32::from(wanted[channel])).abs() <= tolerance, "{name} {index} {channel}");
                assert_eq!(linear.pixels[index][channel], srgb_to_linear(bytes[channel]));
            }
        }
    }
}

/// Colour under alpha 0 must survive: neither the writer nor the reader multiplies or divides by alpha.
#[test]
fn alpha_does_not_touch_colour() {
    let folder = folder();
    let values = [1.0, 0.6, 0.2, 0.0, 1.0, 0.6, 0.2, 0.4];
    for name in ["a.png", "a.tif"] {
        for format in [PixelFormat::U8, PixelFormat::U16] {
            let path = folder.path().join(name);
            write_atomic(&path, &ImageSpec::new(2, 1, channels(&["R", "G", "B", "A"], format)), &values).unwrap();
            let image = read(&path, &Limits::default()).unwrap();
            assert!(image.pixels.iter().zip(values).all(|(a, b)| (a - b).abs() < 1e-5), "{name} {:?}", image.pixels);
        }
    }
}

#[test]
fn oiiotool_agrees() {
    let folder = folder();
    let (spec, values) = layered();
    let exr = folder.path().join("a.exr");
    write_atomic(&exr, &spec, &values).unwrap();
    let Some((ok, text)) = oiiotool(&[OsStr::new("--info"), "-v".as_ref(), "--hash".as_ref(), exr.as_os_str()]) else {
        return;
    };
    assert!(ok, "{text}");
    for part in ["37 x  300", "9 channel", "compression: \"zip\"", "tress:samples: -3", "direct.R", "SHA-1"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // The same floats through another format and another process.
    let float = ImageSpec::new(37, 300, channels(&["R", "G", "B"], PixelFormat::Float));
    let files = ["a.tif", "b.exr"].map(|name| folder.path().join(name));
    for file in &files {
        write_atomic(file, &float, &values[..37 * 300 * 3]).unwrap();
    }
    let arguments = [OsStr::new("--fail"), "0".as_ref(), "--diff".as_ref(), files[0].as_os_str(), files[1].as_os_str()];
    let (ok, text) = oiiotool(&arguments).unwrap();
    assert!(ok && text.contains("PASS"), "{text}");
}

/// Against oiiotool, but for the ways 5 and 7, which release 2.4 of it takes for each other.
#[test]
fn pictures_are_turned_upright_as_oiiotool_does() {
    let folder = folder();
    let stored = folder.path().join("stored.tif");
    let upright = folder.path().join("upright.exr");
    for orientation in [1, 2, 3, 4, 6, 8] {
        let mut spec = ImageSpec::new(3, 2, channels(&["R", "G", "B"], PixelFormat::Float));
        spec.metadata = vec![("Orientation".into(), MetaValue::Int(orientation))];
        write_atomic(&stored, &spec, &noise(18)).unwrap();
        let arguments = [stored.as_os_str(), "--reorient".as_ref(), "-o".as_ref(), upright.as_os_str()];
        let Some((ok, text)) = oiiotool(&arguments) else { return };
        assert!(ok, "{text}");
        let load = |path: &Path| read(path, &Limits::default()).unwrap().rgb().unwrap();
        assert_eq!(load(&stored), load(&upright), "{orientation}");
    }
}

#[test]
fn a_new_file_has_the_usual_permissions() {
    let folder = folder();
    let (spec, values) = layered();
    let path = folder.path().join("a.exr");
    write_atomic(&path, &spec, &values).unwrap();
    fs::write(folder.path().join("usual"), "").unwrap();
    let mode = |name: &str| fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
    assert_eq!(mode("a.exr"), mode("usual"));
}

#[test]
fn a_link_keeps_its_place() {
    let folder = folder();
    let (spec, values) = layered();
    fs::write(folder.path().join("real.exr"), "old").unwrap();
    symlink("real.exr", folder.path().join("link.exr")).unwrap();
    write_atomic(&folder.path().join("link.exr"), &spec, &values).unwrap();
    assert!(folder.path().join("link.exr").is_symlink());
    assert_eq!(info(&folder.path().join("real.exr")).unwrap().width, 37);
}

#[test]
fn odd_file_names_are_taken_as_they_are() {
    let folder = folder();
    let spec = ImageSpec::new(1, 1, channels(&["Y"], PixelFormat::Float));
    for name in [&b"a b?c=d.exr"[..], b"frame.%04d.exr", b"\xff\xfe.exr", "Haar-ä.exr".as_bytes()] {
        let path = folder.path().join(OsStr::from_bytes(name));
        write_atomic(&path, &spec, &[0.5]).unwrap();
        assert_eq!(read(&path, &Limits::default()).unwrap().pixels, [0.5]);
    }
    assert_eq!(names_in(folder.path()).len(), 4);
}

#[test]
fn impossible_targets_and_images_are_refused_with_reasons() {
    let folder = folder();
    let old = folder.path().join("old.exr");
    fs::write(&old, "old").unwrap();
    fs::create_dir(folder.path().join("folder.exr")).unwrap();
    let one = |format| ImageSpec::new(1, 1, channels(&["Y"], format));
    let write = |name: &str, spec: &ImageSpec, values: &[f32]| {
        let error = write_atomic(&folder.path().join(name), spec, values).unwrap_err();
        (error.to_string(), error)
    };
    let half = one(PixelFormat::Half);
    assert!(matches!(write("folder.exr", &half, &[0.0]).1, Error::NotAFile { .. }));
    assert!(matches!(write("none/a.exr", &half, &[0.0]).1, Error::Io { .. }));
    assert!(matches!(write("old.exr/a.exr", &half, &[0.0]).1, Error::Io { .. }));
    for name in ["a.webp", "a", ".exr"] {
        let (text, error) = write(name, &half, &[0.0]);
        assert!(matches!(error, Error::UnknownExtension { .. }) && text.contains(".exr, .png"), "{text}");
        assert!(check_target(&folder.path().join(name)).is_err());
    }
    let twice = ImageSpec::new(1, 1, channels(&["Y", "Y"], PixelFormat::Half));
    let mixed = ImageSpec::new(1, 1, [channels(&["R"], PixelFormat::U8), channels(&["G"], PixelFormat::U16)].concat());
    let five = ImageSpec::new(1, 1, channels(&["R", "G", "B", "A", "Z"], PixelFormat::U8));
    let wide = ImageSpec::new(70_000, 1, channels(&["Y"], PixelFormat::U8));
    let four = ImageSpec::new(1, 1, channels(&["R", "G", "B", "A"], PixelFormat::U8));
    let odd = ImageSpec { compression: Some("lzma".into()), ..half.clone() };
    let zero_byte = ImageSpec { metadata: vec![("a\0b".into(), MetaValue::Int(1))], ..half.clone() };
    for (name, spec, count, part) in [
        ("old.exr", &half, 2, "2 values"),
        ("old.exr", &ImageSpec::new(0, 1, Vec::new()), 0, "0x1 pixels"),
        ("old.exr", &twice, 2, "\"Y\""),
        ("old.exr", &one(PixelFormat::U8), 1, "U8"),
        ("old.exr", &odd, 1, "'lzma' (known: none"),
        ("old.exr", &zero_byte, 1, "zero byte"),
        ("a.png", &half, 1, "Half"),
        ("a.png", &five, 5, "5 channels"),
        ("a.tif", &mixed, 2, "one format"),
        ("a.jpg", &four, 4, "4 channels"),
        ("a.jpg", &wide, 70_000, "65500"),
    ] {
        let (text, _) = write(name, spec, &vec![0.0; count]);
        assert!(text.contains(part), "{text}");
    }
    assert_eq!(fs::read(&old).unwrap(), b"old");
    assert_eq!(names_in(folder.path()), ["folder.exr", "old.exr"]);
}

#[test]
fn a_folder_without_write_permission_is_an_error() {
    let folder = folder();
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o500)).unwrap();
    let path = folder.path().join("a.exr");
    if fs::write(folder.path().join("probe"), "").is_ok() {
        eprintln!("skipped: permissions do not bind this user");
        return;
    }
    assert!(matches!(check_target(&path), Err(Error::Io { .. })));
}

/// Header text beyond what a format holds is stored, dropped by the library or refused, but the process goes on.
#[test]
fn long_metadata_is_no_danger() {
    let folder = folder();
    for name in ["a.exr", "a.png", "a.jpg", "a.tif"] {
        let format = if name == "a.exr" { PixelFormat::Half } else { PixelFormat::U8 };
        for key in ["ImageDescription", "Artist", "tress:scene", "a b  c", "XMP:x", &"k".repeat(300)] {
            for length in [0, 100, 16_000, 70_000, 300_000] {
                let mut spec = ImageSpec::new(8, 8, channels(&["R", "G", "B"], format));
                spec.metadata = vec![(key.to_owned(), MetaValue::Str("ö<&>\n".repeat(length / 6)))];
                let result = write_atomic(&folder.path().join(name), &spec, &[0.5; 192]);
                assert!(result.is_ok() || length > 100 || key.len() > 100, "{name} {key} {length}: {result:?}");
            }
        }
    }
}

/// A file system of 128 kB; unmounted when dropped.
struct SmallDisk(TempDir);

impl SmallDisk {
    fn new() -> Option<Self> {
        let folder = folder();
        let mount = Command::new("mount").args(["-t", "tmpfs", "-o", "size=128k", "tmpfs"]).arg(folder.path()).output();
        if mount.is_ok_and(|output| output.status.success()) {
            return Some(Self(folder));
        }
        eprintln!("skipped: cannot mount a small file system");
        None
    }

    fn path(&self) -> PathBuf {
        self.0.path().to_owned()
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.0.path()).status();
    }
}

#[test]
fn a_full_disk_is_an_error_and_leaves_the_old_file() {
    let Some(disk) = SmallDisk::new() else { return };
    // From sizes that fail at once to one that lacks the last bytes only.
    for (name, format) in [
        ("a.exr", PixelFormat::Half),
        ("a.png", PixelFormat::U8),
        ("a.jpg", PixelFormat::U8),
        ("a.tif", PixelFormat::U8),
    ] {
        let path = disk.path().join(name);
        let image = |side: u32| {
            let values =
                noise((side * side * 3) as usize).into_iter().map(|value| value / 4.0 + 0.5).collect::<Vec<_>>();
            (ImageSpec::new(side, side, channels(&["R", "G", "B"], format)), values)
        };
        let (spec, values) = image(8);
        write_atomic(&path, &spec, &values).unwrap();
        let before = fs::read(&path).unwrap();
        let mut failures = 0;
        for side in [120, 140, 160, 180, 200, 220, 260, 600] {
            let (spec, values) = image(side);
            match write_atomic(&path, &spec, &values) {
                Ok(_) => {
                    let (spec, values) = image(8);
                    write_atomic(&path, &spec, &values).unwrap();
                }
                Err(error) => {
                    failures += 1;
                    assert!(error.to_string().starts_with(path.to_str().unwrap()), "{error}");
                    assert!(!error.to_string().contains(".tress-"), "{error}");
                }
            }
            assert_eq!(fs::read(&path).unwrap(), before, "{name} {side}");
            assert_eq!(names_in(&disk.path()), [name]);
        }
        assert!(failures > 0, "{name}");
        fs::remove_file(path).unwrap();
    }
}
