//! Rows of a Markdown table with the bounds that they are held against.

/// What a number is held against.
#[derive(Clone, Copy)]
pub struct Bounds {
    pub reach: f64,
    pub stretch: f64,
    /// Whether more is better.
    pub at_least: bool,
}

impl Bounds {
    pub fn at_least(reach: f64, stretch: f64) -> Self {
        Self { reach, stretch, at_least: true }
    }

    pub fn at_most(reach: f64, stretch: f64) -> Self {
        Self { reach, stretch, at_least: false }
    }

    fn verdict(self, value: f64) -> &'static str {
        let within = |bound: f64| if self.at_least { value >= bound } else { value <= bound };
        match (within(self.reach), within(self.stretch)) {
            (_, true) => "stretch",
            (true, false) => "reach",
            // Also where it is not a number.
            (false, false) => "**no**",
        }
    }
}

#[derive(Default)]
pub struct Table {
    lines: Vec<String>,
}

impl Table {
    /// A row that is held against bounds.
    pub fn held(&mut self, row: u32, what: &str, measured: &str, value: f64, bounds: Bounds) {
        let sign = if bounds.at_least { "≥" } else { "≤" };
        let (reach, stretch) = (bounds.reach, bounds.stretch);
        let verdict = bounds.verdict(value);
        self.lines.push(format!("| {row} | {what} | {measured} | {sign} {reach} | {sign} {stretch} | {verdict} |"));
    }

    /// A row that only says something.
    pub fn said(&mut self, row: u32, what: &str, measured: &str) {
        self.lines.push(format!("| {row} | {what} | {measured} | | | |"));
    }

    pub fn print(&self) {
        println!("| row | what | measured | reach | stretch | met |\n|---|---|---|---|---|---|");
        self.lines.iter().for_each(|line| println!("{line}"));
    }
}
