//! Corridors on a unit lattice: the cells that a module can reach from outside.
//!
//! Modules are unit squares on the cells of a lattice. Between such squares every gap is a whole number of cells wide, so
//! a unit square that does not turn can move from outside to a cell exactly if free cells lead there edge by edge.

use super::ground::Ground;
use formation_model::{MICRO_PER_UNIT, Pose, Target};

/// The greatest offset of a coordinate from its cell's centre, for targets with three decimals.
const LATTICE_TOLERANCE_MICRO: i64 = 1_000;

/// The free cells that are connected to the outside, updated while spots are vacated.
///
/// Only cells within one step, also diagonally, of some spot of the target are held. They suffice: the target is connected,
/// so the border of each region of its complement is one closed curve of such cells, and two of them in one region are
/// connected along it. Cells beyond connect no others.
#[derive(Clone)]
pub(super) struct Corridors {
    /// The four neighbours of each cell; `None` for cells that are not held.
    neighbours: Vec<[Option<u32>; 4]>,
    /// The cell of each spot.
    cell_of: Vec<u32>,
    /// The spot on each cell.
    spot_at: Vec<Option<u32>>,
    /// Whether a module stands on the cell.
    occupied: Vec<bool>,
    /// Whether the cell is free and connected to the outside.
    open: Vec<bool>,
    /// The cells opened so far, in this order, for undoing.
    opened: Vec<u32>,
}

impl Corridors {
    /// The corridors with every filled spot occupied; `None` if the target is not on a unit lattice.
    pub(super) fn of(target: &Target, ground: &Ground) -> Option<Self> {
        let origin = target.spots().first()?.pose;
        let sites: Vec<(i64, i64)> = target
            .spots()
            .iter()
            .map(|spot| cell_under(&spot.pose, &origin))
            .collect::<Option<_>>()?;
        let on_lattice = |&(first, second): &(usize, usize)| {
            let ((x, y), (other_x, other_y)) = (sites[first], sites[second]);
            (x - other_x).abs() + (y - other_y).abs() == 1
        };
        if !target.topology().edges().iter().all(on_lattice) {
            return None;
        }
        let mut cells: Vec<(i64, i64)> = sites
            .iter()
            .flat_map(|&(x, y)| {
                (-1..=1).flat_map(move |right| (-1..=1).map(move |up| (x + right, y + up)))
            })
            .collect();
        cells.sort_unstable();
        cells.dedup();
        let find = |cell: (i64, i64)| {
            let position = cells.binary_search(&cell).ok()?;
            u32::try_from(position).ok()
        };
        let cell_of: Vec<u32> = sites
            .iter()
            .map(|&site| find(site))
            .collect::<Option<_>>()?;
        let mut spot_at = vec![None; cells.len()];
        for (spot, &cell) in cell_of.iter().enumerate() {
            // Two spots share a cell.
            if spot_at[cell as usize]
                .replace(u32::try_from(spot).ok()?)
                .is_some()
            {
                return None;
            }
        }
        let neighbours = cells
            .iter()
            .map(|&(x, y)| [(x + 1, y), (x, y + 1), (x - 1, y), (x, y - 1)].map(find))
            .collect();
        let occupied = spot_at
            .iter()
            .map(|spot| spot.is_some_and(|spot| ground.is_filled(spot as usize)))
            .collect();
        let mut corridors = Self {
            neighbours,
            cell_of,
            spot_at,
            occupied,
            open: vec![false; cells.len()],
            opened: Vec::new(),
        };
        // The first cell in order has no spot on it or to its left, so it is free and outside.
        corridors.flood(0);
        Some(corridors)
    }

    /// Whether a corridor leads to this occupied spot.
    pub(super) fn reaches(&self, spot: usize) -> bool {
        let cell = self.cell_of[spot] as usize;
        self.neighbours[cell]
            .iter()
            .flatten()
            .any(|&neighbour| self.open[neighbour as usize])
    }

    /// Removes the module from an occupied spot.
    pub(super) fn vacate(&mut self, spot: usize) {
        let cell = self.cell_of[spot];
        self.occupied[cell as usize] = false;
        if self.reaches(spot) {
            self.flood(cell);
        }
    }

    /// The number of cells opened so far: a point in time for [`Self::spots_next_to_opened_since`] and [`Self::undo`].
    pub(super) fn mark(&self) -> usize {
        self.opened.len()
    }

    /// The occupied spots adjacent to cells that were opened after `mark`, with repetitions.
    pub(super) fn spots_next_to_opened_since(
        &self,
        mark: usize,
    ) -> impl Iterator<Item = usize> + '_ {
        self.opened[mark..]
            .iter()
            .flat_map(|&cell| self.neighbours[cell as usize].iter().flatten())
            .filter(|&&cell| self.occupied[cell as usize])
            .filter_map(|&cell| self.spot_at[cell as usize])
            .map(|spot| spot as usize)
    }

    /// Puts the module back on a vacated spot. `mark` is the time just before it was vacated; all spots vacated later must
    /// have been undone.
    pub(super) fn undo(&mut self, spot: usize, mark: usize) {
        for cell in self.opened.drain(mark..) {
            self.open[cell as usize] = false;
        }
        self.occupied[self.cell_of[spot] as usize] = true;
    }

    fn flood(&mut self, start: u32) {
        let mut next = self.opened.len();
        self.open[start as usize] = true;
        self.opened.push(start);
        while let Some(&cell) = self.opened.get(next) {
            for &neighbour in self.neighbours[cell as usize].iter().flatten() {
                if !self.open[neighbour as usize] && !self.occupied[neighbour as usize] {
                    self.open[neighbour as usize] = true;
                    self.opened.push(neighbour);
                }
            }
            next += 1;
        }
    }
}

/// The lattice cell of a pose, counted from the origin's; `None` if the pose is off the cell's centre.
fn cell_under(pose: &Pose, origin: &Pose) -> Option<(i64, i64)> {
    let along = |offset: i64| {
        let cell = (offset + MICRO_PER_UNIT / 2).div_euclid(MICRO_PER_UNIT);
        ((offset - cell * MICRO_PER_UNIT).abs() <= LATTICE_TOLERANCE_MICRO).then_some(cell)
    };
    Some((along(pose.x.0 - origin.x.0)?, along(pose.y.0 - origin.y.0)?))
}
