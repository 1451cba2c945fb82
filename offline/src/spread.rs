//! What the parameter `spread` gives up: the plan next to the one that plain distances lead to.

use std::sync::Arc;

use formation_model::{PlanningProblem, Spread};
use formation_planner::{PlanOutcome, plan};
use serde::Serialize;

/// The totals of the plan for the same problem with `spread: 0`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WithoutSpread {
    utility: f64,
    distance: f64,
    longest: f64,
}

impl WithoutSpread {
    /// Plans once more; `None` if the choice of spots has no spread.
    pub fn of(problem: &PlanningProblem) -> Option<Self> {
        if problem.parameters().spread_in_use() == Spread::ZERO {
            return None;
        }
        let outcome = plan(Arc::new(problem.with_spread(Spread::ZERO)));
        Some(Self {
            utility: outcome.total_utility.to_units(),
            distance: outcome.total_distance.to_units(),
            longest: outcome.longest_distance.to_units(),
        })
    }

    /// The differences to the claims that are made with a spread, in a sentence.
    pub fn text(&self, spread: Spread, made: &PlanOutcome) -> String {
        let (mut utility, mut distance) = (made.total_utility, made.total_distance);
        let mut longest = made.longest_distance;
        if let Some(swapped) = &made.swapped {
            utility += swapped.utility;
            distance = distance - swapped.distance;
            longest = swapped.claimed_longest;
        }
        format!(
            "spread {}: the longest distance is {:.3} units, without spread {:.3}; given up: {:.3} units of total distance, \
             {:.3} of total utility",
            f64::from(spread),
            longest.to_units(),
            self.longest,
            distance.to_units() - self.distance,
            self.utility - utility.to_units(),
        )
    }
}
