//! How far a long plan has come, on a terminal.

use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Shorter plans show nothing.
const SHOWN_AFTER: Duration = Duration::from_secs(1);
/// Between two drawings while nothing is reported.
const TICK_INTERVAL: Duration = Duration::from_millis(200);

/// A line on the standard error output, which goes when this is dropped.
pub struct PlanProgress {
    bar: ProgressBar,
    start: Instant,
    is_shown: bool,
}

impl PlanProgress {
    pub fn new() -> Self {
        Self {
            bar: ProgressBar::hidden(),
            start: Instant::now(),
            is_shown: false,
        }
    }

    /// Shows how many turns are taken, and how many are left.
    pub fn show_turns(&mut self, taken: usize, left: usize) {
        self.show_if_due();
        self.bar.set_length((taken + left) as u64);
        self.bar.set_position(taken as u64);
    }

    /// Shows that the motion is planned, of which no part can be counted.
    pub fn show_motion(&mut self) {
        self.show_if_due();
        if let Ok(style) = ProgressStyle::with_template("{spinner} planning paths ({elapsed})") {
            self.bar.set_style(style);
        }
    }

    fn show_if_due(&mut self) {
        if self.is_shown || !stderr().is_terminal() || self.start.elapsed() < SHOWN_AFTER {
            return;
        }
        self.is_shown = true;
        // A template that does not parse would only change the looks.
        let template = "{spinner} planning {bar:24} {pos}/{len} turns ({elapsed}, {eta} to go)";
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style);
        }
        self.bar.set_draw_target(ProgressDrawTarget::stderr());
        self.bar.enable_steady_tick(TICK_INTERVAL);
    }
}

impl Drop for PlanProgress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
