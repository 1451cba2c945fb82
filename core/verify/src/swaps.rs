//! Replays the swap of spots after the last claim, and checks it.

use std::collections::{BTreeMap, BTreeSet};

use super::replay::{Replay, groups, kept_links_of};
use super::violation::Violation;
use formation_model::{ModuleId, PlanningProblem, Policy, SpotId, SpotSelection};

impl Replay {
    /// Gives spots new holders, if a swap may do so: the same spots stay filled, and pinned modules stay on theirs. The policy
    /// `paper` has no swaps. Blocks that their links still join stay blocks; the modules of the others move as single ones.
    pub(super) fn swap(&mut self, problem: &PlanningProblem, turn: u32, swaps: &[SpotSelection]) {
        if swaps.is_empty() {
            return;
        }
        self.swapped = true;
        let wrong = swaps
            .iter()
            .filter(|&one| !self.may_swap(problem, swaps, one));
        let wrong = wrong.map(|&SpotSelection { spot, module }| Violation::WrongSwap {
            turn,
            spot,
            module,
        });
        let wrong: Vec<Violation> = wrong.collect();
        if !wrong.is_empty() {
            self.violations.extend(wrong);
            return;
        }
        for former in swaps.iter().filter_map(|one| self.holders.get(&one.spot)) {
            self.spots.remove(former);
        }
        for &SpotSelection { spot, module } in swaps {
            self.holders.insert(spot, module);
            self.spots.insert(module, spot);
        }
        let spots = &self.spots;
        self.blocks.retain(|block| is_joined(problem, spots, block));
    }

    fn may_swap(
        &self,
        problem: &PlanningProblem,
        swaps: &[SpotSelection],
        one: &SpotSelection,
    ) -> bool {
        let is_pinned =
            |module: ModuleId| problem.module(module).is_none_or(|one| one.pin.is_some());
        let holder = self.holders.get(&one.spot);
        let left = self.spots.get(&one.module);
        !matches!(problem.parameters().policy, Policy::Paper | Policy::Given)
            && !is_pinned(one.module)
            && holder.is_some_and(|&holder| !is_pinned(holder) && holder != one.module)
            && left.is_none_or(|left| swaps.iter().any(|other| other.spot == *left))
            && swaps
                .iter()
                .filter(|other| other.module == one.module)
                .count()
                == 1
            && swaps.iter().filter(|other| other.spot == one.spot).count() == 1
    }
}

/// Whether links that are kept join the modules of a block.
fn is_joined(
    problem: &PlanningProblem,
    spots: &BTreeMap<ModuleId, SpotId>,
    block: &[ModuleId],
) -> bool {
    let members: BTreeSet<ModuleId> = block.iter().copied().collect();
    let links = kept_links_of(problem, spots, &members);
    groups(&members, links.into_iter()).len() == 1
}
