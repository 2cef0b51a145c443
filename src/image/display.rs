//! Linear Rec.709 colour to sRGB (IEC 61966-2-1), exactly and without dither: equal input gives equal bytes.

use super::{Error, ImageSpec, PixelFormat, RgbImage, Written, write_atomic};
use std::path::Path;

/// The sRGB transfer function, from linear light to the encoded value; both 0 to 1. The breakpoint and the constants are
/// the standard's; the two pieces differ by 3e-8 where they meet.
#[must_use]
pub fn linear_to_srgb(linear: f32) -> f32 {
    let linear = f64::from(linear);
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    encoded as f32
}

/// The inverse of [`linear_to_srgb`].
#[must_use]
pub fn srgb_to_linear(encoded: f32) -> f32 {
    let encoded = f64::from(encoded);
    let linear = if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
    linear as f32
}

/// One pixel for a display: scaled by 2^`exposure`, clamped, encoded and rounded to the nearest byte. NaN becomes 0,
/// infinity 255.
#[must_use]
pub fn to_srgb8(rgb: [f32; 3], exposure: f32) -> [u8; 3] {
    let scale = exposure.exp2();
    rgb.map(|value| {
        let scaled = value * scale;
        // `max` before `min`: it turns NaN into 0.
        let encoded = linear_to_srgb(scaled.max(0.0).min(1.0));
        (encoded * 255.0).round() as u8
    })
}

/// Writes linear colour, row by row from the top, as sRGB bytes to a PNG, JPEG or TIFF file.
///
/// # Errors
/// As [`write_atomic`].
pub fn write_srgb8(path: &Path, image: &RgbImage, exposure: f32) -> Result<Written, Error> {
    let channels = ["R", "G", "B"].map(|name| (name.to_owned(), PixelFormat::U8));
    let spec = ImageSpec::new(image.width, image.height, channels.to_vec());
    let encode = |&pixel: &[f32; 3]| to_srgb8(pixel, exposure).map(|byte| f32::from(byte) / 255.0);
    let pixels: Vec<f32> = image.pixels.iter().flat_map(encode).collect();
    write_atomic(path, &spec, &pixels)
}
