//! What Γ by projection costs and how far it is from rays: every number of the table in `docs/method.md`, row by row.
//!
//! `cargo bench --bench gamma [-- [--fresh] ROW...]`; all rows unless some are named by number. Times are CPU times of one thread, medians of
//! runs that alternate in this process, and ratios are of times measured together. The rays that stand for the truth are kept in
//! `target/truth`; `--fresh` traces them again. A row that is not met is said to be so, and is no failure.

#[path = "../../tests/common/mod.rs"]
mod common;

mod equal_error;
mod far_field;
mod knob;
mod measure;
mod robust;
mod scalp;
mod scene;
mod size;
mod table;

use scene::Bench;
use table::Table;

/// What prints some rows of the table; `wanted` tells which.
type Group = fn(bench: &Bench, wanted: &dyn Fn(u32) -> bool);

const GROUPS: [(&[u32], Group); 7] = [
    (&[1, 2, 3], equal_error::print),
    (&[4], far_field::print),
    (&[5], equal_error::print_every_segment),
    (&[6, 7], size::print),
    (&[8, 10], robust::print),
    (&[9], scalp::print),
    (&[11], knob::print),
];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let rows: Vec<u32> = arguments.iter().filter_map(|argument| argument.parse().ok()).collect();
    let bench = Bench::new(arguments.iter().any(|argument| argument == "--fresh"));
    let wanted = |row: u32| rows.is_empty() || rows.contains(&row);
    println!("machine: {}", machine());
    println!("command: cargo bench --bench gamma -- {}", arguments.join(" "));
    println!(
        "Γ̄ is sky visibility, the mean of Γ over a point's igloo. Errors are root mean squares over points, unless said otherwise."
    );
    let start = std::time::Instant::now();
    for (numbers, print) in GROUPS {
        if numbers.iter().any(|&row| wanted(row)) {
            print(&bench, &wanted);
        }
    }
    println!("\n{:.0} s in all", start.elapsed().as_secs_f64());
}

/// Processor and threads.
fn machine() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or(": unknown");
    let name = name.trim_start_matches([' ', '\t', ':']);
    let instructions = tress::occlusion::Instructions::available()[0];
    format!("{name}, {instructions:?}, {} threads; times are of one", rayon::current_num_threads())
}

/// The heading of a group, and the rows that it has.
fn table(title: &str) -> Table {
    println!("\n### {title}\n");
    Table::default()
}
