//! The result of all turns.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::planning::{Planning, Turn};
use super::swapped::Swapped;
use crate::assembly;
use formation_baselines::auction::AuctionCounts;
use formation_model::{Decision, MicroUnits, ModuleId, Plan, PlanningProblem, SpotId, Target};

/// The result of planning a problem to the end.
#[derive(Clone, Debug)]
pub struct PlanOutcome {
    /// The target that is formed: the problem's own without the spots that were trimmed.
    pub target: Arc<Target>,
    /// The plan, with its acting order.
    pub plan: Plan,
    /// Every turn with its decision.
    pub decisions: Vec<(Turn, Decision)>,
    /// All spots of the problem's target that no module takes, with those trimmed; ascending.
    pub open_spots: Vec<SpotId>,
    /// The spots that were left out because there are too few modules; ascending.
    pub trimmed_spots: Vec<SpotId>,
    /// The modules without a spot, ascending.
    pub unassigned: Vec<ModuleId>,
    /// Those of them that walls leave no way to the target.
    pub cut_off: Vec<ModuleId>,
    /// The sum of the placed modules' utilities at plain distances, the savings of kept links and the rewards of blocks.
    pub total_utility: MicroUnits,
    /// The sum of the distances of all placed modules to their spots.
    pub total_distance: MicroUnits,
    /// The longest of these distances.
    pub longest_distance: MicroUnits,
    /// Whether every block took the best place that exists; `false` when a search ended at its budget.
    pub proven: bool,
    /// The swap of spots after the claims, if the motion needs one.
    pub swapped: Option<Swapped>,
    /// The messages of the auction before the first turn; `None` under every other policy.
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
    /// The plan once no turn is left; `None` before. Each call computes the acting order.
    #[must_use]
    pub fn finish(&self) -> Option<Plan> {
        self.queue.next().is_none().then(|| self.ordered())
    }

    /// The plan as far as it is decided, with an acting order.
    pub(super) fn ordered(&self) -> Plan {
        let mut plan = self.allocated();
        plan.assembly = assembly::order(self.problem(), &plan, &self.spot_values());
        plan
    }

    /// The value of each spot of the problem's target, by position; zero for those that were trimmed.
    pub(super) fn spot_values(&self) -> Vec<MicroUnits> {
        let (target, utilities) = (&self.instance.target, &self.instance.utilities);
        let spots = self.problem().target().spots().iter();
        let value = |position| utilities.value(position);
        spots
            .map(|spot| target.position_of(spot.id).map_or(MicroUnits::ZERO, value))
            .collect()
    }

    /// Sums up a plan after [`Self::take_all_turns`]; without an acting order if turns are left.
    #[must_use]
    pub fn outcome(&self, decisions: Vec<(Turn, Decision)>) -> PlanOutcome {
        let plan = self.finish().unwrap_or_else(|| self.allocated());
        let (target, utilities) = (&self.instance.target, &self.instance.utilities);
        let mut total_utility = utilities.kept_link().times(plan.kept_links.len());
        let mut total_distance = MicroUnits::ZERO;
        let mut longest_distance = MicroUnits::ZERO;
        let mut unassigned = Vec::new();
        for (module, member) in self.problem().modules().iter().enumerate() {
            if let Some(spot) = self.allocation.table.spot_of(module) {
                let distance = utilities.distance(module, spot);
                total_utility += utilities.plain(module, spot);
                total_distance += distance;
                longest_distance = longest_distance.max(distance);
            } else {
                unassigned.push(member.id);
            }
        }
        let blocks = plan.blocks.iter();
        total_utility += blocks
            .map(|block| utilities.retention_reward(block.len()))
            .sum();
        let taken: BTreeSet<SpotId> = plan.assignments.values().copied().collect();
        let spots = self.problem().target().spots().iter().map(|spot| spot.id);
        PlanOutcome {
            target: Arc::clone(target),
            trimmed_spots: spots
                .clone()
                .filter(|&spot| target.position_of(spot).is_none())
                .collect(),
            open_spots: spots.filter(|spot| !taken.contains(spot)).collect(),
            plan,
            decisions,
            cut_off: self.cut_off(),
            unassigned,
            total_utility,
            total_distance,
            longest_distance,
            proven: self.proven,
            swapped: None,
            auction: self.whole.as_ref().and_then(|whole| whole.auction),
        }
    }

    fn cut_off(&self) -> Vec<ModuleId> {
        let modules = self.problem().modules().iter().enumerate();
        modules
            .filter(|&(position, _)| self.problem().is_cut_off(position))
            .map(|(_, module)| module.id)
            .collect()
    }

    /// The plan as far as it is decided, without an acting order.
    fn allocated(&self) -> Plan {
        let (modules, table) = (self.problem().modules(), &self.allocation.table);
        let mut block_of: BTreeMap<usize, usize> = BTreeMap::new();
        for (number, block) in self.blocks.iter().enumerate() {
            block_of.extend(block.iter().map(|&member| (member, number)));
        }
        let ids_of = |block: &Vec<usize>| block.iter().map(|&member| modules[member].id).collect();
        let mut blocks: Vec<Vec<ModuleId>> = self.blocks.iter().map(ids_of).collect();
        blocks.sort_unstable();
        let placed = modules.iter().enumerate().filter_map(|(module, member)| {
            let spot = table.spot_of(module)?;
            Some((member.id, self.spot_id(spot)))
        });
        let kept_link = |first: usize, second: usize| {
            let pinned = modules[first].pin.is_some() && modules[second].pin.is_some();
            let block = block_of.get(&first);
            let together = pinned || (block.is_some() && block == block_of.get(&second));
            let (one, other) = (table.spot_of(first)?, table.spot_of(second)?);
            let topology = self.instance.target.topology();
            (together && topology.has_edge(one, other))
                .then(|| (modules[first].id, modules[second].id))
        };
        let links = self.instance.links.edges().iter();
        Plan {
            assignments: placed.collect(),
            blocks,
            kept_links: links
                .filter_map(|&(first, second)| kept_link(first, second))
                .collect(),
            ..Plan::default()
        }
    }
}
