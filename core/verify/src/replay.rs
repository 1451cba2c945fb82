//! Replays decisions turn by turn and checks each against the spots held before it.

use std::collections::{BTreeMap, BTreeSet};

use petgraph::algo::kosaraju_scc;
use petgraph::graphmap::{NodeTrait, UnGraphMap};

use super::violation::Violation;
use formation_model::{Decision, ModuleId, PlanningProblem, Policy, SpotId, SpotSelection};

/// The state after the turns replayed so far, and the violations of these turns.
#[derive(Clone, Debug, Default)]
pub(super) struct Replay {
    /// The spot of each placed module.
    pub(super) spots: BTreeMap<ModuleId, SpotId>,
    /// The holder of each filled spot.
    pub(super) holders: BTreeMap<SpotId, ModuleId>,
    /// The groups of two or more modules that one turn placed with links between them.
    pub(super) blocks: Vec<Vec<ModuleId>>,
    /// The modules that left their configuration.
    pub(super) detached: BTreeSet<ModuleId>,
    /// The number of evictions.
    pub(super) evictions: usize,
    /// The number of (spot, selector) pairs.
    pub(super) pairs: usize,
    /// Whether spots were swapped, which only the last turn may do.
    pub(super) swapped: bool,
    pub(super) violations: Vec<Violation>,
    /// The violations of the latest turn unless it is the last one and restores the optimum.
    unless_last: Vec<Violation>,
    /// Pinned modules and members of blocks, which must not be evicted.
    protected: BTreeSet<ModuleId>,
}

impl Replay {
    /// The state before the first turn, in which only pinned modules hold spots.
    pub(super) fn new(problem: &PlanningProblem) -> Self {
        let spots: BTreeMap<ModuleId, SpotId> = problem
            .modules()
            .iter()
            .filter_map(|module| Some((module.id, module.pin?)))
            .collect();
        Self {
            holders: spots
                .iter()
                .map(|(&module, &spot)| (spot, module))
                .collect(),
            protected: spots.keys().copied().collect(),
            spots,
            ..Self::default()
        }
    }

    /// Replays one turn. A turn with violations is applied as far as possible.
    pub(super) fn apply(&mut self, problem: &PlanningProblem, turn: u32, decision: &Decision) {
        self.violations.append(&mut self.unless_last);
        if self.swapped {
            self.violations.push(Violation::SwapTooEarly { turn });
        }
        self.pairs += decision.selections.len();
        self.evictions += decision.evictions.len();
        if !self.names_exist(problem, decision) {
            return;
        }
        for &module in &decision.detached {
            if let Some(&spot) = self.spots.get(&module) {
                self.violations
                    .push(Violation::DetachedTooLate { turn, module, spot });
            }
        }
        let walked = self.walk_evictions(turn, decision);
        // Only the spots of modules that this turn names can change; to copy only these keeps a turn linear in its size.
        let before: BTreeMap<ModuleId, SpotId> = decision
            .selections
            .iter()
            .map(|selection| selection.module)
            .chain(walked.keys().copied())
            .filter_map(|module| Some((module, *self.spots.get(&module)?)))
            .collect();
        self.select(turn, decision, &before, &walked);
        self.compare(turn, &before, &walked);
        self.note_blocks(problem, decision, &before);
        let mut unusual = moves_without_eviction(turn, decision, &before, &walked);
        unusual.extend(self.too_long_a_chain(problem, turn, decision));
        if may_finish(problem) {
            self.unless_last = unusual;
        } else {
            self.violations.append(&mut unusual);
        }
        self.detached.extend(&decision.detached);
        self.swap(problem, turn, &decision.swaps);
    }

    /// Whether all modules and spots of a decision exist.
    fn names_exist(&mut self, problem: &PlanningProblem, decision: &Decision) -> bool {
        let mut modules: Vec<ModuleId> = decision.detached.clone();
        let mut spots: Vec<SpotId> = Vec::new();
        for selection in decision.selections.iter().chain(&decision.swaps) {
            modules.push(selection.module);
            spots.push(selection.spot);
        }
        for eviction in &decision.evictions {
            modules.extend([eviction.evicted, eviction.by]);
            spots.push(eviction.from);
            spots.extend(eviction.to);
        }
        modules.retain(|&module| problem.position_of(module).is_none());
        spots.retain(|&spot| problem.target().position_of(spot).is_none());
        let all_exist = modules.is_empty() && spots.is_empty();
        let modules = modules.into_iter();
        let unknown = modules.map(|module| Violation::UnknownModule { module });
        self.violations.extend(unknown);
        let unknown = spots
            .into_iter()
            .map(|spot| Violation::UnknownSpot { spot });
        self.violations.extend(unknown);
        all_exist
    }

    /// Follows the evictions one after another; returns the spots to which they move modules.
    fn walk_evictions(
        &mut self,
        turn: u32,
        decision: &Decision,
    ) -> BTreeMap<ModuleId, Option<SpotId>> {
        let mut changed: BTreeMap<SpotId, Option<ModuleId>> = BTreeMap::new();
        let mut moved: BTreeMap<ModuleId, Option<SpotId>> = BTreeMap::new();
        for (index, eviction) in decision.evictions.iter().enumerate() {
            let (evicted, by, from) = (eviction.evicted, eviction.by, eviction.from);
            if self.protected.contains(&evicted) {
                self.violations.push(Violation::MemberEvicted {
                    turn,
                    module: evicted,
                    spot: from,
                });
            }
            let held = |changed: &BTreeMap<SpotId, Option<ModuleId>>, spot: SpotId| {
                changed
                    .get(&spot)
                    .copied()
                    .unwrap_or_else(|| self.holders.get(&spot).copied())
            };
            let holder = held(&changed, from);
            // A module that leaves its configuration in this turn can take a spot and lose it again within the turn.
            let came_and_went = holder.is_none()
                && decision.detached.contains(&evicted)
                && !self.spots.contains_key(&evicted);
            if !came_and_went && holder != Some(evicted) || evicted == by {
                self.violations.push(Violation::WrongEviction {
                    turn,
                    module: evicted,
                    spot: from,
                });
                continue;
            }
            let left = moved
                .get(&by)
                .copied()
                .unwrap_or_else(|| self.spots.get(&by).copied());
            if let Some(left) = left.filter(|&left| held(&changed, left) == Some(by)) {
                changed.insert(left, None);
            }
            changed.insert(from, Some(by));
            moved.insert(by, Some(from));
            moved.insert(evicted, eviction.to);
            // An occupied spot is taken by the next eviction of the chain; its holder may have come in this turn.
            let next = decision.evictions.get(index + 1);
            let is_contested = |to: SpotId| {
                let is_next = next.is_some_and(|next| next.by == evicted && next.from == to);
                is_next || held(&changed, to).is_some()
            };
            if let Some(to) = eviction.to.filter(|&to| !is_contested(to)) {
                changed.insert(to, Some(evicted));
            }
        }
        moved
    }

    fn select(
        &mut self,
        turn: u32,
        decision: &Decision,
        before: &BTreeMap<ModuleId, SpotId>,
        walked: &BTreeMap<ModuleId, Option<SpotId>>,
    ) {
        let mut chosen = BTreeSet::new();
        // The pairs list changes, so a module that several chains move away and back is in none.
        let returns = |module: ModuleId| {
            before.contains_key(&module)
                && walked.get(&module).copied().flatten() == before.get(&module).copied()
        };
        let moving = decision
            .selections
            .iter()
            .map(|selection| selection.module)
            .chain(
                decision
                    .evictions
                    .iter()
                    .map(|one| one.evicted)
                    .filter(|&evicted| !returns(evicted)),
            );
        for module in moving {
            if let Some(spot) = self.spots.remove(&module) {
                self.holders.remove(&spot);
            }
        }
        for selection in &decision.selections {
            let (spot, module) = (selection.spot, selection.module);
            if !chosen.insert(module) {
                self.violations.push(Violation::TwoSpots { turn, module });
                continue;
            }
            if let Some(&holder) = self.holders.get(&spot) {
                self.violations.push(Violation::SpotTaken {
                    turn,
                    spot,
                    module,
                    holder,
                });
                continue;
            }
            self.holders.insert(spot, module);
            self.spots.insert(module, spot);
        }
    }

    /// Compares the spots to which the evictions lead with those of the pairs.
    fn compare(
        &mut self,
        turn: u32,
        before: &BTreeMap<ModuleId, SpotId>,
        walked: &BTreeMap<ModuleId, Option<SpotId>>,
    ) {
        for (&module, &end) in walked {
            let after = self.spots.get(&module).copied();
            if after != end {
                let spot = end.or(after).or_else(|| before.get(&module).copied());
                self.violations
                    .extend(spot.map(|spot| Violation::WrongEviction { turn, module, spot }));
            }
        }
    }

    /// The modules that get their first spot in a turn and keep links to each other form a block, which is protected from
    /// then on.
    fn note_blocks(
        &mut self,
        problem: &PlanningProblem,
        decision: &Decision,
        before: &BTreeMap<ModuleId, SpotId>,
    ) {
        let selected = decision.selections.iter().map(|selection| selection.module);
        let placed: BTreeSet<ModuleId> = selected
            .filter(|module| !before.contains_key(module) && !decision.detached.contains(module))
            .collect();
        if placed.len() < 2 {
            return;
        }
        let kept = kept_links_of(problem, &self.spots, &placed);
        for block in groups(&placed, kept.into_iter()) {
            if block.len() >= 2 {
                self.protected.extend(&block);
                self.blocks.push(block);
            }
        }
    }

    fn too_long_a_chain(
        &self,
        problem: &PlanningProblem,
        turn: u32,
        decision: &Decision,
    ) -> Option<Violation> {
        let evictions = decision.evictions.len();
        // A block's turn re-inserts each displaced singleton with a chain of its own; the policy `paper` also inserts the
        // modules that leave the block.
        let displaced = decision
            .evictions
            .iter()
            .filter(|eviction| self.protected.contains(&eviction.by))
            .count();
        let limit = problem.parameters().d_max?;
        let chains = (displaced + decision.detached.len()).max(1);
        let allowed = displaced + chains * usize::try_from(limit).unwrap_or(usize::MAX);
        (evictions > allowed).then_some(Violation::ChainTooLong {
            turn,
            evictions,
            limit,
        })
    }
}

/// Whether the last turn can restore the optimum of the singletons by chains of any length.
fn may_finish(problem: &PlanningProblem) -> bool {
    let parameters = problem.parameters();
    parameters.exact_finish && parameters.d_max.is_some() && parameters.policy == Policy::Exact
}

/// The modules that change their spot without being evicted.
fn moves_without_eviction(
    turn: u32,
    decision: &Decision,
    before: &BTreeMap<ModuleId, SpotId>,
    walked: &BTreeMap<ModuleId, Option<SpotId>>,
) -> Vec<Violation> {
    let moves = |selection: &SpotSelection| {
        let (module, &spot) = (selection.module, before.get(&selection.module)?);
        let is_own_choice = !walked.contains_key(&module) && spot != selection.spot;
        is_own_choice.then_some(Violation::MovedWithoutEviction { turn, module, spot })
    };
    decision.selections.iter().filter_map(moves).collect()
}

/// The links between some modules whose ends take adjacent spots.
pub(super) fn kept_links_of(
    problem: &PlanningProblem,
    spots: &BTreeMap<ModuleId, SpotId>,
    members: &BTreeSet<ModuleId>,
) -> BTreeSet<(ModuleId, ModuleId)> {
    let mut links = BTreeSet::new();
    for &first in members {
        let (Some(module), Some(&spot)) = (problem.module(first), spots.get(&first)) else {
            continue;
        };
        let adjacent: BTreeSet<SpotId> = problem.target().neighbours_of(spot).collect();
        let others = module.links.iter().copied();
        let others = others.filter(|other| first < *other && members.contains(other));
        let others =
            others.filter(|other| spots.get(other).is_some_and(|to| adjacent.contains(to)));
        links.extend(others.map(|second| (first, second)));
    }
    links
}

/// Splits things into the groups that the edges join; groups and members ascend. Edges to other things do not count.
pub(super) fn groups<T: NodeTrait>(
    things: &BTreeSet<T>,
    edges: impl Iterator<Item = (T, T)>,
) -> Vec<Vec<T>> {
    let within = |edge: &(T, T)| things.contains(&edge.0) && things.contains(&edge.1);
    let mut graph: UnGraphMap<T, ()> = edges.filter(within).collect();
    for &thing in things {
        graph.add_node(thing);
    }
    let mut groups = kosaraju_scc(&graph);
    for group in &mut groups {
        group.sort_unstable();
    }
    groups.sort_unstable();
    groups
}
