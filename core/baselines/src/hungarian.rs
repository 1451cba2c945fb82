//! The Hungarian method, by the `pathfinding` crate: the optimal assignment of single modules to spots.

use pathfinding::matrix::Matrix;
use pathfinding::prelude::kuhn_munkres;

/// Assigns as many rows (modules) as possible to distinct columns (spots), with the greatest total utility.
///
/// `utilities` has a row for each module, all of the same length. A total must fit an `i64`, as is the case for weights
/// within `WEIGHT_LIMIT` of the model. Returns the column of each row.
#[must_use]
pub fn assign(utilities: &[Vec<i64>]) -> Vec<Option<usize>> {
    let row_count = utilities.len();
    let column_count = utilities.first().map_or(0, Vec::len);
    if row_count == 0 || column_count == 0 {
        return vec![None; row_count];
    }
    // The solver needs at least as many columns as rows.
    if row_count <= column_count {
        let matrix = Matrix::from_fn(row_count, column_count, |(row, column)| {
            utilities[row][column]
        });
        return kuhn_munkres(&matrix).1.into_iter().map(Some).collect();
    }
    let matrix = Matrix::from_fn(column_count, row_count, |(column, row)| {
        utilities[row][column]
    });
    let mut assignment = vec![None; row_count];
    for (column, row) in kuhn_munkres(&matrix).1.into_iter().enumerate() {
        assignment[row] = Some(column);
    }
    assignment
}
