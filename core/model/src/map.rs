//! Maps: targets, modules and walls on a lattice, drawn as text.
//!
//! A spot or module stands at every second column and row. Between two of them, `-` or `|` is a dock. `#` closes a place; between
//! places it may be drawn where it is surrounded by such. The top line is the row with the greatest y.

use std::collections::BTreeMap;

use crate::{FieldError, RawArea, RawConfiguration, RawModule, RawSpot, Topology};

/// Where a map lies in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lattice {
    /// The position of the first column in the bottom row, in units.
    pub origin: [f64; 2],
    /// The distance between neighbouring rows and columns, in units.
    pub pitch: f64,
}

/// A drawn map: what stands where, and what is docked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Map {
    /// What stands on the lattice, in reading order.
    cells: Vec<Cell>,
    /// Pairs of positions in `cells`.
    docks: Vec<(usize, usize)>,
    /// The row and the column of each closed place.
    walls: Vec<(usize, usize)>,
    rows: usize,
}

/// One drawn spot or module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cell {
    letter: char,
    row: usize,
    column: usize,
}

/// A place in a map, in messages: lines and columns count from 1.
fn refused(field: &str, line: usize, column: usize, reason: &str) -> FieldError {
    let place = format!("line {} column {}: {reason}", line + 1, column + 1);
    FieldError::new(format_args!("{field}.map"), place)
}

impl Map {
    /// Reads a map, which is the field `field.map`.
    pub(crate) fn read(field: &str, text: &str) -> Result<Self, FieldError> {
        let lines: Vec<Vec<char>> = text
            .lines()
            .map(|line| line.trim_end().chars().collect())
            .collect();
        let mut cells = Vec::new();
        let mut walls = Vec::new();
        let mut at = BTreeMap::new();
        for (line, characters) in lines.iter().enumerate() {
            for (column, &letter) in characters.iter().enumerate() {
                let is_place = line % 2 == 0 && column % 2 == 0;
                match letter {
                    ' ' | '.' => {}
                    WALL if is_place => walls.push((line / 2, column / 2)),
                    WALL => check_between(field, &lines, line, column)?,
                    _ if is_place && letter.is_ascii_alphanumeric() => {
                        at.insert((line, column), cells.len());
                        cells.push(Cell {
                            letter,
                            row: line / 2,
                            column: column / 2,
                        });
                    }
                    '-' | '|' if !is_place => {}
                    _ if letter.is_ascii_alphanumeric() => {
                        let reason = "stands between two places; places are the columns and lines 1, 3, 5, ...";
                        return Err(refused(field, line, column, reason));
                    }
                    other => {
                        let reason =
                            format!("{other:?} is no letter, no dock (`-`, `|`) and no wall (`#`)");
                        return Err(refused(field, line, column, &reason));
                    }
                }
            }
        }
        let docks = docks(field, &lines, &at)?;
        let rows = lines.len().div_ceil(2);
        Ok(Self {
            cells,
            docks,
            walls,
            rows,
        })
    }

    fn position(&self, cell: Cell, lattice: Lattice) -> (f64, f64) {
        self.middle(cell.row, cell.column, lattice)
    }

    /// The middle of a place.
    fn middle(&self, row: usize, column: usize, lattice: Lattice) -> (f64, f64) {
        #[expect(clippy::cast_precision_loss, reason = "a map has few rows and columns")]
        let along = |from: f64, steps: usize| from + lattice.pitch * steps as f64;
        (
            along(lattice.origin[0], column),
            along(lattice.origin[1], self.rows - 1 - row),
        )
    }

    /// The walls, a box for each closed place.
    pub(crate) fn walls(
        &self,
        field: &str,
        lattice: Lattice,
        spots: &[RawSpot],
    ) -> Result<Vec<RawArea>, FieldError> {
        let mut walls = Vec::with_capacity(self.walls.len());
        for &(row, column) in &self.walls {
            let (x, y) = self.middle(row, column, lattice);
            let reach = f64::midpoint(lattice.pitch, 1.0);
            let covers = |spot: &&RawSpot| (spot.x - x).abs() < reach && (spot.y - y).abs() < reach;
            if let Some(spot) = spots.iter().find(covers) {
                let reason = format!("this wall closes spot {}", spot.id);
                return Err(refused(field, row * 2, column * 2, &reason));
            }
            walls.push(RawArea {
                x,
                y,
                width: lattice.pitch,
                height: lattice.pitch,
            });
        }
        Ok(walls)
    }

    /// Whether any place is closed.
    pub(crate) fn has_walls(&self) -> bool {
        !self.walls.is_empty()
    }

    /// The lattice, if no module on it stands on a spot or reaches into its cell; else one on which the modules stand below
    /// the target, with a row between.
    pub(crate) fn clear_of(&self, spots: &[RawSpot], lattice: Lattice) -> Lattice {
        let reaches = |(x, y): (f64, f64), spot: &RawSpot| {
            (x - spot.x).abs() < 1.0 && (y - spot.y).abs() < 1.0
        };
        let mut places = self.cells.iter().map(|&cell| self.position(cell, lattice));
        if !places.any(|place| spots.iter().any(|spot| reaches(place, spot))) {
            return lattice;
        }
        let least = |of: fn(&RawSpot) -> f64| spots.iter().map(of).fold(f64::INFINITY, f64::min);
        #[expect(clippy::cast_precision_loss, reason = "a map has few rows")]
        let height = lattice.pitch * self.rows.saturating_sub(1) as f64;
        Lattice {
            origin: [least(|spot| spot.x), least(|spot| spot.y) - height - 2.0],
            ..lattice
        }
    }

    /// The identifiers of what is drawn: as given, or else from 1 in reading order.
    fn ids(&self, field: &str, ids: Option<&[u32]>) -> Result<Vec<u32>, FieldError> {
        match ids {
            Some(ids) if ids.len() == self.cells.len() => Ok(ids.to_vec()),
            Some(ids) => Err(FieldError::new(
                format_args!("{field}.ids"),
                format_args!(
                    "{} are given for {} in the map",
                    ids.len(),
                    self.cells.len()
                ),
            )),
            None => Ok((1..).take(self.cells.len()).collect()),
        }
    }

    /// The spots and edges of a drawn target.
    pub(crate) fn target(
        &self,
        lattice: Lattice,
        ids: Option<&[u32]>,
    ) -> Result<(Vec<RawSpot>, Vec<[u32; 2]>), FieldError> {
        let ids = self.ids("target", ids)?;
        let spots = self.cells.iter().zip(&ids).map(|(&cell, &id)| {
            let (x, y) = self.position(cell, lattice);
            let theta = 0.0;
            RawSpot { id, x, y, theta }
        });
        let edges = self
            .docks
            .iter()
            .map(|&(one, other)| [ids[one], ids[other]]);
        Ok((spots.collect(), edges.collect()))
    }

    /// The configurations and single modules that are drawn: what is docked is one configuration, and has one letter.
    pub(crate) fn modules(
        &self,
        lattice: Lattice,
        ids: Option<&[u32]>,
    ) -> Result<(Vec<RawConfiguration>, Vec<RawModule>), FieldError> {
        let ids = self.ids("modules", ids)?;
        for &(one, other) in &self.docks {
            let (one, other) = (self.cells[one], self.cells[other]);
            if one.letter != other.letter {
                let reason = format!(
                    "{} is docked to {}; the modules of a configuration have one letter",
                    other.letter, one.letter
                );
                return Err(refused("modules", other.row * 2, other.column * 2, &reason));
            }
        }
        let raw = |at: usize| {
            let (x, y) = self.position(self.cells[at], lattice);
            let (id, theta) = (ids[at], 0.0);
            RawModule { id, x, y, theta }
        };
        let mut configurations = Vec::new();
        let mut singles = Vec::new();
        // In reading order.
        for part in Topology::new(self.cells.len(), &self.docks).components() {
            if let [single] = part[..] {
                singles.push(raw(single));
                continue;
            }
            let edges = self.docks.iter().filter(|(one, _)| part.contains(one));
            configurations.push(RawConfiguration {
                id: (1..).nth(configurations.len()).unwrap_or_default(),
                leader: None,
                edges: edges.map(|&(one, other)| [ids[one], ids[other]]).collect(),
                modules: part.into_iter().map(raw).collect(),
            });
        }
        Ok((configurations, singles))
    }
}

/// The character of a wall.
const WALL: char = '#';

/// Checks a wall that is drawn between places: all places next to it must be closed.
fn check_between(
    field: &str,
    lines: &[Vec<char>],
    line: usize,
    column: usize,
) -> Result<(), FieldError> {
    let around = |at: usize| match at % 2 {
        0 => [at, at],
        _ => [at - 1, at + 1],
    };
    let is_closed = |line: usize, column: usize| {
        let place = lines.get(line).and_then(|line| line.get(column));
        place == Some(&WALL)
    };
    let (lines_around, columns_around) = (around(line), around(column));
    let mut places = lines_around
        .iter()
        .flat_map(|&line| columns_around.map(|column| (line, column)));
    if places.all(|(line, column)| is_closed(line, column)) {
        return Ok(());
    }
    let reason = "a wall closes whole places; between places it may stand only where all of those next to it are closed; \
                  places are the columns and lines 1, 3, 5, ...";
    Err(refused(field, line, column, reason))
}

/// The docks of a map, each between two places.
fn docks(
    field: &str,
    lines: &[Vec<char>],
    at: &BTreeMap<(usize, usize), usize>,
) -> Result<Vec<(usize, usize)>, FieldError> {
    let mut docks = Vec::new();
    for (line, characters) in lines.iter().enumerate() {
        for (column, &dock) in characters.iter().enumerate() {
            let ends = match dock {
                '-' if line % 2 == 0 => [(line, column.wrapping_sub(1)), (line, column + 1)],
                '|' if column % 2 == 0 => [(line.wrapping_sub(1), column), (line + 1, column)],
                '-' | '|' => {
                    let reason = "`-` docks two places of one line, and `|` two of one column";
                    return Err(refused(field, line, column, reason));
                }
                _ => continue,
            };
            let [Some(&one), Some(&other)] = ends.map(|end| at.get(&end)) else {
                let reason = "a dock needs a place on both sides";
                return Err(refused(field, line, column, reason));
            };
            docks.push((one, other));
        }
    }
    Ok(docks)
}

/// Draws what stands on a lattice of pitch 1 as a map: letters at positions, and the pairs of them that are docked.
///
/// Returns the map, the origin of its lattice, and in reading order the indices of what it shows.
///
/// # Errors
/// Names, by its index, the first of them that stands off the lattice of the first one or on the place of another; or the
/// first pair that is docked without being side by side.
pub(crate) fn draw(
    placed: &[(char, f64, f64)],
    docks: &[(usize, usize)],
) -> Result<(String, [f64; 2], Vec<usize>), Undrawable> {
    let least =
        |of: fn(&(char, f64, f64)) -> f64| placed.iter().map(of).fold(f64::INFINITY, f64::min);
    let origin = [least(|place| place.1), least(|place| place.2)];
    let mut at: BTreeMap<(i64, i64), usize> = BTreeMap::new();
    let mut cells = Vec::with_capacity(placed.len());
    for (index, &(_, x, y)) in placed.iter().enumerate() {
        let (column, row) = ((x - origin[0]).round(), (y - origin[1]).round());
        let is_off = |here: f64, there: f64| (here - there).abs() > 1e-6;
        if is_off(x, origin[0] + column) || is_off(y, origin[1] + row) {
            return Err(Undrawable::OffLattice(index));
        }
        #[expect(clippy::cast_possible_truncation, reason = "coordinates are bounded")]
        let cell = (column as i64, row as i64);
        if let Some(other) = at.insert(cell, index) {
            return Err(Undrawable::Shared(other, index));
        }
        cells.push(cell);
    }
    let height = at.keys().map(|cell| cell.1).max().unwrap_or(0);
    let mut characters: BTreeMap<(i64, i64), char> = BTreeMap::new();
    for (&(column, row), &index) in &at {
        characters.insert((2 * (height - row), 2 * column), placed[index].0);
    }
    for &(one, other) in docks {
        let (from, to) = (cells[one], cells[other]);
        let dock = match ((from.0 - to.0).abs(), (from.1 - to.1).abs()) {
            (1, 0) => '-',
            (0, 1) => '|',
            _ => return Err(Undrawable::FarDock(one, other)),
        };
        characters.insert((2 * height - from.1 - to.1, from.0 + to.0), dock);
    }
    let mut text = String::new();
    let (mut line, mut column) = (0, 0);
    for (&(row, place), &character) in &characters {
        while line < row {
            text.push('\n');
            (line, column) = (line + 1, 0);
        }
        while column < place {
            text.push(' ');
            column += 1;
        }
        text.push(character);
        column += 1;
    }
    text.push('\n');
    let mut order: Vec<usize> = (0..placed.len()).collect();
    order.sort_by_key(|&index| (-cells[index].1, cells[index].0));
    Ok((text, origin, order))
}

/// Why something cannot be drawn as a map; the numbers are positions in what was to be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Undrawable {
    /// It does not stand on the lattice of the others.
    OffLattice(usize),
    /// Two stand on one place.
    Shared(usize, usize),
    /// Two are docked and not side by side.
    FarDock(usize, usize),
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATTICE: Lattice = Lattice {
        origin: [5.0, 7.0],
        pitch: 1.0,
    };
    const TARGET: &str = "o-o   o-o\n|     |\no-o-o-o\n";

    #[test]
    fn a_target_is_read_in_reading_order() {
        let map = Map::read("target", TARGET).unwrap();
        let (spots, edges) = map.target(LATTICE, None).unwrap();
        let places: Vec<(u32, f64, f64)> =
            spots.iter().map(|spot| (spot.id, spot.x, spot.y)).collect();
        assert_eq!(places.len(), 8);
        assert_eq!(&places[..3], &[(1, 5.0, 8.0), (2, 6.0, 8.0), (3, 8.0, 8.0)]);
        assert_eq!(places[4], (5, 5.0, 7.0));
        assert_eq!(
            edges,
            [[1, 2], [3, 4], [1, 5], [3, 8], [5, 6], [6, 7], [7, 8]]
        );
        let ids = [9, 8, 7, 6, 5, 4, 3, 2];
        assert_eq!(map.target(LATTICE, Some(&ids)).unwrap().0[0].id, 9);
        let few = map.target(LATTICE, Some(&ids[1..])).unwrap_err();
        assert_eq!(few.to_string(), "target.ids: 7 are given for 8 in the map");
    }

    #[test]
    fn a_hash_closes_its_place() {
        let closed = "#####\n#   #\n# A #\n#   #\n#####\n";
        assert_eq!(Map::read("modules", closed).unwrap().walls.len(), 8);
        let map = Map::read("target", "###\n#\n# o\n").unwrap();
        let (spots, _) = map.target(LATTICE, None).unwrap();
        assert_eq!((spots[0].x, spots[0].y), (6.0, 7.0));
        let walls = map.walls("target", LATTICE, &spots).unwrap();
        let middles: Vec<(f64, f64)> = walls.iter().map(|wall| (wall.x, wall.y)).collect();
        assert_eq!(middles, [(5.0, 8.0), (6.0, 8.0), (5.0, 7.0)]);
        assert!(
            walls
                .iter()
                .all(|wall| (wall.width, wall.height) == (1.0, 1.0))
        );
        let other = RawSpot {
            id: 9,
            x: 5.5,
            y: 7.0,
            theta: 0.0,
        };
        assert_eq!(
            map.walls("target", LATTICE, &[other])
                .unwrap_err()
                .to_string(),
            "target.map: line 3 column 1: this wall closes spot 9"
        );
    }

    #[test]
    fn docked_letters_are_a_configuration_and_others_are_single() {
        let map = Map::read("modules", "A-A   B   C\n|\nA\n").unwrap();
        let (configurations, singles) = map.modules(LATTICE, None).unwrap();
        assert_eq!(configurations.len(), 1);
        assert_eq!(configurations[0].edges, [[1, 2], [1, 5]]);
        assert_eq!(singles.iter().map(|one| one.id).collect::<Vec<_>>(), [3, 4]);
    }

    #[test]
    fn mistakes_are_named_by_line_and_column() {
        for (text, expected) in [
            (
                "o-\n",
                "target.map: line 1 column 2: a dock needs a place on both sides",
            ),
            (
                "oo\n",
                "target.map: line 1 column 2: stands between two places; places are the columns and lines 1, 3, 5, ...",
            ),
            (
                "o o\n -\no\n",
                "target.map: line 2 column 2: `-` docks two places of one line, and `|` two of one column",
            ),
            (
                "o*o\n",
                "target.map: line 1 column 2: '*' is no letter, no dock (`-`, `|`) and no wall (`#`)",
            ),
            (
                "o # o\n  #\no   o\n",
                "target.map: line 2 column 3: a wall closes whole places; between places it may stand only where all of those \
                 next to it are closed; places are the columns and lines 1, 3, 5, ...",
            ),
        ] {
            assert_eq!(Map::read("target", text).unwrap_err().to_string(), expected);
        }
        let map = Map::read("modules", "A-B\n").unwrap();
        assert_eq!(
            map.modules(LATTICE, None).unwrap_err().to_string(),
            "modules.map: line 1 column 3: B is docked to A; the modules of a configuration have one letter"
        );
    }

    #[test]
    fn what_is_drawn_is_read_back() {
        let map = Map::read("target", TARGET).unwrap();
        let placed: Vec<(char, f64, f64)> = map
            .cells
            .iter()
            .map(|&cell| {
                let (x, y) = map.position(cell, LATTICE);
                (cell.letter, x, y)
            })
            .collect();
        let (text, origin, order) = draw(&placed, &map.docks).unwrap();
        assert_eq!((text.as_str(), origin), (TARGET, LATTICE.origin));
        assert_eq!(order, (0..8).collect::<Vec<_>>());
        let off = [('o', 0.0, 0.0), ('o', 1.25, 0.0)];
        assert_eq!(draw(&off, &[]), Err(Undrawable::OffLattice(1)));
        let far = [('o', 0.0, 0.0), ('o', 2.0, 0.0)];
        assert_eq!(draw(&far, &[(0, 1)]), Err(Undrawable::FarDock(0, 1)));
        assert_eq!(draw(&[far[0], far[0]], &[]), Err(Undrawable::Shared(0, 1)));
    }
}
