//! The pose of a layout that fits the measured poses of its modules best.

use super::lattice::Site;
use formation_model::MICRO_PER_UNIT;
use formation_model::turning::{Point, off_quarter, rotated};

/// Modules of one body as they were measured.
pub(super) struct Measured<'a> {
    /// Their cells in the layout.
    pub cells: &'a [Site],
    /// Where they are from the first, in a frame that is turned by `off`.
    pub offsets: &'a [Point],
    pub headings: &'a [i64],
    pub off: i64,
}

/// The pose of a layout.
pub(super) struct Fit {
    /// By how much it is turned in the frame of the offsets.
    pub turned: i64,
    /// Where one of its cells is in that frame.
    pub offset: Point,
    member: usize,
}

impl Measured<'_> {
    /// The pose of the layout that comes nearest to the offsets by least squares, for small turns, or of all that are turned by
    /// so much.
    pub fn fit(&self, member: usize, turned: Option<i64>) -> Fit {
        let Self { cells, offsets, .. } = *self;
        let count = i64::try_from(cells.len()).unwrap_or(i64::MAX);
        let sum = |points: &[(i64, i64)]| {
            let add = |sum: (i64, i64), one: &(i64, i64)| (sum.0 + one.0, sum.1 + one.1);
            points.iter().fold((0, 0), add)
        };
        let (all_cells, all_offsets) = (sum(cells), sum(offsets));
        // Times the number of modules, from the middle of all.
        let arm = |cell: Site| (cell.0 * count - all_cells.0, cell.1 * count - all_cells.1);
        let best = || {
            let (mut moment, mut inertia) = (0, 0);
            for (&cell, offset) in cells.iter().zip(offsets) {
                let (x, y) = arm(cell);
                let right = offset.0 - cell.0 * MICRO_PER_UNIT;
                let up = offset.1 - cell.1 * MICRO_PER_UNIT;
                moment += x * up - y * right;
                inertia += x * x + y * y;
            }
            (moment * count).checked_div(inertia).unwrap_or_default()
        };
        let turned = turned.unwrap_or_else(best);
        let (x, y) = arm(cells[member]);
        let (right, up) = rotated(
            (x * MICRO_PER_UNIT / count, y * MICRO_PER_UNIT / count),
            turned,
        );
        Fit {
            turned,
            offset: (all_offsets.0 / count + right, all_offsets.1 / count + up),
            member,
        }
    }

    /// How far the modules are off their places in a layout, in units and radians.
    pub fn farthest(&self, fit: &Fit) -> i64 {
        let base = self.cells[fit.member];
        let off = |member: usize| {
            let cell = self.cells[member];
            let arm = (cell.0 - base.0, cell.1 - base.1);
            let arm = (arm.0 * MICRO_PER_UNIT, arm.1 * MICRO_PER_UNIT);
            let (x, y) = rotated(arm, fit.turned);
            let offset = self.offsets[member];
            let right = (offset.0 - fit.offset.0 - x).abs();
            let up = (offset.1 - fit.offset.1 - y).abs();
            let heading = self.headings[member] - self.off - fit.turned;
            right.max(up).max(off_quarter(heading).abs())
        };
        let all = (0..self.cells.len()).map(off);
        all.max().unwrap_or_default()
    }
}
