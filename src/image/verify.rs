//! Is the file what was written? On a full disk some writers report success: the answer is in the file only.

use super::format::FileFormat;
use super::read::{Info, for_each_band, open};
use super::{Error, ImageSpec, PixelFormat};
use std::path::Path;

/// Reads `file` back whole and compares it with `pixels`; value by value where the compression keeps values. Errors name
/// `path`, the name under which the user knows the image. Returns the file's size in bytes.
pub(super) fn verify(
    file: &Path,
    path: &Path,
    format: FileFormat,
    spec: &ImageSpec,
    pixels: &[f32],
) -> Result<u64, Error> {
    let damaged = |what: String| Error::Damaged { path: path.to_owned(), what };
    let (mut input, info) = open(file).map_err(|error| damaged(without_path(&error)))?;
    let order = compare_headers(format, spec, &info).map_err(damaged)?;
    let lossless = format.is_lossless(spec.compression.as_deref());
    let mut buffer = Vec::new();
    let header = input.header;
    for_each_band(&header, |rows, range| {
        buffer.resize(range.len(), 0.0);
        let first_row = (rows.start - header.y) as usize;
        input.read_rows(rows, &mut buffer)?;
        if !lossless {
            return Ok(());
        }
        compare(&order, &spec.channels, &pixels[range], &buffer).map_err(|(pixel, what)| {
            let (x, y) = (pixel % spec.width as usize, pixel / spec.width as usize);
            format!("pixel {x}, {}: {what}", first_row + y)
        })
    })
    .map_err(damaged)?;
    Ok(info.file_bytes)
}

/// The reason without the temporary file's name.
fn without_path(error: &Error) -> String {
    match error {
        Error::Library { message, .. } => message.clone(),
        Error::UnknownFormat { .. } => "it does not start as an image".to_owned(),
        Error::Io { source, .. } => source.to_string(),
        other => other.to_string(),
    }
}

/// For each channel of the file its position in `spec`.
fn compare_headers(format: FileFormat, spec: &ImageSpec, info: &Info) -> Result<Vec<usize>, String> {
    if info.format.as_bytes() != format.library_name().to_bytes() {
        return Err(format!("a file of format {}", info.format));
    }
    if [info.width, info.height] != [spec.width, spec.height] || info.channels.len() != spec.channels.len() {
        return Err(format!("{}x{} pixels of {} channels", info.width, info.height, info.channels.len()));
    }
    if format != FileFormat::Exr {
        // The other formats know no names; they keep the order.
        return Ok((0..spec.channels.len()).collect());
    }
    if info.origin != spec.origin || info.full_size != spec.full_size {
        return Err(format!("data window at {:?} in {:?}", info.origin, info.full_size));
    }
    let asked = spec.compression.as_deref().or(format.default_compression()).unwrap_or_default();
    let asked = asked.split(':').next().unwrap_or_default();
    let found = info.compression().unwrap_or("none");
    if found.split(':').next() != Some(asked) {
        return Err(format!("compression {found} in place of {asked}"));
    }
    let position = |channel| spec.channels.iter().position(|wanted| wanted == channel);
    let order: Option<Vec<usize>> = info.channels.iter().map(position).collect();
    order.ok_or_else(|| format!("channels {:?}", info.channels))
}

/// Compares interleaved pixels; an error says which pixel and what is wrong with it.
fn compare(
    order: &[usize],
    channels: &[(String, PixelFormat)],
    wanted: &[f32],
    found: &[f32],
) -> Result<(), (usize, String)> {
    let pixels = wanted.chunks_exact(channels.len()).zip(found.chunks_exact(channels.len()));
    for (index, (wanted, found)) in pixels.enumerate() {
        for (&channel, &found) in order.iter().zip(found) {
            let (name, format) = &channels[channel];
            if !same(*format, wanted[channel], found) {
                return Err((index, format!("{name} is {found} in place of {}", wanted[channel])));
            }
        }
    }
    Ok(())
}

/// Equal to the rounding of `format`: half has 11 significant bits and steps of 2^-24 near zero.
fn same(format: PixelFormat, wanted: f32, found: f32) -> bool {
    let near = |tolerance: f32| (found - wanted).abs() <= tolerance;
    match format {
        _ if wanted.is_nan() => found.is_nan(),
        _ if wanted == found => true,
        PixelFormat::Half => near((wanted.abs() / 2048.0).max(f32::from_bits(0x3300_0000))),
        PixelFormat::U8 => near(0.500_1 / 255.0),
        PixelFormat::U16 => near(0.501 / 65_535.0),
        _ => false,
    }
}
