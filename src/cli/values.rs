//! The values of options: read strictly, with messages that show the right form.

use std::fmt;
use std::path::Path;

use super::Failure;
use crate::file::replaceable;
use crate::scene::keypath::clip;

/// The most frames of one run.
const MAX_FRAMES: u64 = 1_000_000;

/// A picture's size in pixels: `640x480`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resolution {
    /// Columns, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
}

impl Resolution {
    /// What it stands for, as after `--set`.
    pub(crate) fn setting(self) -> String {
        format!("camera.resolution=[{}, {}]", self.width, self.height)
    }
}

/// A size, `WIDTHxHEIGHT` in pixels.
///
/// # Errors
/// A message that shows the form.
pub fn resolution(text: &str) -> Result<Resolution, String> {
    let form = || format!("\"{}\" is not a size; write WIDTHxHEIGHT in pixels, as in 1920x1080", clip(text));
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(form)?;
    let resolution = Resolution { width: whole(width).ok_or_else(form)?, height: whole(height).ok_or_else(form)? };
    if resolution.width == 0 || resolution.height == 0 {
        return Err("a picture needs at least 1 pixel each way".to_owned());
    }
    Ok(resolution)
}

/// The part of the picture that is rendered: columns `x0` to before `x1`, rows `y0` to before `y1`, from the top left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// The column after the last; greater than `x0`.
    pub x1: u32,
    /// The row after the last; greater than `y0`.
    pub y1: u32,
}

/// A part of a picture, `x0,y0,x1,y1` in pixels.
///
/// # Errors
/// A message that shows the form, or says that it is empty.
pub fn crop(text: &str) -> Result<Crop, String> {
    let form = || format!("\"{}\" is not a crop; write x0,y0,x1,y1 in pixels, as in 100,50,200,150", clip(text));
    let mut numbers = text.split(',').map(|part| whole(part.trim()));
    let mut next = || numbers.next().flatten().ok_or_else(form);
    let crop = Crop { x0: next()?, y0: next()?, x1: next()?, y1: next()? };
    if numbers.next().is_some() {
        return Err(form());
    }
    if crop.x0 >= crop.x1 || crop.y0 >= crop.y1 {
        return Err(format!("{crop} is empty: x1 must be greater than x0 and y1 greater than y0"));
    }
    Ok(crop)
}

/// A pixel's column and row: `120,80`.
pub(crate) fn pixel(text: &str) -> Result<[u32; 2], String> {
    let form =
        || format!("\"{}\" is not a pixel; write its column and row from the upper left, as in 120,80", clip(text));
    let (x, y) = text.split_once(',').ok_or_else(form)?;
    Ok([whole(x.trim()).ok_or_else(form)?, whole(y.trim()).ok_or_else(form)?])
}

impl fmt::Display for Crop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{},{}", self.x0, self.y0, self.x1, self.y1)
    }
}

/// Frame numbers in the order of rendering, each once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frames(Vec<u32>);

impl Frames {
    /// The numbers; at least one.
    pub fn numbers(&self) -> &[u32] {
        &self.0
    }
}

impl Default for Frames {
    /// Frame 1 alone.
    fn default() -> Self {
        Self(vec![1])
    }
}

/// Reads `5`, `1-10`, `1-10x2` and lists of them with commas.
///
/// # Errors
/// A message that shows the form or names the limit of a million frames.
pub fn frames(text: &str) -> Result<Frames, String> {
    let mut runs = Vec::new();
    let mut total = 0_u64;
    for part in text.split(',') {
        let (first, last, step) = run(part.trim())?;
        total = total.saturating_add(u64::from((last - first) / step) + 1);
        // Checked before a single number is stored.
        if total > MAX_FRAMES {
            return Err(format!("\"{}\" is {total} frames or more; at most {MAX_FRAMES} in one run", clip(text)));
        }
        runs.push((first, last, step));
    }
    let one_run = runs.len() == 1;
    let numbers = runs.into_iter().flat_map(|(first, last, step)| (first..=last).step_by(step as usize));
    if one_run {
        return Ok(Frames(numbers.collect()));
    }
    Ok(Frames(first_of_each(numbers)))
}

/// Numbers in their order, each where it comes first; by sorting, as up to a million would take a hash table's time each. A word holds a number and its place.
fn first_of_each(numbers: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut places: Vec<u64> = (0_u64..).zip(numbers).map(|(place, number)| u64::from(number) << 32 | place).collect();
    places.sort_unstable();
    places.dedup_by_key(|at| *at >> 32);
    places.iter_mut().for_each(|at| *at = at.rotate_left(32));
    places.sort_unstable();
    places.into_iter().map(|at| at as u32).collect()
}

/// `FIRST`, `FIRST-LAST` or `FIRST-LASTxSTEP`.
fn run(part: &str) -> Result<(u32, u32, u32), String> {
    let form =
        || format!("\"{}\" is no run of frames; write 5, 1-10, 1-10x2 (each second) or a list 1-10,20", clip(part));
    let number = |text: &str| whole(text).ok_or_else(form);
    let Some((first, rest)) = part.split_once('-') else {
        return number(part).map(|frame| (frame, frame, 1));
    };
    let (last, step) = rest.split_once(['x', 'X']).unwrap_or((rest, "1"));
    let (first, last, step) = (number(first)?, number(last)?, number(step)?);
    if step == 0 {
        return Err(format!("\"{}\" has step 0; the step must be at least 1", clip(part)));
    }
    if first > last {
        return Err(format!("\"{}\" runs backwards; write {last}-{first}", clip(part)));
    }
    Ok((first, last, step))
}

/// Digits alone: no sign, no spaces, no more than fits.
fn whole(text: &str) -> Option<u32> {
    let digits = !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    digits.then(|| text.parse().ok()).flatten()
}

/// An error as a share (an RMS error of sky visibility, or of a picture): above 0, up to 1.
///
/// # Errors
/// A message that shows the form.
pub fn accuracy(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|&number: &f64| number > 0.0 && number <= 1.0);
    number.ok_or_else(|| {
        format!("\"{}\" is no number above 0 and up to 1; write a share, as in 0.01 for 1 %", clip(text))
    })
}

/// An amount of memory, in bytes: `2GiB`, `512MiB`, `1.5GB`, or a whole number of bytes.
///
/// # Errors
/// A message that shows the form, or says that it is 0 or more than an address counts.
pub fn size(text: &str) -> Result<u64, String> {
    const UNITS: [(&str, u64); 9] = [
        ("b", 1),
        ("kb", 1000),
        ("mb", 1_000_000),
        ("gb", 1_000_000_000),
        ("tb", 1_000_000_000_000),
        ("kib", 1 << 10),
        ("mib", 1 << 20),
        ("gib", 1 << 30),
        ("tib", 1 << 40),
    ];
    let form = || format!("\"{}\" is no amount of memory; write a number and a unit, as in 2GiB or 800MB", clip(text));
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = (&text[..end], text[end..].trim_start_matches(' ').to_ascii_lowercase());
    let (whole_part, fraction) = number.split_once('.').unwrap_or((number, "0"));
    let digits = |part: &str| !part.is_empty() && part.len() <= 18 && part.bytes().all(|b| b.is_ascii_digit());
    if !digits(whole_part) || !digits(fraction) || unit.is_empty() && number.contains('.') {
        return Err(form());
    }
    let factor = if unit.is_empty() { 1 } else { UNITS.iter().find(|(name, _)| *name == unit).ok_or_else(form)?.1 };
    let part = |digits: &str| digits.parse::<u128>().unwrap_or(0) * u128::from(factor);
    let bytes = part(whole_part) + part(fraction) / 10_u128.pow(fraction.len() as u32);
    match u64::try_from(bytes) {
        Ok(0) => Err(format!("\"{}\" leaves no memory at all; give more", clip(text))),
        Ok(bytes) => Ok(bytes),
        Err(_) => Err(format!("\"{}\" is more than any machine has", clip(text))),
    }
}

/// A time in seconds: `90`, `90s`, `5m`, `1.5h`; above 0, up to a month.
pub(crate) fn duration(text: &str) -> Result<f64, String> {
    let form = || format!("\"{}\" is no time; write 90s, 5m or 1h", clip(text));
    let (number, unit) = match text.strip_suffix(['s', 'm', 'h']) {
        Some(number) => (
            number,
            if text.ends_with('m') {
                60.0
            } else if text.ends_with('h') {
                3600.0
            } else {
                1.0
            },
        ),
        None => (text, 1.0),
    };
    let plain = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    let seconds = plain.then(|| number.parse::<f64>().ok()).flatten().ok_or_else(form)? * unit;
    let month = 30.0 * 24.0 * 3600.0;
    if !(seconds > 0.0 && seconds <= month) {
        return Err(format!("\"{}\" is out of range; give more than 0 s and at most a month", clip(text)));
    }
    Ok(seconds)
}

/// The argument of `--set`, checked for its form only.
///
/// # Errors
/// A message that shows the form.
pub fn setting(text: &str) -> Result<String, String> {
    crate::scene::overrides::check_form(text).map(|()| text.to_owned())
}

/// An error unless the folder of an output file exists and the file may be replaced: better now than when the work is done.
pub(crate) fn folder_exists(file: &Path) -> Result<(), Failure> {
    replaceable(file).map_err(|e| Failure::Output(format!("{}: {e}", file.display())))?;
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
            let message = format!("{}: the folder {} does not exist; make it first", file.display(), folder.display());
            Err(Failure::Output(message))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_long_list_of_frames_holds_each_once_in_its_order() {
        // Overlapping runs of nearly a million; found by fuzzing as a time-out while each number was looked up in a hash table.
        let found = frames("6448-21919,300-881920,431").expect("a list");
        let before = (6448..=21919).chain(300..=6447).chain(21920..=881_920);
        assert!(found.numbers().iter().copied().eq(before));
        assert_eq!(frames("7,3,4294967295,7,1-4").expect("a list").numbers(), [7, 3, u32::MAX, 1, 2, 4]);
    }

    #[test]
    fn resolutions() {
        assert_eq!(resolution("640x480"), Ok(Resolution { width: 640, height: 480 }));
        for text in ["", "x", "640", "640x", "-1x5", "1x2x3", "4294967296x1", "+6x6", " 6x6", "६x६"] {
            assert!(resolution(text).unwrap_err().contains("WIDTHxHEIGHT"), "{text}");
        }
        assert!(resolution("0x5").unwrap_err().contains("at least 1"));
    }

    #[test]
    fn crops() {
        assert_eq!(crop("1,2,3, 4"), Ok(Crop { x0: 1, y0: 2, x1: 3, y1: 4 }));
        for text in ["", "1,2,3", "1,2,3,4,5", "a,b,c,d", "1,2,3,-4", "1,2,3,4294967296"] {
            assert!(crop(text).unwrap_err().contains("x0,y0,x1,y1"), "{text}");
        }
        assert!(crop("5,0,5,9").unwrap_err().contains("empty"));
        assert!(crop("0,9,5,1").unwrap_err().contains("empty"));
    }

    #[test]
    fn pixels() {
        assert_eq!(pixel("12, 3"), Ok([12, 3]));
        for text in ["", "1", "1,", "1,2,3", "-1,2", "1.5,2"] {
            assert!(pixel(text).unwrap_err().contains("as in 120,80"), "{text}");
        }
    }

    #[test]
    fn accuracies() {
        assert_eq!((accuracy("0.01"), accuracy("1e-6"), accuracy("1")), (Ok(0.01), Ok(1e-6), Ok(1.0)));
        for text in ["", "0", "-1", "1.01", "nan", "inf", "1 %"] {
            assert!(accuracy(text).unwrap_err().contains("as in 0.01"), "{text}");
        }
    }

    #[test]
    fn amounts_of_memory() {
        assert_eq!(
            (size("2GiB"), size("1.5 kb"), size("100"), size("0.5KiB")),
            (Ok(2 << 30), Ok(1500), Ok(100), Ok(512))
        );
        for text in ["", "GiB", "-1GiB", "1e9", "1.5", "2 giraffes", "1..2MB", "१GB", "inf", "1.GB", ".5GB"] {
            assert!(size(text).unwrap_err().contains("as in 2GiB"), "{text}");
        }
        assert!(size("0MB").unwrap_err().contains("no memory"));
        assert!(size("0.1b").unwrap_err().contains("no memory"));
        assert!(size("99999999999999TiB").unwrap_err().contains("any machine"));
    }

    #[test]
    fn durations() {
        assert_eq!(["90", "90s", "1.5m", "2h"].map(|text| duration(text).unwrap()), [90.0, 90.0, 90.0, 7200.0]);
        for text in ["", "s", "m", "5 m", "-5m", "1e3s", "5d", "nan", "inf", "1.2.3s"] {
            assert!(duration(text).unwrap_err().contains("5m"), "{text}");
        }
        assert!(["0s", "9999h"].iter().all(|text| duration(text).unwrap_err().contains("out of range")));
    }

    #[test]
    fn frame_runs() {
        let numbers = |text: &str| frames(text).unwrap().numbers().to_vec();
        assert_eq!(numbers("5"), [5]);
        assert_eq!(numbers("1-10x3"), [1, 4, 7, 10]);
        assert_eq!(numbers("8-10, 20,9"), [8, 9, 10, 20]);
        assert_eq!(numbers("4294967290-4294967295x4"), [4_294_967_290, 4_294_967_294]);
        assert_eq!(numbers("0-999999").len(), 1_000_000);
        for (text, part) in [
            ("", "no run of frames"),
            ("1-", "no run of frames"),
            ("-5", "no run of frames"),
            ("1-2-3", "no run of frames"),
            ("1-5x", "no run of frames"),
            ("1,,2", "no run of frames"),
            ("99999999999", "no run of frames"),
            ("1-10x0", "step 0"),
            ("10-1", "runs backwards; write 1-10"),
            ("0-4294967295", "4294967296 frames or more; at most 1000000"),
            ("1-600000,1-600000", "1200000 frames or more"),
        ] {
            let error = frames(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "[0-9x,\\-]{0,24}|.*") {
            let _ = (resolution(&text), crop(&text), setting(&text), accuracy(&text), duration(&text));
            if let Ok(frames) = frames(&text) {
                prop_assert!(!frames.numbers().is_empty());
            }
        }
    }
}
