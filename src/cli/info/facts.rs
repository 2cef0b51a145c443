//! What is found in a file, as data. Each function's error is a message that names the file.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::hair::{formats, inspect as hair_inspect};
use crate::image::{self, ChannelRange, Limits};
use crate::scene::description::{Description, HairFormat};
use crate::surface::{inspect as mesh_inspect, obj};

/// One file's facts.
#[derive(Debug, Serialize)]
pub(super) struct Facts {
    pub file: PathBuf,
    #[serde(flatten)]
    pub content: Content,
    /// What reading assumed, mended or left out.
    pub notes: Vec<String>,
    /// What a user may not have meant.
    pub suspicious: Vec<String>,
}

#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub(super) enum Content {
    Hair { format: &'static str, facts: hair_inspect::Report },
    Mesh { facts: mesh_inspect::Report },
    Image { facts: ImageFacts },
    Scene { facts: SceneFacts },
}

#[derive(Debug, Serialize)]
pub(super) struct ImageFacts {
    pub format: String,
    /// Pixels that are stored.
    pub size: [u32; 2],
    /// Where they start in the display window.
    pub origin: [i32; 2],
    /// The display window.
    pub full_size: [u32; 2],
    pub tile: Option<[u32; 2]>,
    pub compression: Option<String>,
    pub deep: bool,
    pub file_bytes: u64,
    /// Empty for deep images, whose pixels are not read.
    pub channels: Vec<ChannelRange>,
}

#[derive(Debug, Serialize)]
pub(super) struct SceneFacts {
    pub resolution: [u32; 2],
    pub hair_objects: usize,
    pub surfaces: usize,
    pub lights: usize,
    /// The files it names, as it names them.
    pub files: Vec<PathBuf>,
}

pub(super) fn hair(file: &Path) -> Result<Facts, String> {
    let loaded = formats::read(file, HairFormat::Auto, &formats::Options::default()).map_err(|e| e.to_string())?;
    let mut facts = hair_inspect::inspect(&loaded.strands);
    let suspicious = std::mem::take(&mut facts.suspicious);
    let format = match loaded.format {
        HairFormat::Hair => "HAIR",
        HairFormat::Tfx => "TressFX",
        HairFormat::Text | HairFormat::Auto => "text",
    };
    Ok(Facts { file: file.into(), content: Content::Hair { format, facts }, notes: loaded.notes, suspicious })
}

pub(super) fn mesh(file: &Path) -> Result<Facts, String> {
    let loaded = obj::load_obj(file).map_err(|e| e.to_string())?;
    let mut facts = mesh_inspect::inspect(&loaded.mesh);
    let suspicious = std::mem::take(&mut facts.suspicious);
    Ok(Facts { file: file.into(), content: Content::Mesh { facts }, notes: loaded.notes, suspicious })
}

pub(super) fn image(file: &Path) -> Result<Facts, String> {
    let text = |e: image::Error| e.to_string();
    let header = image::info(file).map_err(text)?;
    let (info, channels) = match header.deep {
        true => (header, Vec::new()),
        false => image::measure(file, &Limits::default()).map_err(text)?,
    };
    let facts = ImageFacts {
        size: [info.width, info.height],
        origin: info.origin,
        full_size: info.full_size,
        tile: info.tile,
        compression: info.compression().map(str::to_owned),
        deep: info.deep,
        file_bytes: info.file_bytes,
        channels,
        format: info.format,
    };
    let suspicious = image_suspicious(&facts);
    Ok(Facts { file: file.into(), content: Content::Image { facts }, notes: vec![], suspicious })
}

fn image_suspicious(facts: &ImageFacts) -> Vec<String> {
    let mut list = vec![];
    if facts.deep {
        list.push("it is a deep image: its pixels were not looked at, and tress does not read them".to_owned());
    }
    let sum = |of: fn(&ChannelRange) -> u64| facts.channels.iter().map(of).sum::<u64>();
    for (count, what) in [
        (sum(|c| c.nan), "values are not numbers (NaN)"),
        (sum(|c| c.infinite), "values are infinite"),
        (sum(|c| if is_color(&c.name) { c.negative } else { 0 }), "values are negative: no radiance is"),
    ] {
        if count > 0 {
            list.push(format!("{count} {what}"));
        }
    }
    if !facts.deep && facts.channels.iter().all(|c| c.max.is_none_or(|max| max == 0.0) && c.negative == 0) {
        list.push("no value is above zero: it is black".to_owned());
    }
    list
}

/// Whether a channel holds light rather than a direction or a distance.
fn is_color(channel: &str) -> bool {
    let last = channel.rsplit('.').next().unwrap_or(channel).to_ascii_lowercase();
    matches!(last.as_str(), "r" | "g" | "b" | "red" | "green" | "blue") || ["Y", "L"].contains(&channel)
}

pub(super) fn scene(file: &Path) -> Result<Facts, String> {
    let document = crate::scene::load(file, &[]).map_err(|e| e.to_string())?;
    let scene = &document.description;
    let facts = SceneFacts {
        resolution: scene.camera.resolution,
        hair_objects: scene.hair.len(),
        surfaces: scene.surface.len(),
        lights: scene.light.point.len() + scene.light.directional.len() + scene.light.rect.len(),
        files: named_files(scene),
    };
    let suspicious = document.warnings.iter().map(ToString::to_string).collect();
    let notes = vec!["the files that it names were not looked at; `tress check` does that".to_owned()];
    Ok(Facts { file: file.into(), content: Content::Scene { facts }, notes, suspicious })
}

fn named_files(scene: &Description) -> Vec<PathBuf> {
    let hair = scene.hair.iter().filter_map(|hair| hair.file.clone());
    let surfaces = scene.surface.iter().filter_map(|surface| surface.file.clone());
    hair.chain(surfaces).chain(scene.environment.file.clone()).collect()
}
