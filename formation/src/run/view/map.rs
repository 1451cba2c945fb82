//! A small map of the target, in signs.

use std::collections::{BTreeMap, BTreeSet};

use formation_model::{MICRO_PER_UNIT, SpotId, Target};

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
        let mut lines = cells.lines(|spot| labelled(watched, spot, digits, style), width, style);
        let one = colour_of(Some(0));
        let signs = [
            style.paint("[4]", Paint::Back(one)) + " settled",
            style.paint(">4", Paint::Front(one)) + " moving",
            style.paint("4", Paint::Dim) + " claimed",
            style.paint(style.sign(DOT, "."), Paint::Dim) + " free",
        ];
        let walls = cells
            .walls_are_drawn()
            .then(|| format!("   {} wall", wall(1, style)));
        let walls = walls.unwrap_or_default();
        lines.push(format!("{INSET}{}{walls}", signs.join("   ")));
        return lines;
    }
    if fits(2) {
        let mut lines = cells.lines(|spot| signed(watched, spot, style), 2, style);
        let walls = match cells.walls_are_drawn() {
            true => format!("   {} wall", wall(1, style)),
            false => String::new(),
        };
        lines.push(format!(
            "{INSET}# settled   > moving   o claimed   . free{walls}"
        ));
        return lines;
    }
    Vec::new()
}

/// Larger maps fit no terminal.
const WALL_CELLS_MAX: usize = 100_000;

/// Precedes each row, as all other lines.
const INSET: &str = "  ";
/// An obstacle, or what is beyond the walls, as wide as a cell.
fn wall(width: usize, style: Style) -> String {
    style.paint(&style.sign("▒", "%").repeat(width), Paint::Dim)
}

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
    /// The cells without a spot that no module may enter.
    walls: BTreeSet<(usize, usize)>,
}

impl Cells {
    fn of(target: &Target) -> Option<Self> {
        let cell = |micro: i64| (micro + MICRO_PER_UNIT / 2).div_euclid(MICRO_PER_UNIT);
        let places: Vec<(i64, i64)> = target
            .spots()
            .iter()
            .map(|spot| (cell(spot.pose.x.0), cell(spot.pose.y.0)))
            .collect();
        // Obstacles and walls around the target are shown next to it.
        let margin = if target.surroundings().is_open() {
            0
        } else {
            1
        };
        let left = places.iter().map(|&(x, _)| x).min()? - margin;
        let top = places.iter().map(|&(_, y)| y).max()? + margin;
        let mut cells = Self {
            columns: 0,
            rows: 0,
            spots: BTreeMap::new(),
            walls: BTreeSet::new(),
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
        let margin = usize::try_from(margin).ok()?;
        cells.columns += margin;
        cells.rows += margin;
        cells.mark_walls(target, (left, top));
        Some(cells)
    }

    /// Marks the cells that obstacles cover in part, or that are not whole within the walls; `corner` is the upper left cell.
    fn mark_walls(&mut self, target: &Target, corner: (i64, i64)) {
        let surroundings = target.surroundings();
        let spots = target.spots();
        if surroundings.is_open() || self.columns * self.rows > WALL_CELLS_MAX {
            return;
        }
        let half = MICRO_PER_UNIT / 2;
        // How far the spots stand off whole units.
        let off = |along: i64| (along + half).rem_euclid(MICRO_PER_UNIT) - half;
        let (right, up) = (off(spots[0].pose.x.0), off(spots[0].pose.y.0));
        for row in 0..self.rows {
            for column in 0..self.columns {
                let along = |first: i64, steps: usize, sign: i64, off: i64| {
                    let steps = i64::try_from(steps).unwrap_or(i64::MAX);
                    (first + sign * steps) * MICRO_PER_UNIT + off
                };
                let middle = (
                    along(corner.0, column, 1, right),
                    along(corner.1, row, -1, up),
                );
                let is_covered = surroundings.obstacles().iter().any(|area| {
                    let ((left, bottom), (right, top)) = (area.low, area.high);
                    left.0 < middle.0 + half
                        && middle.0 - half < right.0
                        && bottom.0 < middle.1 + half
                        && middle.1 - half < top.0
                });
                let is_beyond = surroundings.arena().is_some_and(|area| {
                    let ((left, bottom), (right, top)) = (area.low, area.high);
                    middle.0 - half < left.0
                        || right.0 < middle.0 + half
                        || middle.1 - half < bottom.0
                        || top.0 < middle.1 + half
                });
                if (is_covered || is_beyond) && !self.spots.contains_key(&(row, column)) {
                    self.walls.insert((row, column));
                }
            }
        }
    }

    fn walls_are_drawn(&self) -> bool {
        !self.walls.is_empty()
    }

    fn lines(&self, drawn: impl Fn(SpotId) -> String, width: usize, style: Style) -> Vec<String> {
        (0..self.rows)
            .map(|row| {
                let mut line = INSET.to_owned();
                let of_row = (row, 0)..=(row, usize::MAX);
                let spots = self.spots.range(of_row.clone()).next_back();
                let walls = self.walls.range(of_row).next_back();
                let last = spots.map(|(&(_, column), _)| column);
                let last = last.max(walls.map(|&(_, column)| column));
                for column in 0..=last.unwrap_or(0) {
                    match self.spots.get(&(row, column)) {
                        Some(&spot) => line.push_str(&drawn(spot)),
                        None if self.walls.contains(&(row, column)) => {
                            line.push_str(&wall(width, style));
                        }
                        None => line.push_str(&" ".repeat(width)),
                    }
                }
                line
            })
            .collect()
    }
}
