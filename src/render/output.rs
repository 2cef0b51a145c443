//! The film as an image file: layers and metadata for OpenEXR, the beauty for display formats.

use std::path::Path;

use glam::DMat4;

use super::film::Film;
use super::statistics::Statistics;
use crate::image::{self, ImageSpec, MetaValue, PixelFormat, Written, display};
use crate::scene::Scene;
use crate::scene::description::{Compression, Layer, PixelType};

/// Checks, before anything is rendered, that a picture could be written.
///
/// # Errors
/// An ending that no writer serves, a folder that is not there or not writable.
pub fn check(path: &Path) -> Result<(), image::Error> {
    image::check_target(path)
}

/// Writes a film: all layers that the scene asks for to an OpenEXR file, the beauty in sRGB to PNG, JPEG and TIFF.
///
/// # Errors
/// Anything that keeps the whole, right file from being there; a file that was there before is then untouched.
pub fn write(path: &Path, film: &Film, scene: &Scene, statistics: &Statistics) -> Result<Written, image::Error> {
    let openexr = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
    let metadata = metadata(scene, statistics);
    if openexr { write_layers(path, film, scene, metadata) } else { write_display(path, film, scene, metadata) }
}

/// How many channels these layers have.
pub fn channel_count(layers: &[Layer]) -> usize {
    channels(layers).len()
}

/// A channel: its name, whether it is always 32-bit float, and its value.
type Channel = (String, bool, fn(&Film, usize) -> f32);

fn channels(layers: &[Layer]) -> Vec<Channel> {
    let mut layers = layers.to_vec();
    layers.sort_unstable();
    layers.dedup();
    let one = |name: &str, float, get: fn(&Film, usize) -> f32| (name.to_owned(), float, get);
    let mut channels: Vec<Channel> = Vec::new();
    for layer in layers {
        let rgb: [fn(&Film, usize) -> f32; 3] = match layer {
            Layer::Beauty => {
                channels.push(one("R", false, |f, i| f.pixels[i].beauty.x));
                channels.push(one("G", false, |f, i| f.pixels[i].beauty.y));
                channels.push(one("B", false, |f, i| f.pixels[i].beauty.z));
                continue;
            }
            Layer::Alpha => {
                channels.push(one("A", false, |f, i| f.pixels[i].alpha));
                continue;
            }
            Layer::Occlusion => {
                channels.push(one("occlusion.Y", false, |f, i| f.pixels[i].occlusion));
                continue;
            }
            Layer::Depth => {
                channels.push(one("depth.Z", true, |f, i| f.pixels[i].depth));
                continue;
            }
            Layer::Cost => {
                channels.push(one("cost.Y", true, |f, i| f.cost.get(i).copied().unwrap_or(0.0)));
                continue;
            }
            Layer::StandardError => [|f, i| f.error_of(i).x, |f, i| f.error_of(i).y, |f, i| f.error_of(i).z],
            Layer::Direct => [|f, i| f.pixels[i].direct.x, |f, i| f.pixels[i].direct.y, |f, i| f.pixels[i].direct.z],
            Layer::Environment => {
                [|f, i| f.pixels[i].environment.x, |f, i| f.pixels[i].environment.y, |f, i| f.pixels[i].environment.z]
            }
            Layer::EnvironmentUnoccluded => {
                [|f, i| f.pixels[i].unoccluded.x, |f, i| f.pixels[i].unoccluded.y, |f, i| f.pixels[i].unoccluded.z]
            }
            Layer::Normal => [|f, i| f.pixels[i].normal.x, |f, i| f.pixels[i].normal.y, |f, i| f.pixels[i].normal.z],
            Layer::Tangent => {
                [|f, i| f.pixels[i].tangent.x, |f, i| f.pixels[i].tangent.y, |f, i| f.pixels[i].tangent.z]
            }
        };
        let (name, parts, float) = match layer {
            Layer::Direct => ("direct", ["R", "G", "B"], false),
            Layer::Environment => ("environment", ["R", "G", "B"], false),
            Layer::EnvironmentUnoccluded => ("environment-unoccluded", ["R", "G", "B"], false),
            Layer::StandardError => ("standard-error", ["R", "G", "B"], true),
            Layer::Normal => ("normal", ["X", "Y", "Z"], true),
            _ => ("tangent", ["X", "Y", "Z"], true),
        };
        channels.extend(parts.iter().zip(rgb).map(|(part, get)| (format!("{name}.{part}"), float, get)));
    }
    channels
}

fn write_layers(
    path: &Path,
    film: &Film,
    scene: &Scene,
    metadata: Vec<(String, MetaValue)>,
) -> Result<Written, image::Error> {
    let output = &scene.description().output;
    let channels = channels(&output.layers);
    let colour = if output.pixel_type == PixelType::Half { PixelFormat::Half } else { PixelFormat::Float };
    let format = |float: bool| if float { PixelFormat::Float } else { colour };
    let names = channels.iter().map(|(name, float, _)| (name.clone(), format(*float))).collect();
    let spec = ImageSpec {
        width: film.width() as u32,
        height: film.height() as u32,
        origin: film.window.min.map(|v| v as i32),
        full_size: film.full_size,
        channels: names,
        compression: Some(compression(output.compression).to_owned()),
        metadata,
    };
    let values = (0..film.pixels.len()).flat_map(|pixel| channels.iter().map(move |(_, _, get)| get(film, pixel)));
    image::write_atomic(path, &spec, &values.collect::<Vec<f32>>())
}

/// With the environment behind the objects the picture is opaque; without, PNG and TIFF get an alpha channel, their colour not multiplied by it.
fn write_display(
    path: &Path,
    film: &Film,
    scene: &Scene,
    metadata: Vec<(String, MetaValue)>,
) -> Result<Written, image::Error> {
    let jpeg = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("jpg") || e.eq_ignore_ascii_case("jpeg"));
    let with_alpha = !scene.description().camera.background && !jpeg;
    let exposure = scene.description().output.exposure as f32;
    let names: &[&str] = if with_alpha { &["R", "G", "B", "A"] } else { &["R", "G", "B"] };
    let channels = names.iter().map(|name| ((*name).to_owned(), PixelFormat::U8)).collect();
    let mut spec = ImageSpec::new(film.width() as u32, film.height() as u32, channels);
    spec.metadata = metadata;
    let mut values = Vec::with_capacity(film.pixels.len() * names.len());
    for pixel in &film.pixels {
        let color = if with_alpha && pixel.alpha > 0.0 { pixel.beauty / pixel.alpha } else { pixel.beauty };
        values.extend(display::to_srgb8(color.to_array(), exposure).map(|byte| f32::from(byte) / 255.0));
        if with_alpha {
            values.push(pixel.alpha);
        }
    }
    image::write_atomic(path, &spec, &values)
}

fn compression(compression: Compression) -> &'static str {
    match compression {
        Compression::None => "none",
        Compression::Rle => "rle",
        Compression::Zips => "zips",
        Compression::Zip => "zip",
        Compression::Piz => "piz",
        Compression::Pxr24 => "pxr24",
        Compression::Dwaa => "dwaa",
        Compression::Dwab => "dwab",
    }
}

fn metadata(scene: &Scene, statistics: &Statistics) -> Vec<(String, MetaValue)> {
    let description = scene.description();
    let text = |value: &str| MetaValue::Str(value.to_owned());
    let json = |value: serde_json::Result<String>| MetaValue::Str(value.unwrap_or_default());
    let (to_camera, to_screen) = matrices(scene);
    let mut metadata = vec![
        ("Software".to_owned(), text(concat!("tress ", env!("CARGO_PKG_VERSION")))),
        ("tress:scene".to_owned(), text(&scene.document.path.to_string_lossy())),
        ("tress:sceneHash".to_owned(), text(&format!("sha256:{}", scene.document.source_hash))),
        ("tress:overrides".to_owned(), text(&scene.document.overrides.join(" "))),
        ("tress:occlusion".to_owned(), json(serde_json::to_string(&description.occlusion))),
        ("tress:sampling".to_owned(), json(serde_json::to_string(&description.sampling))),
        ("worldToCamera".to_owned(), MetaValue::Matrix(row_vectors(&to_camera))),
        ("worldToNDC".to_owned(), MetaValue::Matrix(row_vectors(&to_screen))),
    ];
    for (name, choice) in [("without", &description.effects.without), ("with", &description.effects.forced)] {
        if !choice.is_empty() {
            let names: Vec<String> = choice.iter().map(ToString::to_string).collect();
            metadata.push((format!("tress:effects.{name}"), text(&names.join(" "))));
        }
    }
    if let Some(settled) = &statistics.occlusion {
        metadata.push(("tress:occlusionFound".to_owned(), json(serde_json::to_string(settled))));
    }
    if let Some(claim) = &statistics.claim {
        metadata.push(("tress:error".to_owned(), MetaValue::Float(claim.error as f32)));
        metadata.push(("tress:errorInterval".to_owned(), MetaValue::Floats(vec![claim.low as f32, claim.high as f32])));
    }
    if !description.output.reproducible {
        metadata.push(("tress:renderSeconds".to_owned(), MetaValue::Float(statistics.seconds() as f32)));
    }
    metadata
}

/// From the scene's space to camera space (scene units) and to OpenEXR's normalised device coordinates.
fn matrices(scene: &Scene) -> (DMat4, DMat4) {
    let to_render = DMat4::from(scene.space.from_scene());
    let camera = scene.camera.world_to_camera() * to_render;
    let screen = scene.camera.camera_to_ndc() * camera;
    (DMat4::from_scale(glam::DVec3::splat(scene.space.scene_length(1.0))) * camera, screen)
}

/// OpenImageIO's matrices multiply row vectors.
fn row_vectors(matrix: &DMat4) -> [f32; 16] {
    // A column of ours is a row of theirs: glam's own order in memory.
    matrix.to_cols_array().map(|value| value as f32)
}
