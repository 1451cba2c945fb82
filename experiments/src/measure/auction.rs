//! What is said in an auction, bid by bid.

use std::sync::Arc;

use formation::model::PlanningProblem;
use formation::planner::assignment::Instance;
use formation::planner::baseline::auction::{Bid, assign_observed};
use serde::{Deserialize, Serialize};

/// How many points of each curve are kept; an auction makes thousands of bids.
const POINTS: usize = 100;

/// An auction in numbers. Its time is counted in bids.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AuctionMeasurement {
    /// How many modules bid.
    pub modules: usize,
    /// Bids of all rounds.
    pub bids: usize,
    /// New prices of all rounds.
    pub price_updates: usize,
    /// Rounds, each with a smaller epsilon.
    pub rounds: usize,
    /// After each hundredth of the bids: how many modules hold some spot.
    pub holding: Vec<usize>,
    /// After each hundredth of the bids: how many modules hold the spot that they have in the end.
    pub settled: Vec<usize>,
}

impl AuctionMeasurement {
    /// Bids and new prices, each a message to all.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.bids + self.price_updates
    }

    /// The same times those that hear them; each names one pair of a spot and a module.
    #[must_use]
    pub fn deliveries(&self) -> usize {
        self.samples() * self.modules.saturating_sub(1)
    }
}

/// Holds an auction over an instance with a spot for each module.
pub(crate) fn measure(problem: &Arc<PlanningProblem>) -> AuctionMeasurement {
    let instance = Instance::new(Arc::clone(problem), Arc::clone(problem.target()));
    let modules = problem.modules().len();
    let utilities: Vec<Vec<i64>> = (0..modules)
        .map(|module| instance.utilities.row(module))
        .collect();
    let mut bids = Vec::new();
    let outcome = assign_observed(&utilities, |bid| bids.push(bid));
    let (holding, settled) = curves(&bids, &outcome.assignment);
    AuctionMeasurement {
        modules,
        bids: outcome.counts.bids,
        price_updates: outcome.counts.price_updates,
        rounds: outcome.counts.rounds,
        holding,
        settled,
    }
}

fn curves(bids: &[Bid], assignment: &[Option<usize>]) -> (Vec<usize>, Vec<usize>) {
    let mut held: Vec<Option<usize>> = vec![None; assignment.len()];
    let mut round = 0;
    let (mut holding, mut settled) = (Vec::new(), Vec::new());
    for (number, bid) in (1..).zip(bids) {
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
        // The last bid that begins no later than each hundredth.
        while holding.len() < number * POINTS / bids.len() {
            holding.push(held.iter().flatten().count());
            let at_home =
                |(held, end): &(&Option<usize>, &Option<usize>)| held.is_some() && held == end;
            settled.push(held.iter().zip(assignment).filter(at_home).count());
        }
    }
    (holding, settled)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contender::Contender;
    use crate::instance::{Docked, Instance as Spec};

    #[test]
    fn curves_end_with_everybody_at_home() {
        let spec = Spec::Generated {
            modules: 9,
            spots: 9,
            docked: Docked::Singletons,
            seed: 3,
        };
        let measured = measure(&spec.problem(Contender::Auction).unwrap());
        assert_eq!(measured.holding.len(), POINTS);
        assert_eq!(measured.settled.len(), POINTS);
        assert_eq!(measured.holding.last(), Some(&9));
        assert_eq!(measured.settled.last(), Some(&9));
        assert!(measured.bids >= 9 && measured.price_updates == measured.bids);
    }
}
