//! `spotAllocation` and `evict` (Algorithm 1).

use std::cmp::Reverse;

use super::PaperTurn;
use crate::assignment::{Displacement, Holder, Instance};
use formation_model::Evicted;

/// A module that is evicted, and the spot to which it moves.
pub(super) type Move = (usize, usize);

/// How many of its best spots a module needs: a chain of evictions excludes the contested spot, and the one it has lost.
const FAVOURITES: usize = 3;

/// For each module, the spots of greatest utility, held or not, the best first; computed at first use.
#[derive(Clone, Debug)]
pub(crate) struct Favourites {
    of: Vec<Option<Vec<usize>>>,
}

impl Favourites {
    pub(crate) fn new(module_count: usize) -> Self {
        Self {
            of: vec![None; module_count],
        }
    }

    /// `arg max U(s)` over all spots but some (Algorithm 1, lines 12 and 13).
    fn other_than(
        &mut self,
        instance: &Instance,
        module: usize,
        excluded: [Option<usize>; FAVOURITES - 1],
    ) -> Option<usize> {
        let best = self.of[module].get_or_insert_with(|| {
            let mut sorted = spots_by_utility(instance, module);
            sorted.truncate(FAVOURITES);
            sorted
        });
        let mut best = best.iter().copied();
        best.find(|&spot| !excluded.contains(&Some(spot)))
    }
}

/// All spots in descending order of a module's utility (Algorithm 1, line 2).
fn spots_by_utility(instance: &Instance, module: usize) -> Vec<usize> {
    let row = instance.utilities.row(module);
    let mut spots: Vec<usize> = (0..row.len()).collect();
    spots.sort_by_key(|&spot| Reverse(row[spot]));
    spots
}

impl PaperTurn<'_> {
    /// `spotAllocation` (Algorithm 1, lines 1 to 9). A module that finds no spot gets none: NO_SPOT_FOUND.
    pub(crate) fn allocate_spot(&mut self, module: usize) {
        for spot in spots_by_utility(self.instance, module) {
            match self.table.holder(spot) {
                Holder::Free => {
                    self.table.give(spot, Holder::Singleton(module));
                    return;
                }
                Holder::Singleton(holder) => {
                    if let Some(moves) = self.evict(module, holder, spot) {
                        let start = self.evictions.len();
                        self.take_from(module, holder, spot, Holder::Singleton(module));
                        self.follow(start, &moves);
                        return;
                    }
                }
                Holder::Fixed(_) | Holder::Closed => {}
            }
        }
    }

    /// `evict` (Algorithm 1, lines 10 to 20), its recursion unrolled: the moves by which `current` takes `contested` from
    /// `blocking`; `None` if it may not.
    pub(super) fn evict(
        &mut self,
        mut current: usize,
        mut blocking: usize,
        mut contested: usize,
    ) -> Option<Vec<Move>> {
        let instance = self.instance;
        let parameters = instance.problem.parameters();
        let utility = |module, spot| instance.utilities.of(module, spot);
        let counts_lost = parameters.paper.evicted == Evicted::Literal;
        let spot_count = self.table.holders().len();
        let depth_limit = parameters.d_max.map_or(spot_count, |d_max| d_max as usize);
        let first = current;
        let mut lost = None;
        let mut moves: Vec<Move> = Vec::new();
        for _ in 0..depth_limit.min(spot_count) {
            let others = [Some(contested), None];
            let for_blocking = self.favourites.other_than(instance, blocking, others)?;
            let others = [Some(contested), lost];
            let for_current = self.favourites.other_than(instance, current, others)?;
            let evicting = utility(current, contested) + utility(blocking, for_blocking);
            let yielding = utility(current, for_current) + utility(blocking, contested);
            if evicting <= yielding {
                return None;
            }
            moves.push((blocking, for_blocking));
            let Holder::Singleton(next) = self.table.holder(for_blocking) else {
                let is_free = self.table.holder(for_blocking) == Holder::Free;
                return is_free.then_some(moves);
            };
            if !counts_lost {
                // A spot that has changed hands in this chain is held by a module of the chain, which keeps it.
                if next == first || moves.iter().any(|&(module, _)| module == next) {
                    return None;
                }
                lost = Some(contested);
            }
            (current, blocking, contested) = (blocking, next, for_blocking);
        }
        None
    }

    fn take_from(&mut self, module: usize, holder: usize, spot: usize, as_holder: Holder) {
        self.table.release(holder);
        self.table.give(spot, as_holder);
        self.evictions.push(Displacement {
            evicted: holder,
            by: module,
            from: spot,
            to: None,
        });
    }

    /// Carries out the moves of `evict` for the module of eviction `position` and the modules that it displaces in turn.
    pub(super) fn follow(&mut self, mut position: usize, moves: &[Move]) {
        for (number, &(module, spot)) in moves.iter().enumerate() {
            match self.table.holder(spot) {
                Holder::Free => {
                    self.table.give(spot, Holder::Singleton(module));
                    self.evictions[position].to = Some(spot);
                    return;
                }
                Holder::Singleton(holder)
                    if moves.get(number + 1).is_some_and(|next| next.0 == holder) =>
                {
                    self.evictions[position].to = Some(spot);
                    self.take_from(module, holder, spot, Holder::Singleton(module));
                    position = self.evictions.len() - 1;
                }
                // The table has changed since the test.
                Holder::Singleton(_) | Holder::Fixed(_) | Holder::Closed => return,
            }
        }
    }
}
