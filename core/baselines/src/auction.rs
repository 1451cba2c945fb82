//! The auction algorithm with epsilon scaling, in fixed point.
//!
//! D. P. Bertsekas, "The auction algorithm for assignment and other network flow problems: a tutorial", Interfaces 20(4),
//! 1990, the paper's comparison. Modules bid for spots. Each bid raises the price of its spot by the bidder's advantage
//! there over its second choice, plus epsilon, and takes the spot from its holder. One module bids at a time (the
//! Gauss-Seidel version).
//!
//! Utilities are whole numbers, so an assignment within `n * epsilon < 1` of the optimum is optimal. To stay in whole
//! numbers, utilities are multiplied by `n + 1` and epsilon ends at 1. A price that remains from a coarser epsilon spoils
//! the result if its spot gets no bid, so both sides are filled up to `n` with stand-ins of utility zero.

/// The number of messages of an auction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AuctionCounts {
    /// Bids of modules, without those of stand-ins.
    pub bids: usize,
    /// New prices of spots, without those of stand-ins.
    pub price_updates: usize,
    /// Rounds of bidding, each with a smaller epsilon.
    pub rounds: usize,
}

/// The result of an auction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuctionOutcome {
    /// The column of each row.
    pub assignment: Vec<Option<usize>>,
    /// The number of messages.
    pub counts: AuctionCounts,
}

/// One bid; `None` is a stand-in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bid {
    /// The round, from 1. At the start of each, no row has a column.
    pub round: usize,
    /// The bidder.
    pub row: Option<usize>,
    /// The column that it gets.
    pub column: Option<usize>,
    /// The row that loses the column.
    pub displaced: Option<usize>,
}

/// Epsilon starts at the greatest difference of utilities divided by this number, and is divided by it after each round.
const EPSILON_DIVISOR: i128 = 5;

/// Assigns as many rows (modules) as possible to distinct columns (spots), with the greatest total utility.
///
/// `utilities` has a row for each module, all of the same length. Ties among a row's best columns go to the lowest; a row
/// that loses its column bids next. The result is optimal, and the same on every machine.
#[must_use]
pub fn assign(utilities: &[Vec<i64>]) -> AuctionOutcome {
    assign_observed(utilities, |_| {})
}

/// [`assign`], with a call of `observe` for every bid.
#[must_use]
pub fn assign_observed(utilities: &[Vec<i64>], mut observe: impl FnMut(Bid)) -> AuctionOutcome {
    let row_count = utilities.len();
    let column_count = utilities.first().map_or(0, Vec::len);
    let mut auction = Auction::new(utilities, row_count, column_count);
    let mut epsilon = (auction.spread() / EPSILON_DIVISOR).max(1);
    if row_count > 0 && column_count > 0 {
        loop {
            auction.run_round(epsilon, &mut observe);
            if epsilon == 1 {
                break;
            }
            epsilon = (epsilon / EPSILON_DIVISOR).max(1);
        }
    }
    AuctionOutcome {
        assignment: (0..row_count)
            .map(|row| auction.column_of[row].filter(|&column| column < column_count))
            .collect(),
        counts: auction.counts,
    }
}

struct Auction<'a> {
    utilities: &'a [Vec<i64>],
    row_count: usize,
    column_count: usize,
    /// The number of rows, and of columns, with the stand-ins.
    size: usize,
    scale: i128,
    prices: Vec<i128>,
    column_of: Vec<Option<usize>>,
    row_of: Vec<Option<usize>>,
    counts: AuctionCounts,
}

impl<'a> Auction<'a> {
    fn new(utilities: &'a [Vec<i64>], row_count: usize, column_count: usize) -> Self {
        let size = row_count.max(column_count);
        Self {
            utilities,
            row_count,
            column_count,
            size,
            scale: i128::try_from(size + 1).unwrap_or(i128::MAX),
            prices: vec![0; size],
            column_of: vec![None; size],
            row_of: vec![None; size],
            counts: AuctionCounts::default(),
        }
    }

    fn value(&self, row: usize, column: usize) -> i128 {
        if row < self.row_count && column < self.column_count {
            i128::from(self.utilities[row][column]) * self.scale
        } else {
            0
        }
    }

    /// The greatest difference between two values.
    fn spread(&self) -> i128 {
        let has_stand_ins = self.row_count != self.column_count;
        let utilities = self.utilities.iter().flatten().copied();
        let all = utilities.chain(has_stand_ins.then_some(0));
        let (least, most) = (all.clone().min(), all.max());
        (i128::from(most.unwrap_or(0)) - i128::from(least.unwrap_or(0))) * self.scale
    }

    /// All rows bid, at the prices so far, until each has a column.
    fn run_round(&mut self, epsilon: i128, observe: &mut impl FnMut(Bid)) {
        self.counts.rounds += 1;
        self.column_of.fill(None);
        self.row_of.fill(None);
        let mut waiting: Vec<usize> = (0..self.size).rev().collect();
        while let Some(row) = waiting.pop() {
            let (column, raise) = self.bid_of(row);
            self.prices[column] += raise + epsilon;
            self.counts.bids += usize::from(row < self.row_count);
            self.counts.price_updates += usize::from(column < self.column_count);
            let displaced = self.row_of[column].replace(row);
            let real_row = |row: &usize| *row < self.row_count;
            observe(Bid {
                round: self.counts.rounds,
                row: Some(row).filter(real_row),
                column: Some(column).filter(|&column| column < self.column_count),
                displaced: displaced.filter(real_row),
            });
            if let Some(loser) = displaced {
                self.column_of[loser] = None;
                waiting.push(loser);
            }
            self.column_of[row] = Some(column);
        }
    }

    /// The column of greatest profit for a row at the current prices, and the difference to the second greatest profit.
    fn bid_of(&self, row: usize) -> (usize, i128) {
        let mut best = (0, i128::MIN);
        let mut second = i128::MIN;
        for column in 0..self.size {
            let profit = self.value(row, column) - self.prices[column];
            if profit > best.1 {
                second = best.1;
                best = (column, profit);
            } else if profit > second {
                second = profit;
            }
        }
        let raise = if self.size > 1 { best.1 - second } else { 0 };
        (best.0, raise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hungarian;
    use proptest::prelude::*;

    fn total(utilities: &[Vec<i64>], assignment: &[Option<usize>]) -> i64 {
        assignment
            .iter()
            .zip(utilities)
            .filter_map(|(column, row)| column.map(|column| row[column]))
            .sum()
    }

    #[track_caller]
    fn assert_equals_hungarian(utilities: &[Vec<i64>]) {
        let rows = utilities.len();
        let columns = utilities.first().map_or(0, Vec::len);
        let outcome = assign(utilities);
        let mut taken: Vec<usize> = outcome.assignment.iter().copied().flatten().collect();
        taken.sort_unstable();
        taken.dedup();
        assert_eq!(taken.len(), rows.min(columns));
        assert_eq!(
            total(utilities, &outcome.assignment),
            total(utilities, &hungarian::assign(utilities))
        );
        assert!(outcome.counts.bids >= rows.min(columns));
        assert_bids_lead_to(utilities, &outcome);
    }

    /// Follows the observed bids, and arrives where the auction did.
    fn assert_bids_lead_to(utilities: &[Vec<i64>], outcome: &AuctionOutcome) {
        let mut held = vec![None; utilities.len()];
        let (mut round, mut bids, mut price_updates) = (0, 0, 0);
        let observed = assign_observed(utilities, |bid| {
            if bid.round > round {
                round = bid.round;
                held.fill(None);
            }
            if let Some(loser) = bid.displaced {
                held[loser] = None;
            }
            if let Some(row) = bid.row {
                held[row] = bid.column;
            }
            bids += usize::from(bid.row.is_some());
            price_updates += usize::from(bid.column.is_some());
        });
        assert_eq!(observed, *outcome);
        assert_eq!(held, outcome.assignment);
        let counts = AuctionCounts {
            bids,
            price_updates,
            rounds: round,
        };
        assert_eq!(counts, outcome.counts);
    }

    proptest! {
        #[test]
        fn as_good_as_the_hungarian_method(
            utilities in (1_usize..9, 1_usize..9).prop_flat_map(|(rows, columns)| {
                let entry = prop_oneof![-30_000_000_i64..2_000_000, -3_i64..3];
                prop::collection::vec(prop::collection::vec(entry, columns), rows)
            })
        ) {
            assert_equals_hungarian(&utilities);
        }
    }

    #[test]
    fn the_numbers_at_their_limits_fit() {
        let far = 282_842_712_474_600;
        assert_equals_hungarian(&[vec![-far, far], vec![-far, far], vec![far, -far]]);
        assert_equals_hungarian(&vec![vec![0; 12]; 12]);
        assert_equals_hungarian(&vec![vec![-5; 7]; 3]);
        assert_eq!(assign(&[]).assignment, []);
        assert_eq!(assign(&[Vec::new(), Vec::new()]).assignment, [None, None]);
    }
}
