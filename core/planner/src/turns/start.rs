//! The state before the first turn.

use std::sync::Arc;

use super::planning::Planning;
use super::trimming;
use super::turn_order::{TurnQueue, Unit};
use crate::assignment::{Allocation, ChainSearch, Holder, Instance};
use crate::baseline::Favourites;
use crate::placement::SearchBudget;
use crate::policies::WholeAllocation;
use formation_model::{PlanningProblem, SpotId, Target, TurnOrder};

impl Planning {
    /// Starts to plan. With fewer candidates than spots, the target is trimmed first, unless the parameters forbid it or the policy is the
    /// paper's, which does not trim.
    pub fn new(problem: Arc<PlanningProblem>) -> Self {
        let mut budget = SearchBudget::of_plan();
        let full = Arc::clone(problem.target());
        let order = problem.parameters().order;
        let candidates = problem.candidate_count();
        let is_trimmed = candidates > 0 && candidates < full.spots().len();
        if !problem.parameters().trims_target() || !is_trimmed {
            return Self::for_target(problem, full, order, &[], budget);
        }
        let half = budget.half();
        let mut dry_run = Self::for_target(
            Arc::clone(&problem),
            Arc::clone(&full),
            TurnOrder::SizeFirst,
            &[],
            half,
        );
        dry_run.take_all_turns();
        budget.spend(dry_run.budget.spent_since(half));
        let trimmed = trimming::trim(&dry_run.instance, &dry_run.holding_sizes());
        let closed = trimmed.closed.iter().map(|&spot| full.spots()[spot].id);
        let closed: Vec<SpotId> = closed.collect();
        let target = full.restricted_to(&trimmed.kept);
        debug_assert!(target.is_some(), "trimming keeps the target connected");
        Self::for_target(
            problem,
            target.map_or(full, Arc::new),
            order,
            &closed,
            budget,
        )
    }

    #[cfg(test)]
    pub(super) fn with_budget(problem: Arc<PlanningProblem>, nodes: u64) -> Self {
        let (target, order) = (Arc::clone(problem.target()), problem.parameters().order);
        Self::for_target(problem, target, order, &[], SearchBudget::of(nodes))
    }

    /// Plans for a target made of spots of the problem's own, of which the spots `closed` stay empty.
    /// Enforces P2.
    pub(super) fn for_target(
        problem: Arc<PlanningProblem>,
        target: Arc<Target>,
        order: TurnOrder,
        closed: &[SpotId],
        budget: SearchBudget,
    ) -> Self {
        let instance = Instance::new(problem, target);
        let (problem, target) = (&instance.problem, &instance.target);
        let module_count = instance.module_count();
        let mut allocation = Allocation::new(module_count, target.spots().len());
        for (position, module) in problem.modules().iter().enumerate() {
            if let Some(spot) = module.pin.and_then(|pin| target.position_of(pin)) {
                allocation.table.give(spot, Holder::Fixed(position));
            }
        }
        for spot in closed.iter().filter_map(|&spot| target.position_of(spot)) {
            allocation.table.close(spot);
        }
        let whole = WholeAllocation::of(&instance, &allocation.table);
        let places_blocks = whole.as_ref().is_none_or(|whole| whole.keeps_links);
        let mut queue = TurnQueue::new(order);
        for unit in initial_units(&instance, &allocation, places_blocks) {
            queue.insert(&instance, unit);
        }
        Self {
            queue,
            search: ChainSearch::default(),
            favourites: Favourites::new(module_count),
            whole,
            allocation,
            instance,
            applied_turns: 0,
            blocks: Vec::new(),
            proven: true,
            budget,
            pending: None,
        }
    }

    /// For each spot, the number of modules of the unit that holds it; 0 for a spot without a holder.
    fn holding_sizes(&self) -> Vec<usize> {
        let mut unit_sizes = vec![1; self.instance.module_count()];
        for block in &self.blocks {
            for &member in block {
                unit_sizes[member] = block.len();
            }
        }
        let holders = self.allocation.table.holders().iter();
        holders
            .map(|holder| match *holder {
                Holder::Free | Holder::Closed => 0,
                Holder::Singleton(module) | Holder::Fixed(module) => unit_sizes[module],
            })
            .collect()
    }
}

/// The configurations, unless the policy treats all modules as single, and the other modules without a spot.
fn initial_units(instance: &Instance, allocation: &Allocation, places_blocks: bool) -> Vec<Unit> {
    let problem = &instance.problem;
    let configurations = match places_blocks {
        true => problem.configurations(),
        false => Vec::new(),
    };
    let mut is_single: Vec<bool> = (0..instance.module_count())
        .map(|module| allocation.table.spot_of(module).is_none() && !problem.is_cut_off(module))
        .collect();
    let mut units = Vec::new();
    for configuration in configurations {
        let modules = configuration.modules.iter();
        let members: Vec<usize> = modules.filter_map(|&id| problem.position_of(id)).collect();
        for &member in &members {
            is_single[member] = false;
        }
        if let Some(leader) = problem.position_of(configuration.leader) {
            units.push(Unit { leader, members });
        }
    }
    let singles = (0..instance.module_count()).filter(|&module| is_single[module]);
    units.extend(singles.map(Unit::single));
    units
}
