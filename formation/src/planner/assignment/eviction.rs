//! Chain eviction: a module takes a spot, its holder moves on to another, and so on, until the last displaced one
//! moves to a free spot.
//!
//! This replaces the paper's `evict` (Algorithm 1), which never commits the evicted module's move. A chain is an
//! augmenting path in the assignment of singletons to spots; the module whose turn it is takes the path of greatest
//! gain in total utility. Unbounded, that keeps the singletons' allocation utility-optimal after every turn, which
//! makes the paper's Theorem 3 true (shortest augmenting paths with dual potentials; R. Jonker and A. Volgenant,
//! "A shortest augmenting path algorithm for dense and sparse linear assignment problems", Computing 38, 1987).

use crate::planner::assignment::frontier::{Frontier, Mover};
use crate::planner::assignment::{Holder, Instance, SpotTable, bounded_eviction};

/// One step of a chain: a module leaves a spot for another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Step {
    /// The module that moves.
    pub(crate) module: usize,
    /// The spot that it takes; `None` when it is dropped.
    pub(crate) to: Option<usize>,
}

/// The spot table with the dual potentials that prove the singletons' allocation optimal.
///
/// With the cost of a pair being minus its utility, the reduced cost `cost - of_module - of_spot` is never negative,
/// zero for a module and the spot that it holds, and `of_spot` is zero for free spots and never positive.
#[derive(Clone, Debug, Default)]
pub(crate) struct Allocation {
    /// Who holds which spot.
    pub(crate) table: SpotTable,
    of_module: Vec<i64>,
    of_spot: Vec<i64>,
    /// Once no spot is free: what a module's potential may reach before dropping it pays.
    of_dropping: Option<i64>,
    /// A chain was cut short by `d_max`, so that the allocation may not be optimal and the potentials mean nothing.
    cut_short: bool,
}

impl Allocation {
    pub(crate) fn new(module_count: usize, spot_count: usize) -> Self {
        Self {
            table: SpotTable::new(module_count, spot_count),
            of_module: vec![0; module_count],
            of_spot: vec![0; spot_count],
            of_dropping: None,
            cut_short: false,
        }
    }

    /// Becomes a copy of another allocation, in the memory at hand.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.table.copy_from(&other.table);
        self.of_module.clone_from(&other.of_module);
        self.of_spot.clone_from(&other.of_spot);
        self.of_dropping = other.of_dropping;
        self.cut_short = other.cut_short;
    }

    pub(crate) fn potential_of_module(&self, module: usize) -> i64 {
        self.of_module[module]
    }

    pub(crate) fn potential_of_spot(&self, spot: usize) -> i64 {
        self.of_spot[spot]
    }

    fn threshold_of_dropping(&mut self) -> i64 {
        let table = &self.table;
        let of_module = &self.of_module;
        *self.of_dropping.get_or_insert_with(|| {
            table
                .holders()
                .iter()
                .filter_map(|holder| match holder {
                    Holder::Singleton(module) => Some(of_module[*module]),
                    _ => None,
                })
                .max()
                .unwrap_or(0)
        })
    }
}

/// Inserts modules into an allocation; keeps its buffers between calls.
#[derive(Clone, Debug, Default)]
pub(crate) struct ChainSearch {
    frontier: Frontier,
    /// The spots whose holders were reached, in the order of their distance.
    reached: Vec<usize>,
}

/// Where a shortest augmenting path ends.
#[derive(Clone, Copy, Debug)]
enum End {
    FreeSpot(usize),
    Dropped(usize),
}

#[derive(Clone, Copy, Debug)]
struct ShortestPath {
    end: End,
    length: i64,
    evictions: u32,
}

impl ChainSearch {
    /// Lets the search take more memory for speed.
    pub(crate) fn expect_to_be_alone(&mut self) {
        self.frontier.expect_to_be_alone();
    }

    /// Inserts a module that holds no spot by the chain of greatest gain with at most `d_max` evictions.
    ///
    /// The chain begins with the module itself. While a spot is free, it ends at a free spot. When none is, it ends
    /// with the module that is dropped, and it is empty if dropping the inserted module itself is best.
    /// Among chains of equal gain the one with the fewest evictions is taken, so that a module is evicted only if
    /// that strictly raises the total utility; then the one whose last spot has the lowest identifier.
    pub(crate) fn insert(
        &mut self,
        instance: &Instance,
        allocation: &mut Allocation,
        module: usize,
    ) -> Vec<Step> {
        let limit = instance.problem.parameters().d_max.unwrap_or(u32::MAX);
        if !allocation.cut_short {
            let path = self.shortest_path(instance, allocation, module);
            if path.evictions <= limit {
                return self.follow(instance, allocation, module, path);
            }
            allocation.cut_short = true;
        }
        let chain = bounded_eviction::best_chain(instance, &allocation.table, module, limit);
        for step in &chain {
            allocation.table.release(step.module);
        }
        for step in &chain {
            if let Some(spot) = step.to {
                allocation.table.give(spot, Holder::Singleton(step.module));
            }
        }
        chain
    }

    /// The same without a bound, into an allocation in which no chain was cut short.
    pub(crate) fn insert_unbounded(
        &mut self,
        instance: &Instance,
        allocation: &mut Allocation,
        module: usize,
    ) -> Vec<Step> {
        let path = self.shortest_path(instance, allocation, module);
        self.follow(instance, allocation, module, path)
    }

    fn follow(
        &mut self,
        instance: &Instance,
        allocation: &mut Allocation,
        module: usize,
        path: ShortestPath,
    ) -> Vec<Step> {
        self.raise_potentials(instance, allocation, module, path.length);
        self.augment(instance, allocation, module, path.end)
    }

    /// Dijkstra's search from the inserted module over the spots, by (reduced cost, evictions, identifier).
    fn shortest_path(
        &mut self,
        instance: &Instance,
        allocation: &mut Allocation,
        source: usize,
    ) -> ShortestPath {
        allocation.of_module[source] = 0;
        // While spots are free, nobody is dropped.
        let threshold =
            (allocation.table.free_count() == 0).then(|| allocation.threshold_of_dropping());
        let mut drop = ShortestPath {
            end: End::Dropped(source),
            length: threshold.unwrap_or(i64::MAX),
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
            if let Some(threshold) = threshold {
                let dropped = length + threshold - allocation.of_module[holder];
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

    /// Restores the potentials' meaning for the allocation that the path of that length leads to.
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

    fn augment(
        &self,
        instance: &Instance,
        allocation: &mut Allocation,
        source: usize,
        end: End,
    ) -> Vec<Step> {
        let table = &mut allocation.table;
        let mut chain = Vec::new();
        let mut spot = match end {
            End::FreeSpot(spot) => spot,
            End::Dropped(module) => {
                let Some(spot) = table.spot_of(module) else {
                    return chain;
                };
                table.release(module);
                chain.push(Step { module, to: None });
                spot
            }
        };
        loop {
            let module = self.frontier.mover_to(instance, spot);
            let left = table.spot_of(module);
            table.release(module);
            table.give(spot, Holder::Singleton(module));
            chain.push(Step {
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
