//! Chain eviction: a module takes a spot, its holder moves to another spot, and so on, until the last displaced module
//! moves to a free spot.
//!
//! This replaces the paper's `evict` (Algorithm 1), which never commits the move of the evicted module. A chain is an
//! augmenting path in the assignment of singletons to spots. The module whose turn it is takes the path of greatest
//! gain in total utility. Without a bound on its length, this keeps the singletons' allocation utility-optimal after every
//! turn, which makes the paper's Theorem 3 true (shortest augmenting paths with dual potentials: R. Jonker and
//! A. Volgenant, "A shortest augmenting path algorithm for dense and sparse linear assignment problems", Computing 38,
//! 1987).

use crate::assignment::allocation::{
    Allocation, Displacement, Holder, Reassignment, displacements_of,
};
use crate::assignment::bounded_eviction;
use crate::assignment::frontier::{Frontier, Mover};
use crate::assignment::instance::Instance;

/// Inserts modules into an allocation; reuses its buffers and its bounds between calls.
#[derive(Clone, Debug, Default)]
pub(crate) struct ChainSearch {
    frontier: Frontier,
    /// The spots whose holders the search has reached, in ascending order of path length.
    reached: Vec<usize>,
}

/// The end of an augmenting path.
#[derive(Clone, Copy, Debug)]
enum End {
    FreeSpot(usize),
    /// This module loses its spot and gets no other.
    Dropped(usize),
}

#[derive(Clone, Copy, Debug)]
struct ShortestPath {
    end: End,
    /// The sum of the reduced costs along the path.
    length: i64,
    evictions: u32,
}

impl ChainSearch {
    /// Allows the search to use more memory for speed; see [`Frontier::expect_to_be_alone`].
    pub(crate) fn expect_to_be_alone(&mut self) {
        self.frontier.expect_to_be_alone();
    }

    /// The turn of a single module, the paper's `spotAllocation` (Algorithm 1): inserts a module that holds no spot by the
    /// chain of greatest gain with at most `d_max` evictions, and appends these evictions in the order of the chain.
    ///
    /// Returns the spot that the module takes; `None` means NO_SPOT_FOUND.
    pub(crate) fn allocate(
        &mut self,
        instance: &Instance,
        allocation: &mut Allocation,
        module: usize,
        evictions: &mut Vec<Displacement>,
    ) -> Option<usize> {
        let limit = instance.problem.parameters().d_max.unwrap_or(u32::MAX);
        let chain = self.insert(instance, allocation, module, limit);
        evictions.extend(displacements_of(&chain));
        chain.first().and_then(|step| step.to)
    }

    /// Inserts a module by the best chain with at most `limit` evictions, and returns the chain.
    ///
    /// The chain begins with the module itself and ends at a free spot if there is one. If there is none, it ends with a
    /// module that gets no spot; it is empty if that is the inserted module. Ties go to the chain with the fewest
    /// evictions, so that an eviction always raises the total utility, then to the chain whose last spot is the lowest.
    pub(super) fn insert(
        &mut self,
        instance: &Instance,
        allocation: &mut Allocation,
        module: usize,
        limit: u32,
    ) -> Vec<Reassignment> {
        if !allocation.cut_short {
            let path = self.shortest_path(instance, allocation, module);
            if path.evictions <= limit {
                self.raise_potentials(instance, allocation, module, path.length);
                return self.augment(instance, allocation, module, path.end);
            }
            allocation.cut_short = true;
        }
        let chain = bounded_eviction::best_chain(instance, &allocation.table, module, limit);
        allocation.table.carry_out(chain.iter());
        chain
    }

    /// Dijkstra's search from the inserted module over the spots, by (reduced cost, evictions, identifier).
    fn shortest_path(
        &mut self,
        instance: &Instance,
        allocation: &mut Allocation,
        source: usize,
    ) -> ShortestPath {
        allocation.of_module[source] = 0;
        // No module is dropped while a spot is free.
        let dropping = (allocation.table.free_count() == 0).then(|| allocation.cost_of_dropping());
        let mut drop = ShortestPath {
            end: End::Dropped(source),
            length: dropping.unwrap_or(i64::MAX),
            evictions: 0,
        };
        self.reached.clear();
        self.frontier.reset(instance, allocation);
        self.frontier.limit_to(drop.length);
        let mut mover = Mover {
            module: source,
            length: 0,
            hops: 1,
        };
        loop {
            self.frontier.relax(instance, allocation, mover);
            let Some((length, hops, spot)) = self
                .frontier
                .reach_nearest(instance, (drop.length, drop.evictions))
            else {
                return drop;
            };
            let Holder::Singleton(holder) = allocation.table.holder(spot) else {
                return ShortestPath {
                    end: End::FreeSpot(spot),
                    length,
                    evictions: hops - 1,
                };
            };
            self.reached.push(spot);
            if let Some(dropping) = dropping {
                let dropped = length + dropping - allocation.of_module[holder];
                if (dropped, hops) < (drop.length, drop.evictions) {
                    drop = ShortestPath {
                        end: End::Dropped(holder),
                        length: dropped,
                        evictions: hops,
                    };
                    self.frontier.limit_to(dropped);
                }
            }
            mover = Mover {
                module: holder,
                length,
                hops: hops + 1,
            };
        }
    }

    /// Updates the potentials for the allocation to which a path of this length leads.
    fn raise_potentials(
        &mut self,
        instance: &Instance,
        allocation: &mut Allocation,
        source: usize,
        length: i64,
    ) {
        self.frontier.lift_bounds(length);
        for &spot in &self.reached {
            let slack = length - self.frontier.length_to(instance, spot);
            allocation.of_spot[spot] -= slack;
            if let Holder::Singleton(holder) = allocation.table.holder(spot) {
                allocation.of_module[holder] += slack;
            }
        }
        allocation.of_module[source] += length;
    }

    /// Moves the modules along the path that ends at `end`, and returns the steps from `source` on.
    fn augment(
        &self,
        instance: &Instance,
        allocation: &mut Allocation,
        source: usize,
        end: End,
    ) -> Vec<Reassignment> {
        let table = &mut allocation.table;
        let mut chain = Vec::new();
        let mut spot = match end {
            End::FreeSpot(spot) => spot,
            End::Dropped(module) => {
                let Some(spot) = table.spot_of(module) else {
                    return chain;
                };
                table.release(module);
                chain.push(Reassignment { module, to: None });
                spot
            }
        };
        loop {
            let module = self.frontier.mover_to(instance, spot);
            let left = table.spot_of(module);
            table.release(module);
            table.give(spot, Holder::Singleton(module));
            chain.push(Reassignment {
                module,
                to: Some(spot),
            });
            match left {
                Some(left) if module != source => spot = left,
                _ => break,
            }
        }
        chain.reverse();
        chain
    }
}
