//! What there is to report of a finished plan, as `formation plan --json` prints it.

use std::collections::BTreeSet;

use serde::Serialize;

use crate::model::{Assignment, MicroUnits, ModuleId, PlanningProblem, Pose, SpotId, Topology};
use crate::planner::PlanOutcome;
use crate::planner::turns::block_allocation::best_matching;

/// How much was said while units took their turns: one claim a turn, heard by every other module. An auction adds a
/// sample for each bid and for each new price, each of one pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MessageCounts {
    /// Samples published.
    pub samples: usize,
    /// Samples times receivers.
    pub deliveries: usize,
    /// (Spot, selector) pairs in them times receivers.
    pub pairs: usize,
}

/// How far the initial configurations were taken apart, counted in four ways; the paper's "number of modules
/// disconnected" leaves open which one it means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Disconnected {
    /// The modules of all configurations that would not fit if each had the whole target for itself.
    pub unmatched_on_empty_target: usize,
    /// The initial links that are not kept.
    pub broken_links: usize,
    /// The modules outside the largest retained piece of their configuration.
    pub outside_largest_piece: usize,
    /// The modules of configurations that keep no link at all.
    pub alone: usize,
}

/// Everything there is to report of a plan. Lengths are in units, utilities in units of utility.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// Who takes which spot, by module.
    pub assignments: Vec<Assignment>,
    /// The modules without a spot.
    pub unassigned: Vec<ModuleId>,
    /// The spots that nobody takes, those trimmed included.
    pub open_spots: Vec<SpotId>,
    /// The spots that were left out because there are too few modules.
    pub trimmed_spots: Vec<SpotId>,
    /// The links of which both ends are in one block, on adjacent spots.
    pub kept_links: usize,
    /// The initial links that are not kept.
    pub broken_links: usize,
    /// The modules that leave their configuration in some turn.
    pub detached_modules: usize,
    /// The ends of kept links at which the neighbour is at another port in the target than at the start.
    pub port_changes: usize,
    /// The evictions of all turns.
    pub evictions: usize,
    /// Four ways of counting what was taken apart.
    pub disconnected: Disconnected,
    /// The sum of all utilities.
    pub total_utility: f64,
    /// The sum of all straight ways.
    pub total_distance: f64,
    /// Whether every block took the best place there is.
    pub proven: bool,
    /// The spots in the order in which they are filled.
    pub assembly_order: Vec<SpotId>,
    /// What people should know of the acting order.
    pub warnings: Vec<String>,
    /// How much was said.
    pub messages: MessageCounts,
}

impl Statistics {
    /// Counts what a plan keeps, breaks and costs.
    #[must_use]
    pub fn of(problem: &PlanningProblem, outcome: &PlanOutcome) -> Self {
        let plan = &outcome.plan;
        let receivers = problem.modules().len() - 1;
        let auction = outcome
            .auction
            .map_or(0, |counts| counts.bids + counts.price_updates);
        let samples = outcome.decisions.len() + auction;
        let claimed_pairs: usize = outcome
            .decisions
            .iter()
            .map(|(_, decision)| decision.selections.len())
            .sum();
        let initial_links = problem
            .modules()
            .iter()
            .map(|module| module.links.len())
            .sum::<usize>()
            / 2;
        let detached: BTreeSet<ModuleId> = outcome
            .decisions
            .iter()
            .flat_map(|(_, decision)| decision.detached.iter().copied())
            .collect();
        let broken_links = initial_links - plan.kept_links.len();
        Self {
            assignments: plan
                .assignments
                .iter()
                .map(|(&module, &spot)| Assignment { module, spot })
                .collect(),
            unassigned: outcome.unassigned.clone(),
            open_spots: outcome.open_spots.clone(),
            trimmed_spots: outcome.trimmed_spots.clone(),
            kept_links: plan.kept_links.len(),
            broken_links,
            detached_modules: detached.len(),
            port_changes: port_changes(problem, outcome),
            evictions: outcome
                .decisions
                .iter()
                .map(|(_, decision)| decision.evictions.len())
                .sum(),
            disconnected: Disconnected {
                broken_links,
                ..disconnected(problem, outcome)
            },
            total_utility: outcome.total_utility.to_units(),
            total_distance: outcome.total_distance.to_units(),
            proven: outcome.proven,
            assembly_order: plan.assembly.spots().collect(),
            warnings: plan
                .assembly
                .warnings
                .iter()
                .map(ToString::to_string)
                .collect(),
            messages: MessageCounts {
                samples,
                deliveries: samples * receivers,
                pairs: (claimed_pairs + auction) * receivers,
            },
        }
    }
}

fn disconnected(problem: &PlanningProblem, outcome: &PlanOutcome) -> Disconnected {
    let mut counts = Disconnected::default();
    for configuration in problem.configurations() {
        let members = &configuration.modules;
        let edges_where = |keeps: &dyn Fn(ModuleId, ModuleId) -> bool| {
            let mut edges = Vec::new();
            for (first, &id) in members.iter().enumerate() {
                let links = problem.module(id).map(|module| &module.links);
                for &other in links.into_iter().flatten().filter(|&&other| other > id) {
                    if let Ok(second) = members.binary_search(&other)
                        && keeps(id, other)
                    {
                        edges.push((first, second));
                    }
                }
            }
            Topology::new(members.len(), &edges)
                .unwrap_or_else(|_| Topology::without_edges(members.len()))
        };
        let whole = edges_where(&|_, _| true);
        let matching = best_matching(outcome.target.topology(), &whole, |_, _| {
            Some(MicroUnits::ZERO)
        });
        counts.unmatched_on_empty_target += members.len() - matching.pairs.len();
        let kept = edges_where(&|first, second| outcome.plan.kept_links.contains(&(first, second)));
        let pieces = kept.components_within(|_| true);
        let largest = pieces.iter().map(Vec::len).max().unwrap_or(0);
        counts.outside_largest_piece += members.len() - largest;
        counts.alone += pieces.iter().filter(|piece| piece.len() == 1).count();
    }
    counts
}

/// Counts the ends of kept links at which one undocking and one redocking are due although the neighbour stays the
/// same (the grey modules of the paper's case studies).
fn port_changes(problem: &PlanningProblem, outcome: &PlanOutcome) -> usize {
    let spot_pose = |module: ModuleId| {
        let spot = outcome.plan.assignments.get(&module)?;
        Some(problem.target().spot(*spot)?.pose)
    };
    let start_pose = |module: ModuleId| problem.module(module).map(|module| module.pose);
    let changed = |module: ModuleId, neighbour: ModuleId| {
        let before = port(&start_pose(module)?, &start_pose(neighbour)?)?;
        let after = port(&spot_pose(module)?, &spot_pose(neighbour)?)?;
        Some(before != after)
    };
    outcome
        .plan
        .kept_links
        .iter()
        .flat_map(|&(first, second)| [(first, second), (second, first)])
        .filter(|&(module, neighbour)| changed(module, neighbour) == Some(true))
        .count()
}

/// The side of a module on which its neighbour is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Port {
    Front,
    Left,
    Back,
    Right,
}

/// The port of a module at `own` that faces a neighbour at `other`; `None` if both are at one point.
#[expect(
    clippy::cast_precision_loss,
    reason = "a report, not a decision; differences are below 2^53 micro-units"
)]
fn port(own: &Pose, other: &Pose) -> Option<Port> {
    let (dx, dy) = ((other.x - own.x).0 as f64, (other.y - own.y).0 as f64);
    if own.x == other.x && own.y == other.y {
        return None;
    }
    let (sine, cosine) = own.theta.to_units().sin_cos();
    let (ahead, leftward) = (dx * cosine + dy * sine, dy * cosine - dx * sine);
    Some(
        match (ahead.abs() >= leftward.abs(), ahead > 0.0, leftward > 0.0) {
            (true, true, _) => Port::Front,
            (true, false, _) => Port::Back,
            (false, _, true) => Port::Left,
            (false, _, false) => Port::Right,
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_turn_with_the_module() {
        let at = |x: f64, y: f64, theta: f64| Pose::from_units(x, y, theta).unwrap();
        let east = at(1.0, 0.1, 0.0);
        assert_eq!(port(&at(0.0, 0.0, 0.0), &east), Some(Port::Front));
        assert_eq!(port(&at(0.0, 0.0, 1.5), &east), Some(Port::Right));
        assert_eq!(port(&at(0.0, 0.0, 3.1), &east), Some(Port::Back));
        assert_eq!(port(&at(0.0, 0.0, -1.5), &east), Some(Port::Left));
        assert_eq!(port(&east, &east), None);
    }
}
