//! The spots that a search for a chain can visit next, with the shortest known path to each.
//!
//! Plain Dijkstra relaxes every spot from every module that it reaches. But paths longer than the best known end are
//! useless, so only spots of small reduced cost matter, and these are few and close together. Each module therefore keeps,
//! for each leaf of the tree of spots and for each branch of adjacent leaves, a lower bound of the cost of a spot there less
//! the spot's potential, and skips leaves and branches whose bound exceeds the limit. A bound stays valid, because
//! potentials of spots only fall. Where the potentials of a whole leaf or branch fall by some amount, that amount is added
//! to the bounds of all modules at once (the *lift*).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::assignment::allocation::{Allocation, Holder};
use crate::assignment::instance::Instance;
use crate::assignment::spot_tree::{BRANCH_SIZE, LEAF_SIZE};

/// The key by which spots are visited: path length, then spots on the path, then identifier. One number, because the
/// search spends most of its time on these comparisons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Nearness(u128);

impl Nearness {
    fn new(length: i64, hops: u32, spot: u32) -> Self {
        // With its sign bit flipped, a signed number sorts as an unsigned one.
        let length = length.cast_unsigned() ^ SIGN;
        Self(u128::from(length) << 64 | u128::from(hops) << 32 | u128::from(spot))
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "splits the number into the parts that `new` joined"
    )]
    fn parts(self) -> (i64, u32, u32) {
        let length = ((self.0 >> 64) as u64 ^ SIGN).cast_signed();
        (length, (self.0 >> 32) as u32, self.0 as u32)
    }
}

const SIGN: u64 = 1 << 63;

/// The shortest known path to a spot.
#[derive(Clone, Copy, Debug, Default)]
struct PathTo {
    length: i64,
    hops: u32,
    /// The last module of the path, which moves to this spot.
    mover: u32,
}

/// A module from which the search relaxes spots.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mover {
    pub(super) module: usize,
    /// The length of the shortest path to it.
    pub(super) length: i64,
    /// The number of spots on that path, with the one to which the module moves next.
    pub(super) hops: u32,
}

/// The greatest number of travel costs that a search keeps; beyond, it computes them when it needs them. Low enough for a
/// process that holds many replicas.
const COSTS_KEPT_MAX: usize = 1 << 18;

/// The same limit for the only search of a process.
const COSTS_KEPT_MAX_ALONE: usize = 1 << 24;

/// A length above every limit.
const UNREACHABLE: i64 = i64::MAX / 8;

/// The length of the path to a spot that the search has visited, which no path shortens.
const REACHED: i64 = i64::MIN;

/// The offset of a place to which no path leads: it has no spot, or one that is fixed or closed.
const CLOSED: i64 = -UNREACHABLE;

/// A position in 32 bits, which hold every module and spot.
fn short(position: usize) -> u32 {
    u32::try_from(position).unwrap_or(u32::MAX)
}

/// The frontier of one search, and the bounds that are kept from search to search.
#[derive(Clone, Debug, Default)]
pub(super) struct Frontier {
    /// For the places of each leaf, the length of the shortest known path; [`UNREACHABLE`] without a path, [`REACHED`] once
    /// the search has visited the spot. Separate from `paths`, so that most of it stays in the cache.
    lengths: Vec<[i64; LEAF_SIZE]>,
    /// By place; valid where a path is known.
    paths: Vec<PathTo>,
    /// For the places of each leaf, the net value of the spot plus its potential.
    offsets: Vec<[i64; LEAF_SIZE]>,
    /// For each leaf, the number of spots that the search can still visit.
    open: Vec<usize>,
    /// The places of free spots.
    free: Vec<usize>,
    queue: BinaryHeap<Reverse<Nearness>>,
    /// The length beyond which a path is useless.
    limit: i64,
    /// For each leaf, the amount by which the potentials of all of its spots have fallen.
    leaf_lifts: Vec<i64>,
    /// The bound of each branch, likewise.
    branch_lifts: Vec<i64>,
    /// For each module; filled at its first insertion.
    outlooks: Vec<Outlook>,
    is_alone: bool,
}

/// The costs and bounds of one module.
#[derive(Clone, Debug, Default)]
struct Outlook {
    /// The travel costs to the places of each leaf; empty if they are not kept.
    travel_costs: Vec<[u32; LEAF_SIZE]>,
    /// The bound of each leaf, less the leaf's lift at the time when the bound was computed.
    leaf_bounds: Vec<i64>,
    /// The same for each branch.
    branch_bounds: Vec<i64>,
}

impl Outlook {
    fn new(instance: &Instance, module: usize, kept_max: usize) -> Self {
        let tree = &instance.spot_tree;
        let keeps_costs = instance.module_count() * tree.place_count() <= kept_max;
        let travel_costs: Option<Vec<_>> = (0..if keeps_costs { tree.leaf_count() } else { 0 })
            .map(|leaf| shortened(costs_to_leaf(instance, module, leaf)))
            .collect();
        Self {
            travel_costs: travel_costs.unwrap_or_default(),
            leaf_bounds: vec![-UNREACHABLE; tree.leaf_count()],
            branch_bounds: vec![-UNREACHABLE; tree.branch_count()],
        }
    }
}

fn costs_to_leaf(instance: &Instance, module: usize, leaf: usize) -> [i64; LEAF_SIZE] {
    std::array::from_fn(|index| {
        // An empty place stands for some spot, which keeps its cost small.
        let spot = instance.spot_tree.spot_at(leaf * LEAF_SIZE + index);
        let spot = spot.unwrap_or_default();
        instance.utilities.travel_cost(module, spot)
    })
}

/// The same costs in half the memory; `None` if one of them does not fit.
fn shortened(costs: [i64; LEAF_SIZE]) -> Option<[u32; LEAF_SIZE]> {
    let mut short = [0; LEAF_SIZE];
    for (short, cost) in short.iter_mut().zip(costs) {
        *short = u32::try_from(cost).ok()?;
    }
    Some(short)
}

impl Frontier {
    /// Allows the frontier to use memory as if no other search ran in the process.
    pub(super) fn expect_to_be_alone(&mut self) {
        self.is_alone = true;
    }

    /// Starts a search.
    pub(super) fn reset(&mut self, instance: &Instance, allocation: &Allocation) {
        let tree = &instance.spot_tree;
        let utilities = &instance.utilities;
        if self.outlooks.is_empty() {
            self.paths = vec![PathTo::default(); tree.place_count()];
            self.leaf_lifts = vec![0; tree.leaf_count()];
            self.branch_lifts = vec![0; tree.branch_count()];
            self.outlooks = vec![Outlook::default(); instance.module_count()];
        }
        self.lengths.clear();
        self.lengths
            .resize(tree.leaf_count(), [UNREACHABLE; LEAF_SIZE]);
        self.queue.clear();
        self.limit = UNREACHABLE;
        self.offsets.clear();
        self.open.clear();
        self.free.clear();
        for leaf in 0..tree.leaf_count() {
            let mut offsets = [CLOSED; LEAF_SIZE];
            let mut open = 0;
            for (offset, place) in offsets.iter_mut().zip(leaf * LEAF_SIZE..) {
                let Some(spot) = tree.spot_at(place) else {
                    break;
                };
                match allocation.table.holder(spot) {
                    Holder::Fixed(_) | Holder::Closed => continue,
                    Holder::Free => self.free.push(place),
                    Holder::Singleton(_) => (),
                }
                *offset = utilities.net_value(spot) + allocation.of_spot[spot];
                open += 1;
            }
            self.offsets.push(offsets);
            self.open.push(open);
            if open == 0 {
                // Fixed and closed spots stay so: no search needs to visit this leaf again.
                self.leaf_lifts[leaf] = 2 * UNREACHABLE;
            }
        }
    }

    /// Discards paths that are longer than `length`.
    pub(super) fn limit_to(&mut self, length: i64) {
        self.limit = self.limit.min(length);
    }

    /// Relaxes the spots to which a module can move within the limit.
    pub(super) fn relax(&mut self, instance: &Instance, allocation: &Allocation, mover: Mover) {
        let module = mover.module;
        let base =
            mover.length - allocation.of_module[module] + instance.utilities.undocking(module);
        let mut outlook = std::mem::take(&mut self.outlooks[module]);
        if outlook.leaf_bounds.is_empty() {
            let kept_max = if self.is_alone {
                COSTS_KEPT_MAX_ALONE
            } else {
                COSTS_KEPT_MAX
            };
            outlook = Outlook::new(instance, module, kept_max);
        }
        let Outlook {
            travel_costs,
            leaf_bounds,
            branch_bounds,
        } = &mut outlook;
        if mover.hops == 1 {
            self.limit_by_free_spots(instance, module, travel_costs, base);
        }
        for (branch, branch_bound) in branch_bounds.iter_mut().enumerate() {
            let branch_lift = self.branch_lifts[branch];
            if base + *branch_bound + branch_lift > self.limit {
                continue;
            }
            let mut least = UNREACHABLE;
            let first = branch * BRANCH_SIZE;
            let bounds = leaf_bounds[first..].iter_mut().take(BRANCH_SIZE);
            for (bound, leaf) in bounds.zip(first..) {
                let lift = self.leaf_lifts[leaf];
                if base + *bound + lift <= self.limit && self.open[leaf] > 0 {
                    let reduced =
                        self.relax_leaf(instance, allocation, leaf, travel_costs, mover, base);
                    *bound = reduced - lift;
                }
                least = least.min(*bound + lift);
            }
            *branch_bound = least - branch_lift;
        }
        self.outlooks[module] = outlook;
    }

    /// Limits the search to the shortest path without an eviction.
    fn limit_by_free_spots(
        &mut self,
        instance: &Instance,
        module: usize,
        travel_costs: &[[u32; LEAF_SIZE]],
        base: i64,
    ) {
        for &place in &self.free {
            let (leaf, index) = (place / LEAF_SIZE, place % LEAF_SIZE);
            let kept = travel_costs.get(leaf);
            let cost = kept.map_or_else(
                || {
                    let spot = instance.spot_tree.spot_at(place).unwrap_or_default();
                    instance.utilities.travel_cost(module, spot)
                },
                |costs| i64::from(costs[index]),
            );
            self.limit = self.limit.min(base + cost - self.offsets[leaf][index]);
        }
    }

    /// Relaxes a leaf's spots, and returns the least of their costs less potential.
    fn relax_leaf(
        &mut self,
        instance: &Instance,
        allocation: &Allocation,
        leaf: usize,
        travel_costs: &[[u32; LEAF_SIZE]],
        mover: Mover,
        base: i64,
    ) -> i64 {
        let Mover { module, hops, .. } = mover;
        let costs = match travel_costs.get(leaf) {
            Some(costs) => costs.map(i64::from),
            None => costs_to_leaf(instance, module, leaf),
        };
        let (offsets, lengths) = (&self.offsets[leaf], &mut self.lengths[leaf]);
        let mut least = UNREACHABLE;
        for index in 0..LEAF_SIZE {
            let reduced = costs[index] - offsets[index];
            least = least.min(reduced);
            let length = base + reduced;
            if length > lengths[index].min(self.limit) {
                continue;
            }
            let place = leaf * LEAF_SIZE + index;
            let path = &mut self.paths[place];
            if length == lengths[index] && hops >= path.hops {
                continue;
            }
            lengths[index] = length;
            *path = PathTo {
                length,
                hops,
                mover: short(module),
            };
            let spot = instance.spot_tree.spot_at(place).unwrap_or_default();
            let nearness = Nearness::new(length, hops, short(spot));
            self.queue.push(Reverse(nearness));
            if allocation.table.holder(spot) == Holder::Free {
                self.limit = length;
            }
        }
        least
    }

    /// Takes the nearest spot out of the frontier if it is nearer than `end`, given as path length and spots on the path.
    /// Returns path length, spots on the path, and spot.
    pub(super) fn reach_nearest(
        &mut self,
        instance: &Instance,
        end: (i64, u32),
    ) -> Option<(i64, u32, usize)> {
        while let Some(Reverse(nearest)) = self.queue.pop() {
            let (length, hops, spot) = nearest.parts();
            if (length, hops) >= end {
                return None;
            }
            let spot = spot as usize;
            let place = instance.spot_tree.place_of(spot);
            let leaf = place / LEAF_SIZE;
            let known = &mut self.lengths[leaf][place % LEAF_SIZE];
            if *known == length && self.paths[place].hops == hops {
                *known = REACHED;
                self.open[leaf] -= 1;
                return Some((length, hops, spot));
            }
        }
        None
    }

    /// The module that moves to a spot on the shortest path to it.
    pub(super) fn mover_to(&self, instance: &Instance, spot: usize) -> usize {
        self.paths[instance.spot_tree.place_of(spot)].mover as usize
    }

    /// The length of the shortest path to a visited spot.
    pub(super) fn length_to(&self, instance: &Instance, spot: usize) -> i64 {
        self.paths[instance.spot_tree.place_of(spot)].length
    }

    /// Lifts the bounds of the leaves and branches in which the potentials of all spots are about to fall: each potential
    /// falls by `total`, the length of the whole path, less the length of the path to its spot.
    pub(super) fn lift_bounds(&mut self, total: i64) {
        for (branch, branch_lift) in self.branch_lifts.iter_mut().enumerate() {
            let first = branch * BRANCH_SIZE;
            let lifts = self.leaf_lifts[first..].iter_mut().take(BRANCH_SIZE);
            let mut fall_of_branch = UNREACHABLE;
            for (lift, leaf) in lifts.zip(first..) {
                let mut fall = if self.open[leaf] > 0 { 0 } else { UNREACHABLE };
                if fall > 0 {
                    for (index, &offset) in self.offsets[leaf].iter().enumerate() {
                        if offset != CLOSED {
                            fall = fall.min(total - self.paths[leaf * LEAF_SIZE + index].length);
                        }
                    }
                }
                fall_of_branch = fall_of_branch.min(fall);
                if fall < UNREACHABLE {
                    *lift += fall;
                }
            }
            if fall_of_branch < UNREACHABLE {
                *branch_lift += fall_of_branch;
            }
        }
    }
}
