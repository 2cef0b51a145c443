//! The facts of a file as lines for people.

use std::fmt::Write;

use super::super::check::count;
use super::super::log::printable;
use super::facts::{Content, Facts, ImageFacts, SceneFacts};
use crate::hair::inspect::{self as hair_inspect, Given, Spread};
use crate::surface::inspect as mesh_inspect;

/// A heading with the file's name, and its facts below it.
pub(super) fn lines(facts: &Facts) -> String {
    let mut page = Page::default();
    let file = facts.file.display();
    match &facts.content {
        Content::Hair { format, facts } => {
            page.heading(format!("{file}: hair ({format})"));
            hair(facts, &mut page);
        }
        Content::Mesh { facts } => {
            page.heading(format!("{file}: mesh"));
            mesh(facts, &mut page);
        }
        Content::Image { facts } => {
            page.heading(format!("{file}: image ({})", facts.format));
            image(facts, &mut page);
        }
        Content::Scene { facts } => {
            page.heading(format!("{file}: scene"));
            scene(facts, &mut page);
        }
    }
    facts.notes.iter().for_each(|note| page.fact("note", note));
    facts.suspicious.iter().for_each(|oddity| page.fact("suspicious", oddity));
    page.0
}

#[derive(Default)]
struct Page(String);

impl Page {
    fn heading(&mut self, text: String) {
        self.0.push_str(&printable(&text));
        self.0.push('\n');
    }

    fn fact(&mut self, name: &str, value: impl AsRef<str>) {
        // Names come from the file: no escape sequence of theirs shall reach the terminal.
        let _ = writeln!(self.0, "  {:<14} {}", printable(name), printable(value.as_ref()));
    }
}

fn hair(facts: &hair_inspect::Report, page: &mut Page) {
    page.fact("strands", facts.strands.to_string());
    page.fact("segments", facts.segments.to_string());
    page.fact("points", format!("{}; {} a strand", facts.points, spread(&facts.points_per_strand)));
    page.fact("bounds", bounds(&facts.bounds));
    page.fact("strand length", spread(&facts.strand_length));
    page.fact("segment length", spread(&facts.segment_length));
    page.fact("width", format!("{}{}", spread(&facts.width), given(facts.width_given)));
    page.fact("transparency", format!("{}{}", spread(&facts.transparency), given(facts.transparency_given)));
    let [r, g, b] = facts.color_mean;
    page.fact("colour", format!("{r:.4} {g:.4} {b:.4} mean{}", given(facts.color_given)));
}

fn mesh(facts: &mesh_inspect::Report, page: &mut Page) {
    page.fact("triangles", facts.triangles.to_string());
    page.fact("vertices", format!("{}, {} normals", facts.vertices, if facts.normals { "with" } else { "without" }));
    page.fact("bounds", bounds(&facts.bounds));
    page.fact("area", number(facts.area));
    let edges = count(facts.open_edges, "edge");
    page.fact(
        "closed",
        if facts.closed { "yes".to_owned() } else { format!("no: {edges} not shared by two triangles") },
    );
    for material in &facts.materials {
        let [r, g, b] = material.diffuse;
        let triangles = count(material.triangles, "triangle");
        page.fact("material", format!("{}: {triangles}, diffuse {r:.4} {g:.4} {b:.4}", material.name));
    }
}

fn image(facts: &ImageFacts, page: &mut Page) {
    let [width, height] = facts.size;
    let mut size = format!("{width}x{height} pixels");
    if facts.origin != [0, 0] || facts.full_size != facts.size {
        let ([x, y], [full_width, full_height]) = (facts.origin, facts.full_size);
        let _ = write!(size, " at {x},{y} of a picture of {full_width}x{full_height}");
    }
    if let Some([width, height]) = facts.tile {
        let _ = write!(size, ", in tiles of {width}x{height}");
    }
    page.fact("size", size);
    page.fact("compression", facts.compression.as_deref().unwrap_or("none named"));
    for channel in &facts.channels {
        let range = match (channel.min, channel.mean, channel.max) {
            (Some(min), Some(mean), Some(max)) => {
                format!("{} to {}, mean {}", number(min.into()), number(max.into()), number(mean))
            }
            _ => "no finite value".to_owned(),
        };
        let mut counts = String::new();
        for (n, what) in [(channel.nan, "NaN"), (channel.infinite, "infinite"), (channel.negative, "negative")] {
            if n > 0 {
                let _ = write!(counts, ", {n} {what}");
            }
        }
        page.fact(&channel.name, format!("{range}{counts} ({})", channel.format));
    }
}

fn scene(facts: &SceneFacts, page: &mut Page) {
    let [width, height] = facts.resolution;
    page.fact("picture", format!("{width}x{height} pixels"));
    page.fact("hair", count(facts.hair_objects, "object"));
    page.fact("surfaces", facts.surfaces.to_string());
    page.fact("lights", facts.lights.to_string());
    facts.files.iter().for_each(|file| page.fact("names", file.display().to_string()));
}

fn spread(spread: &Spread) -> String {
    if spread.min == spread.max {
        return number(spread.min);
    }
    format!("{} to {}, mean {}", number(spread.min), number(spread.max), number(spread.mean))
}

fn given(given: Given) -> &'static str {
    match given {
        Given::Uniform => " (the same for all)",
        Given::PerStrand => " (a value a strand)",
        Given::PerPoint => " (a value a point)",
    }
}

fn bounds(bounds: &Option<[[f32; 3]; 2]>) -> String {
    let corner = |c: [f32; 3]| c.map(|v| number(v.into())).join(" ");
    bounds.map_or("none".to_owned(), |[low, high]| format!("{} .. {}", corner(low), corner(high)))
}

/// Six digits, in powers of ten where the number is very large or very small.
fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        "0".to_owned()
    } else if !(1e-4..1e7).contains(&size) {
        format!("{value:.5e}")
    } else {
        let digits = (5 - size.log10().floor() as i32).max(0) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_digits() {
        for (value, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (-0.125, "-0.125"),
            (1234567.0, "1234567"),
            (123.456789, "123.457"),
            (0.00012345678, "0.000123457"),
            (1e-5, "1.00000e-5"),
            (3.5e9, "3.50000e9"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn names_from_files_cannot_steer_a_terminal() {
        let mut page = Page::default();
        page.fact("a\x1b[2J", "b\u{9b}c\nd");
        assert!(!page.0.trim_end().contains(|c: char| c.is_control()), "{:?}", page.0);
    }
}
