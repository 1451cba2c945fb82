//! Scenarios between walls, drawn as maps, and generated mazes and rooms.

#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "maps are small, and a failure in a helper fails the test that calls it"
)]

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use formation_model::{PlanningProblem, Scenario};

use super::Numbers;

pub type Cell = (i64, i64);

/// A field of cells between walls, with the cells of spots and starts.
#[derive(Clone, Debug, Default)]
pub struct Field {
    pub width: i64,
    pub height: i64,
    pub walls: BTreeSet<Cell>,
    pub spots: BTreeMap<u32, Cell>,
    pub starts: BTreeMap<u32, Cell>,
}

impl Field {
    /// `#` is a wall, a digit the spot of that number, and the letters a, b, ... are the modules 1, 2, ...
    /// A capital letter is a module on the spot of its number.
    pub fn drawn(map: &str) -> Self {
        let rows: Vec<&str> = map
            .lines()
            .map(str::trim)
            .filter(|row| !row.is_empty())
            .collect();
        let mut field = Self {
            width: rows[0].len() as i64,
            height: rows.len() as i64,
            ..Self::default()
        };
        for (y, row) in (0..).zip(rows.iter().rev()) {
            for (x, mark) in (0..).zip(row.bytes()) {
                match mark {
                    b'#' => drop(field.walls.insert((x, y))),
                    b'1'..=b'9' => drop(field.spots.insert(u32::from(mark - b'0'), (x, y))),
                    b'A'..=b'Z' => {
                        let number = u32::from(mark - b'A') + 1;
                        field.spots.insert(number, (x, y));
                        field.starts.insert(number, (x, y));
                    }
                    b'a'..=b'z' => drop(field.starts.insert(u32::from(mark - b'a') + 1, (x, y))),
                    _ => {}
                }
            }
        }
        field
    }

    /// A maze in which exactly one way joins any two places; its corridors are two cells wide.
    pub fn maze(numbers: &mut Numbers) -> Self {
        Self::grid(10, 3, 0, numbers)
    }

    /// Rooms of four by four cells with doors of one cell: a maze with some doors more.
    pub fn rooms(numbers: &mut Numbers) -> Self {
        Self::grid(6, 5, 40, numbers)
    }

    /// A maze of lanes that are one cell wide; some walls, in percent, have an opening more.
    pub fn lanes(count: i64, percent: usize, numbers: &mut Numbers) -> Self {
        Self::grid(count, 2, percent, numbers)
    }

    /// One lane, with modules on its first cells and spots on its last ones.
    pub fn lane(lane: &[Cell], count: usize) -> Self {
        let low = lane
            .iter()
            .fold((0, 0), |low, cell| (low.0.min(cell.0), low.1.min(cell.1)));
        let lane: Vec<Cell> = lane
            .iter()
            .map(|cell| (cell.0 - low.0, cell.1 - low.1))
            .collect();
        let mut field = Self {
            width: lane.iter().map(|cell| cell.0 + 1).max().unwrap(),
            height: lane.iter().map(|cell| cell.1 + 1).max().unwrap(),
            spots: (1..)
                .zip(lane[lane.len() - count..].iter().copied())
                .collect(),
            starts: (1..).zip(lane[..count].iter().copied()).collect(),
            ..Self::default()
        };
        let cells = (0..field.width).flat_map(|x| (0..field.height).map(move |y| (x, y)));
        field.walls = cells.filter(|cell| !lane.contains(cell)).collect();
        field
    }

    /// Puts the modules on the cells nearest to a random one.
    pub fn started_together(mut self, count: usize, numbers: &mut Numbers) -> Self {
        let cells = (0..self.width).flat_map(|x| (0..self.height).map(move |y| (x, y)));
        let free: Vec<Cell> = cells.filter(|&cell| self.is_free(cell)).collect();
        let blob = self.blob(free[numbers.below(free.len())], count);
        self.starts = (1..).zip(blob).collect();
        self
    }

    fn blob(&self, first: Cell, count: usize) -> Vec<Cell> {
        let (mut blob, mut seen) = (VecDeque::from([first]), BTreeSet::from([first]));
        let mut found = Vec::new();
        while found.len() < count {
            let cell = blob.pop_front().unwrap();
            found.push(cell);
            let next = Self::around(cell).into_iter();
            blob.extend(next.filter(|&cell| self.is_free(cell) && seen.insert(cell)));
        }
        found
    }

    /// Places of `pitch - 1` cells a side, with walls of one cell between them. A spanning tree of openings joins all of them;
    /// of the other walls some, in percent, have an opening. Openings are as wide as the places if no wall is opened besides.
    fn grid(count: i64, pitch: i64, percent: usize, numbers: &mut Numbers) -> Self {
        let side = count * pitch - 1;
        let all = (0..side).flat_map(|x| (0..side).map(move |y| (x, y)));
        let on_line = |&(x, y): &Cell| x % pitch == pitch - 1 || y % pitch == pitch - 1;
        let mut field = Self {
            width: side,
            height: side,
            walls: all.filter(on_line).collect(),
            ..Self::default()
        };
        let mut between: Vec<(Cell, Cell)> = Vec::new();
        for x in 0..count {
            for y in 0..count {
                between.extend((x + 1 < count).then_some(((x, y), (x + 1, y))));
                between.extend((y + 1 < count).then_some(((x, y), (x, y + 1))));
            }
        }
        let mut group: BTreeMap<Cell, Cell> = (0..count)
            .flat_map(|x| (0..count).map(move |y| ((x, y), (x, y))))
            .collect();
        while !between.is_empty() {
            let (one, other) = between.swap_remove(numbers.below(between.len()));
            let (kept, joined) = (group[&one], group[&other]);
            if kept == joined && numbers.below(100) >= percent {
                continue;
            }
            for member in group.values_mut().filter(|member| **member == joined) {
                *member = kept;
            }
            let inside = numbers.below((pitch - 1) as usize) as i64;
            let open = if percent == 0 {
                0..pitch - 1
            } else {
                inside..inside + 1
            };
            for along in open {
                let cell = if one.0 < other.0 {
                    (one.0 * pitch + pitch - 1, one.1 * pitch + along)
                } else {
                    (one.0 * pitch + along, one.1 * pitch + pitch - 1)
                };
                field.walls.remove(&cell);
            }
        }
        field
    }

    pub fn is_free(&self, (x, y): Cell) -> bool {
        (0..self.width).contains(&x)
            && (0..self.height).contains(&y)
            && !self.walls.contains(&(x, y))
    }

    fn around((x, y): Cell) -> [Cell; 4] {
        [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
    }

    /// Puts spots on the cells nearest to a random one, and modules on others.
    pub fn filled(mut self, count: usize, numbers: &mut Numbers) -> Self {
        let cells = (0..self.width).flat_map(|x| (0..self.height).map(move |y| (x, y)));
        let mut free: Vec<Cell> = cells.filter(|&cell| self.is_free(cell)).collect();
        let first = free[numbers.below(free.len())];
        self.spots = (1..).zip(self.blob(first, count)).collect();
        free.retain(|cell| !self.spots.values().any(|spot| spot == cell));
        for module in 1..=count {
            let cell = free.swap_remove(numbers.below(free.len()));
            self.starts.insert(module as u32, cell);
        }
        self
    }

    /// The problem of bringing the modules to spots that are joined wherever they are side by side.
    pub fn problem(&self) -> Arc<PlanningProblem> {
        let boxes = |cells: &BTreeSet<Cell>| -> Vec<String> {
            let entry = |(x, y): &Cell| format!("{{x: {x}, y: {y}, width: 1, height: 1}}");
            cells.iter().map(entry).collect()
        };
        let places = |places: &BTreeMap<u32, Cell>| -> Vec<String> {
            let entry = |(id, (x, y)): (&u32, &Cell)| format!("{{id: {id}, x: {x}, y: {y}}}");
            places.iter().map(entry).collect()
        };
        let mut edges = Vec::new();
        for (one, &(x, y)) in &self.spots {
            let beside = |other: &Cell| *other == (x + 1, y) || *other == (x, y + 1);
            let others = self.spots.iter().filter(|(_, other)| beside(other));
            edges.extend(others.map(|(other, _)| format!("[{one}, {other}]")));
        }
        let text = format!(
            "target: {{spots: [{}], edges: [{}]}}\nsingletons: [{}]\nobstacles: [{}]\n\
             arena: {{x: {:?}, y: {:?}, width: {}, height: {}}}\n",
            places(&self.spots).join(", "),
            edges.join(", "),
            places(&self.starts).join(", "),
            boxes(&self.walls).join(", "),
            (self.width - 1) as f64 / 2.0,
            (self.height - 1) as f64 / 2.0,
            self.width,
            self.height,
        );
        Arc::new(Scenario::from_yaml(&text).unwrap().problem().clone())
    }
}
