//! The plan of one instance, and the time that the core needs for it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use formation_model::{Decision, PlanningProblem, Policy};
use formation_planner::{Planning, Statistics};
use serde::{Deserialize, Serialize};

use super::least_us;
use super::spot_table::SpotTable;

/// A plan in numbers. Lengths are in units, times in microseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanMeasurement {
    /// The time of all turns, computed one after another on one core.
    pub planning_us: f64,
    /// After each turn: the computing time since the start in microseconds, and the number of selected spots.
    pub turns: Vec<(f64, usize)>,
    /// The number of filled spots.
    pub filled_spots: usize,
    /// The number of spots that can be filled: the smaller of the numbers of modules and spots.
    pub fillable_spots: usize,
    /// The number of spots of the target.
    pub spots: usize,
    /// The sum of all utilities.
    pub utility: f64,
    /// The sum of the straight paths of all modules that have a spot.
    pub distance: f64,
    /// The number of links at the start.
    pub initial_links: usize,
    /// The number of links that are not kept.
    pub broken_links: usize,
    /// The number of ends of kept links that change their port.
    pub port_changes: usize,
    /// The number of modules that do not fit if each configuration has the whole target for itself.
    pub unmatched_on_empty_target: usize,
    /// The number of modules outside the largest retained piece of their configuration.
    pub outside_largest_piece: usize,
    /// The number of modules of configurations that keep no link.
    pub alone: usize,
    /// The number of evictions of all turns.
    pub evictions: usize,
    /// The number of broadcasts of the contender's own algorithm: one for each turn; in the paper's Algorithm 2 one more
    /// for each disconnected module; in an auction one more for each bid and each new price.
    pub broadcasts: usize,
    /// The number of claims that the protocol publishes for the plan, one for each turn.
    pub claims: usize,
    /// The (spot, selector) pairs in these claims, times receivers; an auction's bids and prices are pairs too.
    pub pairs_delivered: usize,
    /// The number of modules that receive a broadcast.
    pub receivers: usize,
}

impl PlanMeasurement {
    /// The (spot, selector) pairs that are received if each broadcast repeats the whole set, as the paper's do.
    #[must_use]
    pub fn whole_set_pairs(&self) -> usize {
        self.broadcasts * self.spots * self.receivers
    }

    /// Per cent of the spots that are selected after `percent` of the computing time.
    #[must_use]
    pub fn selected_after(&self, percent: f64) -> f64 {
        let end = self.turns.last().map_or(0.0, |turn| turn.0);
        let taken = self
            .turns
            .partition_point(|turn| turn.0 <= percent / 100.0 * end);
        let selected = self.turns[..taken].last().map_or(0, |turn| turn.1);
        100.0 * selected as f64 / self.fillable_spots as f64
    }
}

/// Plans an instance.
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
    let of_detached = match problem.parameters().policy {
        Policy::Paper => statistics.changes.detached_modules,
        _ => 0,
    };
    let disconnected = statistics.changes.disconnected;
    PlanMeasurement {
        planning_us,
        turns,
        filled_spots: outcome.plan.assignments.len(),
        fillable_spots: problem.modules().len().min(problem.target().spots().len()),
        spots: problem.target().spots().len(),
        utility: statistics.total_utility,
        distance: statistics.total_distance,
        initial_links: statistics.changes.kept_links + statistics.changes.broken_links,
        broken_links: statistics.changes.broken_links,
        port_changes: statistics.changes.port_changes,
        unmatched_on_empty_target: disconnected.unmatched_on_empty_target,
        outside_largest_piece: disconnected.outside_largest_piece,
        alone: disconnected.alone,
        evictions: statistics.changes.evictions,
        broadcasts: statistics.messages.samples + of_detached,
        claims: outcome.decisions.len(),
        pairs_delivered: statistics.messages.pairs,
        receivers: problem.modules().len() - 1,
    }
}

/// The time and the selected spots after each turn, in the fastest of `times` runs.
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
