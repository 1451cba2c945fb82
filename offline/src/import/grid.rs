//! A map as cells of the unit lattice: the cell (x, y) has its middle there.

use formation_generate::LatticeCell;

/// More cells than these are refused.
pub const CELLS_MAX: usize = 4_000_000;

/// Which cells of a rectangle are closed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grid {
    /// The lowest cell.
    pub low: LatticeCell,
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// Row by row from below.
    closed: Vec<bool>,
}

/// Closed cells side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// The leftmost cell.
    pub x: i64,
    /// Its row.
    pub y: i64,
    /// How many they are.
    pub length: usize,
}

impl Run {
    /// The column after the last cell.
    pub fn end(&self) -> i64 {
        self.x.saturating_add_unsigned(self.length as u64)
    }
}

impl Grid {
    /// A rectangle of open cells.
    ///
    /// # Errors
    /// There are none, or more than [`CELLS_MAX`].
    pub fn open(low: LatticeCell, width: usize, height: usize) -> anyhow::Result<Self> {
        let count = width.saturating_mul(height);
        anyhow::ensure!(count > 0, "has no cell of the size of a module");
        anyhow::ensure!(
            count <= CELLS_MAX,
            "has {width} x {height} cells of the size of a module; at most {CELLS_MAX} are supported"
        );
        Ok(Self {
            low,
            width,
            height,
            closed: vec![false; count],
        })
    }

    /// Closes a cell, if it is one of these.
    pub fn close(&mut self, (x, y): LatticeCell) {
        let along = |from: i64, to: i64, extent: usize| {
            usize::try_from(to - from).ok().filter(|&at| at < extent)
        };
        let column = along(self.low.0, x, self.width);
        let row = along(self.low.1, y, self.height);
        if let Some((column, row)) = column.zip(row) {
            self.closed[row * self.width + column] = true;
        }
    }

    /// The cells with whether they are closed, row by row from below.
    fn cells(&self) -> impl Iterator<Item = (LatticeCell, bool)> + '_ {
        let rows = self.closed.chunks(self.width).zip(self.low.1..);
        rows.flat_map(|(row, y)| {
            let cells = row.iter().zip(self.low.0..);
            cells.map(move |(&closed, x)| ((x, y), closed))
        })
    }

    /// The open cells.
    pub fn free_cells(&self) -> impl Iterator<Item = LatticeCell> + '_ {
        let free = self.cells().filter(|(_, closed)| !closed);
        free.map(|(cell, _)| cell)
    }

    /// The closed cells, those side by side as one.
    pub fn closed_runs(&self) -> Vec<Run> {
        let mut runs: Vec<Run> = Vec::new();
        for ((x, y), _) in self.cells().filter(|&(_, closed)| closed) {
            match runs.last_mut() {
                Some(last) if last.y == y && last.end() == x => last.length += 1,
                _ => runs.push(Run { x, y, length: 1 }),
            }
        }
        runs
    }
}
