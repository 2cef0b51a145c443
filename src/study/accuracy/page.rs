//! The study as one HTML page that stands by itself: plots, pictures, tables; no scripts, nothing loaded from elsewhere.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::results::{Point, Study, percent, seconds};
use super::svg::{Mark, Plot, escape};
use crate::image::{self, RgbImage, display};
use crate::study::mosaic::difference;

/// What is shown beside the numbers.
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    pub reference: &'a RgbImage,
    /// A picture for each point of the study.
    pub pictures: &'a [Option<RgbImage>],
    pub exposure: f32,
}

/// Factor on differences, in levels of a display.
const MAGNIFIED: f32 = 8.0;

const STYLE: &str = include_str!("page.css");

/// The page.
///
/// # Errors
/// Pictures that cannot be encoded.
pub fn page(study: &Study, shown: &Shown<'_>) -> Result<String, image::Error> {
    let name = study.scene.rsplit('/').next().unwrap_or(&study.scene);
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>What accuracy costs: {0}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n\
         <header><p class=\"over\">tress study</p><h1>What accuracy costs</h1><p class=\"scene\">{0}</p></header>\n",
        escape(name)
    );
    out.push_str(&advice(study));
    out.push_str(&main_plot(study));
    out.push_str(&pictures(study, shown)?);
    out.push_str(&sweeps(study));
    out.push_str(&table(study));
    out.push_str(&left_out(study));
    out.push_str(&method(study));
    out.push_str("</main>\n</body>\n</html>\n");
    Ok(out)
}

fn advice(study: &Study) -> String {
    let mut out = "<section class=\"advice\">\n".to_owned();
    for advice in &study.advice {
        let none = if advice.point.is_none() { " none" } else { "" };
        out.push_str(&format!(
            "<article class=\"card{none}\"><p class=\"target\">{}</p><p>{}</p><pre><code>{}</code></pre></article>\n",
            percent(advice.target),
            escape(&advice.text),
            escape(&advice.command)
        ));
    }
    out + "</section>\n"
}

/// The settings in the order in which they first come, for their colours.
fn settings(study: &Study) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for point in &study.points {
        if !names.contains(&point.setting.as_str()) {
            names.push(&point.setting);
        }
    }
    names
}

fn colour_of(names: &[&str], setting: &str) -> usize {
    names.iter().position(|name| *name == setting).unwrap_or(0) % 14
}

fn title_of(point: &Point) -> String {
    format!(
        "{} = {}: error {}, {} of CPU time",
        point.setting,
        point.value,
        percent(point.errors.rms),
        seconds(point.cpu_seconds)
    )
}

fn short(point: &Point) -> String {
    match point.setting.as_str() {
        "default" => "default".to_owned(),
        setting if setting.starts_with("knob") => point.value.clone(),
        setting => format!("{setting} {}", point.value),
    }
}

fn main_plot(study: &Study) -> String {
    let names = settings(study);
    let mark = |(index, point): (usize, &Point)| {
        let named = index == 0 || study.frontier.contains(&index);
        Mark {
            time: point.cpu_seconds,
            error: point.errors.rms,
            colour: colour_of(&names, &point.setting),
            label: if named { short(point) } else { String::new() },
            title: title_of(point),
        }
    };
    let plot = Plot {
        width: 1080.0,
        height: 560.0,
        marks: study.points.iter().enumerate().map(mark).collect(),
        line: study.frontier.clone(),
        line_class: "frontier",
        titles: true,
        name: "Error of every setting over its CPU time, with the frontier".to_owned(),
        ..Plot::default()
    };
    let legend: String = names
        .iter()
        .map(|name| {
            format!("<span class=\"key\"><i class=\"dot b{}\"></i>{}</span>", colour_of(&names, name), escape(name))
        })
        .collect();
    format!(
        "<section><h2>Error against time</h2>\n<figure>{}<p class=\"legend\">{legend}</p>\
         <figcaption>Each dot is one choice of settings, at {}×{} pixels. Lower is more accurate, further left is faster. The line is the frontier: no other setting is both \
         faster and more accurate. The reference itself is known to {}.</figcaption></figure></section>\n",
        plot.svg(),
        study.size[0],
        study.size[1],
        percent(study.reference.standard_error)
    )
}

fn sweeps(study: &Study) -> String {
    let names = settings(study);
    let default = &study.points[0];
    let all = || study.points.iter();
    let bounds = |get: fn(&Point) -> f64| {
        let low = all().map(get).fold(f64::INFINITY, f64::min);
        [low, all().map(get).fold(0.0, f64::max)]
    };
    let range = [bounds(|p| p.cpu_seconds), bounds(|p| p.errors.rms)];
    let mut out = "<section><h2>One setting at a time</h2>\n<p>Everything else is as the scene says; grey dots are all other settings, the scene as it is among them. All plots share their axes.</p>\n<div class=\"sweeps\">\n".to_owned();
    for name in names.iter().skip(1) {
        let of: Vec<&Point> = all().filter(|point| point.setting == *name).collect();
        let marks: Vec<Mark> = of
            .iter()
            .map(|point| Mark {
                time: point.cpu_seconds,
                error: point.errors.rms,
                colour: colour_of(&names, name),
                label: point.value.clone(),
                title: title_of(point),
            })
            .collect();
        let plot = Plot {
            width: 350.0,
            height: 250.0,
            line: (0..marks.len()).collect(),
            marks,
            line_class: "sweep",
            behind: all().filter(|p| p.setting != *name).map(|p| [p.cpu_seconds, p.errors.rms]).collect(),
            range: Some(range),
            name: format!("Error over CPU time for {name}"),
            titles: false,
        };
        // A wrong default is a thing to see: which value of this setting does not lie on the way of others.
        let span = of.iter().map(|p| p.errors.bias).fold(f64::INFINITY, f64::min);
        out.push_str(&format!(
            "<figure><h3>{}</h3>{}<figcaption>default {}; least bias here {}</figcaption></figure>\n",
            escape(name),
            plot.svg(),
            percent(default.errors.rms),
            percent(span)
        ));
    }
    out + "</div></section>\n"
}

fn pictures(study: &Study, shown: &Shown<'_>) -> Result<String, image::Error> {
    let mut chosen: Vec<usize> = Vec::new();
    // The ends of the frontier and what is advised, by time.
    let wanted =
        study.frontier.first().into_iter().chain(study.advice.iter().filter_map(|advice| advice.point.as_ref()));
    for &index in wanted.chain(study.frontier.last()).chain([&0]) {
        if !chosen.contains(&index) && shown.pictures.get(index).is_some_and(Option::is_some) {
            chosen.push(index);
        }
    }
    chosen.sort_by(|&a, &b| study.points[a].cpu_seconds.total_cmp(&study.points[b].cpu_seconds));
    let mut out = format!(
        "<section><h2>What errors look like</h2>\n<p>Each picture above its difference from the reference, {MAGNIFIED} times as bright as it is. The rightmost is the reference.</p>\n<div class=\"pictures\">\n"
    );
    for index in chosen {
        let (Some(picture), point) = (shown.pictures[index].as_ref(), &study.points[index]) else { continue };
        let exposed = |image: &RgbImage| exposed(image, shown.exposure);
        let Some((magnified, _)) = difference(&exposed(shown.reference), &exposed(picture), MAGNIFIED) else {
            continue;
        };
        out.push_str(&format!(
            "<figure><img src=\"{}\" alt=\"{1}\"><img src=\"{2}\" alt=\"its difference from the reference\"><figcaption><b>{1}</b><br>error {3}, {4}<br>FLIP {5:.4}</figcaption></figure>\n",
            png(picture, shown.exposure)?,
            escape(&short(point)),
            png(&magnified, 0.0)?,
            percent(point.errors.rms),
            seconds(point.cpu_seconds),
            point.errors.flip
        ));
    }
    out.push_str(&format!(
        "<figure><img src=\"{}\" alt=\"the reference\"><div class=\"none\"></div><figcaption><b>reference</b><br>known to {}, {}</figcaption></figure>\n</div></section>\n",
        png(shown.reference, shown.exposure)?,
        percent(study.reference.standard_error),
        seconds(study.reference.cpu_seconds)
    ));
    Ok(out)
}

fn exposed(image: &RgbImage, exposure: f32) -> RgbImage {
    let scale = exposure.exp2();
    RgbImage { pixels: image.pixels.iter().map(|pixel| pixel.map(|value| value * scale)).collect(), ..image.clone() }
}

/// A picture as the address of itself.
fn png(image: &RgbImage, exposure: f32) -> Result<String, image::Error> {
    let failed = |source| image::Error::Io { path: std::env::temp_dir(), action: "encode a picture", source };
    let folder = tempfile::tempdir().map_err(failed)?;
    let path = folder.path().join("picture.png");
    display::write_srgb8(&path, image, exposure)?;
    let bytes = std::fs::read(&path).map_err(failed)?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(bytes)))
}

fn table(study: &Study) -> String {
    let mut out = "<section><h2>All numbers</h2>\n<div class=\"wide\"><table>\n<thead><tr><th>setting</th><th>value</th><th>error</th><th>at most</th><th>noise</th><th>bias</th><th>mean</th><th>largest</th><th>FLIP</th><th>CPU time</th><th>wall</th><th>building</th><th>calibrating</th><th>rendering</th><th>memory</th></tr></thead>\n<tbody>\n".to_owned();
    let mut order: Vec<usize> = (0..study.points.len()).collect();
    // Settings together, in the order of the sweep.
    order.sort_by_key(|&index| settings(study).iter().position(|name| *name == study.points[index].setting));
    for index in order {
        let point = &study.points[index];
        let e = &point.errors;
        let stage = |name: &str| {
            let found = point.stages.iter().find(|stage| stage.name == name);
            found.map_or_else(|| "–".to_owned(), |stage| seconds(stage.cpu_seconds))
        };
        let class = if study.frontier.contains(&index) { " class=\"front\"" } else { "" };
        out.push_str(&format!(
            "<tr{class}><th>{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}{}</td><td>{}</td><td>{:.4}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}{:.0} MiB</td></tr>\n",
            escape(&point.setting),
            escape(&point.value),
            percent(e.rms),
            percent(e.at_most),
            e.noise.map_or_else(|| "–".to_owned(), percent),
            percent(e.bias),
            if e.mean > 0.0 { "+" } else { "" },
            percent(e.mean),
            percent(e.max),
            e.flip,
            seconds(point.cpu_seconds),
            seconds(point.wall_seconds),
            stage("building"),
            stage("calibrating"),
            stage("rendering"),
            if point.own_peak { "" } else { "≤ " },
            point.peak_bytes as f64 / f64::from(1 << 20)
        ));
    }
    out + "</tbody></table></div>\n<p class=\"note\">Marked rows are on the frontier. Error, noise and bias are root mean squares over the pixels in which something is seen, mean and largest are differences; all are shares of the mean brightness there. error² = noise² + bias². “At most” is the error and two standard errors, as far as the reference tells it; advice goes by that.</p></section>\n"
}

fn left_out(study: &Study) -> String {
    let mut out = String::new();
    if !study.skipped.is_empty() {
        out.push_str("<section><h2>Not studied</h2>\n<ul>\n");
        for skipped in &study.skipped {
            out.push_str(&format!(
                "<li><b>{}</b> (<code>{}</code>): {}</li>\n",
                escape(&skipped.setting),
                escape(&skipped.key),
                escape(&skipped.reason)
            ));
        }
        out.push_str("</ul></section>\n");
    }
    if !study.cut.is_empty() {
        let lines: String = study.cut.iter().map(|line| format!("<li>{}</li>\n", escape(line))).collect();
        out.push_str(&format!("<section><h2>Cut for the time</h2>\n<ul>\n{lines}</ul></section>\n"));
    }
    out
}

fn method(study: &Study) -> String {
    let m = &study.machine;
    let [seen, all] = study.reference.seen;
    format!(
        "<section class=\"method\"><h2>How it was measured</h2>\n<dl>\n<dt>Reference</dt><dd>{} passes in two independent halves, <code>{}</code>; {} of CPU time. Its standard error, {}, comes from the difference of the halves and is taken out of all errors. What it does not resolve (the error of its faces) no error contains.</dd>\n\
         <dt>Pictures</dt><dd>{}×{} pixels, something is seen in {seen} of {all}; {} of each setting, with different seeds, which tells noise from bias.</dd>\n\
         <dt>Time</dt><dd>CPU time of all threads, from structures to the last pixel; loading and writing files are not in it.</dd>\n\
         <dt>Machine</dt><dd>{}, {} processors, {} threads, {}{}; tress {}.</dd>\n\
         <dt>Command</dt><dd><code>{}</code></dd>\n</dl></section>\n",
        study.reference.passes,
        escape(&study.reference.set.join(" ")),
        seconds(study.reference.cpu_seconds),
        percent(study.reference.standard_error),
        study.size[0],
        study.size[1],
        study.repeats,
        escape(&m.processor),
        m.processors,
        m.threads,
        escape(&m.system),
        m.load.map_or_else(String::new, |load| format!(", load {load:.1} at the end")),
        escape(study.version),
        escape(&study.command)
    )
}

#[cfg(test)]
mod tests {
    use super::super::results::tests::sample;
    use super::*;

    #[test]
    fn the_page_is_well_formed_and_stands_by_itself() {
        let study = sample();
        let grey = |value: f32| RgbImage { width: 4, height: 3, pixels: vec![[value; 3]; 12] };
        let pictures: Vec<Option<RgbImage>> = (0..4).map(|i| Some(grey(0.1 * i as f32))).collect();
        let reference = grey(0.2);
        let text = page(&study, &Shown { reference: &reference, pictures: &pictures, exposure: 0.0 }).unwrap();
        // As XML, but for what HTML writes without an end.
        let xml = text.replace("<!DOCTYPE html>\n", "");
        let void =
            ["<meta charset=\"utf-8\">", "content=\"width=device-width, initial-scale=1\">", "content=\"light dark\">"];
        let xml = void.iter().fold(xml, |xml, tag| xml.replace(tag, &format!("{}/>", &tag[..tag.len() - 1])));
        let xml = xml.replace("<br>", "<br/>");
        let mut closed = String::new();
        for (i, part) in xml.split("<img ").enumerate() {
            closed.push_str(&if i == 0 {
                part.to_owned()
            } else {
                format!("<img {}", part.replacen("\">", "\"/>", 1))
            });
        }
        let document = roxmltree::Document::parse(&closed).unwrap_or_else(|e| panic!("{e}"));
        let count = |name: &str| document.descendants().filter(|node| node.has_tag_name(name)).count();
        assert_eq!(count("svg"), 1 + 2, "the plot, and one each for knob and layers");
        assert!(count("img") >= 5 && count("script") == 0 && count("link") == 0);
        assert!(!text.contains("src=\"http") && !text.contains("url("), "nothing is loaded");
        for part in ["a &lt;b&gt; &amp; 'c'.toml", "occlusion.opening", "something", "frontier"] {
            assert!(text.contains(part), "{part}");
        }
    }

    #[test]
    fn odd_numbers_have_a_place() {
        let mut study = sample();
        study.points.truncate(1);
        study.points[0].errors.rms = 0.0;
        study.points[0].errors.noise = None;
        study.points[0].cpu_seconds = 0.0;
        study.conclude();
        let picture = RgbImage { width: 1, height: 1, pixels: vec![[f32::NAN, f32::INFINITY, -1.0]] };
        let text = page(&study, &Shown { reference: &picture, pictures: &[None], exposure: 3.0 }).unwrap();
        assert!(!text.contains("\"NaN") && !text.contains("inf,"), "{text}");
    }
}
