//! How far the formation has come: read from the verifier, shown to people.

use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use formation::chronicle::Entry;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Deserialize;

use crate::console;

/// Without a terminal, a line is written at most this often within one phase.
const LINE_INTERVAL: Duration = Duration::from_secs(1);
/// More names than these say nothing more.
const NAMES_MAX: usize = 8;

/// How far the formation has come.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default)]
pub struct Progress {
    /// Which part of the work is being done.
    pub phase: String,
    /// How many modules were heard.
    pub joined: usize,
    /// How many there are to be; the launcher knows.
    #[serde(skip)]
    pub expected: usize,
    /// How many have a spot by the claims so far.
    pub planned: usize,
    /// How many have shown that they hold the whole plan.
    pub agreed: usize,
    /// How many stand on their spots.
    pub settled: usize,
    /// The modules for which the phase waits.
    pub waiting_for: Vec<u32>,
}

impl Progress {
    /// The numbers by phase.
    fn counts(&self) -> String {
        let Self {
            joined,
            expected,
            planned,
            agreed,
            settled,
            ..
        } = self;
        format!("joined {joined}/{expected}, planned {planned}, agreed {agreed}, settled {settled}")
    }

    /// Where it stands and who is missing, for when it does not go on.
    pub fn standstill(&self) -> String {
        let phase = if self.phase.is_empty() {
            "starting"
        } else {
            &self.phase
        };
        format!("{phase}: {}{}", self.counts(), self.waiting())
    }

    fn waiting(&self) -> String {
        if self.waiting_for.is_empty() {
            return String::new();
        }
        let named: Vec<String> = self
            .waiting_for
            .iter()
            .take(NAMES_MAX)
            .map(u32::to_string)
            .collect();
        let more = match self.waiting_for.len().saturating_sub(NAMES_MAX) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let noun = if self.waiting_for.len() == 1 {
            "module"
        } else {
            "modules"
        };
        format!("; waiting for {noun} {}{more}", named.join(", "))
    }
}

/// Shows progress on the standard error output: a moving bar on a terminal, plain lines elsewhere.
pub enum Display {
    /// On a terminal.
    Bar(ProgressBar),
    /// Elsewhere.
    Lines(LineThrottle),
}

impl Display {
    /// Begins to show.
    pub fn start() -> Self {
        if !stderr().is_terminal() {
            return Self::Lines(LineThrottle::default());
        }
        let bar = ProgressBar::with_draw_target(Some(1), ProgressDrawTarget::stderr());
        // A template that does not parse would only change the looks.
        if let Ok(style) = ProgressStyle::with_template("{spinner} {bar:24} {msg} ({elapsed})") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(120));
        Self::Bar(bar)
    }

    /// Shows new numbers.
    pub fn show(&mut self, progress: &Progress) {
        match self {
            Self::Bar(bar) => {
                bar.set_length(progress.expected.max(1) as u64 * 3);
                bar.set_position((progress.joined + progress.planned + progress.settled) as u64);
                bar.set_message(progress.standstill());
            }
            Self::Lines(throttle) => {
                if throttle.lets_pass(progress, Instant::now()) {
                    console::note(&progress.standstill());
                }
            }
        }
    }

    /// Takes in something that happened.
    pub fn hear(&mut self, _entry: &Entry) {}

    /// Says something beside the progress.
    pub fn note(&self, line: &str) {
        match self {
            Self::Bar(bar) => bar.suspend(|| console::note(line)),
            Self::Lines(_) => console::note(line),
        }
    }

    /// Ends showing, and leaves the terminal clean.
    pub fn finish(&self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

/// Lets through the first numbers of each phase, and then some.
#[derive(Debug, Default)]
pub struct LineThrottle {
    last: Option<(Progress, Instant)>,
}

impl LineThrottle {
    fn lets_pass(&mut self, progress: &Progress, now: Instant) -> bool {
        if let Some((last, at)) = &self.last
            && (last == progress || (last.phase == progress.phase && now < *at + LINE_INTERVAL))
        {
            return false;
        }
        self.last = Some((progress.clone(), now));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planning(planned: usize) -> Progress {
        Progress {
            phase: "planning".to_owned(),
            joined: 17,
            expected: 17,
            planned,
            agreed: 0,
            settled: 0,
            waiting_for: vec![4],
        }
    }

    #[test]
    fn a_standstill_names_who_is_missing() {
        assert_eq!(
            planning(3).standstill(),
            "planning: joined 17/17, planned 3, agreed 0, settled 0; waiting for module 4"
        );
        let many = Progress {
            waiting_for: (1..=20).collect(),
            ..planning(0)
        };
        assert!(
            many.standstill()
                .ends_with("; waiting for modules 1, 2, 3, 4, 5, 6, 7, 8 and 12 more")
        );
        assert_eq!(
            Progress::default().standstill(),
            "starting: joined 0/0, planned 0, agreed 0, settled 0"
        );
    }

    #[test]
    fn plain_lines_come_once_a_phase_and_then_at_most_once_a_second() {
        let start = Instant::now();
        let after = |millis| start + Duration::from_millis(millis);
        let mut throttle = LineThrottle::default();
        assert!(throttle.lets_pass(&planning(1), after(0)));
        assert!(!throttle.lets_pass(&planning(2), after(500)));
        assert!(throttle.lets_pass(&planning(3), after(1_000)));
        assert!(!throttle.lets_pass(&planning(3), after(9_000)));
        let settling = Progress {
            phase: "acting".to_owned(),
            ..planning(3)
        };
        assert!(throttle.lets_pass(&settling, after(9_001)));
    }
}
