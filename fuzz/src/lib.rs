//! What the fuzz targets do with their bytes: whatever these are, a parser ends in something sound or in a message, and the
//! projection of hair in numbers from 0 to 1 that are the same for every kind of vector code.
//!
//! The program's ordinary tests call the same functions on the corpus (`tests/fuzz_corpus.rs`), so the file is compiled
//! there too and uses nothing that they do not have. No function here may fail but by a panic.

mod igloo;

use std::io;
use std::path::Path;

use tress::cli::values;
use tress::hair::formats::{self, Has};
use tress::hair::inspect::inspect as inspect_hair;
use tress::image::{self, Limits};
use tress::scene::description::{HairFormat, ThicknessIs};
use tress::scene::document;
use tress::scene::frame::{frame_path, is_numbered};
use tress::study::figure::Figure;
use tress::surface::{inspect::inspect as inspect_mesh, obj};

pub use igloo::igloo;

/// Bytes of a structure that one byte of a file may become, and what a file may cost however short it is.
const GROWTH: usize = 64;
const BASE: usize = 1 << 16;

/// Hair files. The first byte says what the caller knows: format, ending, meaning of the thickness, attributes replaced.
pub fn hair(data: &[u8]) {
    let Some((&how, bytes)) = data.split_first() else { return };
    let format = [HairFormat::Auto, HairFormat::Hair, HairFormat::Tfx, HairFormat::Text][usize::from(how & 3)];
    let ending = [None, Some("hair"), Some("tfx"), Some("txt")][usize::from(how >> 2 & 3)];
    let thickness_is = [None, Some(ThicknessIs::Radius)][usize::from(how >> 4 & 1)];
    let replaced = Has { width: how >> 5 & 1 == 1, ..Has::default() };
    match formats::parse(bytes, format, ending, &formats::Options { thickness_is, replaced }) {
        Ok(loaded) => {
            let strands = &loaded.strands;
            assert_eq!(strands.validate(), Ok(()));
            assert!(strands.strand_count() > 0 && loaded.format != HairFormat::Auto);
            assert!(strands.transparency.values().iter().all(|t| (0.0..=1.0).contains(t)));
            let held = strands.points.len() * 12 + strands.first.len() * 4;
            assert!(held <= BASE + GROWTH * bytes.len(), "{held} bytes of {}", bytes.len());
            inspect_hair(strands);
        }
        Err(fault) => assert!(!fault.to_string().is_empty()),
    }
}

/// One MTL file under any name that does not begin with a digit.
struct Given<'a>(&'a [u8]);

impl obj::Library for Given<'_> {
    fn has(&self, name: &str) -> bool {
        !name.starts_with(|c: char| c.is_ascii_digit())
    }

    fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        if self.has(name) { Ok(self.0.to_vec()) } else { Err(io::ErrorKind::NotFound.into()) }
    }
}

/// OBJ text, and behind a zero byte the text of its MTL file.
pub fn obj(data: &[u8]) {
    let mut parts = data.splitn(2, |&byte| byte == 0);
    let (text, materials) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    match obj::parse(text, Path::new("fuzz.obj"), &Given(materials)) {
        Ok(loaded) => {
            let mesh = &loaded.mesh;
            assert_eq!(mesh.validate(), Ok(()));
            let held = mesh.positions.len() * 12 + mesh.triangles.len() * 16;
            assert!(held <= BASE + GROWTH * text.len(), "{held} bytes of {}", text.len());
            inspect_mesh(mesh);
        }
        Err(error) => assert!(error.to_string().contains("fuzz.obj"), "{error}"),
    }
}

/// A scene's text, and behind zero bytes one `--set` each.
fn scene(data: &[u8], name: &str) {
    let mut parts = data.split(|&byte| byte == 0);
    let text = parts.next().unwrap_or_default();
    let settings: Vec<String> = parts.take(8).map(|part| String::from_utf8_lossy(part).into_owned()).collect();
    match document::parse(text, &Path::new("/nowhere").join(name), &settings) {
        Ok(document) => {
            let frame = document.at_frame(7);
            assert!(frame.description.surface.len() == document.description.surface.len());
            assert!(document.warnings.iter().all(|warning| !warning.message.is_empty()));
        }
        Err(error) => {
            // Each line says where.
            let text = error.to_string();
            assert!(!text.is_empty() && text.lines().all(|line| !line.is_empty()), "{text:?}");
        }
    }
}

/// Scenes in TOML.
pub fn scene_toml(data: &[u8]) {
    scene(data, "fuzz.toml");
}

/// Scenes in JSON.
pub fn scene_json(data: &[u8]) {
    scene(data, "fuzz.json");
}

/// The values of options: every reader gets every text.
pub fn options(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    if let Ok(frames) = values::frames(&text) {
        let numbers = frames.numbers();
        assert!((1..=1_000_000).contains(&numbers.len()));
        // Of long lists a part will do: the target is for odd texts, not for long loops.
        let mut sorted: Vec<u32> = numbers.iter().copied().take(1000).collect();
        let count = sorted.len();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), count);
    }
    if let Ok(size) = values::resolution(&text) {
        assert!(size.width > 0 && size.height > 0);
    }
    if let Ok(crop) = values::crop(&text) {
        assert!(crop.x0 < crop.x1 && crop.y0 < crop.y1);
        assert_eq!(values::crop(&crop.to_string()), Ok(crop));
    }
    if let Ok(accuracy) = values::accuracy(&text) {
        assert!(accuracy > 0.0 && accuracy <= 1.0);
    }
    if let Ok(bytes) = values::size(&text) {
        assert!(bytes > 0);
    }
    if values::setting(&text).is_ok() {
        assert!(text.contains('='));
    }
    let pattern = Path::new(&*text);
    let (one, two) = (frame_path(pattern, 1), frame_path(pattern, u32::MAX));
    assert_eq!(one != two, is_numbered(pattern), "{text:?}");
}

/// Figure files.
pub fn figure(data: &[u8]) {
    match Figure::parse(data, Path::new("fuzz.toml")) {
        Ok(figure) => assert!(!figure.panels.is_empty()),
        Err(error) => assert!(error.to_string().contains("fuzz.toml"), "{error}"),
    }
}

/// Image files, through a file as that is how the library reads.
pub fn image(data: &[u8]) {
    // In memory where the system has such a folder.
    let folder = Path::new("/dev/shm");
    let file = if folder.is_dir() { tempfile::NamedTempFile::new_in(folder) } else { tempfile::NamedTempFile::new() };
    let file = file.expect("a folder for temporary files");
    std::fs::write(file.path(), data).expect("room for a temporary file");
    let info = image::info(file.path());
    match image::read(file.path(), &Limits { max_bytes: 16 << 20 }) {
        Ok(image) => {
            let info = info.expect("what can be read can be described");
            assert_eq!((image.width, image.height), (info.width, info.height));
            let pixels = image.width as usize * image.height as usize;
            assert_eq!(image.pixels.len(), pixels * image.channels.len());
            if let Ok(rgb) = image.rgb() {
                assert_eq!(rgb.pixels.len(), rgb.width as usize * rgb.height as usize);
            }
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}
