//! The messages of an auction, bid by bid.

use std::sync::Arc;

use formation_baselines::auction::{Bid, assign_observed};
use formation_model::PlanningProblem;
use formation_planner::assignment::Instance;

use super::talk::{Moment, Talk};

/// The number of points of each curve that are kept; an auction makes thousands of bids.
const POINTS: usize = 100;

/// Holds an auction over an instance with a spot for each module.
pub(crate) fn measure(problem: &Arc<PlanningProblem>) -> Talk {
    let instance = Instance::new(Arc::clone(problem), Arc::clone(problem.target()));
    let modules = problem.modules().len();
    let utilities: Vec<Vec<i64>> = (0..modules)
        .map(|module| instance.utilities.row(module))
        .collect();
    let mut bids = Vec::new();
    let outcome = assign_observed(&utilities, |bid| bids.push(bid));
    Talk {
        modules,
        fillable_spots: modules,
        duration: POINTS as u64,
        samples: outcome.counts.bids + outcome.counts.price_updates,
        bids: outcome.counts.bids,
        course: course(&bids, &outcome.assignment),
    }
}

fn course(bids: &[Bid], assignment: &[Option<usize>]) -> Vec<Moment> {
    let mut held: Vec<Option<usize>> = vec![None; assignment.len()];
    let mut round = 0;
    let mut course = Vec::new();
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
        while course.len() < number * POINTS / bids.len() {
            let is_settled =
                |(held, end): &(&Option<usize>, &Option<usize>)| held.is_some() && held == end;
            course.push(Moment {
                at: course.len() as u64 + 1,
                samples: 2 * number,
                pairs: 2 * number,
                selected: held.iter().flatten().count(),
                settled: held.iter().zip(assignment).filter(is_settled).count(),
            });
        }
    }
    course
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
        assert_eq!(measured.course.len(), POINTS);
        let last = measured.course.last().unwrap();
        assert_eq!((last.at, last.selected, last.settled), (100, 9, 9));
        assert!(measured.bids >= 9);
        assert_eq!(
            (last.samples, last.pairs),
            (measured.samples, measured.samples)
        );
    }
}
