//! A formation as it happens, redrawn in place on a terminal.

mod canvas;
mod draw;
mod map;
mod watched;

use std::env;
use std::io::{IsTerminal, Stderr, stderr};
use std::time::{Duration, Instant};

use ::console::{Term, colors_enabled_stderr};
use formation::event_log::Entry;

use super::progress::Progress;
use crate::plan::CheckedPlan;
use canvas::Canvas;
use draw::{Size, Style, frame};
use watched::Watched;

/// However much happens, it is drawn at most this often.
const DRAW_INTERVAL: Duration = Duration::from_millis(60);
/// Though nothing happens, the clock goes on.
const TICK_INTERVAL: Duration = Duration::from_millis(200);

/// What the terminal shows of a run.
pub struct View<'a> {
    watched: Watched<'a>,
    canvas: Canvas<Stderr>,
    terminal: Term,
    style: Style,
    start: Instant,
    drawn: Instant,
    is_stale: bool,
}

impl<'a> View<'a> {
    /// A view on the standard error output; `None` where that is no terminal on which one can draw.
    pub fn on_terminal(name: &'a str, plan: &'a CheckedPlan) -> Option<Self> {
        let is_dumb = env::var_os("TERM").is_none_or(|kind| kind == "dumb" || kind.is_empty());
        if !stderr().is_terminal() || is_dumb {
            return None;
        }
        let mut view = Self {
            watched: Watched::new(name, plan),
            canvas: Canvas::new(stderr()),
            terminal: Term::stderr(),
            style: Style {
                colours: colors_enabled_stderr(),
                unicode: speaks_unicode(|name| env::var(name).ok()),
            },
            start: Instant::now(),
            drawn: Instant::now(),
            is_stale: true,
        };
        view.draw();
        Some(view)
    }

    /// Takes in how far it has come.
    pub fn show(&mut self, progress: &Progress) {
        self.watched.show(progress);
        self.draw_if_due();
    }

    /// Takes in something that happened.
    pub fn hear(&mut self, entry: &Entry) {
        self.watched.hear(entry);
        self.draw_if_due();
    }

    /// When it wants to be drawn again.
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

    /// Draws what is known now, as large as the terminal is now.
    pub fn draw(&mut self) {
        self.drawn = Instant::now();
        self.is_stale = false;
        // Where a terminal does not tell its size, it has the size that terminals always had.
        let (rows, columns) = self.terminal.size_checked().unwrap_or((24, 80));
        let size = Size {
            columns: usize::from(columns),
            rows: usize::from(rows),
        };
        let lines = frame(&self.watched, self.start.elapsed(), size, self.style);
        self.canvas.draw(&lines, size.columns);
    }

    /// Clears the view, lets `say` write beside it, and draws it again.
    pub fn suspend(&mut self, say: impl FnOnce()) {
        self.canvas.clear(self.columns());
        say();
        self.draw();
    }

    /// Leaves the terminal as if nothing had been drawn.
    pub fn finish(&mut self) {
        self.canvas.clear(self.columns());
    }

    fn columns(&self) -> usize {
        self.terminal
            .size_checked()
            .map_or(80, |(_, columns)| usize::from(columns))
    }
}

/// Whether the locale has more than ASCII: the first of these variables that is set tells (POSIX, "Locale").
fn speaks_unicode(variable: impl Fn(&str) -> Option<String>) -> bool {
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
    fn the_first_locale_variable_that_is_set_tells() {
        let speaks = |set: &[(&str, &str)]| {
            speaks_unicode(|name| {
                let found = set.iter().find(|(variable, _)| *variable == name);
                found.map(|(_, value)| (*value).to_owned())
            })
        };
        assert!(speaks(&[("LANG", "C.UTF-8")]));
        assert!(speaks(&[("LC_ALL", ""), ("LANG", "en_GB.utf8")]));
        assert!(!speaks(&[("LC_ALL", "C"), ("LANG", "en_GB.utf8")]));
        assert!(!speaks(&[]));
    }
}
