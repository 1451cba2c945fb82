//! A formation as it happens, redrawn in place on a terminal.

mod canvas;
mod draw;
mod keys;
mod map;
mod style;
mod watched;

use std::env;
use std::io::{IsTerminal, Stderr, stderr};
use std::sync::Arc;
use std::time::{Duration, Instant};

use ::console::{Term, colors_enabled_stderr};
use formation_event_log::Entry;
use formation_model::PlanningProblem;
use formation_offline::CheckedPlan;
use formation_verify::Progress;

use canvas::Canvas;
use draw::{Size, frame};
pub use keys::Key;
use keys::Keys;
use style::Style;
use watched::Watched;

/// The least time between two drawings.
const DRAW_INTERVAL: Duration = Duration::from_millis(60);
/// The most time between two drawings, for the clock in the first line.
const TICK_INTERVAL: Duration = Duration::from_millis(200);

/// What the terminal shows of a run.
pub struct View {
    watched: Watched,
    canvas: Canvas<Stderr>,
    terminal: Term,
    /// `None` where the standard input is no terminal, or no keys are asked for.
    keys: Option<Keys>,
    style: Style,
    start: Instant,
    drawn: Instant,
    is_stale: bool,
}

impl View {
    /// A view on the standard error output, which gives orders by keys if it `has_keys`; `None` where that is no terminal on
    /// which one can draw.
    pub fn on_terminal(name: &str, has_keys: bool) -> Option<Self> {
        let is_dumb = env::var_os("TERM").is_none_or(|kind| kind == "dumb" || kind.is_empty());
        if !stderr().is_terminal() || is_dumb {
            return None;
        }
        let mut view = Self {
            watched: Watched::new(name),
            canvas: Canvas::new(stderr()),
            terminal: Term::stderr(),
            keys: has_keys.then(Keys::of_terminal).flatten(),
            style: Style {
                colours: colors_enabled_stderr(),
                unicode: has_unicode(|name| env::var(name).ok()),
            },
            start: Instant::now(),
            drawn: Instant::now(),
            is_stale: true,
        };
        view.draw();
        Some(view)
    }

    /// Names what is shown.
    pub fn set_name(&mut self, name: &str) {
        name.clone_into(&mut self.watched.name);
    }

    /// Takes in which modules form which target from now on.
    pub fn set_problem(&mut self, problem: Arc<PlanningProblem>) {
        self.watched.set_problem(problem);
        self.draw_if_due();
    }

    /// Takes in the plan that the formation is to follow.
    pub fn set_plan(&mut self, plan: Arc<CheckedPlan>) {
        self.watched.set_plan(plan);
        self.draw_if_due();
    }

    /// Shows new progress.
    pub fn show_progress(&mut self, progress: &Progress) {
        self.watched.progress = Some(progress.clone());
        self.draw_if_due();
    }

    /// Shows something that happened.
    pub fn show_entry(&mut self, entry: &Entry) {
        self.watched.take(entry, self.start.elapsed());
        self.draw_if_due();
    }

    /// When to draw next.
    pub fn due(&self) -> Instant {
        self.drawn
            + if self.is_stale {
                DRAW_INTERVAL
            } else {
                TICK_INTERVAL
            }
    }

    fn draw_if_due(&mut self) {
        self.is_stale = true;
        if Instant::now() >= self.due() {
            self.draw();
        }
    }

    /// Draws what is known, in the present size of the terminal.
    pub fn draw(&mut self) {
        self.drawn = Instant::now();
        self.is_stale = false;
        let size = self.size();
        let help = self.keys.as_ref().map(|_| keys::HELP);
        let elapsed = self.start.elapsed();
        let lines = frame(&self.watched, elapsed, size, self.style, help);
        self.canvas.draw(&lines, size.columns);
    }

    /// What a key that was pressed asks for; does not wait for one.
    pub fn key(&self) -> Option<Key> {
        self.keys.as_ref().and_then(Keys::pressed)
    }

    /// Clears the view, lets `write` use the terminal, and draws the view again.
    pub fn suspend(&mut self, write: impl FnOnce()) {
        self.canvas.clear(self.size().columns);
        write();
        self.draw();
    }

    /// Leaves the terminal as if nothing had been drawn.
    pub fn finish(&mut self) {
        self.canvas.clear(self.size().columns);
    }

    /// The size of the terminal; the usual one, where it does not report any.
    fn size(&self) -> Size {
        let (rows, columns) = self.terminal.size_checked().unwrap_or((24, 80));
        Size {
            columns: columns.into(),
            rows: rows.into(),
        }
    }
}

/// Whether the locale has more than ASCII, by the first of these variables that is set (POSIX, "Locale").
fn has_unicode(variable: impl Fn(&str) -> Option<String>) -> bool {
    ["LC_ALL", "LC_CTYPE", "LANG"]
        .into_iter()
        .filter_map(variable)
        .find(|value| !value.is_empty())
        .is_some_and(|value| {
            let value = value.to_ascii_lowercase();
            value.contains("utf-8") || value.contains("utf8")
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_locale_variable_that_is_set_decides() {
        let unicode = |set: &[(&str, &str)]| {
            has_unicode(|name| {
                let found = set.iter().find(|(variable, _)| *variable == name);
                found.map(|(_, value)| (*value).to_owned())
            })
        };
        assert!(unicode(&[("LANG", "C.UTF-8")]));
        assert!(unicode(&[("LC_ALL", ""), ("LANG", "en_GB.utf8")]));
        assert!(!unicode(&[("LC_ALL", "C"), ("LANG", "en_GB.utf8")]));
        assert!(!unicode(&[]));
    }
}
