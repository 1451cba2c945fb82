//! The spots that a search for a chain may go to next, with the shortest path known to each.
//!
//! Dijkstra's search would look at every spot for every module that it reaches. But only spots of small reduced cost
//! matter, since paths longer than the best known end are of no use, and these are few and lie together. So each
//! module keeps, for each leaf of the tree of spots and for each branch of adjacent leaves, a lower bound for what a
//! spot there costs it, less the spot's potential, and looks into a branch or leaf only if the bound lets it. A bound
//! stays valid as potentials only ever fall; where the potentials of a whole leaf or branch fall together, they lift the
//! bounds of all modules at once.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::planner::assignment::eviction::Allocation;
use crate::planner::assignment::spot_tree::{BRANCH_SIZE, LEAF_SIZE};
use crate::planner::assignment::{Holder, Instance};
use crate::planner::value::Utilities;

/// A spot by how near it is: length of the path, then spots on it, then identifier, in one number, as these are compared
/// more often than anything else.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Nearness(u128);

impl Nearness {
    fn new(length: i64, hops: u32, spot: u32) -> Self {
        // With its sign turned, a signed number is ordered as an unsigned one.
        let length = length.cast_unsigned() ^ SIGN;
        Self(u128::from(length) << 64 | u128::from(hops) << 32 | u128::from(spot))
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "takes apart what was put together of just these"
    )]
    fn parts(self) -> (i64, u32, u32) {
        let length = ((self.0 >> 64) as u64 ^ SIGN).cast_signed();
        (length, (self.0 >> 32) as u32, self.0 as u32)
    }
}

const SIGN: u64 = 1 << 63;

/// The shortest path known to a spot.
#[derive(Clone, Copy, Debug, Default)]
struct PathTo {
    length: i64,
    hops: u32,
    /// The module that moves here.
    mover: u32,
}

/// A module from which paths go on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mover {
    pub(crate) module: usize,
    /// The length of the shortest path to it.
    pub(crate) length: i64,
    /// The spots on that path, the one to which the module moves next included.
    pub(crate) hops: u32,
}

/// The costs of ways are kept if they are no more than this many, so that a process can hold many replicas; otherwise
/// they are computed whenever needed.
const WAY_COSTS_KEPT_MAX: usize = 1 << 18;

/// The same for a search that is the only one.
const WAY_COSTS_KEPT_MAX_ALONE: usize = 1 << 24;

/// What a spot costs at most; more than any limit.
const UNREACHABLE: i64 = i64::MAX / 8;

/// Stands for the length of the path to a spot that was reached, which nothing shortens.
const REACHED: i64 = i64::MIN;

/// The offset of a place that no path leads to: it has no spot, or one that stays as it is.
const CLOSED: i64 = -UNREACHABLE;

/// A position in 32 bits; there are never as many modules or spots.
fn short(position: usize) -> u32 {
    u32::try_from(position).unwrap_or(u32::MAX)
}

/// The frontier of one search, and the bounds that outlast it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Frontier {
    /// For the places of each leaf, the length of the shortest path known; [`UNREACHABLE`] if there is none, and
    /// [`REACHED`] once there cannot be a shorter one. Apart from the rest, so that most of it stays in the cache.
    lengths: Vec<[i64; LEAF_SIZE]>,
    /// By place; means something where a path is known.
    paths: Vec<PathTo>,
    /// For the places of each leaf, the net value and potential of the spot.
    offsets: Vec<[i64; LEAF_SIZE]>,
    /// How many spots of each leaf may still be reached.
    open: Vec<usize>,
    /// The places that nobody holds.
    free: Vec<usize>,
    queue: BinaryHeap<Reverse<Nearness>>,
    /// Paths longer than this are of no use.
    limit: i64,
    /// By how much the potentials of all spots of each leaf have fallen together.
    leaf_lifts: Vec<i64>,
    /// The same for each branch.
    branch_lifts: Vec<i64>,
    /// What is kept for each module that was inserted.
    outlooks: Vec<Outlook>,
    is_alone: bool,
}

/// What a module knows of all spots.
#[derive(Clone, Debug, Default)]
struct Outlook {
    /// The costs of the ways to the places of each leaf; empty if they are not kept.
    way_costs: Vec<[u32; LEAF_SIZE]>,
    /// The bound of each leaf, less the leaf's lift when it was computed.
    leaf_bounds: Vec<i64>,
    /// The same for each branch.
    branch_bounds: Vec<i64>,
}

impl Outlook {
    fn new(instance: &Instance, module: usize, kept_max: usize) -> Self {
        let tree = &instance.spot_tree;
        let keeps_ways = instance.utilities.module_count() * tree.place_count() <= kept_max;
        let way_costs: Option<Vec<_>> = (0..if keeps_ways { tree.leaf_count() } else { 0 })
            .map(|leaf| shortened(ways_to_leaf(instance, module, leaf)))
            .collect();
        Self {
            way_costs: way_costs.unwrap_or_default(),
            leaf_bounds: vec![-UNREACHABLE; tree.leaf_count()],
            branch_bounds: vec![-UNREACHABLE; tree.branch_count()],
        }
    }
}

fn ways_to_leaf(instance: &Instance, module: usize, leaf: usize) -> [i64; LEAF_SIZE] {
    let utilities: &Utilities = &instance.utilities;
    std::array::from_fn(|index| {
        utilities.way_cost(module, instance.spot_tree.pose_at(leaf * LEAF_SIZE + index))
    })
}

/// The same costs in half the memory; `None` if one is too high for that.
fn shortened(ways: [i64; LEAF_SIZE]) -> Option<[u32; LEAF_SIZE]> {
    let mut short = [0; LEAF_SIZE];
    for (short, way) in short.iter_mut().zip(ways) {
        *short = u32::try_from(way).ok()?;
    }
    Some(short)
}

impl Frontier {
    /// Lets the frontier take more memory for speed.
    pub(crate) fn expect_to_be_alone(&mut self) {
        self.is_alone = true;
    }

    /// Begins a search.
    pub(crate) fn reset(&mut self, instance: &Instance, allocation: &Allocation) {
        let tree = &instance.spot_tree;
        let utilities = &instance.utilities;
        if self.outlooks.is_empty() {
            self.paths = vec![PathTo::default(); tree.place_count()];
            self.leaf_lifts = vec![0; tree.leaf_count()];
            self.branch_lifts = vec![0; tree.branch_count()];
            self.outlooks = vec![Outlook::default(); utilities.module_count()];
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
                    Holder::Nobody => self.free.push(place),
                    Holder::Singleton(_) => (),
                }
                *offset = utilities.net_value(spot) + allocation.potential_of_spot(spot);
                open += 1;
            }
            self.offsets.push(offsets);
            self.open.push(open);
            if open == 0 {
                // What is fixed stays so, and nobody needs to look here again.
                self.leaf_lifts[leaf] = 2 * UNREACHABLE;
            }
        }
    }

    /// Lets paths that are longer than `length` be forgotten.
    pub(crate) fn limit_to(&mut self, length: i64) {
        self.limit = self.limit.min(length);
    }

    /// Shortens the paths to all spots to which a module can move on within the limit.
    pub(crate) fn relax(&mut self, instance: &Instance, allocation: &Allocation, mover: Mover) {
        let module = mover.module;
        let base = mover.length - allocation.potential_of_module(module)
            + instance.utilities.undocking(module);
        let mut outlook = std::mem::take(&mut self.outlooks[module]);
        if outlook.leaf_bounds.is_empty() {
            let kept_max = if self.is_alone {
                WAY_COSTS_KEPT_MAX_ALONE
            } else {
                WAY_COSTS_KEPT_MAX
            };
            outlook = Outlook::new(instance, module, kept_max);
        }
        let Outlook {
            way_costs,
            leaf_bounds,
            branch_bounds,
        } = &mut outlook;
        if mover.hops == 1 {
            self.limit_by_free_spots(instance, module, way_costs, base);
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
                        self.relax_leaf(instance, allocation, leaf, way_costs, mover, base);
                    *bound = reduced - lift;
                }
                least = least.min(*bound + lift);
            }
            *branch_bound = least - branch_lift;
        }
        self.outlooks[module] = outlook;
    }

    /// Limits the search to the length of the shortest path that ends at once.
    fn limit_by_free_spots(
        &mut self,
        instance: &Instance,
        module: usize,
        way_costs: &[[u32; LEAF_SIZE]],
        base: i64,
    ) {
        for &place in &self.free {
            let (leaf, index) = (place / LEAF_SIZE, place % LEAF_SIZE);
            let way = way_costs.get(leaf).map(|ways| i64::from(ways[index]));
            let way = way.unwrap_or_else(|| {
                let pose = instance.spot_tree.pose_at(place);
                instance.utilities.way_cost(module, pose)
            });
            self.limit = self.limit.min(base + way - self.offsets[leaf][index]);
        }
    }

    /// Shortens the paths to a leaf's spots, and returns the least cost of any, less its potential.
    fn relax_leaf(
        &mut self,
        instance: &Instance,
        allocation: &Allocation,
        leaf: usize,
        way_costs: &[[u32; LEAF_SIZE]],
        mover: Mover,
        base: i64,
    ) -> i64 {
        let Mover { module, hops, .. } = mover;
        let ways = match way_costs.get(leaf) {
            Some(ways) => ways.map(i64::from),
            None => ways_to_leaf(instance, module, leaf),
        };
        let (offsets, lengths) = (&self.offsets[leaf], &mut self.lengths[leaf]);
        let mut least = UNREACHABLE;
        for index in 0..LEAF_SIZE {
            let reduced = ways[index] - offsets[index];
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
            if allocation.table.holder(spot) == Holder::Nobody {
                self.limit = length;
            }
        }
        least
    }

    /// Takes the nearest spot out of the frontier if it is nearer than `end`, given as length and spots on the path.
    pub(crate) fn reach_nearest(
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
    pub(crate) fn mover_to(&self, instance: &Instance, spot: usize) -> usize {
        self.paths[instance.spot_tree.place_of(spot)].mover as usize
    }

    /// The length of the shortest path to a spot that was reached.
    pub(crate) fn length_to(&self, instance: &Instance, spot: usize) -> i64 {
        self.paths[instance.spot_tree.place_of(spot)].length
    }

    /// Lifts the bounds of leaves and branches in which the potentials of all spots are about to fall, each by what is
    /// missing at it to the length of the whole path.
    pub(crate) fn lift_bounds(&mut self, total: i64) {
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
