//! Plots of error against time as SVG, both axes logarithmic. Colours are classes of the page's style sheet, so that they follow its light or dark theme.

/// A point of a plot.
#[derive(Clone, Debug)]
pub(super) struct Mark {
    /// Seconds.
    pub time: f64,
    /// Share.
    pub error: f64,
    /// Number of its colour.
    pub colour: usize,
    /// Shown beside it; nothing where empty.
    pub label: String,
    /// Shown where a pointer rests on it.
    pub title: String,
}

/// A plot.
#[derive(Clone, Debug, Default)]
pub(super) struct Plot {
    pub width: f64,
    pub height: f64,
    pub marks: Vec<Mark>,
    /// Indices of the marks that a line joins.
    pub line: Vec<usize>,
    /// Marks without a name behind the others.
    pub behind: Vec<[f64; 2]>,
    /// Class of the line: "frontier" or "sweep".
    pub line_class: &'static str,
    /// Axis titles.
    pub titles: bool,
    /// Bounds of time and error that the plot holds beside its marks.
    pub range: Option<[[f64; 2]; 2]>,
    pub name: String,
}

/// The least error that is drawn: none is a place on a logarithmic axis.
const LEAST: f64 = 1e-4;

struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let logs: Vec<f64> = values.map(|value| value.max(1e-9).ln()).collect();
        let low = logs.iter().copied().fold(f64::INFINITY, f64::min);
        let high = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (low, high) = if low.is_finite() { (low, high) } else { (0.0, 1.0) };
        let margin = 0.08 * (high - low) + 0.12;
        Self { low: low - margin, high: high + margin, from, to }
    }

    fn at(&self, value: f64) -> f64 {
        self.from + (value.max(1e-9).ln() - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// 1, 2, 5, 10, ... of the range; only the powers of ten of a wide one.
    fn ticks(&self) -> Vec<f64> {
        let decades = (self.high - self.low) / std::f64::consts::LN_10;
        let steps: &[f64] = if decades > 3.2 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let exponents = -9..9;
        let all = exponents.flat_map(|e| steps.iter().map(move |step| step * 10_f64.powi(e)));
        all.filter(|tick| (self.low..=self.high).contains(&tick.ln())).collect()
    }
}

impl Plot {
    pub fn svg(&self) -> String {
        let (left, right, top, bottom) = if self.titles { (74.0, 24.0, 18.0, 58.0) } else { (52.0, 12.0, 10.0, 30.0) };
        let error = |error: f64| error.max(LEAST);
        let [more_times, more_errors] = self.range.unwrap_or_default();
        let more = |bounds: [f64; 2]| bounds.into_iter().filter(|bound| *bound > 0.0);
        let times =
            self.marks.iter().map(|mark| mark.time).chain(self.behind.iter().map(|b| b[0])).chain(more(more_times));
        let errors = self
            .marks
            .iter()
            .map(|m| error(m.error))
            .chain(self.behind.iter().map(|b| error(b[1])))
            .chain(more(more_errors).map(error));
        let x = Axis::new(times, left, self.width - right);
        let y = Axis::new(errors, self.height - bottom, top);
        let mut out = format!(
            "<svg class=\"plot\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">\n",
            self.width,
            self.height,
            escape(&self.name)
        );
        self.grid(&mut out, &x, &y, [left, self.width - right, top, self.height - bottom]);
        for [time, e] in &self.behind {
            out.push_str(&format!(
                "<circle class=\"behind\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"2.6\"/>",
                x.at(*time),
                y.at(error(*e))
            ));
        }
        if self.line.len() > 1 {
            let points: Vec<String> = self
                .line
                .iter()
                .map(|&i| format!("{:.1},{:.1}", x.at(self.marks[i].time), y.at(error(self.marks[i].error))))
                .collect();
            out.push_str(&format!("<polyline class=\"{}\" points=\"{}\"/>\n", self.line_class, points.join(" ")));
        }
        let mut taken: Vec<[f64; 4]> = Vec::new();
        for mark in &self.marks {
            let (px, py) = (x.at(mark.time), y.at(error(mark.error)));
            out.push_str(&format!(
                "<circle class=\"mark c{}\" cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"{}\"><title>{}</title></circle>",
                mark.colour,
                if self.titles { 5.5 } else { 4.5 },
                escape(&mark.title)
            ));
            taken.push([px - 5.0, py - 5.0, px + 5.0, py + 5.0]);
        }
        for mark in self.marks.iter().filter(|mark| !mark.label.is_empty()) {
            self.label(&mut out, mark, [x.at(mark.time), y.at(error(mark.error))], &mut taken);
        }
        out.push_str("</svg>\n");
        out
    }

    /// Puts a label where it covers nothing, of eight places around its mark; leaves it out where all are taken.
    fn label(&self, out: &mut String, mark: &Mark, [px, py]: [f64; 2], taken: &mut Vec<[f64; 4]>) {
        let size = if self.titles { 13.0 } else { 11.5 };
        let wide = 0.56 * size * mark.label.chars().count() as f64;
        let places = [
            (9.0, 4.0),
            (-9.0 - wide, 4.0),
            (7.0, -9.0),
            (7.0, 18.0),
            (-7.0 - wide, -9.0),
            (-7.0 - wide, 18.0),
            (-wide / 2.0, -12.0),
            (-wide / 2.0, 22.0),
        ];
        for (dx, dy) in places {
            let [x0, y0] = [px + dx, py + dy];
            let place = [x0, y0 - size, x0 + wide, y0 + 2.0];
            let outside =
                place[0] < 2.0 || place[2] > self.width - 2.0 || place[1] < 2.0 || place[3] > self.height - 2.0;
            let covers = |other: &[f64; 4]| {
                place[0] < other[2] && other[0] < place[2] && place[1] < other[3] && other[1] < place[3]
            };
            if outside || taken.iter().any(covers) {
                continue;
            }
            taken.push(place);
            out.push_str(&format!(
                "<text class=\"name\" x=\"{x0:.1}\" y=\"{y0:.1}\" font-size=\"{size}\">{}</text>",
                escape(&mark.label)
            ));
            return;
        }
    }

    fn grid(&self, out: &mut String, x: &Axis, y: &Axis, [left, right, top, bottom]: [f64; 4]) {
        let size = if self.titles { 14.0 } else { 11.5 };
        let mut last = f64::NEG_INFINITY;
        for tick in x.ticks() {
            let at = x.at(tick);
            out.push_str(&format!("<line class=\"grid\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{top}\" y2=\"{bottom}\"/>"));
            let text = format!("{} s", number(tick));
            let half = 0.3 * size * text.len() as f64;
            if at - half > last + 4.0 {
                last = at + half;
                out.push_str(&format!(
                    "<text class=\"tick\" x=\"{at:.1}\" y=\"{:.1}\" font-size=\"{size}\" text-anchor=\"middle\">{text}</text>",
                    bottom + size + 5.0
                ));
            }
        }
        let mut last = f64::INFINITY;
        for tick in y.ticks() {
            let at = y.at(tick);
            out.push_str(&format!("<line class=\"grid\" x1=\"{left}\" x2=\"{right}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>"));
            if at < last - size - 2.0 {
                last = at;
                out.push_str(&format!(
                    "<text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" font-size=\"{size}\" text-anchor=\"end\">{} %</text>",
                    left - 8.0,
                    at + 0.35 * size,
                    number(100.0 * tick)
                ));
            }
        }
        if self.titles {
            out.push_str(&format!(
                "<text class=\"title\" x=\"{:.1}\" y=\"{:.1}\" font-size=\"15\" text-anchor=\"middle\">CPU time of a render</text>\
                 <text class=\"title\" transform=\"translate(20 {:.1}) rotate(-90)\" font-size=\"15\" text-anchor=\"middle\">relative RMS error</text>\n",
                0.5 * (left + right),
                bottom + 46.0,
                0.5 * (top + bottom)
            ));
        }
    }
}

fn number(value: f64) -> String {
    if value >= 1.0 { format!("{value:.0}") } else { format!("{value:.6}").trim_end_matches('0').to_owned() }
}

/// Text that HTML and XML can hold.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() || "\u{FFFE}\u{FFFF}".contains(c) => out.push('\u{FFFD}'),
            c => out.push(c),
        }
    }
    out
}
