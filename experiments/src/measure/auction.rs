//! The messages of an auction, bid by bid.

use std::sync::Arc;

use formation_baselines::auction::{Bid, assign_observed};
use formation_model::PlanningProblem;
use formation_planner::assignment::Instance;

use super::talk::{Moment, Talk, correlation, course};

/// Holds an auction over an instance with a spot for each module.
pub(crate) fn measure(problem: &Arc<PlanningProblem>) -> Talk {
    let instance = Instance::new(Arc::clone(problem), Arc::clone(problem.target()));
    let modules = problem.modules().len();
    let utilities: Vec<Vec<i64>> = (0..modules)
        .map(|module| instance.utilities.row(module))
        .collect();
    let mut bids = Vec::new();
    let outcome = assign_observed(&utilities, |bid| bids.push(bid));
    let moments = moments(&bids, &outcome.assignment);
    let duration = bids.len() as u64;
    Talk {
        modules,
        fillable_spots: modules,
        duration,
        samples: outcome.counts.bids + outcome.counts.price_updates,
        steps: outcome.counts.bids,
        correlation: correlation(&moments),
        course: course(&moments, duration),
    }
}

/// The state after each bid.
fn moments(bids: &[Bid], assignment: &[Option<usize>]) -> Vec<Moment> {
    let mut held: Vec<Option<usize>> = vec![None; assignment.len()];
    let mut round = 0;
    let mut moments = Vec::with_capacity(bids.len());
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
        let is_settled =
            |(held, end): &(&Option<usize>, &Option<usize>)| held.is_some() && held == end;
        moments.push(Moment {
            at: number as u64,
            pairs: 2 * number,
            selected: held.iter().flatten().count(),
            settled: held.iter().zip(assignment).filter(is_settled).count(),
        });
    }
    moments
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contender::Contender;
    use crate::instance::{Docked, Draw, Instance as Spec};

    #[test]
    fn curves_end_with_every_module_on_its_final_spot() {
        let spec = Spec::Generated(Draw {
            modules: 9,
            spots: 9,
            docked: Docked::Singletons,
            seed: 3,
        });
        let measured = measure(&spec.problem(Contender::Auction).unwrap());
        assert!(measured.steps >= 9);
        assert_eq!(measured.course.first(), Some(&[0, 0, 0]));
        assert_eq!(measured.course.last(), Some(&[9, 9, measured.samples]));
    }
}
