//! The optimal assignment by a third-party solver.

use pathfinding::matrix::Matrix;
use pathfinding::prelude::kuhn_munkres;

/// The greatest total of `utilities[module][spot]` over all assignments that fill the greatest possible number of spots.
pub fn best_total(utilities: &[Vec<i64>]) -> i64 {
    let rows = utilities.len();
    let columns = utilities.first().map_or(0, Vec::len);
    if rows == 0 || columns == 0 {
        return 0;
    }
    let matrix = if rows <= columns {
        Matrix::from_fn(rows, columns, |(row, column)| utilities[row][column])
    } else {
        Matrix::from_fn(columns, rows, |(column, row)| utilities[row][column])
    };
    kuhn_munkres(&matrix).0
}
