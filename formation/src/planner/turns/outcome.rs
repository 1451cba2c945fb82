//! What comes of all turns.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::{Planning, Turn};
use crate::model::{Decision, MicroUnits, ModuleId, Plan, PlanningProblem, SpotId, Target};
use crate::planner::baseline::AuctionCounts;

/// What planning a problem to the end gives.
#[derive(Clone, Debug)]
pub struct PlanOutcome {
    /// The target that is formed: the problem's own without the spots that were trimmed.
    pub target: Arc<Target>,
    /// The plan, with its acting order.
    pub plan: Plan,
    /// Every turn with its decision.
    pub decisions: Vec<(Turn, Decision)>,
    /// All spots of the problem's target that nobody takes, those trimmed included; ascending.
    pub open_spots: Vec<SpotId>,
    /// The spots that were left out because there are too few modules; ascending.
    pub trimmed_spots: Vec<SpotId>,
    /// The modules without a spot, ascending.
    pub unassigned: Vec<ModuleId>,
    /// The sum of all utilities: each placed module's own, what kept links save, and each block's reward.
    pub total_utility: MicroUnits,
    /// The sum of the straight ways of all placed modules.
    pub total_distance: MicroUnits,
    /// Whether every block took the best place there is; `false` when a search was cut at its budget.
    pub proven: bool,
    /// What the auction said before the first turn; `None` under every other policy.
    pub auction: Option<AuctionCounts>,
}

/// Runs all turns at once: the offline planner.
#[must_use]
pub fn plan(problem: Arc<PlanningProblem>) -> PlanOutcome {
    let mut planning = Planning::new(problem);
    let decisions = planning.take_all_turns();
    planning.outcome(decisions)
}

impl Planning {
    /// Sums up a plan after [`Self::take_all_turns`]; without its acting order if turns are left.
    #[must_use]
    pub fn outcome(&self, decisions: Vec<(Turn, Decision)>) -> PlanOutcome {
        let plan = self.finish().unwrap_or_else(|| self.allocated());
        let utilities = &self.instance.utilities;
        let mut total_utility = utilities.kept_link().times(plan.kept_links.len());
        let mut total_distance = MicroUnits::ZERO;
        let mut unassigned = Vec::new();
        for (module, member) in self.problem().modules().iter().enumerate() {
            if let Some(spot) = self.allocation.table.spot_of(module) {
                total_utility += utilities.of(module, spot);
                total_distance += member
                    .pose
                    .distance_to(&self.instance.target.spots()[spot].pose);
            } else {
                unassigned.push(member.id);
            }
        }
        total_utility += plan
            .blocks
            .iter()
            .map(|block| utilities.retention_reward(block.len()))
            .sum();
        let taken: BTreeSet<SpotId> = plan.assignments.values().copied().collect();
        PlanOutcome {
            target: Arc::clone(&self.instance.target),
            open_spots: self
                .problem()
                .target()
                .spots()
                .iter()
                .map(|spot| spot.id)
                .filter(|spot| !taken.contains(spot))
                .collect(),
            trimmed_spots: self.trimmed_spots.clone(),
            plan,
            decisions,
            unassigned,
            total_utility,
            total_distance,
            proven: self.proven,
            auction: self.auction_counts(),
        }
    }

    /// The plan as far as it is decided, without an acting order.
    pub(super) fn allocated(&self) -> Plan {
        let mut plan = Plan::default();
        let mut block_of: BTreeMap<usize, usize> = BTreeMap::new();
        for (number, block) in self.blocks.iter().enumerate() {
            block_of.extend(block.iter().map(|&member| (member, number)));
            plan.blocks
                .push(block.iter().map(|&member| self.module_id(member)).collect());
        }
        plan.blocks.sort_unstable();
        for (module, member) in self.problem().modules().iter().enumerate() {
            if let Some(spot) = self.allocation.table.spot_of(module) {
                plan.assignments.insert(member.id, self.spot_id(spot));
            }
        }
        let pinned = |module: usize| self.problem().modules()[module].pin.is_some();
        plan.kept_links = self
            .instance
            .links
            .edges()
            .iter()
            .filter(|&&(first, second)| {
                let together = (pinned(first) && pinned(second))
                    || matches!(
                        (block_of.get(&first), block_of.get(&second)),
                        (Some(one), Some(other)) if one == other
                    );
                let spots = (
                    self.allocation.table.spot_of(first),
                    self.allocation.table.spot_of(second),
                );
                together
                    && matches!(spots, (Some(one), Some(other))
                        if self.instance.target.topology().has_edge(one, other))
            })
            .map(|&(first, second)| (self.module_id(first), self.module_id(second)))
            .collect::<BTreeSet<_>>();
        plan
    }
}
