//! The computation of one turn, by policy.

use super::planning::Planning;
use super::turn_order::Unit;
use super::turn_result::TurnResult;
use super::{block_allocation, claiming};
use crate::assignment::{self, Holder};
use crate::baseline::PaperTurn;
use formation_model::{Decision, EvictionRecord, ModuleId, Policy, SpotSelection};

impl Planning {
    /// The decision of the unit whose turn it is, computed at the first call of the turn.
    pub(super) fn compute(&mut self) -> Option<&Decision> {
        if self.pending.is_none() {
            let unit = self.queue.next()?.clone();
            let mut result = TurnResult {
                allocation: self.allocation.clone(),
                proven: true,
                ..TurnResult::default()
            };
            match self.instance.problem.parameters().policy {
                Policy::Exact => self.decide_exactly(&unit, &mut result),
                Policy::Paper => self.decide_as_in_the_paper(&unit, &mut result),
                Policy::Auction | Policy::Hungarian | Policy::Given | Policy::Own(_) => {
                    if let Some(whole) = &self.whole {
                        claiming::claim(&self.instance, whole, &unit, &mut result);
                    }
                }
            }
            self.pending = Some((self.decision_of(&result), result));
        }
        self.pending.as_ref().map(|(decision, _)| decision)
    }

    fn decide_exactly(&mut self, unit: &Unit, result: &mut TurnResult) {
        let (instance, search) = (&self.instance, &mut self.search);
        if unit.is_block() {
            let nodes_max = self.budget.share(self.queue.block_count());
            block_allocation::allocate(
                instance,
                search,
                &unit.members,
                &self.queue,
                nodes_max,
                result,
            );
            return;
        }
        let (allocation, evictions) = (&mut result.allocation, &mut result.evictions);
        if self.queue.exact_finish_is_due(instance) {
            let entered = assignment::finish(instance, allocation, Vec::new(), evictions);
            result.detached.extend(instance.linked(entered));
        } else {
            search.allocate(instance, allocation, unit.leader, evictions);
        }
    }

    fn decide_as_in_the_paper(&mut self, unit: &Unit, result: &mut TurnResult) {
        let nodes_max = self.budget.share(self.queue.block_count());
        let mut turn = PaperTurn {
            nodes_max,
            instance: &self.instance,
            favourites: &mut self.favourites,
            table: &mut result.allocation.table,
            evictions: &mut result.evictions,
        };
        if unit.is_block() {
            let block = turn.allocate_block(&unit.members);
            (result.blocks, result.detached) = (block.blocks, block.detached);
            (result.proven, result.nodes) = (block.proven, block.nodes);
        } else {
            turn.allocate_spot(unit.leader);
        }
    }

    /// The decision with identifiers instead of positions.
    fn decision_of(&self, result: &TurnResult) -> Decision {
        let before = self.allocation.table.holders().iter();
        let changes = before.zip(result.allocation.table.holders()).enumerate();
        let selections = changes.filter_map(|(spot, (before, after))| match *after {
            Holder::Singleton(module) | Holder::Fixed(module) if before != after => {
                Some(SpotSelection {
                    spot: self.spot_id(spot),
                    module: self.module_id(module),
                })
            }
            _ => None,
        });
        let evictions = result.evictions.iter().map(|displacement| EvictionRecord {
            evicted: self.module_id(displacement.evicted),
            by: self.module_id(displacement.by),
            from: self.spot_id(displacement.from),
            to: displacement.to.map(|spot| self.spot_id(spot)),
        });
        let detached = result.detached.iter();
        let mut detached: Vec<ModuleId> = detached.map(|&module| self.module_id(module)).collect();
        detached.sort_unstable();
        Decision {
            selections: selections.collect(),
            evictions: evictions.collect(),
            detached,
            swaps: Vec::new(),
        }
    }
}
