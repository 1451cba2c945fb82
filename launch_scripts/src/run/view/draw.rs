//! The lines that a terminal shows of a run.

use std::time::Duration;

use ::console::truncate_str;
use formation::model::ModuleId;

use super::map::map;
use super::watched::{LOG_MAX, Waiting, Watched, named};
use crate::failure::one_line;

/// How large a terminal is.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    pub columns: usize,
    pub rows: usize,
}

/// What a terminal can show.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    pub colours: bool,
    pub unicode: bool,
}

/// How something is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paint {
    Plain,
    Bold,
    Dim,
    /// In one of the 256 colours.
    Front(u8),
    /// Black on one of the 256 colours.
    Back(u8),
}

/// The palette of the pictures, in the 256 colours of terminals: configurations, then single modules.
const CONFIGURATION_COLOURS: [u8; 6] = [74, 178, 36, 227, 32, 175];
const SINGLE_COLOUR: u8 = 252;

/// The colour of the modules of the configuration at this position, or of those that stand alone.
pub fn colour_of(configuration: Option<usize>) -> ModuleColour {
    ModuleColour(configuration.map_or(SINGLE_COLOUR, |position| {
        CONFIGURATION_COLOURS[position % CONFIGURATION_COLOURS.len()]
    }))
}

/// The colour of a module.
#[derive(Clone, Copy, Debug)]
pub struct ModuleColour(u8);

impl ModuleColour {
    pub fn front(self) -> Paint {
        Paint::Front(self.0)
    }

    pub fn back(self) -> Paint {
        Paint::Back(self.0)
    }
}

impl Style {
    /// A free spot.
    pub fn dot(self) -> &'static str {
        if self.unicode { "·" } else { "." }
    }

    pub fn paint(self, text: &str, paint: Paint) -> String {
        if !self.colours {
            return text.to_owned();
        }
        let code = match paint {
            Paint::Plain => return text.to_owned(),
            Paint::Bold => "1".to_owned(),
            Paint::Dim => "2".to_owned(),
            Paint::Front(colour) => format!("1;38;5;{colour}"),
            Paint::Back(colour) => format!("30;48;5;{colour}"),
        };
        format!("\x1b[{code}m{text}\x1b[0m")
    }
}

/// The phases through which a run goes, as the verifier names them.
const PHASES: [&str; 5] = ["gathering", "planning", "agreeing", "acting", "done"];
/// At most so many units are told for whom they wait.
const WAITING_MAX: usize = 3;
/// Below the map, so many of the last happenings are told at least.
const LOG_MIN: usize = 2;

/// Draws a run: phases, how far it has come, whose turn it is and who waits for whom, a map, and what happened last;
/// as much of it as fits.
pub fn frame(watched: &Watched<'_>, elapsed: Duration, size: Size, style: Style) -> Vec<String> {
    // One column stays free, so that no terminal breaks a line.
    let columns = size.columns.saturating_sub(1).max(1);
    // One row stays free for the cursor.
    let rows = size.rows.saturating_sub(1).max(1);
    let mut lines = vec![head(watched, elapsed, style)];
    lines.push(phases(watched, style));
    lines.extend(bars(watched, columns, style));
    lines.extend(waiting(watched, style));
    let left = rows.saturating_sub(lines.len());
    let map = map(watched, columns, left.saturating_sub(LOG_MIN + 2), style);
    if !map.is_empty() {
        lines.push(String::new());
        lines.extend(map);
    }
    let left = rows.saturating_sub(lines.len() + 1).min(LOG_MAX);
    if left > 0 && watched.log().len() > 0 {
        lines.push(String::new());
        let skipped = watched.log().len().saturating_sub(left);
        for (at_ms, text) in watched.log().skip(skipped) {
            let time = format!("{:>7.1} s  ", seconds(at_ms));
            lines.push(format!("{}{text}", style.paint(&time, Paint::Dim)));
        }
    }
    lines.truncate(rows);
    let tail = match style.unicode {
        true => "…",
        false if columns > 10 => "...",
        false => "",
    };
    lines
        .iter()
        .map(|line| truncate_str(line, columns, tail).into_owned())
        .collect()
}

#[expect(clippy::cast_precision_loss, reason = "a day at most")]
fn seconds(millis: u64) -> f64 {
    millis as f64 / 1_000.0
}

fn head(watched: &Watched<'_>, elapsed: Duration, style: Style) -> String {
    const DOTS: [&str; 10] = ["⠋", "⠙", "⠹", "⠸", "⠼", "⠴", "⠦", "⠧", "⠇", "⠏"];
    const STROKES: [&str; 4] = ["|", "/", "-", "\\"];
    let step = usize::try_from(elapsed.as_millis() / 100).unwrap_or(0);
    let spinner = if style.unicode {
        DOTS[step % DOTS.len()]
    } else {
        STROKES[step % STROKES.len()]
    };
    let name = one_line(watched.name);
    let name = if name.is_empty() { "formation" } else { &name };
    let epoch = match watched.epoch {
        Some(epoch) if epoch.number > 1 => format!(", epoch {}", epoch.number),
        _ => String::new(),
    };
    format!(
        "{spinner} {}  {:.1} s{epoch}",
        style.paint(name, Paint::Bold),
        elapsed.as_secs_f64()
    )
}

fn phases(watched: &Watched<'_>, style: Style) -> String {
    let phase = watched.progress.phase.as_str();
    let at = PHASES.iter().position(|&known| known == phase);
    let Some(at) = at else {
        let phase = if phase.is_empty() { "starting" } else { phase };
        return format!("  {}", style.paint(phase, Paint::Bold));
    };
    let parts: Vec<String> = PHASES
        .iter()
        .enumerate()
        .map(|(index, name)| match index.cmp(&at) {
            std::cmp::Ordering::Less => style.paint(name, Paint::Plain),
            // Brackets say so where there is no bold.
            std::cmp::Ordering::Equal => style.paint(&format!("[{name}]"), Paint::Bold),
            std::cmp::Ordering::Greater => style.paint(name, Paint::Dim),
        })
        .collect();
    let arrow = if style.unicode { " → " } else { " > " };
    format!("  {}", parts.join(arrow))
}

/// Three bars: joined, with a spot, settled.
fn bars(watched: &Watched<'_>, columns: usize, style: Style) -> Vec<String> {
    let progress = &watched.progress;
    let spots = watched.plan().problem.target().spots().len();
    let to_fill = progress.expected.min(spots);
    let turns = watched.plan().outcome.decisions.len();
    let turn = if watched.turns > 0 && !watched.is_acting() {
        format!("  turn {} of {turns}", watched.turns)
    } else {
        String::new()
    };
    // The words around a bar.
    let width = columns.saturating_sub(30).clamp(4, 40);
    [
        ("joined", progress.joined, progress.expected, String::new()),
        ("planned", progress.planned, to_fill, turn),
        ("settled", progress.settled, to_fill, String::new()),
    ]
    .into_iter()
    .map(|(name, count, all, more)| {
        let filled = (width * count.min(all)).checked_div(all).unwrap_or(0);
        let (full, empty) = if style.unicode {
            ("█", "░")
        } else {
            ("#", "-")
        };
        format!(
            "  {name:<8}{}{}  {count}/{all}{more}",
            style.paint(&full.repeat(filled), Paint::Front(CONFIGURATION_COLOURS[0])),
            style.paint(&empty.repeat(width - filled), Paint::Dim),
        )
    })
    .collect()
}

/// Whose turn it is and who waits for whom, by the plan where the run follows it, else as the verifier says.
fn waiting(watched: &Watched<'_>, style: Style) -> Vec<String> {
    let queue = watched.queue();
    let Some((first, rest)) = queue.split_first() else {
        let waiting: Vec<ModuleId> = watched
            .progress
            .waiting_for
            .iter()
            .copied()
            .map(ModuleId)
            .collect();
        return if waiting.is_empty() {
            Vec::new()
        } else {
            vec![format!("  waiting for {}", named(&waiting))]
        };
    };
    let ids = named(&first.modules);
    let is_one = first.modules.len() == 1;
    let now = if watched.is_acting() {
        let spots: Vec<ModuleId> = watched
            .spots_of(&first.modules)
            .into_iter()
            .map(|spot| ModuleId(spot.0))
            .collect();
        let (verb, noun) = if is_one {
            ("goes", "spot")
        } else {
            ("go", "spots")
        };
        format!("{ids} {verb} to {noun} {}", named(&spots))
    } else {
        format!("{ids} {}", if is_one { "decides" } else { "decide" })
    };
    let mut lines = vec![format!("  {}   {now}", style.paint("now", Paint::Bold))];
    for (index, Waiting { modules, waits_for }) in rest.iter().take(WAITING_MAX).enumerate() {
        let label = if index == 0 { "next" } else { "then" };
        let verb = if modules.len() == 1 { "waits" } else { "wait" };
        lines.push(format!(
            "  {}  {} {verb} for {}",
            style.paint(label, Paint::Dim),
            named(modules),
            named(waits_for)
        ));
    }
    let more: usize = rest
        .iter()
        .skip(WAITING_MAX)
        .map(|waiting| waiting.modules.len())
        .sum();
    if more > 0 {
        lines.push(format!(
            "  {}",
            style.paint(&format!("and {more} more after them"), Paint::Dim)
        ));
    }
    lines
}

#[cfg(test)]
mod tests;
