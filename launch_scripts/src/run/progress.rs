//! How far the formation has come: read from the verifier, shown to people.

use std::time::{Duration, Instant};

use formation::event_log::Entry;
use serde::Deserialize;

use super::view::View;
use crate::console;
use crate::plan::CheckedPlan;

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

    /// Whether the target was heard.
    pub fn knows_target(&self) -> bool {
        !matches!(self.phase.as_str(), "" | "waiting for a target")
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

/// Shows a run on the standard error output: a view that moves on a terminal, plain lines elsewhere.
pub enum Display<'a> {
    /// On a terminal.
    View(Box<View<'a>>),
    /// Elsewhere.
    Lines(LineThrottle),
}

impl<'a> Display<'a> {
    /// Begins to show a run that is to go as planned.
    pub fn start(name: &'a str, plan: &'a CheckedPlan) -> Self {
        View::on_terminal(name, plan).map_or_else(
            || Self::Lines(LineThrottle::default()),
            |view| Self::View(Box::new(view)),
        )
    }

    /// Shows new numbers.
    pub fn show(&mut self, progress: &Progress) {
        match self {
            Self::View(view) => view.show(progress),
            Self::Lines(throttle) => {
                if throttle.lets_pass(progress, Instant::now()) {
                    console::note(&progress.standstill());
                }
            }
        }
    }

    /// Takes in something that happened.
    pub fn hear(&mut self, entry: &Entry) {
        if let Self::View(view) = self {
            view.hear(entry);
        }
    }

    /// When something has to be drawn though nothing happens.
    pub fn due(&self) -> Option<Instant> {
        match self {
            Self::View(view) => Some(view.due()),
            Self::Lines(_) => None,
        }
    }

    /// Draws all that is known.
    pub fn refresh(&mut self) {
        if let Self::View(view) = self {
            view.draw();
        }
    }

    /// Says something beside the progress.
    pub fn note(&mut self, line: &str) {
        match self {
            Self::View(view) => view.suspend(|| console::note(line)),
            Self::Lines(_) => console::note(line),
        }
    }

    /// Ends showing, and leaves the terminal clean.
    pub fn finish(&mut self) {
        if let Self::View(view) = self {
            view.finish();
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
