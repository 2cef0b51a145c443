//! A cross-check as a picture (SVG): the two estimators against each other, and below it their difference, finer.

use std::error::Error;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use thiserror::Error;

use super::report::{Part, Report, Verdict};

/// Width and height, in pixels.
const SIZE: (u32, u32) = (860, 1230);
/// Heights of the title and of the upper panel, whose axes are then equally long.
const TITLE: u32 = 92;
const SCATTER: u32 = 784;

/// Brown for hair, blue for surfaces: told apart by eyes that see red and green alike.
const HAIR: RGBColor = RGBColor(176, 92, 20);
const SURFACE: RGBColor = RGBColor(20, 110, 190);
const BAND: RGBColor = RGBColor(226, 230, 222);
const INK: RGBColor = RGBColor(50, 50, 50);
const GRID: RGBColor = RGBColor(225, 225, 225);
const FONT: &str = "sans-serif";

/// Why there is no plot.
#[derive(Debug, Error)]
pub enum PlotError {
    /// A cross-check without points.
    #[error("there are no points to plot")]
    Nothing,
    #[error("cannot draw the plot: {0}")]
    Drawing(String),
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Draws a cross-check as SVG.
///
/// # Errors
/// A report without points.
pub fn svg(report: &Report) -> Result<String, PlotError> {
    let Some(all) = report.all.as_ref().filter(|_| !report.points.is_empty()) else { return Err(PlotError::Nothing) };
    let mut text = String::new();
    draw(report, all, &mut text).map_err(|e| PlotError::Drawing(e.to_string()))?;
    Ok(text)
}

fn draw(report: &Report, all: &Part, text: &mut String) -> Result<(), Box<dyn Error>> {
    let root = SVGBackend::with_string(text, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let (title, panels) = root.split_vertically(TITLE);
    let (scatter, differences) = panels.split_vertically(SCATTER);
    title_lines(report, all, &title)?;
    draw_scatter(report, &scatter)?;
    draw_differences(report, &differences)?;
    root.present()?;
    Ok(())
}

fn title_lines(report: &Report, all: &Part, area: &Area<'_>) -> Result<(), Box<dyn Error>> {
    let centered = Pos::new(HPos::Center, VPos::Center);
    let middle = SIZE.0 as i32 / 2;
    let line = |text: String, size: u32, y: i32| {
        area.draw(&Text::new(text, (middle, y), (FONT, size).into_font().color(&INK).pos(centered)))
    };
    let rms = &all.summary.rms;
    let interval = match (rms.low, rms.high) {
        (Some(low), Some(high)) => format!(" ({low:.4} to {high:.4})"),
        _ => String::new(),
    };
    let verdict = match report.verdict {
        Verdict::Held => "held",
        Verdict::Exceeded => "exceeded",
        Verdict::Undecided | Verdict::Nothing => "not decided",
    };
    line(printable(&report.scene), 25, 32)?;
    line(
        format!(
            "RMS difference {:.4}{interval}, mean {:+.4}; accuracy {} {verdict}",
            rms.value, all.summary.mean.value, report.accuracy
        ),
        17,
        66,
    )?;
    Ok(())
}

/// Projection over rays.
fn draw_scatter(report: &Report, area: &Area<'_>) -> Result<(), Box<dyn Error>> {
    let mut chart = ChartBuilder::on(area)
        .margin_left(14)
        .margin_right(40)
        .margin_top(4)
        .x_label_area_size(52)
        .y_label_area_size(78)
        .build_cartesian_2d(0.0..1.0, 0.0..1.0)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style((FONT, 15).into_font().color(&INK))
        .axis_desc_style((FONT, 17).into_font().color(&INK))
        .x_desc("sky visibility by rays")
        .y_desc("sky visibility by projection")
        .x_labels(6)
        .y_labels(6)
        .draw()?;
    let a = report.accuracy.min(1.0);
    let band = vec![(0.0, 0.0), (0.0, a), (1.0 - a, 1.0), (1.0, 1.0), (1.0, 1.0 - a), (a, 0.0)];
    chart
        .draw_series([Polygon::new(band, BAND)])?
        .label(format!("within the accuracy of {}", report.accuracy))
        .legend(|(x, y)| Rectangle::new([(x, y - 6), (x + 18, y + 6)], BAND.filled()));
    chart
        .draw_series(LineSeries::new([(0.0, 0.0), (1.0, 1.0)], INK))?
        .label("equal")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], INK));
    for (on_hair, name, part) in [(true, "hair", &report.hair), (false, "surfaces", &report.surface)] {
        let Some(part) = part else { continue };
        let points = report.points.iter().filter(|point| point.on_hair() == on_hair);
        let label = format!("{name}: {} points, RMS {:.4}", part.summary.points, part.summary.rms.value);
        chart
            .draw_series(points.map(|point| dot((point.rays, point.projection), on_hair)))?
            .label(label)
            .legend(move |(x, y)| dot((x + 9, y), on_hair));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .margin(16)
        .legend_area_size(28)
        .label_font((FONT, 16).into_font().color(&INK))
        .background_style(WHITE.mix(0.9))
        .border_style(GRID)
        .draw()?;
    Ok(())
}

/// The difference over rays: where a scatter shows a line, this shows what is left.
fn draw_differences(report: &Report, area: &Area<'_>) -> Result<(), Box<dyn Error>> {
    let largest = report.points.iter().map(|point| point.difference.abs()).fold(0.0, f64::max);
    let reach = 1.15 * largest.max(report.accuracy);
    let mut chart = ChartBuilder::on(area)
        .margin_left(14)
        .margin_right(40)
        .margin_top(18)
        .margin_bottom(8)
        .x_label_area_size(52)
        .y_label_area_size(78)
        .build_cartesian_2d(0.0..1.0, -reach..reach)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style((FONT, 15).into_font().color(&INK))
        .axis_desc_style((FONT, 17).into_font().color(&INK))
        .x_desc("sky visibility by rays")
        .y_desc("projection less rays")
        .x_labels(6)
        .y_labels(7)
        .y_label_formatter(&|y| tick(*y, reach))
        .draw()?;
    let a = report.accuracy;
    chart.draw_series([Rectangle::new([(0.0, -a), (1.0, a)], BAND.filled())])?;
    chart.draw_series(LineSeries::new([(0.0, 0.0), (1.0, 0.0)], INK))?;
    chart.draw_series(report.points.iter().map(|point| dot((point.rays, point.difference), point.on_hair())))?;
    Ok(())
}

fn dot<C>(at: C, on_hair: bool) -> Circle<C, i32> {
    Circle::new(at, 3, if on_hair { HAIR } else { SURFACE }.mix(0.65).filled())
}

/// A number of the axis with digits enough for its range.
fn tick(value: f64, reach: f64) -> String {
    let digits = (1.0 - reach.log10()).ceil().clamp(1.0, 9.0) as usize;
    format!("{value:+.digits$}")
}

/// Text that XML can hold.
fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() || "\u{FFFE}\u{FFFF}".contains(c) { '\u{FFFD}' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::super::report::{Compared, Population, Site};
    use super::*;

    fn report(count: u32, accuracy: f64, difference: f64) -> Report {
        let point = |index: u32| {
            let site = if index.is_multiple_of(2) {
                Site::Hair { object: "fur".to_owned(), strand: index, segment: index }
            } else {
                Site::Surface { triangle: index }
            };
            let rays = f64::from(index) / f64::from(count);
            let projection = rays + difference;
            Compared { pixel: [0, 0], site, projection, rays, halves: [rays; 2], difference, hair_distance: None }
        };
        let mut report = Report::new("a<b>&\"c\u{1}\u{FFFF}.toml".to_owned(), accuracy, 0, 1000);
        report.judge(Population { hair: 10, surface: 10 }, (0..count).map(point).collect(), Vec::new());
        report
    }

    #[test]
    fn plots_are_well_formed_whatever_the_numbers() {
        for (count, accuracy, difference) in [(2, 0.01, 0.0), (30, 1.0, 0.5), (30, 1e-9, 1e-9), (1, 1e-300, 0.0)] {
            let text = svg(&report(count, accuracy, difference));
            if count < 2 {
                // A kind that the picture holds and no point lies on: there is no sum over all.
                assert!(matches!(text, Err(PlotError::Nothing)));
                continue;
            }
            let text = text.unwrap();
            let document = roxmltree::Document::parse(&text).unwrap();
            let circles = document.descendants().filter(|node| node.has_tag_name("circle")).count();
            assert_eq!(circles as u32, 2 * count + 2);
            let texts: Vec<_> = document.descendants().filter_map(|node| node.text()).map(str::trim).collect();
            assert!(texts.contains(&"a<b>&\"c\u{FFFD}\u{FFFD}.toml"), "{texts:?}");
            for part in ["sky visibility by rays", "sky visibility by projection", "projection less rays", "equal"] {
                assert!(texts.contains(&part), "{part} in {texts:?}");
            }
        }
    }

    #[test]
    fn ticks_have_digits_enough() {
        assert_eq!([tick(0.004, 0.02), tick(-0.5, 1.0), tick(2e-6, 5e-6)], ["+0.004", "-0.5", "+0.0000020"]);
    }
}
