//! The lines that a terminal shows of a run.

use std::time::Duration;

use ::console::{measure_text_width, strip_ansi_codes, truncate_str};
use formation_model::text::joined;
use formation_model::{FormationStage, ModuleId};
use ros_runtime::exit::one_line;

use super::map::map;
use super::style::{FIRST_COLOUR, Paint, Style};
use super::watched::{LOG_MAX, Watched, numbers};

/// How large a terminal is.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    pub columns: usize,
    pub rows: usize,
}

/// The most units of which the view says for which modules they wait.
const WAITING_MAX: usize = 3;
/// The fewest steps below the map.
const LOG_MIN: usize = 2;

/// Draws a run: its stages and numbers, which unit is next and which modules wait, a map, and the last steps; as much of
/// it as fits, with a line of help last.
pub fn frame(
    watched: &Watched,
    elapsed: Duration,
    size: Size,
    style: Style,
    help: Option<&str>,
) -> Vec<String> {
    // One column stays free, so that no terminal breaks a line.
    let columns = size.columns.saturating_sub(1).max(1);
    // One row stays free for the cursor.
    let rows = size.rows.saturating_sub(1).max(1);
    let mut lines = vec![head(watched, elapsed, style)];
    lines.push(stages(watched, style));
    lines.extend(bars(watched, columns, style));
    lines.extend(waiting(watched, style));
    let left = rows.saturating_sub(lines.len());
    let map = map(watched, columns, left.saturating_sub(LOG_MIN + 2), style);
    if !map.is_empty() {
        lines.push(String::new());
        lines.extend(map);
    }
    let left = rows.saturating_sub(lines.len() + 1).min(LOG_MAX);
    if left > 0 && !watched.log.is_empty() {
        lines.push(String::new());
        let skipped = watched.log.len().saturating_sub(left);
        for (elapsed, text) in watched.log.iter().skip(skipped) {
            let time = elapsed.as_secs_f64();
            let time = style.paint(&format!("{time:>7.1} s  "), Paint::Dim);
            lines.push(format!("{time}{text}"));
        }
    }
    lines.extend(help.map(|help| style.paint(help, Paint::Dim)));
    lines.truncate(rows);
    let tail = style.sign("…", if columns > 10 { "..." } else { "" });
    lines.iter().map(|line| cut(line, columns, tail)).collect()
}

/// The line, shortened to this many columns: between two words, unless that loses most of it.
fn cut(line: &str, columns: usize, tail: &str) -> String {
    if measure_text_width(line) <= columns {
        return line.to_owned();
    }
    let room = columns.saturating_sub(measure_text_width(tail));
    let bare = strip_ansi_codes(line);
    // The width of the line up to the last word that fits.
    let ends = bare
        .match_indices(' ')
        .map(|(end, _)| measure_text_width(&bare[..end]));
    let end = ends
        .filter(|&width| width <= room)
        .max()
        .unwrap_or_default();
    let width = if end > columns / 2 { end } else { room };
    truncate_str(line, width + measure_text_width(tail), tail).into_owned()
}

fn head(watched: &Watched, elapsed: Duration, style: Style) -> String {
    const DOTS: [&str; 10] = ["⠋", "⠙", "⠹", "⠸", "⠼", "⠴", "⠦", "⠧", "⠇", "⠏"];
    const STROKES: [&str; 4] = ["|", "/", "-", "\\"];
    let step = usize::try_from(elapsed.as_millis() / 100).unwrap_or(0);
    let spinner = style.sign(DOTS[step % DOTS.len()], STROKES[step % STROKES.len()]);
    let name = one_line(&watched.name);
    let name = if name.is_empty() { "formation" } else { &name };
    let epoch = match watched.scene.epoch() {
        Some(epoch) if epoch.number > 1 => format!(", epoch {}", epoch.number),
        _ => String::new(),
    };
    let is_stopped = watched.progress.as_ref().is_some_and(|now| now.stopped);
    let stopped = if is_stopped { ", stopped" } else { "" };
    format!(
        "{spinner} {}  {:.1} s{epoch}{stopped}",
        style.paint(name, Paint::Bold),
        elapsed.as_secs_f64()
    )
}

fn stages(watched: &Watched, style: Style) -> String {
    let now = watched.progress.as_ref().map(|progress| progress.stage);
    let now = match now {
        Some(stage) if stage > FormationStage::WaitingForTarget => stage,
        Some(stage) => return format!("  {}", style.paint(&stage.to_string(), Paint::Bold)),
        None => return format!("  {}", style.paint("starting", Paint::Bold)),
    };
    let parts = FormationStage::ALL[1..]
        .iter()
        .map(|stage| match stage.cmp(&now) {
            std::cmp::Ordering::Less => stage.to_string(),
            // Brackets mark the stage where there is no bold.
            std::cmp::Ordering::Equal => style.paint(&format!("[{stage}]"), Paint::Bold),
            std::cmp::Ordering::Greater => style.paint(&stage.to_string(), Paint::Dim),
        });
    format!("  {}", joined(parts, style.sign(" → ", " > ")))
}

/// Three bars: joined, with a spot, settled.
fn bars(watched: &Watched, columns: usize, style: Style) -> Vec<String> {
    let progress = watched.progress.as_ref();
    let (modules, to_fill) = match &watched.problem {
        Some(problem) => {
            let modules = problem.modules().len();
            (modules, modules.min(problem.target().spots().len()))
        }
        None => progress.map_or((0, 0), |progress| {
            let modules = progress.expected.unwrap_or(progress.joined);
            (modules, progress.to_fill)
        }),
    };
    let counts = progress.map(|one| [one.joined, one.planned, one.settled]);
    let [joined, planned, settled] = counts.unwrap_or_default();
    let turns = watched.scene.decisions().len();
    let turn = match &watched.plan {
        _ if turns == 0 || watched.is_acting() => String::new(),
        Some(plan) => format!("  turn {turns} of {}", plan.outcome.decisions.len()),
        None => format!("  turn {turns}"),
    };
    // The words around a bar.
    let width = columns.saturating_sub(30).clamp(4, 40);
    [
        ("joined", joined, modules, ""),
        ("planned", planned, to_fill, &turn),
        ("settled", settled, to_fill, ""),
    ]
    .into_iter()
    .map(|(name, count, all, more)| {
        let filled = (width * count.min(all)).checked_div(all).unwrap_or(0);
        let full = style.sign("█", "#").repeat(filled);
        let empty = style.sign("░", "-").repeat(width - filled);
        format!(
            "  {name:<8}{}{}  {count}/{all}{more}",
            style.paint(&full, Paint::Front(FIRST_COLOUR)),
            style.paint(&empty, Paint::Dim),
        )
    })
    .collect()
}

/// Which unit is next and which units wait, by the plan where the run follows it, else as the verifier reports.
fn waiting(watched: &Watched, style: Style) -> Vec<String> {
    if let Some((moving, waiting)) = watched.on_paths() {
        return on_paths(&moving, &waiting, style);
    }
    let queue = watched.queue();
    let Some(first) = queue.first() else {
        let progress = watched.progress.as_ref();
        return match progress.map(|progress| progress.waiting_for.as_slice()) {
            None | Some([]) => Vec::new(),
            Some(modules) => vec![format!("  waiting for {}", numbers(modules))],
        };
    };
    let ids = numbers(first);
    let now = match first.len() {
        1 => format!("{ids} decides"),
        _ => format!("{ids} decide"),
    };
    let mut lines = vec![format!("  {}   {now}", style.paint("now", Paint::Bold))];
    for (index, pair) in queue.windows(2).take(WAITING_MAX).enumerate() {
        let label = if index == 0 { "next" } else { "then" };
        let verb = if pair[1].len() == 1 { "waits" } else { "wait" };
        lines.push(format!(
            "  {}  {} {verb} for {}",
            style.paint(label, Paint::Dim),
            numbers(&pair[1]),
            numbers(&pair[0])
        ));
    }
    let later = queue.iter().skip(1 + WAITING_MAX);
    let more: usize = later.map(Vec::len).sum();
    if more > 0 {
        let more = style.paint(&format!("and {more} more after them"), Paint::Dim);
        lines.push(format!("  {more}"));
    }
    lines
}

/// Who moves along paths and who waits.
fn on_paths(moving: &[ModuleId], waiting: &[ModuleId], style: Style) -> Vec<String> {
    let line = |label, modules: &[ModuleId], one, several| {
        let verb = if modules.len() == 1 { one } else { several };
        let text = format!("  {label}  {} {verb}", numbers(modules));
        (!modules.is_empty()).then_some(text)
    };
    let now = style.paint("now ", Paint::Bold);
    let next = style.paint("next", Paint::Dim);
    let lines = [
        line(now, moving, "is on its way", "are on their way"),
        line(next, waiting, "waits", "wait"),
    ];
    lines.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests;
