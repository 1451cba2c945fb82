//! What a planner decides about one instance, and how long the core takes for it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use formation::model::{Decision, PlanningProblem, Policy};
use formation::planner::{Planning, Statistics};
use formation::verify::check_plan;
use serde::{Deserialize, Serialize};

use super::least_us;
use super::spot_table::SpotTable;

/// A plan in numbers. Lengths are in units, times in microseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanMeasurement {
    /// How long all turns take, computed one after another by one core.
    pub planning_us: f64,
    /// After each turn: the computing time so far in microseconds, from the problem on, and how many spots are selected.
    pub turns: Vec<(f64, usize)>,
    /// How many spots are filled.
    pub filled_spots: usize,
    /// How many spots could be filled: the smaller of the numbers of modules and spots.
    pub fillable_spots: usize,
    /// How many spots the target has.
    pub spots: usize,
    /// The sum of all utilities.
    pub utility: f64,
    /// The sum of the straight ways of all modules that have a spot.
    pub distance: f64,
    /// How many links there are at the start.
    pub initial_links: usize,
    /// How many of them are not kept.
    pub broken_links: usize,
    /// The ends of kept links at which another port docks.
    pub port_changes: usize,
    /// The modules that would not fit if each configuration had the whole target for itself.
    pub unmatched_on_empty_target: usize,
    /// The modules outside the largest retained piece of their configuration.
    pub outside_largest_piece: usize,
    /// The modules of configurations that keep no link.
    pub alone: usize,
    /// The evictions of all turns.
    pub evictions: usize,
    /// The broadcasts that the contender's own algorithm asks for: one a turn; in the paper's Algorithm 2 one more for
    /// each module that is disconnected; in an auction one more for each bid and each new price.
    pub broadcasts: usize,
    /// The claims that the protocol publishes for the plan, one a turn.
    pub claims: usize,
    /// The (spot, selector) pairs in these claims, times receivers; an auction's bids and prices are pairs too.
    pub pairs_delivered: usize,
    /// How many modules hear a broadcast.
    pub receivers: usize,
    /// Why an independent check refuses the plan, if it does; the paper's planner leaves holes.
    pub flaws: usize,
}

impl PlanMeasurement {
    /// The (spot, selector) pairs that are heard if each broadcast repeats the whole set, as the paper's do.
    #[must_use]
    pub fn whole_set_pairs(&self) -> usize {
        self.broadcasts * self.spots * self.receivers
    }
}

/// Plans an instance and counts.
pub(crate) fn measure(problem: &Arc<PlanningProblem>, timings: u32) -> PlanMeasurement {
    let planning_us = least_us(timings, || {
        let mut planning = Planning::new(Arc::clone(problem));
        std::hint::black_box(planning.take_all_turns());
    });
    let mut planning = Planning::new(Arc::clone(problem));
    let decisions = planning.take_all_turns();
    let turns = turns(problem, timings);
    let outcome = planning.outcome(decisions);
    let statistics = Statistics::of(problem, &outcome);
    let claims: Vec<Decision> = outcome
        .decisions
        .iter()
        .map(|(_, decision)| decision.clone())
        .collect();
    let flaws = check_plan(problem, &claims, &outcome.plan)
        .err()
        .map_or(0, |violations| violations.len());
    let of_detached = match problem.parameters().policy {
        Policy::Paper => statistics.detached_modules,
        _ => 0,
    };
    let disconnected = statistics.disconnected;
    PlanMeasurement {
        planning_us,
        turns,
        filled_spots: outcome.plan.assignments.len(),
        fillable_spots: problem.modules().len().min(problem.target().spots().len()),
        spots: problem.target().spots().len(),
        utility: statistics.total_utility,
        distance: statistics.total_distance,
        initial_links: statistics.kept_links + statistics.broken_links,
        broken_links: statistics.broken_links,
        port_changes: statistics.port_changes,
        unmatched_on_empty_target: disconnected.unmatched_on_empty_target,
        outside_largest_piece: disconnected.outside_largest_piece,
        alone: disconnected.alone,
        evictions: statistics.evictions,
        broadcasts: statistics.messages.samples + of_detached,
        claims: outcome.decisions.len(),
        pairs_delivered: statistics.messages.pairs,
        receivers: problem.modules().len() - 1,
        flaws,
    }
}

/// Takes the turns one by one and looks at the clock after each; of `times` tries the quickest.
fn turns(problem: &Arc<PlanningProblem>, times: u32) -> Vec<(f64, usize)> {
    let tries = (0..times.max(1)).map(|_| timed_turns(problem));
    let quickest = tries.min_by_key(|turns| turns.last().map(|turn| turn.0));
    let mut table = SpotTable::default();
    let turns = quickest.unwrap_or_default().into_iter();
    turns
        .map(|(elapsed, decision)| {
            table.apply(&decision);
            (elapsed.as_secs_f64() * 1e6, table.spot_of.len())
        })
        .collect()
}

fn timed_turns(problem: &Arc<PlanningProblem>) -> Vec<(Duration, Decision)> {
    let start = Instant::now();
    let mut planning = Planning::new(Arc::clone(problem));
    let mut taken = Vec::new();
    while let (Some(turn), Some(decision)) = (planning.turn(), planning.decide()) {
        if planning.apply(turn.claimant, &decision).is_err() {
            break;
        }
        taken.push((start.elapsed(), decision));
    }
    taken
}
