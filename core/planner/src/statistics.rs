//! The statistics of a finished plan, as `formation plan --json` prints them.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{UnitComplex, Vector2};
use serde::Serialize;

use crate::placement::{SearchBudget, best_matching};
use crate::turns::PlanOutcome;
use formation_model::{Assignment, MicroUnits, ModuleId, PlanningProblem, Pose, SpotId, Topology};

/// The messages of all turns: one claim for each turn, received by every other module. An auction adds a sample for each
/// bid and for each new price, each of one pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MessageCounts {
    /// Samples published.
    pub samples: usize,
    /// Samples times receivers.
    pub deliveries: usize,
    /// (Spot, selector) pairs in them times receivers.
    pub pairs: usize,
}

/// Four measures of how far the initial configurations were taken apart; the paper does not say which one its "number of
/// modules disconnected" is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Disconnected {
    /// The modules that would not fit if each configuration had the whole target for itself.
    pub unmatched_on_empty_target: usize,
    /// The initial links that are not kept.
    pub broken_links: usize,
    /// The modules outside the largest retained piece of their configuration.
    pub outside_largest_piece: usize,
    /// The modules of configurations that keep no link at all.
    pub alone: usize,
}

/// The changes that a plan makes to the initial configurations and in its turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Changes {
    /// The links whose ends are in one block, or both pinned, and on adjacent spots.
    pub kept_links: usize,
    /// The initial links that are not kept.
    pub broken_links: usize,
    /// The modules that leave their configuration in some turn.
    pub detached_modules: usize,
    /// The ends of kept links at which the neighbour is at another port in the target than at the start.
    pub port_changes: usize,
    /// The evictions of all turns.
    pub evictions: usize,
    /// How far the initial configurations were taken apart.
    pub disconnected: Disconnected,
}

/// The statistics of a plan. Lengths are in units, utilities in units of utility.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// The spot of each placed module, in ascending order of modules.
    pub assignments: Vec<Assignment>,
    /// The modules without a spot.
    pub unassigned: Vec<ModuleId>,
    /// The spots that no module takes, with those trimmed.
    pub open_spots: Vec<SpotId>,
    /// The spots that were left out because there are too few modules.
    pub trimmed_spots: Vec<SpotId>,
    /// The changes to the initial configurations and in the turns.
    #[serde(flatten)]
    pub changes: Changes,
    /// The sum of all utilities.
    pub total_utility: f64,
    /// The sum of the distances of all placed modules to their spots.
    pub total_distance: f64,
    /// The longest of these distances.
    pub longest_distance: f64,
    /// Whether every block took the best place that exists.
    pub proven: bool,
    /// The spots in the order in which they are filled.
    pub assembly_order: Vec<SpotId>,
    /// The flaws of the acting order.
    pub warnings: Vec<String>,
    /// The messages of all turns.
    pub messages: MessageCounts,
}

impl Statistics {
    /// Computes the statistics of a plan.
    pub fn of(problem: &PlanningProblem, outcome: &PlanOutcome) -> Self {
        let plan = &outcome.plan;
        let receivers = problem.modules().len() - 1;
        let auction = outcome
            .auction
            .map_or(0, |counts| counts.bids + counts.price_updates);
        let samples = outcome.decisions.len() + auction;
        let decisions = outcome.decisions.iter().map(|(_, decision)| decision);
        let claimed_pairs = decisions
            .clone()
            .map(|decision| decision.selections.len())
            .sum::<usize>();
        let assignments = plan.assignments.iter();
        Self {
            assignments: assignments
                .map(|(&module, &spot)| Assignment { module, spot })
                .collect(),
            unassigned: outcome.unassigned.clone(),
            open_spots: outcome.open_spots.clone(),
            trimmed_spots: outcome.trimmed_spots.clone(),
            changes: Changes::of(problem, outcome),
            total_utility: outcome.total_utility.to_units(),
            total_distance: outcome.total_distance.to_units(),
            longest_distance: outcome.longest_distance.to_units(),
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

impl Changes {
    fn of(problem: &PlanningProblem, outcome: &PlanOutcome) -> Self {
        let links = problem.links();
        let kept_links = outcome.plan.kept_links.len();
        let broken_links = links.edges().len() - kept_links;
        let decisions = outcome.decisions.iter().map(|(_, decision)| decision);
        let detached: BTreeSet<ModuleId> = decisions
            .clone()
            .flat_map(|decision| decision.detached.iter().copied())
            .collect();
        Self {
            kept_links,
            broken_links,
            detached_modules: detached.len(),
            port_changes: port_changes(problem, outcome),
            evictions: decisions.map(|decision| decision.evictions.len()).sum(),
            disconnected: Disconnected {
                broken_links,
                ..disconnected(problem, &links, outcome)
            },
        }
    }
}

/// All measures but the number of broken links.
fn disconnected(
    problem: &PlanningProblem,
    links: &Topology,
    outcome: &PlanOutcome,
) -> Disconnected {
    let mut counts = Disconnected::default();
    let mut budget = SearchBudget::of_plan();
    // Without weights, equal configurations fit equally well.
    let mut matched: BTreeMap<Vec<(usize, usize)>, usize> = BTreeMap::new();
    let configurations = problem.configurations();
    let mut to_come = configurations.len();
    for configuration in configurations {
        let modules = &configuration.modules;
        let members: Vec<usize> = modules
            .iter()
            .filter_map(|&id| problem.position_of(id))
            .collect();
        let whole = links.induced_by(&members);
        let size = *matched.entry(whole.edges().to_vec()).or_insert_with(|| {
            let (target, weight) = (outcome.target.topology(), |_, _| Some(MicroUnits::ZERO));
            let matching = best_matching(target, &whole, weight, budget.share(to_come));
            budget.spend(matching.nodes);
            matching.pairs.len()
        });
        to_come -= 1;
        counts.unmatched_on_empty_target += members.len() - size;
        let mut kept = whole.edges().to_vec();
        kept.retain(|&(first, second)| {
            let link = (modules[first], modules[second]);
            outcome.plan.kept_links.contains(&link)
        });
        let pieces = Topology::new(members.len(), &kept).components();
        let largest = pieces.iter().map(Vec::len).max().unwrap_or(0);
        counts.outside_largest_piece += members.len() - largest;
        counts.alone += pieces.iter().filter(|piece| piece.len() == 1).count();
    }
    counts
}

/// The ends of kept links that have to undock and dock at another port although the neighbour stays the same (the grey
/// modules of the paper's case studies).
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
    let links = outcome.plan.kept_links.iter();
    links
        .flat_map(|&(first, second)| [(first, second), (second, first)])
        .filter(|&(module, neighbour)| changed(module, neighbour) == Some(true))
        .count()
}

/// A side of a module.
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
    reason = "for a report; differences are below 2^53 micro-units"
)]
fn port(own: &Pose, other: &Pose) -> Option<Port> {
    let offset = Vector2::new((other.x - own.x).0 as f64, (other.y - own.y).0 as f64);
    if offset == Vector2::zeros() {
        return None;
    }
    let rotation = UnitComplex::new(own.theta.to_units());
    let turned = rotation.inverse_transform_vector(&offset);
    let (ahead, left) = (turned.x, turned.y);
    Some(match (ahead.abs() >= left.abs(), ahead > 0.0, left > 0.0) {
        (true, true, _) => Port::Front,
        (true, false, _) => Port::Back,
        (false, _, true) => Port::Left,
        (false, _, false) => Port::Right,
    })
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
