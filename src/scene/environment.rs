//! Environment maps from files: which mapping they have, and values that no radiance can have.

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;

use super::description::EnvironmentMapping;
use crate::illumination::{Map, Mapping, Sources};
use crate::image::{self, RgbImage};

/// Larger maps are refused, in bytes of all their channels as `f32`: 16384x4096 pixels of three.
const MAX_BYTES: u64 = 768 << 20;

/// The largest half: what is brighter, also infinite, is taken as this, so that sums stay finite.
const LARGEST: f32 = 65_504.0;

/// Why a map cannot be used, and the key of the scene that is to blame.
#[derive(Debug)]
pub(super) struct Fault {
    pub key: &'static str,
    pub message: String,
}

/// Reads a map; its radiance is `scale` times what the file says. Gives what should be told about it.
pub(super) fn load(path: &Path, mapping: EnvironmentMapping, scale: f32) -> Result<(Map, Vec<String>), Fault> {
    let rgb = image::read(path, &image::Limits { max_bytes: MAX_BYTES })
        .and_then(|image| image.rgb())
        .map_err(|e| Fault { key: "environment.file", message: e.to_string() })?;
    let mapping = mapping_of(path, &rgb, mapping)?;
    let (width, height) = (rgb.width as usize, rgb.height as usize);
    let mut odd = Odd::default();
    // By value: the vector is reused, so that a large map is held once.
    let clean = |(index, pixel): (usize, [f32; 3])| {
        let place = [index % width, index / width];
        Vec3::from_array(pixel.map(|value| odd.clean(value, place))) * scale
    };
    let pixels: Vec<Vec3> = rgb.pixels.into_iter().enumerate().map(clean).collect();
    Ok((Map::new(mapping, width, height, pixels), odd.notes(path)))
}

/// The mapping that is asked for, or that the picture's shape says.
fn mapping_of(path: &Path, rgb: &RgbImage, wanted: EnvironmentMapping) -> Result<Mapping, Fault> {
    let (width, height) = (rgb.width, rgb.height);
    let fault = |key, what: &str| {
        Err(Fault { key, message: format!("{}: it has {width}x{height} pixels, {what}", path.display()) })
    };
    match wanted {
        EnvironmentMapping::LatLong => Ok(Mapping::LatLong),
        EnvironmentMapping::Angular if width == height => Ok(Mapping::Angular),
        EnvironmentMapping::Angular => fault(
            "environment.mapping",
            "an angular map must be square; crop it, or set environment.mapping to \"lat-long\"",
        ),
        // A single pixel is the same either way.
        EnvironmentMapping::Auto if width == 2 * height || (width, height) == (1, 1) => Ok(Mapping::LatLong),
        EnvironmentMapping::Auto if width == height => Ok(Mapping::Angular),
        EnvironmentMapping::Auto => fault(
            "environment.file",
            "neither 2:1 (lat-long) nor 1:1 (angular); resize it, or say what it is with environment.mapping = \"lat-long\"",
        ),
    }
}

/// The small bright sources of a map, and a note of them.
pub(super) fn sources(path: &Path, map: &Map, faces: u32, notes: &mut Vec<String>) -> Option<Arc<Sources>> {
    let sources = Sources::find(map, faces)?;
    notes.push(format!(
        "{}: {} with {:.1} % of its light {} lit as light{} of {} own",
        path.display(),
        if sources.list.len() == 1 {
            "1 small bright source".to_owned()
        } else {
            format!("{} small bright sources", sources.list.len())
        },
        100.0 * sources.share(),
        if sources.list.len() == 1 { "is" } else { "are" },
        if sources.list.len() == 1 { "" } else { "s" },
        if sources.list.len() == 1 { "its" } else { "their" },
    ));
    Some(Arc::new(sources))
}

/// Values that no radiance can have: how many of each kind, and where the first is (column, row).
#[derive(Debug, Default)]
struct Odd {
    negative: (u64, [usize; 2]),
    nan: (u64, [usize; 2]),
    infinite: (u64, [usize; 2]),
    large: (u64, [usize; 2]),
}

impl Odd {
    /// The value that is used in the place of one from the file.
    fn clean(&mut self, value: f32, place: [usize; 2]) -> f32 {
        let (kind, used) = if value.is_nan() {
            (&mut self.nan, 0.0)
        } else if value.is_infinite() {
            // Minus infinity is as dark as can be.
            (&mut self.infinite, if value > 0.0 { LARGEST } else { 0.0 })
        } else if value < 0.0 {
            (&mut self.negative, 0.0)
        } else if value > LARGEST {
            (&mut self.large, LARGEST)
        } else {
            return value;
        };
        if kind.0 == 0 {
            kind.1 = place;
        }
        kind.0 += 1;
        used
    }

    fn notes(&self, path: &Path) -> Vec<String> {
        [
            (self.negative, "negative; taken as 0"),
            (self.nan, "not a number (NaN); taken as 0"),
            (self.infinite, "infinite; taken as 65504 (0 where negative)"),
            (self.large, "above 65504, the largest half; taken as that"),
        ]
        .into_iter()
        .filter(|((count, _), _)| *count > 0)
        .map(|((count, [x, y]), what)| {
            let values = if count == 1 { "value is" } else { "values are" };
            format!("{}: {count} {values} {what}; first in pixel {x},{y}", path.display())
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{ImageSpec, PixelFormat, write_atomic};

    fn write(path: &Path, width: u32, height: u32, pixels: &[f32]) {
        let channels = ["R", "G", "B"].map(|name| (name.to_owned(), PixelFormat::Float)).to_vec();
        write_atomic(path, &ImageSpec::new(width, height, channels), pixels).expect("a picture");
    }

    #[test]
    fn odd_values_are_counted_by_kind_with_the_first_place() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr");
        let mut pixels = vec![1.0; 4 * 2 * 3];
        (pixels[3], pixels[16], pixels[5]) = (-0.5, -1.0, f32::NAN);
        (pixels[12], pixels[13], pixels[23]) = (f32::INFINITY, f32::NEG_INFINITY, 1e6);
        write(&path, 4, 2, &pixels);
        let (map, notes) = load(&path, EnvironmentMapping::Auto, 2.0).expect("a map");
        let name = path.display();
        assert_eq!(
            notes,
            [
                format!("{name}: 2 values are negative; taken as 0; first in pixel 1,0"),
                format!("{name}: 1 value is not a number (NaN); taken as 0; first in pixel 1,0"),
                format!("{name}: 2 values are infinite; taken as 65504 (0 where negative); first in pixel 0,1"),
                format!("{name}: 1 value is above 65504, the largest half; taken as that; first in pixel 3,1"),
            ]
        );
        assert_eq!(map.pixels[1], Vec3::new(0.0, 2.0, 0.0));
        assert_eq!(map.pixels[4], Vec3::new(131_008.0, 0.0, 2.0));
        assert_eq!((map.pixels[5], map.pixels[7]), (Vec3::new(2.0, 0.0, 2.0), Vec3::new(2.0, 2.0, 131_008.0)));
    }

    #[test]
    fn the_mapping_follows_the_shape_unless_given() {
        let folder = tempfile::tempdir().expect("a folder");
        let mapping = |width: u32, height: u32, wanted| {
            let path = folder.path().join("a.exr");
            write(&path, width, height, &vec![1.0; (3 * width * height) as usize]);
            load(&path, wanted, 1.0).map(|(map, _)| map.mapping)
        };
        use EnvironmentMapping::{Angular, Auto, LatLong};
        assert_eq!(mapping(8, 4, Auto).expect("a map"), Mapping::LatLong);
        assert_eq!(mapping(8, 8, Auto).expect("a map"), Mapping::Angular);
        assert_eq!(mapping(1, 1, Auto).expect("a map"), Mapping::LatLong);
        assert_eq!(mapping(8, 8, LatLong).expect("a map"), Mapping::LatLong);
        assert_eq!(mapping(8, 5, LatLong).expect("a map"), Mapping::LatLong);
        let fault = mapping(8, 5, Auto).expect_err("neither");
        assert!(fault.message.contains("8x5 pixels, neither 2:1") && fault.key == "environment.file", "{fault:?}");
        let fault = mapping(8, 4, Angular).expect_err("not square");
        assert!(fault.message.contains("must be square") && fault.key == "environment.mapping", "{fault:?}");
    }
}
