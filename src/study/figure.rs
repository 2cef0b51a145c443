//! A figure: several pictures side by side, as a file describes them.
//!
//! A figure file is TOML. Each panel is a scene rendered with settings of its own, or the difference of two earlier panels. Differences are of
//! what a display shows, in the 256 levels of sRGB, as pictures in print are compared.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::mosaic::{Tile, difference, mosaic};
use crate::fragment::PixelRect;
use crate::image::{RgbImage, display};
use crate::render::progress::Progress;
use crate::render::{self, Film, Options, RenderError, Statistics};
use crate::scene::{self, Document, Scene, SceneError};

/// The largest figure file, in bytes.
const MAX_BYTES: u64 = 1 << 20;
/// The most panels of a figure.
const MAX_PANELS: usize = 64;
/// The most pixels along a side of a figure.
const MAX_SIDE: usize = 32_768;

/// A figure file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figure {
    /// What it shows.
    pub title: String,
    /// What to look at.
    pub note: String,
    /// Scene of the panels that name none, relative to the figure file.
    pub scene: Option<PathBuf>,
    /// Panels a row; all in one row unless given.
    pub columns: Option<usize>,
    /// Pixels between panels.
    #[serde(default = "default_gap")]
    pub gap: usize,
    /// Settings of all panels, as after `--set`; a panel's own come after them.
    #[serde(default)]
    pub set: Vec<String>,
    #[serde(rename = "panel")]
    pub panels: Vec<Panel>,
}

fn default_gap() -> usize {
    8
}

/// One picture of a figure.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Panel {
    pub label: String,
    /// Its scene, in place of the figure's.
    pub scene: Option<PathBuf>,
    #[serde(default)]
    pub set: Vec<String>,
    /// Only these pixels of the picture: x0, y0, x1, y1, from the top left, the last ones excluded.
    pub crop: Option<[u32; 4]>,
    /// Each pixel is shown as this many along each side.
    #[serde(default = "one")]
    pub enlarge: usize,
    /// In place of a scene: the difference of two panels, by their numbers from 0.
    pub difference: Option<[usize; 2]>,
    /// Factor on a difference.
    #[serde(default = "unit")]
    pub factor: f32,
}

fn one() -> usize {
    1
}

fn unit() -> f32 {
    1.0
}

/// Why there is no figure.
#[derive(Debug, Error)]
pub enum FigureError {
    #[error("{}: cannot read the figure: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{}: {message}", path.display())]
    Invalid { path: PathBuf, message: String },
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Asset(#[from] scene::AssetError),
    #[error(transparent)]
    Render(#[from] RenderError),
}

/// What a panel came to.
#[derive(Clone, Debug, Serialize)]
pub struct PanelReport {
    pub label: String,
    /// Of a rendered panel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub statistics: Option<Statistics>,
    /// Of a difference: mean of red, green and blue, and the largest, in levels of 256.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub difference: Option<Levels>,
}

/// A difference of two pictures, in levels of 256.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Levels {
    pub mean: [f64; 3],
    pub max: u8,
}

/// A figure that was drawn.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// All panels in one picture, linear Rec.709.
    pub picture: RgbImage,
    /// Each panel by itself, exposed as its scene says.
    pub panels: Vec<RgbImage>,
    pub reports: Vec<PanelReport>,
}

impl Figure {
    /// Reads a figure file.
    ///
    /// # Errors
    /// A file that cannot be read, is no figure, or whose panels make no sense.
    pub fn read(path: &Path) -> Result<Self, FigureError> {
        let bytes = crate::file::read_regular(path, MAX_BYTES)
            .map_err(|source| FigureError::Read { path: path.to_owned(), source })?;
        Self::parse(&bytes, path)
    }

    /// The content of a figure file; `path` serves for messages.
    ///
    /// # Errors
    /// As [`Figure::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, FigureError> {
        let invalid = |message| FigureError::Invalid { path: path.to_owned(), message };
        let text = std::str::from_utf8(bytes).map_err(|_| invalid("it is not text in UTF-8".to_owned()))?;
        let figure: Self = toml::from_str(text).map_err(|e| invalid(e.to_string().trim_end().to_owned()))?;
        figure.check().map_err(invalid)?;
        Ok(figure)
    }

    fn check(&self) -> Result<(), String> {
        if self.panels.is_empty() || self.panels.len() > MAX_PANELS {
            return Err(format!("it has {} panels; give 1 to {MAX_PANELS}", self.panels.len()));
        }
        if self.columns == Some(0) || self.gap > 1000 {
            return Err("columns must be at least 1, and gap at most 1000".to_owned());
        }
        for (index, panel) in self.panels.iter().enumerate() {
            let fault = |message: &str| Err(format!("panel[{index}] \"{}\": {message}", panel.label));
            let earlier = |[a, b]: [usize; 2]| a < index && b < index;
            if panel.difference.is_some_and(|pair| !earlier(pair)) {
                return fault("difference names the numbers, from 0, of two panels before it");
            }
            if panel.difference.is_none() && panel.scene.is_none() && self.scene.is_none() {
                return fault("there is no scene; give scene to the panel or to the whole figure");
            }
            if panel.difference.is_some() && (panel.scene.is_some() || !panel.set.is_empty() || panel.crop.is_some()) {
                return fault("a difference has no scene, set or crop of its own");
            }
            if panel.crop.is_some_and(|[x0, y0, x1, y1]| x0 >= x1 || y0 >= y1) {
                return fault("crop is empty; write [x0, y0, x1, y1] with x1 above x0 and y1 above y0");
            }
            if !(1..=256).contains(&panel.enlarge) {
                return fault("enlarge must be 1 to 256");
            }
            if !(panel.factor.is_finite() && panel.factor > 0.0) {
                return fault("factor must be a number above 0");
            }
        }
        Ok(())
    }

    /// Renders all panels, one after the other, and puts them side by side. `path` is the figure's file; `overrides` come after all other settings.
    ///
    /// # Errors
    /// The first panel that cannot be rendered, panels of which no difference can be taken, and figures too large.
    pub fn draw(
        &self,
        path: &Path,
        overrides: &[String],
        threads: Option<usize>,
        progress: &dyn Progress,
    ) -> Result<Drawn, FigureError> {
        let invalid = |message: String| FigureError::Invalid { path: path.to_owned(), message };
        let mut panels: Vec<RgbImage> = Vec::new();
        let mut reports = Vec::new();
        for (index, panel) in self.panels.iter().enumerate() {
            progress.message(&format!("panel {} of {}: {}", index + 1, self.panels.len(), panel.label));
            let label = panel.label.clone();
            if let Some([a, b]) = panel.difference {
                let (picture, levels) = difference(&panels[a], &panels[b], panel.factor)
                    .ok_or_else(|| invalid(format!("panel[{index}] \"{label}\": the two panels differ in size")))?;
                panels.push(picture);
                reports.push(PanelReport { label, statistics: None, difference: Some(levels) });
            } else {
                let (picture, statistics) = self.render(panel, path, overrides, threads, progress)?;
                panels.push(picture);
                reports.push(PanelReport { label, statistics: Some(statistics), difference: None });
            }
        }
        let tiles: Vec<Tile> =
            panels.iter().zip(&self.panels).map(|(image, panel)| Tile { image, enlarge: panel.enlarge }).collect();
        let columns = self.columns.unwrap_or(self.panels.len());
        let picture = mosaic(&tiles, columns, self.gap, MAX_SIDE)
            .ok_or_else(|| invalid(format!("all panels together have more than {MAX_SIDE} pixels along a side")))?;
        Ok(Drawn { picture, panels, reports })
    }

    /// The scenes of the panels that are rendered, each with the pixels of its crop, in their order: what is to be held against a limit of memory.
    ///
    /// # Errors
    /// The first scene file that cannot be read.
    pub fn documents(
        &self,
        path: &Path,
        overrides: &[String],
    ) -> Result<Vec<(Document, Option<PixelRect>)>, FigureError> {
        let rendered = self.panels.iter().filter(|panel| panel.difference.is_none());
        rendered
            .map(|panel| {
                let document = self.document(panel, path, overrides)?;
                let [width, height] = document.description.camera.resolution;
                let window =
                    |[x0, y0, x1, y1]: [u32; 4]| PixelRect { min: [x0, y0], max: [x1.min(width), y1.min(height)] };
                Ok((document, panel.crop.map(window)))
            })
            .collect()
    }

    fn document(&self, panel: &Panel, path: &Path, overrides: &[String]) -> Result<Document, FigureError> {
        let name = panel.scene.as_ref().or(self.scene.as_ref()).map(PathBuf::as_path).unwrap_or(Path::new(""));
        let file = path.parent().unwrap_or(Path::new("")).join(name);
        let set: Vec<String> = self.set.iter().chain(&panel.set).chain(overrides).cloned().collect();
        Ok(scene::load(&file, &set)?)
    }

    fn render(
        &self,
        panel: &Panel,
        path: &Path,
        overrides: &[String],
        threads: Option<usize>,
        progress: &dyn Progress,
    ) -> Result<(RgbImage, Statistics), FigureError> {
        let mut scene = Scene::load(self.document(panel, path, overrides)?)?;
        let [width, height] = scene.camera.resolution();
        let window =
            panel.crop.map(|[x0, y0, x1, y1]| PixelRect { min: [x0, y0], max: [x1.min(width), y1.min(height)] });
        if let Some(rect) = window.filter(|rect| rect.min[0] >= rect.max[0] || rect.min[1] >= rect.max[1]) {
            let message = format!(
                "panel \"{}\": its crop begins at {},{}, outside the picture of {width}x{height} pixels",
                panel.label, rect.min[0], rect.min[1]
            );
            return Err(FigureError::Invalid { path: path.to_owned(), message });
        }
        let exposure = (scene.description().output.exposure as f32).exp2();
        let (film, statistics) = render::render(&mut scene, &Options { window, threads }, progress)?;
        Ok((picture_of(&film, exposure), statistics))
    }
}

/// A film's beauty, exposed.
fn picture_of(film: &Film, exposure: f32) -> RgbImage {
    let pixels = film.pixels.iter().map(|pixel| (pixel.beauty * exposure).to_array()).collect();
    RgbImage { width: film.width() as u32, height: film.height() as u32, pixels }
}

/// The levels that a display shows.
pub(super) fn levels(rgb: [f32; 3]) -> [u8; 3] {
    display::to_srgb8(rgb, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Figure, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("figure.toml");
        std::fs::write(&path, text).unwrap();
        Figure::read(&path).map_err(|e| e.to_string())
    }

    const HEAD: &str = "title = 't'\nnote = 'n'\nscene = 's.toml'\n";

    #[test]
    fn a_figure_is_read() {
        let figure = read(&format!(
            "{HEAD}[[panel]]\nlabel = 'a'\nset = ['camera.fov=40']\n[[panel]]\nlabel = 'b'\ncrop = [1, 2, 3, 4]\n\
             [[panel]]\nlabel = 'c'\ndifference = [0, 1]\nfactor = 16\n"
        ))
        .unwrap();
        assert_eq!((figure.panels.len(), figure.gap, figure.panels[2].factor), (3, 8, 16.0));
    }

    #[test]
    fn what_makes_no_sense_is_refused_with_the_reason() {
        for (text, part) in [
            (HEAD.to_owned(), "missing field `panel`"),
            (format!("{HEAD}panel = []"), "0 panels"),
            (format!("{HEAD}[[panel]]\nlabel = 'a'\ncolour = 1"), "unknown field `colour`"),
            (format!("{HEAD}[[panel]]\nlabel = 'a'\ndifference = [0, 1]"), "two panels before it"),
            (format!("{HEAD}[[panel]]\nlabel = 'a'\ncrop = [5, 0, 5, 9]"), "crop is empty"),
            (format!("{HEAD}[[panel]]\nlabel = 'a'\nenlarge = 0"), "enlarge must be 1 to 256"),
            ("title = 't'\nnote = 'n'\n[[panel]]\nlabel = 'a'".to_owned(), "there is no scene"),
            ("title = ".to_owned(), "TOML parse error"),
        ] {
            let error = read(&text).unwrap_err();
            assert!(error.contains(part) && error.contains("figure.toml"), "{text}: {error}");
        }
    }
}
