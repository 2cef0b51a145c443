//! An image in memory, and its colour: channels by name, the data window inside the display window, linear light.

use super::{Error, MetaValue, display};
use std::path::PathBuf;

/// What the numbers of an image mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Proportional to light.
    Linear,
    /// Encoded for a display (IEC 61966-2-1): by convention, every image of 8- or 16-bit integers.
    Srgb,
}

/// The pixels of a file as they are stored there, converted to `f32`.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Where it came from, for messages.
    pub path: PathBuf,
    /// Width and height of the data window, in pixels.
    pub width: u32,
    pub height: u32,
    pub channels: Vec<String>,
    /// Row by row from the top, channels interleaved: `width * height * channels.len()` values, NaN and infinities as in
    /// the file.
    pub pixels: Vec<f32>,
    /// Where the data window starts, counted from the display window's upper left corner.
    pub origin: [i32; 2],
    /// The display window's width and height.
    pub full_size: [u32; 2],
    pub encoding: Encoding,
    pub metadata: Vec<(String, MetaValue)>,
}

/// Linear Rec.709 colour over a whole display window, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct RgbImage {
    pub width: u32,
    pub height: u32,
    pub pixels: Vec<[f32; 3]>,
}

/// Names of one-channel images.
const GREY: [&str; 4] = ["Y", "L", "I", "luminance"];

impl Image {
    /// The position of the channel called `name`; in any case if there is none in this one.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<usize> {
        let exact = self.channels.iter().position(|channel| channel == name);
        exact.or_else(|| self.channels.iter().position(|channel| channel.eq_ignore_ascii_case(name)))
    }

    /// Linear colour over the display window; black where the file stores nothing. Values are as stored, also where
    /// they are negative or not finite.
    ///
    /// The colour is that of R, G and B; else of the first layer with these (`name.R`); else a grey channel (Y), else the
    /// only channel there is.
    ///
    /// # Errors
    /// [`Error::MissingChannel`] where none of these is present.
    pub fn rgb(&self) -> Result<RgbImage, Error> {
        let channels = self.colour("").or_else(|| self.layers().find_map(|layer| self.colour(&layer)));
        let channels = channels.or_else(|| (self.channels.len() == 1).then_some([0; 3]));
        channels.map(|channels| self.compose(channels)).ok_or_else(|| self.missing("R, G, B or Y"))
    }

    /// As [`Image::rgb`], of one layer: `layer.R`, `layer.G`, `layer.B` or `layer.Y`.
    ///
    /// # Errors
    /// [`Error::MissingChannel`] where the layer is not present.
    pub fn rgb_layer(&self, layer: &str) -> Result<RgbImage, Error> {
        let channels = self.colour(&format!("{layer}."));
        channels.map(|channels| self.compose(channels)).ok_or_else(|| self.missing(&format!("{layer}.R, .G and .B")))
    }

    fn missing(&self, wanted: &str) -> Error {
        Error::MissingChannel { path: self.path.clone(), wanted: wanted.to_owned(), present: self.channels.clone() }
    }

    /// Prefixes up to and including the last dot, in the order of the channels.
    fn layers(&self) -> impl Iterator<Item = String> {
        self.channels.iter().filter_map(|name| name.rfind('.').map(|dot| name[..=dot].to_owned()))
    }

    /// The channels that hold red, green and blue below `prefix`.
    fn colour(&self, prefix: &str) -> Option<[usize; 3]> {
        let find = |name: &str| self.channel(&format!("{prefix}{name}"));
        for [red, green, blue] in [["R", "G", "B"], ["red", "green", "blue"]] {
            if let (Some(red), Some(green), Some(blue)) = (find(red), find(green), find(blue)) {
                return Some([red, green, blue]);
            }
        }
        GREY.iter().find_map(|name| find(name)).map(|grey| [grey; 3])
    }

    fn compose(&self, channels: [usize; 3]) -> RgbImage {
        let [full_width, full_height] = self.full_size;
        let mut pixels = vec![[0.0; 3]; full_width as usize * full_height as usize];
        let count = self.channels.len();
        let columns = overlap(self.origin[0], self.width, full_width);
        for y in overlap(self.origin[1], self.height, full_height) {
            let source_y = (y - i64::from(self.origin[1])) as usize;
            for x in columns.clone() {
                let source_x = (x - i64::from(self.origin[0])) as usize;
                let source = &self.pixels[(source_y * self.width as usize + source_x) * count..][..count];
                let target = &mut pixels[y as usize * full_width as usize + x as usize];
                *target = channels.map(|channel| match self.encoding {
                    Encoding::Linear => source[channel],
                    Encoding::Srgb => display::srgb_to_linear(source[channel]),
                });
            }
        }
        RgbImage { width: full_width, height: full_height, pixels }
    }
}

/// The part of a display window's extent 0 .. `full` that the data `origin .. origin + length` covers.
fn overlap(origin: i32, length: u32, full: u32) -> std::ops::Range<i64> {
    let end = (i64::from(origin) + i64::from(length)).min(full.into());
    i64::from(origin).max(0)..end
}
