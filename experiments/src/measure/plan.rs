//! The plan of one instance, and the time that the core needs for it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use formation_model::{Decision, PlanningProblem, Policy};
use formation_planner::{Planning, Statistics, Turn};
use serde::{Deserialize, Serialize};

use super::spot_table::SpotTable;
use super::{BUDGET, POINTS, rounded};

/// A plan in numbers. Lengths are in units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanCounts {
    /// The number of modules.
    pub modules: usize,
    /// The number of spots of the target.
    pub spots: usize,
    /// The number of filled spots.
    pub filled_spots: usize,
    /// The sum of all utilities.
    pub utility: f64,
    /// The sum of the straight paths of all modules that have a spot.
    pub distance: f64,
    /// The links at the start, those that are not kept, and the ends of kept links that change their port.
    pub links: LinkCounts,
    /// Three counts of disconnected modules.
    pub disconnected: DisconnectedCounts,
    /// What the modules tell each other.
    pub messages: ContenderMessages,
}

/// The links of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinkCounts {
    /// The number of links at the start.
    pub initial: usize,
    /// The number of links that are not kept.
    pub broken: usize,
    /// The number of ends of kept links that change their port.
    pub port_changes: usize,
}

/// The modules of configurations that a plan disconnects.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DisconnectedCounts {
    /// The number of modules that do not fit if each configuration has the whole target for itself.
    pub unmatched_on_empty_target: usize,
    /// The number of modules outside the largest retained piece of their configuration.
    pub outside_largest_piece: usize,
    /// The number of modules of configurations that keep no link.
    pub alone: usize,
}

/// The messages of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContenderMessages {
    /// The number of evictions of all turns.
    pub evictions: usize,
    /// The number of broadcasts of the contender's own algorithm: one for each turn; in the paper's Algorithm 2 one more
    /// for each disconnected module; in an auction one more for each bid and each new price.
    pub broadcasts: usize,
    /// The number of claims that the protocol publishes for the plan, one for each turn.
    pub claims: usize,
    /// The (spot, selector) pairs in these claims, times receivers; an auction's bids and prices are pairs too.
    pub pairs_delivered: usize,
}

/// The time of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanTimes {
    /// The time of all turns, computed one after another on one core, in microseconds.
    pub planning_us: f64,
    /// The number of spots that can be filled.
    pub fillable_spots: usize,
    /// The number of selected spots after each twentieth of the time.
    pub selected: Vec<usize>,
}

impl PlanCounts {
    /// The number of spots that can be filled: the smaller of the numbers of modules and spots.
    #[must_use]
    pub fn fillable_spots(&self) -> usize {
        self.modules.min(self.spots)
    }

    /// The (spot, selector) pairs that are received if each broadcast repeats the whole set, as the paper's do.
    #[must_use]
    pub fn whole_set_pairs(&self) -> usize {
        self.messages.broadcasts * self.spots * self.modules.saturating_sub(1)
    }
}

impl PlanTimes {
    /// Per cent of the spots that are selected after `percent` of the computing time, a multiple of 5.
    #[must_use]
    pub fn selected_after(&self, percent: f64) -> f64 {
        let selected = self.selected.get(super::point_at(percent));
        100.0 * selected.copied().unwrap_or_default() as f64 / self.fillable_spots as f64
    }
}

/// Plans an instance.
pub(crate) fn measure(problem: &Arc<PlanningProblem>, timings: u32) -> (PlanCounts, PlanTimes) {
    let begin = Instant::now();
    let mut quickest = timed(problem);
    // The first try warms up; it counts if the time for more has passed.
    for _ in 0..timings {
        if begin.elapsed() > BUDGET {
            break;
        }
        let again = timed(problem);
        if again.elapsed < quickest.elapsed {
            quickest = again;
        }
    }
    let fillable_spots = problem.modules().len().min(problem.target().spots().len());
    let times = PlanTimes {
        planning_us: rounded(quickest.elapsed.as_secs_f64() * 1e6),
        fillable_spots,
        selected: quickest.selected(),
    };
    (counts(problem, quickest), times)
}

fn counts(problem: &Arc<PlanningProblem>, timed: Timed) -> PlanCounts {
    let outcome = timed.planning.outcome(timed.decisions);
    let statistics = Statistics::of(problem, &outcome);
    let changes = &statistics.changes;
    let of_detached = match problem.parameters().policy {
        Policy::Paper => changes.detached_modules,
        _ => 0,
    };
    PlanCounts {
        modules: problem.modules().len(),
        spots: problem.target().spots().len(),
        filled_spots: outcome.plan.assignments.len(),
        utility: rounded(statistics.total_utility),
        distance: rounded(statistics.total_distance),
        links: LinkCounts {
            initial: changes.kept_links + changes.broken_links,
            broken: changes.broken_links,
            port_changes: changes.port_changes,
        },
        disconnected: DisconnectedCounts {
            unmatched_on_empty_target: changes.disconnected.unmatched_on_empty_target,
            outside_largest_piece: changes.disconnected.outside_largest_piece,
            alone: changes.disconnected.alone,
        },
        messages: ContenderMessages {
            evictions: changes.evictions,
            broadcasts: statistics.messages.samples + of_detached,
            claims: outcome.decisions.len(),
            pairs_delivered: statistics.messages.pairs,
        },
    }
}

/// All turns of a plan, and when each of them ended.
struct Timed {
    planning: Planning,
    decisions: Vec<(Turn, Decision)>,
    ends: Vec<Duration>,
    elapsed: Duration,
}

fn timed(problem: &Arc<PlanningProblem>) -> Timed {
    let start = Instant::now();
    let mut ends = Vec::new();
    let mut planning = Planning::new(Arc::clone(problem));
    let decisions = planning.take_all_turns_with(|_, _| ends.push(start.elapsed()));
    Timed {
        elapsed: start.elapsed(),
        planning,
        decisions,
        ends,
    }
}

impl Timed {
    /// The number of selected spots after each twentieth of the time until the last turn ended.
    fn selected(&self) -> Vec<usize> {
        let mut table = SpotTable::default();
        let after: Vec<usize> = self
            .decisions
            .iter()
            .map(|(_, decision)| {
                table.apply(decision);
                table.spot_of.len()
            })
            .collect();
        let last = self.ends.last().copied().unwrap_or_default();
        let at = |point: u32| {
            let passed = last * point / (POINTS - 1);
            let taken = self.ends.partition_point(|&end| end <= passed);
            after[..taken].last().copied().unwrap_or_default()
        };
        (0..POINTS).map(at).collect()
    }
}
