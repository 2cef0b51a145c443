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
    let scale = f64::from(exposure).exp2();
    rgb.map(|value| {
        // In f64 no exposure below 896 stops overflows; `max` turns NaN into 0.
        let scaled = (f64::from(value) * scale).max(0.0);
        let encoded = linear_to_srgb(scaled.min(1.0) as f32);
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn known_values() {
        // Mid grey, the breakpoint's two sides, and bounds.
        assert!((linear_to_srgb(0.214_041_14) - 0.5).abs() < 1e-6);
        assert!((linear_to_srgb(0.003_130_8) - 0.040_449_936).abs() < 1e-7);
        assert!((linear_to_srgb(0.003_130_9) - linear_to_srgb(0.003_130_8)).abs() < 2e-6);
        assert_eq!([0.0, 1.0].map(linear_to_srgb), [0.0, 1.0]);
        assert_eq!(to_srgb8([0.18, 0.5, 1.0], 0.0), [118, 188, 255]);
        assert_eq!(to_srgb8([0.09, 0.25, 0.5], 1.0), [118, 188, 255]);
    }

    #[test]
    fn odd_values_have_a_place() {
        assert_eq!(to_srgb8([f32::NAN, f32::INFINITY, f32::NEG_INFINITY], 0.0), [0, 255, 0]);
        assert_eq!(to_srgb8([-1.0, 1e30, -0.0], 2.0), [0, 255, 0]);
        // 0 at an exposure that overflows is still black.
        assert_eq!(to_srgb8([0.0, 1e-45, f32::INFINITY], 1e4), [0, 255, 255]);
    }

    #[test]
    fn every_byte_survives_a_round_trip() {
        for byte in 0..=255 {
            let linear = srgb_to_linear(f32::from(byte) / 255.0);
            assert_eq!(to_srgb8([linear; 3], 0.0), [byte; 3]);
        }
    }

    proptest! {
        #[test]
        fn brighter_is_never_darker(a in 0.0_f32..2.0, b in 0.0_f32..2.0, exposure in -4.0_f32..4.0) {
            let bytes = to_srgb8([a.min(b), a.max(b), 0.0], exposure);
            prop_assert!(bytes[0] <= bytes[1]);
        }
    }
}
