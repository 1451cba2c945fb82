//! Shows a run on the standard error output: a view that moves on a terminal, plain lines elsewhere.

use std::time::{Duration, Instant};

use formation::event_log::Entry;
use formation::model::text::listed;
use formation::verify::Progress;

use super::view::{Key, View};
use crate::checked_plan::CheckedPlan;
use crate::console;

/// Without a terminal, a line is written at most this often within one stage.
const LINE_INTERVAL: Duration = Duration::from_secs(1);

/// How far a run has come, in one line: the stage, its numbers, and the modules for which it waits.
pub fn progress_line(progress: &Progress) -> String {
    let Progress {
        stage,
        joined,
        planned,
        agreed,
        settled,
        ..
    } = progress;
    let expected = progress.expected.unwrap_or(0);
    let waiting = match progress.waiting_for.as_slice() {
        [] => String::new(),
        modules => format!("; waiting for {}", listed(modules.iter().copied())),
    };
    format!(
        "{stage}: joined {joined}/{expected}, planned {planned}, agreed {agreed}, settled {settled}{waiting}"
    )
}

/// Shows a run.
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

    /// Shows new progress.
    pub fn show_progress(&mut self, progress: &Progress) {
        match self {
            Self::View(view) => view.show_progress(progress),
            Self::Lines(throttle) => {
                if throttle.lets_pass(progress, Instant::now()) {
                    console::note(&progress_line(progress));
                }
            }
        }
    }

    /// Shows something that happened.
    pub fn show_entry(&mut self, entry: &Entry) {
        if let Self::View(view) = self {
            view.show_entry(entry);
        }
    }

    /// When to draw although nothing happens.
    pub fn due(&self) -> Option<Instant> {
        match self {
            Self::View(view) => Some(view.due()),
            Self::Lines(_) => None,
        }
    }

    /// What a key that was pressed asks for; does not wait for one.
    pub fn key(&self) -> Option<Key> {
        match self {
            Self::View(view) => view.key(),
            Self::Lines(_) => None,
        }
    }

    /// Draws all that is known.
    pub fn refresh(&mut self) {
        if let Self::View(view) = self {
            view.draw();
        }
    }

    /// Writes a line between the progress.
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

/// Lets through the first progress of each stage, and later ones at intervals.
#[derive(Debug, Default)]
pub struct LineThrottle {
    last: Option<(Progress, Instant)>,
}

impl LineThrottle {
    fn lets_pass(&mut self, progress: &Progress, now: Instant) -> bool {
        if let Some((last, at)) = &self.last
            && (last == progress || (last.stage == progress.stage && now < *at + LINE_INTERVAL))
        {
            return false;
        }
        self.last = Some((progress.clone(), now));
        true
    }
}

#[cfg(test)]
mod tests {
    use formation::model::{FormationStage, ModuleId};

    use super::*;

    fn planning(planned: usize) -> Progress {
        Progress {
            stage: FormationStage::Planning,
            epoch: None,
            joined: 17,
            expected: Some(17),
            planned,
            agreed: 0,
            settled: 0,
            to_fill: 17,
            stopped: false,
            waiting_for: vec![ModuleId(4)],
        }
    }

    #[test]
    fn a_line_names_the_modules_that_are_missing() {
        assert_eq!(
            progress_line(&planning(3)),
            "planning: joined 17/17, planned 3, agreed 0, settled 0; waiting for module 4"
        );
        let many = Progress {
            waiting_for: (1..=20).map(ModuleId).collect(),
            ..planning(0)
        };
        assert!(
            progress_line(&many)
                .ends_with("; waiting for modules 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 and 10 more")
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
        let acting = Progress {
            stage: FormationStage::Acting,
            ..planning(3)
        };
        assert!(throttle.lets_pass(&acting, after(9_001)));
    }
}
