//! Shows progress on standard error: a bar with the time left on a terminal, a line now and then elsewhere.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::{Verbosity, interrupt, log};
use crate::render::progress::Progress;

/// The progress of a command.
pub struct Reporter {
    form: Form,
}

enum Form {
    Silent,
    Bar(ProgressBar),
    Lines(Lines),
}

impl Reporter {
    /// Nothing with `--quiet`; a bar where standard error is a terminal; else lines.
    pub fn new(verbosity: Verbosity) -> Self {
        let form = if verbosity.quiet {
            Form::Silent
        } else if std::io::stderr().is_terminal() {
            Form::Bar(log::bars().add(ProgressBar::hidden()))
        } else {
            Form::Lines(Lines::default())
        };
        Self { form }
    }
}

impl Progress for Reporter {
    fn stage(&self, name: &str, total: u64) {
        match &self.form {
            Form::Silent => {}
            Form::Bar(bar) => {
                let template = match total {
                    0 => "{spinner} {prefix} {elapsed}",
                    _ => "{prefix} [{bar:30}] {percent:>3} % {elapsed}, {eta} left",
                };
                bar.reset();
                bar.set_length(total);
                bar.set_prefix(name.to_owned());
                if let Ok(style) = ProgressStyle::with_template(template) {
                    bar.set_style(style.progress_chars("=> "));
                }
                bar.enable_steady_tick(Duration::from_millis(200));
            }
            Form::Lines(lines) => lines.stage(name, total, Instant::now()).iter().for_each(|line| log::say(line)),
        }
    }

    fn advance(&self, n: u64) {
        match &self.form {
            Form::Silent => {}
            Form::Bar(bar) => bar.inc(n),
            Form::Lines(lines) => lines.advance(n, Instant::now()).iter().for_each(|line| log::say(line)),
        }
    }

    fn message(&self, text: &str) {
        if !matches!(self.form, Form::Silent) {
            log::say(text);
        }
    }

    fn cancelled(&self) -> bool {
        interrupt::requested()
    }
}

impl Drop for Reporter {
    fn drop(&mut self) {
        if let Form::Bar(bar) = &self.form {
            bar.finish_and_clear();
        }
    }
}

/// Lines for log files: each tenth of a stage, but not more often than each second, and after five seconds anyway.
#[derive(Default)]
struct Lines {
    done: AtomicU64,
    stage: Mutex<Option<Stage>>,
}

struct Stage {
    name: String,
    total: u64,
    begin: Instant,
    last: Instant,
    tenth: u64,
}

const SOONEST: Duration = Duration::from_secs(1);
const LATEST: Duration = Duration::from_secs(5);

impl Lines {
    fn stage(&self, name: &str, total: u64, now: Instant) -> Option<String> {
        let mut stage = self.stage.lock().ok()?;
        self.done.store(0, Ordering::Relaxed);
        *stage = Some(Stage { name: name.to_owned(), total, begin: now, last: now, tenth: 0 });
        Some(format!("{name} ..."))
    }

    fn advance(&self, n: u64, now: Instant) -> Option<String> {
        let done = self.done.fetch_add(n, Ordering::Relaxed).saturating_add(n);
        // A thread that finds another at it has nothing to add.
        let mut guard = self.stage.try_lock().ok()?;
        let stage = guard.as_mut().filter(|stage| stage.total > 0)?;
        let done = done.min(stage.total);
        let share = done as f64 / stage.total as f64;
        let tenth = (share * 10.0) as u64;
        let since = now.saturating_duration_since(stage.last);
        let elapsed = now.saturating_duration_since(stage.begin);
        let due = since >= LATEST || (since >= SOONEST && tenth > stage.tenth);
        if !due || done == 0 {
            return None;
        }
        stage.last = now;
        stage.tenth = tenth;
        let left = elapsed.as_secs_f64() * (1.0 - share) / share;
        Some(format!("{} {:.0} %, {:.0} s, {left:.0} s left", stage.name, 100.0 * share, elapsed.as_secs_f64()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_few_and_tell_the_time_left() {
        let lines = Lines::default();
        let start = Instant::now();
        assert_eq!(lines.advance(5, start), None, "no stage yet");
        assert_eq!(lines.stage("render", 1000, start), Some("render ...".to_owned()));
        // A thousand steps in 20 s: a tenth each 2 s.
        let said: Vec<String> =
            (1..=1000).filter_map(|n| lines.advance(1, start + Duration::from_millis(20 * n))).collect();
        assert_eq!(said.len(), 10);
        assert_eq!(said[0], "render 10 %, 2 s, 18 s left");
        assert_eq!(said[9], "render 100 %, 20 s, 0 s left");
        // In 0.1 s nothing but the name is worth a line; in an hour a line each five seconds.
        lines.stage("fast", 1000, start);
        assert!((1..=1000).all(|n| lines.advance(1, start + Duration::from_micros(100 * n)).is_none()));
        lines.stage("slow", 3600, start);
        assert_eq!((1..=3600).filter_map(|n| lines.advance(1, start + Duration::from_secs(n))).count(), 720);
    }

    #[test]
    fn more_steps_than_announced_are_no_trouble() {
        let lines = Lines::default();
        let start = Instant::now();
        lines.stage("x", 1, start);
        let line = lines.advance(u64::MAX, start + Duration::from_secs(9)).unwrap();
        assert_eq!(line, "x 100 %, 9 s, 0 s left");
        lines.stage("unknown", 0, start);
        assert_eq!(lines.advance(1, start + Duration::from_secs(99)), None);
    }
}
