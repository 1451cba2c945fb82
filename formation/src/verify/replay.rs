//! Replays decisions turn by turn and watches what each does to the spots held before it.

use std::collections::{BTreeMap, BTreeSet};

use super::Violation;
use crate::model::{Decision, ModuleId, PlanningProblem, Policy, SpotId, SpotSelection};

/// Who holds which spot after the turns replayed so far, and every guarantee that they violated.
#[derive(Clone, Debug)]
pub(super) struct Replay {
    /// The spot of each placed module.
    pub(super) spots: BTreeMap<ModuleId, SpotId>,
    /// The holder of each filled spot.
    pub(super) holders: BTreeMap<SpotId, ModuleId>,
    /// The groups of two or more modules that one turn placed together so that they keep links to each other.
    pub(super) blocks: Vec<Vec<ModuleId>>,
    /// The modules that left their configuration.
    pub(super) detached: BTreeSet<ModuleId>,
    /// How many evictions the turns made.
    pub(super) evictions: usize,
    /// How many (spot, selector) pairs the turns announced.
    pub(super) pairs: usize,
    /// What the turns did wrong.
    pub(super) violations: Vec<Violation>,
    /// What the latest turn did that only the last one may do, where the last one restores an optimum.
    unless_last: Vec<Violation>,
    /// Pinned modules and members of blocks: no turn may evict them.
    protected: BTreeSet<ModuleId>,
}

impl Replay {
    /// Begins before the first turn: only pinned modules hold spots.
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
            blocks: Vec::new(),
            detached: BTreeSet::new(),
            evictions: 0,
            pairs: 0,
            violations: Vec::new(),
            unless_last: Vec::new(),
        }
    }

    /// Replays one turn. A turn that violates a guarantee is applied as far as possible.
    pub(super) fn apply(&mut self, problem: &PlanningProblem, turn: u32, decision: &Decision) {
        self.violations.append(&mut self.unless_last);
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
        // Only the modules that this turn names can change, so only theirs are kept: turns stay linear in their size.
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
    }

    fn names_exist(&mut self, problem: &PlanningProblem, decision: &Decision) -> bool {
        let modules = decision
            .selections
            .iter()
            .map(|selection| selection.module)
            .chain(
                decision
                    .evictions
                    .iter()
                    .flat_map(|one| [one.evicted, one.by]),
            )
            .chain(decision.detached.iter().copied());
        let spots = decision
            .selections
            .iter()
            .map(|selection| selection.spot)
            .chain(decision.evictions.iter().map(|one| one.from))
            .chain(decision.evictions.iter().filter_map(|one| one.to));
        let mut wrong: Vec<Violation> = modules
            .filter(|&module| problem.position_of(module).is_none())
            .map(|module| Violation::UnknownModule { module })
            .collect();
        wrong.extend(
            spots
                .filter(|&spot| problem.target().position_of(spot).is_none())
                .map(|spot| Violation::UnknownSpot { spot }),
        );
        let all_known = wrong.is_empty();
        self.violations.append(&mut wrong);
        all_known
    }

    /// Follows the evictions one after another; returns where they leave the modules that they move.
    fn walk_evictions(
        &mut self,
        turn: u32,
        decision: &Decision,
    ) -> BTreeMap<ModuleId, Option<SpotId>> {
        let mut changed: BTreeMap<SpotId, Option<ModuleId>> = BTreeMap::new();
        let mut moved: BTreeMap<ModuleId, Option<SpotId>> = BTreeMap::new();
        for eviction in &decision.evictions {
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
            // A module that leaves its configuration in this turn may take a spot and lose it again within the turn.
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
            // An occupied spot is taken by the next eviction of the chain.
            if let Some(to) = eviction.to.filter(|&to| held(&changed, to).is_none()) {
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
        // The pairs say what changes, so a module that several chains send away and back is in none.
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

    /// Compares where the evictions lead with where the pairs lead.
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

    /// The modules that a turn places for the first time and that keep links to each other are a block, and protected from
    /// now on.
    fn note_blocks(
        &mut self,
        problem: &PlanningProblem,
        decision: &Decision,
        before: &BTreeMap<ModuleId, SpotId>,
    ) {
        let placed: BTreeSet<ModuleId> = decision
            .selections
            .iter()
            .map(|selection| selection.module)
            .filter(|module| !before.contains_key(module) && !decision.detached.contains(module))
            .collect();
        let adjacent_links = |module: ModuleId| -> Vec<ModuleId> {
            let (Some(found), Some(&spot)) = (problem.module(module), self.spots.get(&module))
            else {
                return Vec::new();
            };
            let adjacent: BTreeSet<SpotId> = problem.target().neighbours_of(spot).collect();
            found
                .links
                .iter()
                .copied()
                .filter(|other| {
                    self.spots
                        .get(other)
                        .is_some_and(|spot| adjacent.contains(spot))
                })
                .collect()
        };
        for block in groups(&placed, adjacent_links) {
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
        // A block's turn re-inserts each singleton that it displaces with a chain of its own; so does the policy `paper`
        // with the modules that leave the block.
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

/// Whether the last turn may move singletons as far as it takes to restore their optimum.
fn may_finish(problem: &PlanningProblem) -> bool {
    let parameters = problem.parameters();
    parameters.exact_finish && parameters.d_max.is_some() && parameters.policy == Policy::Exact
}

/// The modules that leave a spot for another although no eviction takes it from them.
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

/// Splits things into the groups that `neighbours` joins; groups and members ascend.
pub(super) fn groups<T: Copy + Ord>(
    things: &BTreeSet<T>,
    neighbours: impl Fn(T) -> Vec<T>,
) -> Vec<Vec<T>> {
    let mut left = things.clone();
    let mut found = Vec::new();
    while let Some(start) = left.pop_first() {
        let mut group = vec![start];
        let mut next = 0;
        while let Some(&thing) = group.get(next) {
            group.extend(
                neighbours(thing)
                    .into_iter()
                    .filter(|other| left.remove(other)),
            );
            next += 1;
        }
        group.sort_unstable();
        found.push(group);
    }
    found
}
