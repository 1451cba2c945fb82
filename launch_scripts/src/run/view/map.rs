//! A small map of the target, in signs.

use std::collections::BTreeMap;

use formation::model::{MICRO_PER_UNIT, SpotId, Target};

use super::style::{Paint, Style, colour_of};
use super::watched::{SpotStatus, Watched};

/// The map in as many columns and rows as there are, with a line that explains it; empty where it does not fit, or the
/// spots do not lie on a lattice.
pub fn map(watched: &Watched, columns: usize, rows: usize, style: Style) -> Vec<String> {
    let Some(problem) = &watched.problem else {
        return Vec::new();
    };
    let Some(cells) = Cells::of(problem.target()) else {
        return Vec::new();
    };
    let digits = problem.modules().last().map_or(1, |module| {
        module.id.0.checked_ilog10().unwrap_or(0) as usize + 1
    });
    let width = digits + 2;
    let fits = |cell: usize| INSET.len() + cells.columns * cell < columns && cells.rows < rows;
    if fits(width) {
        let mut lines = cells.lines(|spot| labelled(watched, spot, digits, style), width);
        let one = colour_of(Some(0));
        let signs = [
            style.paint("[4]", Paint::Back(one)) + " settled",
            style.paint(">4", Paint::Front(one)) + " moving",
            style.paint("4", Paint::Dim) + " claimed",
            style.paint(style.sign(DOT, "."), Paint::Dim) + " free",
        ];
        lines.push(format!("{INSET}{}", signs.join("   ")));
        return lines;
    }
    if fits(2) {
        let mut lines = cells.lines(|spot| signed(watched, spot, style), 2);
        lines.push(format!("{INSET}# settled   > moving   o claimed   . free"));
        return lines;
    }
    Vec::new()
}

/// Precedes each row, as all other lines.
const INSET: &str = "  ";
/// A free spot.
const DOT: &str = "·";

/// A spot with the number of its module.
fn labelled(watched: &Watched, spot: SpotId, digits: usize, style: Style) -> String {
    let colour = |module| colour_of(watched.configuration_of(module));
    let (cell, paint) = match watched.spot(spot) {
        SpotStatus::Free => {
            let dot = style.sign(DOT, ".");
            (format!("{dot:^width$}", width = digits + 2), Paint::Dim)
        }
        SpotStatus::Claimed(module) => (format!(" {:>digits$} ", module.0), Paint::Dim),
        SpotStatus::Awaited(module) => {
            let cell = format!(">{:>digits$} ", module.0);
            (cell, Paint::Front(colour(module)))
        }
        SpotStatus::Filled(module) => {
            let cell = format!("[{:>digits$}]", module.0);
            (cell, Paint::Back(colour(module)))
        }
    };
    style.paint(&cell, paint)
}

/// A spot as one sign.
fn signed(watched: &Watched, spot: SpotId, style: Style) -> String {
    let colour = |module| Paint::Front(colour_of(watched.configuration_of(module)));
    let (sign, paint) = match watched.spot(spot) {
        SpotStatus::Free => (". ", Paint::Dim),
        SpotStatus::Claimed(_) => ("o ", Paint::Dim),
        SpotStatus::Awaited(module) => ("> ", colour(module)),
        SpotStatus::Filled(module) => ("# ", colour(module)),
    };
    style.paint(sign, paint)
}

/// Which spot is in which cell of the lattice, rows from the top.
struct Cells {
    columns: usize,
    rows: usize,
    spots: BTreeMap<(usize, usize), SpotId>,
}

impl Cells {
    fn of(target: &Target) -> Option<Self> {
        let cell = |micro: i64| (micro + MICRO_PER_UNIT / 2).div_euclid(MICRO_PER_UNIT);
        let places: Vec<(i64, i64)> = target
            .spots()
            .iter()
            .map(|spot| (cell(spot.pose.x.0), cell(spot.pose.y.0)))
            .collect();
        let left = places.iter().map(|&(x, _)| x).min()?;
        let top = places.iter().map(|&(_, y)| y).max()?;
        let mut cells = Self {
            columns: 0,
            rows: 0,
            spots: BTreeMap::new(),
        };
        for (spot, &(x, y)) in target.spots().iter().zip(&places) {
            let (column, row) = (
                usize::try_from(x - left).ok()?,
                usize::try_from(top - y).ok()?,
            );
            cells.columns = cells.columns.max(column + 1);
            cells.rows = cells.rows.max(row + 1);
            // Two spots in one cell cannot both be shown.
            if cells.spots.insert((row, column), spot.id).is_some() {
                return None;
            }
        }
        Some(cells)
    }

    fn lines(&self, drawn: impl Fn(SpotId) -> String, width: usize) -> Vec<String> {
        (0..self.rows)
            .map(|row| {
                let mut line = INSET.to_owned();
                let last = self.spots.range((row, 0)..=(row, usize::MAX)).next_back();
                for column in 0..=last.map_or(0, |(&(_, column), _)| column) {
                    match self.spots.get(&(row, column)) {
                        Some(&spot) => line.push_str(&drawn(spot)),
                        None => line.push_str(&" ".repeat(width)),
                    }
                }
                line
            })
            .collect()
    }
}
