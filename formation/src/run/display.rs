//! Shows a run on the standard error output: a view that moves on a terminal, plain lines elsewhere.

use std::sync::Arc;
use std::time::{Duration, Instant};

use formation_event_log::Entry;
use formation_model::text::listed;
use formation_model::{ModuleId, PlanningProblem};
use formation_offline::CheckedPlan;
use formation_verify::Progress;

use super::lines::{self, RunLine, RunVerdict};
use super::view::{Key, View};
use crate::console;

/// Without a terminal, a line is written at most this often within one stage.
const LINE_INTERVAL: Duration = Duration::from_secs(1);
/// The interval while another launcher's formation is watched; its line repeats even if nothing changes.
const WATCH_INTERVAL: Duration = Duration::from_secs(10);

/// How far a run has come, in one line: the stage, its numbers, and the modules for which it waits.
pub fn progress_line(progress: &Progress) -> String {
    let Progress {
        stage,
        joined,
        planned,
        agreed,
        settled,
        stopped,
        ..
    } = progress;
    let expected = progress.expected.unwrap_or(0);
    let waiting = match progress.waiting_for.as_slice() {
        [] => String::new(),
        modules => format!("; waiting for {}", listed(modules.iter().copied())),
    };
    let stopped = if *stopped { ", stopped by command" } else { "" };
    format!(
        "{stage}{stopped}: joined {joined}/{expected}, planned {planned}, agreed {agreed}, settled {settled}{waiting}"
    )
}

/// Shows a run.
pub enum Display {
    /// On a terminal.
    View(Box<View>),
    /// Elsewhere.
    Lines(LineThrottle),
    /// For a program, which reads the standard output.
    Program,
}

impl Display {
    /// Begins to show a run that is to go as planned, and takes orders by keys.
    pub fn start(name: &str, plan: &Arc<CheckedPlan>) -> Self {
        let throttle = LineThrottle::new(LINE_INTERVAL, false);
        let mut display = Self::on_terminal(name, true, throttle);
        display.set_plan(Arc::clone(plan));
        display.refresh();
        display
    }

    /// Begins to show a formation that another process runs.
    pub fn watch() -> Self {
        Self::on_terminal("", false, LineThrottle::new(WATCH_INTERVAL, true))
    }

    fn on_terminal(name: &str, has_keys: bool, elsewhere: LineThrottle) -> Self {
        match View::on_terminal(name, has_keys) {
            Some(view) => Self::View(Box::new(view)),
            None => Self::Lines(elsewhere),
        }
    }

    /// Names what is shown.
    pub fn set_name(&mut self, name: &str) {
        if let Self::View(view) = self {
            view.set_name(name);
        }
    }

    /// Takes in which modules form which target from now on.
    pub fn set_problem(&mut self, problem: Arc<PlanningProblem>) {
        if let Self::View(view) = self {
            view.set_problem(problem);
        }
    }

    /// Takes in the plan that the formation is to follow.
    pub fn set_plan(&mut self, plan: Arc<CheckedPlan>) {
        if let Self::View(view) = self {
            view.set_plan(plan);
        }
    }

    /// Whether a view is redrawn, which shows the plan.
    pub fn is_view(&self) -> bool {
        matches!(self, Self::View(_))
    }

    /// Whether a program reads what is shown.
    pub fn is_program(&self) -> bool {
        matches!(self, Self::Program)
    }

    /// Shows a verdict that another may replace.
    pub fn show_verdict(&mut self, verdict: RunVerdict) {
        if self.is_program() {
            lines::print(&RunLine::Verdict(verdict));
        }
    }

    /// Shows that a process of modules was started or has ended.
    pub fn show_process(&mut self, modules: &[ModuleId], running: bool) {
        if self.is_program() && !modules.is_empty() {
            let modules = modules.iter().copied().collect();
            lines::print(&RunLine::Process { modules, running });
        }
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
            Self::Program => lines::print(&RunLine::Progress(progress.clone())),
        }
    }

    /// Shows something that happened.
    pub fn show_entry(&mut self, entry: &Entry) {
        match self {
            Self::View(view) => view.show_entry(entry),
            Self::Lines(_) => {}
            Self::Program => lines::print(&RunLine::Entry(entry.clone())),
        }
    }

    /// When to draw although nothing happens.
    pub fn due(&self) -> Option<Instant> {
        match self {
            Self::View(view) => Some(view.due()),
            Self::Lines(throttle) => throttle.due(),
            Self::Program => None,
        }
    }

    /// What a key that was pressed asks for; does not wait for one.
    pub fn key(&self) -> Option<Key> {
        match self {
            Self::View(view) => view.key(),
            Self::Lines(_) | Self::Program => None,
        }
    }

    /// Draws all that is known.
    pub fn refresh(&mut self) {
        match self {
            Self::View(view) => view.draw(),
            Self::Lines(throttle) => {
                if let Some(progress) = throttle.repeated(Instant::now()) {
                    console::note(&progress_line(progress));
                }
            }
            Self::Program => {}
        }
    }

    /// Writes a line between the progress.
    pub fn note(&mut self, line: &str) {
        match self {
            Self::View(view) => view.suspend(|| console::note(line)),
            Self::Lines(_) | Self::Program => console::note(line),
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
#[derive(Debug)]
pub struct LineThrottle {
    interval: Duration,
    /// Whether the last line repeats after the interval.
    repeats: bool,
    last: Option<(Progress, Instant)>,
}

impl LineThrottle {
    /// With `repeats`, the last line repeats after each interval.
    pub fn new(interval: Duration, repeats: bool) -> Self {
        Self {
            interval,
            repeats,
            last: None,
        }
    }

    /// When a line repeats.
    fn due(&self) -> Option<Instant> {
        let last = self.last.as_ref().filter(|_| self.repeats);
        last.map(|(_, at)| *at + self.interval)
    }

    /// What to repeat now, if its time has come.
    fn repeated(&mut self, now: Instant) -> Option<&Progress> {
        self.due().filter(|due| now >= *due)?;
        let (progress, at) = self.last.as_mut()?;
        *at = now;
        Some(progress)
    }

    fn lets_pass(&mut self, progress: &Progress, now: Instant) -> bool {
        if let Some((last, at)) = &self.last
            && (last == progress || (last.stage == progress.stage && now < *at + self.interval))
        {
            return false;
        }
        self.last = Some((progress.clone(), now));
        true
    }
}

#[cfg(test)]
mod tests {
    use formation_model::FormationStage;

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
        let stopped = Progress {
            stopped: true,
            ..planning(3)
        };
        assert!(progress_line(&stopped).starts_with("planning, stopped by command: joined 17/17"));
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
        let mut throttle = LineThrottle::new(LINE_INTERVAL, false);
        assert!(throttle.lets_pass(&planning(1), after(0)));
        assert!(!throttle.lets_pass(&planning(2), after(500)));
        assert!(throttle.lets_pass(&planning(3), after(1_000)));
        assert!(!throttle.lets_pass(&planning(3), after(9_000)));
        let acting = Progress {
            stage: FormationStage::Acting,
            ..planning(3)
        };
        assert!(throttle.lets_pass(&acting, after(9_001)));
        assert_eq!(throttle.due(), None);
    }

    #[test]
    fn the_line_of_a_formation_that_is_watched_repeats() {
        let start = Instant::now();
        let after = |seconds| start + Duration::from_secs(seconds);
        let mut throttle = LineThrottle::new(WATCH_INTERVAL, true);
        assert_eq!(throttle.due(), None);
        assert!(throttle.lets_pass(&planning(1), after(0)));
        assert!(!throttle.lets_pass(&planning(2), after(9)));
        assert_eq!(throttle.repeated(after(9)), None);
        assert_eq!(throttle.repeated(after(10)), Some(&planning(1)));
        assert_eq!(throttle.due(), Some(after(20)));
    }
}
