//! Exact assignment of a node's children to a spot's neighbours, for the common-subtree programmes.

use std::ops::Add;

use formation_model::MicroUnits;

/// Marks a row without a column; no spot has that many neighbours.
pub(crate) const NO_COLUMN: u16 = u16::MAX;

/// A number of matched modules and their utility, ordered by number, then by utility.
///
/// Both share 128 bits: a sum of utilities stays within 64 bits (see [`formation_model::WEIGHT_LIMIT`]), so one addition adds
/// both and one comparison compares both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Score(i128);

impl Score {
    /// No matched module. Every match scores higher, whatever its utility.
    pub(crate) const NOTHING: Self = Self(0);

    /// One matched module.
    pub(crate) fn of_one(utility: i64) -> Self {
        Self((1 << 64) + i128::from(utility))
    }

    /// Some matched modules and their utility.
    pub(crate) fn of(count: usize, utility: usize) -> Self {
        let wide = |number: usize| i128::try_from(number).unwrap_or(i128::MAX);
        Self((wide(count) << 64) + wide(utility))
    }

    /// The utility.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the low 64 bits are the utility in two's complement"
    )]
    pub(crate) fn utility(self) -> MicroUnits {
        MicroUnits(self.0 as i64)
    }
}

impl Add for Score {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

/// Assigns rows to distinct columns with the greatest total score; a row can stay without a column.
///
/// Successive shortest augmenting paths with dual potentials (R. Jonker and A. Volgenant, "A shortest augmenting path
/// algorithm for dense and sparse linear assignment problems", Computing 38, 1987). Buffers are kept between calls.
#[derive(Clone, Debug, Default)]
pub(crate) struct SmallAssignment {
    column_count: usize,
    /// The costs of pairs, row after row: minus their scores.
    costs: Vec<i128>,
    solution: Solution,
    /// The solution of the last call of [`Self::without`].
    reduced: Solution,
    search: Search,
}

#[derive(Clone, Debug, Default)]
struct Solution {
    row_potential: Vec<i128>,
    column_potential: Vec<i128>,
    row_of: Vec<Option<usize>>,
    column_of: Vec<u16>,
}

#[derive(Clone, Debug, Default)]
struct Search {
    distance: Vec<i128>,
    previous_row: Vec<usize>,
    done: Vec<bool>,
}

impl SmallAssignment {
    /// Solves for `row_count` rows. `scores` lists the pairs row after row; each is at least [`Score::NOTHING`].
    pub(crate) fn solve(
        &mut self,
        row_count: usize,
        column_count: usize,
        scores: impl Iterator<Item = Score>,
    ) {
        self.column_count = column_count;
        self.costs.clear();
        self.costs.extend(scores.map(|score| -score.0));
        let solution = &mut self.solution;
        solution.row_potential.clear();
        solution.row_potential.resize(row_count, 0);
        solution.column_potential.clear();
        solution.column_potential.resize(column_count, 0);
        solution.row_of.clear();
        solution.row_of.resize(column_count, None);
        solution.column_of.clear();
        solution.column_of.resize(row_count, NO_COLUMN);
        for row in 0..row_count {
            self.search
                .insert(&self.costs, &mut self.solution, row, NO_COLUMN);
        }
    }

    /// The total score.
    pub(crate) fn score(&self) -> Score {
        self.score_of(&self.solution)
    }

    /// The column of each row.
    pub(crate) fn columns(&self) -> &[u16] {
        &self.solution.column_of
    }

    /// The total score and the column of each row if no row may use `column`.
    pub(crate) fn without(&mut self, column: u16) -> (Score, &[u16]) {
        let Some(row) = self.solution.row_of[usize::from(column)] else {
            return (self.score(), &self.solution.column_of);
        };
        // The other rows are optimal for the remaining columns, so one more augmenting path restores optimality.
        self.reduced.clone_from(&self.solution);
        self.reduced.row_of[usize::from(column)] = None;
        self.reduced.column_of[row] = NO_COLUMN;
        self.reduced.row_potential[row] = 0;
        self.search
            .insert(&self.costs, &mut self.reduced, row, column);
        (self.score_of(&self.reduced), &self.reduced.column_of)
    }

    fn score_of(&self, solution: &Solution) -> Score {
        let mut total = 0;
        for (row, &column) in solution.column_of.iter().enumerate() {
            if column != NO_COLUMN {
                total -= self.costs[row * self.column_count + usize::from(column)];
            }
        }
        Score(total)
    }
}

impl Search {
    /// Inserts an unmatched row along the cheapest augmenting path. The path ends at a free column, or at cost zero with a
    /// row that stays without one. No row may use the column `forbidden`.
    fn insert(&mut self, costs: &[i128], solution: &mut Solution, source: usize, forbidden: u16) {
        let column_count = solution.row_of.len();
        self.distance.clear();
        self.distance.resize(column_count, i128::MAX);
        self.previous_row.clear();
        self.previous_row.resize(column_count, source);
        self.done.clear();
        self.done.resize(column_count, false);
        if let Some(done) = self.done.get_mut(usize::from(forbidden)) {
            *done = true;
        }
        let mut row = source;
        let mut base = 0;
        // The row that is cheapest to leave without a column, and the cost.
        let mut drop = (-solution.row_potential[source], source);
        let end_column = loop {
            let mut nearest: Option<(i128, usize)> = None;
            for column in 0..column_count {
                if self.done[column] {
                    continue;
                }
                let length = base + costs[row * column_count + column]
                    - solution.row_potential[row]
                    - solution.column_potential[column];
                if length < self.distance[column] {
                    self.distance[column] = length;
                    self.previous_row[column] = row;
                }
                if nearest.is_none_or(|(distance, _)| self.distance[column] < distance) {
                    nearest = Some((self.distance[column], column));
                }
            }
            let Some((distance, column)) = nearest.filter(|&(distance, _)| distance < drop.0)
            else {
                break None;
            };
            let Some(holder) = solution.row_of[column] else {
                break Some((distance, column));
            };
            self.done[column] = true;
            base = distance;
            row = holder;
            let dropped = base - solution.row_potential[row];
            if dropped < drop.0 {
                drop = (dropped, row);
            }
        };
        let total = end_column.map_or(drop.0, |(distance, _)| distance);
        for column in 0..column_count {
            if self.done[column] && column != usize::from(forbidden) {
                let slack = total - self.distance[column];
                solution.column_potential[column] -= slack;
                if let Some(holder) = solution.row_of[column] {
                    solution.row_potential[holder] += slack;
                }
            }
        }
        solution.row_potential[source] += total;
        let column = match end_column {
            Some((_, column)) => column,
            None if drop.1 == source => return,
            None => {
                let freed = usize::from(solution.column_of[drop.1]);
                solution.column_of[drop.1] = NO_COLUMN;
                freed
            }
        };
        solution.augment(&self.previous_row, source, column);
    }
}

impl Solution {
    /// Moves rows along the path that begins at the row `source` and ends at `column`.
    fn augment(&mut self, previous_row: &[usize], source: usize, mut column: usize) {
        loop {
            let taker = previous_row[column];
            let left = self.column_of[taker];
            self.row_of[column] = Some(taker);
            self.column_of[taker] = u16::try_from(column).unwrap_or(NO_COLUMN);
            if taker == source {
                break;
            }
            column = usize::from(left);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The best score of all assignments of the rows from `row` on to distinct columns, or to none.
    fn brute_force(scores: &[Vec<Score>], row: usize, used: &mut Vec<bool>) -> Score {
        if row == scores.len() {
            return Score::NOTHING;
        }
        let mut best = brute_force(scores, row + 1, used);
        for column in 0..used.len() {
            if !used[column] {
                used[column] = true;
                best = best.max(scores[row][column] + brute_force(scores, row + 1, used));
                used[column] = false;
            }
        }
        best
    }

    proptest::proptest! {
        #[test]
        fn equals_brute_force_with_and_without_each_column(
            table in proptest::collection::vec(
                proptest::collection::vec(proptest::option::weighted(0.8, (1_u8..4, -50_i64..50)), 5),
                1..5,
            ),
        ) {
            let scores: Vec<Vec<Score>> = table
                .iter()
                .map(|row| {
                    row.iter()
                        .map(|entry| entry.map_or(Score::NOTHING, |(size, utility)| {
                            Score((i128::from(size) << 64) + i128::from(utility))
                        }))
                        .collect()
                })
                .collect();
            let mut assignment = SmallAssignment::default();
            assignment.solve(scores.len(), 5, scores.iter().flatten().copied());
            proptest::prop_assert_eq!(
                assignment.score(),
                brute_force(&scores, 0, &mut vec![false; 5])
            );
            for column in 0..5_u16 {
                let mut used = vec![false; 5];
                used[usize::from(column)] = true;
                let (score, columns) = assignment.without(column);
                proptest::prop_assert!(!columns.contains(&column));
                proptest::prop_assert_eq!(score, brute_force(&scores, 0, &mut used));
            }
        }
    }
}
