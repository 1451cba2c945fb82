//! Which of some spots is best for a module.

use std::cmp::Reverse;

use crate::assignment::allocation::SpotTable;
use crate::assignment::instance::Instance;
use crate::assignment::spot_tree::{BRANCH_SIZE, LEAF_SIZE, PositionBox, SpotTree};
use crate::value::Utilities;

/// A gain in utility and the evictions that it takes; a greater gain is better, then fewer evictions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Prospect {
    gain: i64,
    /// Minus the number of evictions.
    spared_evictions: i64,
}

impl Prospect {
    /// This prospect with one more eviction and its gain.
    pub(crate) fn after_eviction(self, gain: i64) -> Self {
        Self {
            gain: self.gain + gain,
            spared_evictions: self.spared_evictions - 1,
        }
    }

    /// The sum of this prospect and another.
    pub(crate) fn followed_by(self, other: Self) -> Self {
        Self {
            gain: self.gain + other.gain,
            spared_evictions: self.spared_evictions + other.spared_evictions,
        }
    }

    pub(crate) fn gain(self) -> i64 {
        self.gain
    }
}

/// Some spots, each with a prospect that comes on top of its utility (its *promise*), prepared for queries by module.
#[derive(Clone, Debug)]
pub(crate) struct BestOfSpots<'a> {
    tree: &'a SpotTree,
    utilities: &'a Utilities,
    /// At each place, the net value of the spot plus its promise; `None` if the spot is not among those given.
    promises: Vec<Option<Prospect>>,
    /// The greatest entry of `promises` in each leaf, then in each branch.
    greatest: Vec<Option<Prospect>>,
}

impl<'a> BestOfSpots<'a> {
    /// Prepares the given spots with their promises.
    pub(crate) fn new(
        instance: &'a Instance,
        spots: impl Iterator<Item = (usize, Prospect)>,
    ) -> Self {
        let (tree, utilities) = (&instance.spot_tree, &instance.utilities);
        let mut promises = vec![None; tree.place_count()];
        for (spot, promise) in spots {
            promises[tree.place_of(spot)] = Some(Prospect {
                gain: promise.gain + utilities.net_value(spot),
                ..promise
            });
        }
        let greatest_of = |promises: &[Option<Prospect>]| promises.iter().copied().max().flatten();
        let mut greatest: Vec<_> = promises.chunks(LEAF_SIZE).map(greatest_of).collect();
        let branches: Vec<_> = greatest.chunks(BRANCH_SIZE).map(greatest_of).collect();
        greatest.extend(branches);
        Self {
            tree,
            utilities,
            promises,
            greatest,
        }
    }

    /// The free spots of a table, which promise nothing beyond their utility.
    pub(crate) fn free(instance: &'a Instance, table: &SpotTable) -> Self {
        let free = table.free_spots();
        Self::new(instance, free.map(|spot| (spot, Prospect::default())))
    }

    /// The best spot for a module, the lowest among equals, with the sum of its utility and its promise; `None` if no spot
    /// was given.
    pub(crate) fn best_for(&self, module: usize) -> Option<(Prospect, usize)> {
        let leaf_count = self.tree.leaf_count();
        let mut best: Option<(Prospect, Reverse<usize>)> = None;
        let can_beat = |best: Option<(Prospect, _)>, group: usize, around: &PositionBox| {
            let Some(greatest) = self.greatest[group] else {
                return false;
            };
            let nearest = around.nearest_to(self.utilities.module_pose(module));
            let gain = greatest.gain - self.utilities.least_travel_cost(module, &nearest);
            best.is_none_or(|(best, _)| gain >= best.gain)
        };
        for (branch, around) in self.tree.branch_boxes.iter().enumerate() {
            if !can_beat(best, leaf_count + branch, around) {
                continue;
            }
            let first = branch * BRANCH_SIZE;
            for leaf in first..leaf_count.min(first + BRANCH_SIZE) {
                if !can_beat(best, leaf, &self.tree.leaf_boxes[leaf]) {
                    continue;
                }
                for place in leaf * LEAF_SIZE..(leaf + 1) * LEAF_SIZE {
                    if let (Some(promise), Some(spot)) =
                        (self.promises[place], self.tree.spot_at(place))
                    {
                        let cost = self.utilities.travel_cost(module, spot);
                        let gain = promise.gain - cost;
                        best = best.max(Some((Prospect { gain, ..promise }, Reverse(spot))));
                    }
                }
            }
        }
        best.map(|(offered, Reverse(spot))| {
            let gain = offered.gain - self.utilities.undocking(module);
            (Prospect { gain, ..offered }, spot)
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use formation_generate::{GeneratorParameters, generate};
    use formation_model::Scenario;

    #[test]
    fn the_tree_holds_every_spot_and_finds_the_best() {
        for spots in [1, 2, 7, 8, 9, 33, 100, 257, 1_000] {
            let raw = generate(&GeneratorParameters::new(20, spots, 5)).unwrap();
            let problem = Arc::new(Scenario::try_from(raw).unwrap().problem().clone());
            let instance = Instance::new(Arc::clone(&problem), Arc::clone(problem.target()));
            let tree = SpotTree::new(problem.target());
            for spot in 0..spots {
                let place = tree.place_of(spot);
                assert_eq!(tree.spot_at(place), Some(spot));
            }
            let held = (0..tree.place_count()).filter_map(|place| tree.spot_at(place));
            assert_eq!(held.count(), spots);
            for stride in [1, 3, 3_000] {
                let chosen = || (0..spots).filter(move |spot| spot % stride == stride / 2);
                let promise = |spot: usize| Prospect {
                    gain: 3_000_000 * i64::try_from(spot % 5).unwrap(),
                    spared_evictions: 0,
                };
                let best = BestOfSpots::new(&instance, chosen().map(|spot| (spot, promise(spot))));
                for module in 0..20 {
                    let offered = |spot: usize| {
                        let gain = instance.utilities.of(module, spot).0 + promise(spot).gain;
                        (gain, Reverse(spot))
                    };
                    let found = best
                        .best_for(module)
                        .map(|(best, spot)| (best.gain, Reverse(spot)));
                    assert_eq!(found, chosen().map(offered).max());
                }
            }
        }
    }
}
