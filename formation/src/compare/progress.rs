//! How far a comparison has come: a bar on a terminal, else a line at intervals.

use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::console;

/// The interval of lines if the standard error output is not a terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(10);

pub struct CompareProgress {
    bar: ProgressBar,
    total: usize,
    finished: usize,
    line_at: Instant,
}

impl CompareProgress {
    pub fn new(total: usize, finished: usize) -> Self {
        let target = match stderr().is_terminal() {
            true => ProgressDrawTarget::stderr(),
            false => ProgressDrawTarget::hidden(),
        };
        let bar = ProgressBar::with_draw_target(Some(total as u64), target);
        // A template that does not parse would only change the looks.
        let template = "{bar:30} {pos}/{len} rows  {elapsed} gone, {eta} left  {msg}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_position(finished as u64);
        bar.reset_eta();
        if finished > 0 {
            console::note(&format!("{finished} of {total} rows are there already"));
        }
        Self {
            bar,
            total,
            finished,
            line_at: Instant::now(),
        }
    }

    /// Shows what is measured next.
    pub fn show(&mut self, label: &str) {
        self.bar.set_message(label.to_owned());
        if self.bar.is_hidden() && self.line_at.elapsed() >= LINE_INTERVAL {
            self.line_at = Instant::now();
            let (finished, total) = (self.finished, self.total);
            console::note(&format!("{finished} of {total} rows: {label}"));
        }
    }

    pub fn advance(&mut self) {
        self.finished += 1;
        self.bar.inc(1);
    }

    pub fn end(&self) {
        self.bar.finish_and_clear();
    }
}
