//! The spots grouped by position, so that searches can skip those too far away to matter.

use std::cmp::Reverse;

use crate::model::{MicroUnits, Pose, Target};
use crate::planner::assignment::Instance;
use crate::planner::value::Utilities;

/// How many places a leaf has.
pub(crate) const LEAF_SIZE: usize = 8;

/// How many adjacent leaves make a branch.
pub(crate) const BRANCH_SIZE: usize = 16;

/// Stands for the spot of a place that has none.
const NO_SPOT: usize = usize::MAX;

/// Leaves of up to [`LEAF_SIZE`] spots that lie together, and branches of up to [`BRANCH_SIZE`] leaves.
///
/// The spots are halved along the longer side of their box until a leaf holds each part (J. L. Bentley,
/// "Multidimensional binary search trees used for associative searching", Communications of the ACM 18, 1975). A leaf's
/// spots take its *places*; those left over stay empty.
#[derive(Clone, Debug)]
pub(crate) struct SpotTree {
    /// The spot at each place, [`NO_SPOT`] where there is none.
    spots: Vec<usize>,
    /// The place of each spot.
    places: Vec<usize>,
    /// The pose of the spot at each place.
    poses: Vec<Pose>,
    leaf_boxes: Vec<PositionBox>,
    branch_boxes: Vec<PositionBox>,
}

/// An upright rectangle.
#[derive(Clone, Copy, Debug)]
struct PositionBox {
    low: (MicroUnits, MicroUnits),
    high: (MicroUnits, MicroUnits),
}

impl PositionBox {
    const EMPTY: Self = Self {
        low: (MicroUnits(i64::MAX), MicroUnits(i64::MAX)),
        high: (MicroUnits(i64::MIN), MicroUnits(i64::MIN)),
    };

    fn around<'a>(poses: impl Iterator<Item = &'a Pose>) -> Self {
        poses.fold(Self::EMPTY, |around, pose| {
            around.joined(&Self {
                low: (pose.x, pose.y),
                high: (pose.x, pose.y),
            })
        })
    }

    fn joined(&self, other: &Self) -> Self {
        Self {
            low: (self.low.0.min(other.low.0), self.low.1.min(other.low.1)),
            high: (self.high.0.max(other.high.0), self.high.1.max(other.high.1)),
        }
    }

    /// The point of the box nearest to a pose. The distance to it is a bound for all distances into the box, also
    /// after rounding down.
    fn nearest_to(&self, pose: &Pose) -> Pose {
        Pose {
            x: pose.x.clamp(self.low.0, self.high.0),
            y: pose.y.clamp(self.low.1, self.high.1),
            theta: pose.theta,
        }
    }
}

impl SpotTree {
    pub(crate) fn new(target: &Target) -> Self {
        let poses: Vec<Pose> = target.spots().iter().map(|spot| spot.pose).collect();
        let leaf_count = poses.len().div_ceil(LEAF_SIZE);
        let mut order: Vec<usize> = (0..poses.len()).collect();
        let mut spots = vec![NO_SPOT; leaf_count * LEAF_SIZE];
        // Each entry: a range of `order`, and the first and the number of the leaves that it fills.
        let mut stack = vec![(0..poses.len(), 0, leaf_count)];
        while let Some((range, first, count)) = stack.pop() {
            let within = &mut order[range.clone()];
            if count <= 1 {
                within.sort_unstable();
                spots[first * LEAF_SIZE..][..within.len()].copy_from_slice(within);
                continue;
            }
            let left = count / 2;
            let middle = within.len() * left / count;
            let around = PositionBox::around(within.iter().map(|&spot| &poses[spot]));
            let is_wide = around.high.0 - around.low.0 >= around.high.1 - around.low.1;
            within.select_nth_unstable_by_key(middle, |&spot| {
                let Pose { x, y, .. } = poses[spot];
                (if is_wide { x } else { y }, spot)
            });
            let middle = range.start + middle;
            stack.push((range.start..middle, first, left));
            stack.push((middle..range.end, first + left, count - left));
        }
        let mut places = vec![0; poses.len()];
        for (place, &spot) in spots.iter().enumerate() {
            if let Some(entry) = places.get_mut(spot) {
                *entry = place;
            }
        }
        let leaf_boxes: Vec<PositionBox> = spots
            .chunks(LEAF_SIZE)
            .map(|leaf| PositionBox::around(leaf.iter().filter_map(|&spot| poses.get(spot))))
            .collect();
        Self {
            branch_boxes: leaf_boxes
                .chunks(BRANCH_SIZE)
                .map(|branch| {
                    branch
                        .iter()
                        .fold(PositionBox::EMPTY, |around, leaf| around.joined(leaf))
                })
                .collect(),
            leaf_boxes,
            poses: spots
                .iter()
                // Where there is no spot, a pose as near as any keeps costs of ways small.
                .map(|&spot| {
                    poses
                        .get(spot)
                        .or(poses.first())
                        .copied()
                        .unwrap_or_default()
                })
                .collect(),
            places,
            spots,
        }
    }

    pub(crate) fn place_count(&self) -> usize {
        self.spots.len()
    }

    pub(crate) fn leaf_count(&self) -> usize {
        self.leaf_boxes.len()
    }

    pub(crate) fn branch_count(&self) -> usize {
        self.branch_boxes.len()
    }

    /// The spot at a place, if there is one.
    pub(crate) fn spot_at(&self, place: usize) -> Option<usize> {
        Some(self.spots[place]).filter(|&spot| spot != NO_SPOT)
    }

    /// The pose of the spot at a place; any pose where there is none.
    pub(crate) fn pose_at(&self, place: usize) -> &Pose {
        &self.poses[place]
    }

    pub(crate) fn place_of(&self, spot: usize) -> usize {
        self.places[spot]
    }
}

/// What can be gained, and with how many evictions; more gain is better, then fewer evictions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Prospect {
    gain: i64,
    /// Minus the number of evictions.
    spared_evictions: i64,
}

impl Prospect {
    /// With one eviction more, and what it gains.
    pub(crate) fn after_eviction(self, gain: i64) -> Self {
        Self {
            gain: self.gain + gain,
            spared_evictions: self.spared_evictions - 1,
        }
    }

    /// This and then the other.
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

/// Answers which of some spots is best for a module, where each promises something on top of its utility.
#[derive(Clone, Debug)]
pub(crate) struct BestOfSpots<'a> {
    tree: &'a SpotTree,
    utilities: &'a Utilities,
    /// The spot at each place with its net value and promise together; `None` if it is not one of them.
    promises: Vec<Option<Prospect>>,
    /// The greatest of them in each leaf, then in each branch.
    greatest: Vec<Option<Prospect>>,
}

impl<'a> BestOfSpots<'a> {
    /// Prepares for the given spots and what each promises.
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

    /// The best spot for a module, the lowest among equals, and its utility and promise together; `None` if there are
    /// no spots.
    pub(crate) fn best_for(&self, module: usize) -> Option<(Prospect, usize)> {
        let leaf_count = self.tree.leaf_count();
        let mut best: Option<(Prospect, Reverse<usize>)> = None;
        let can_beat = |best: Option<(Prospect, _)>, group: usize, around: &PositionBox| {
            let Some(greatest) = self.greatest[group] else {
                return false;
            };
            let nearest = around.nearest_to(self.utilities.module_pose(module));
            let gain = greatest.gain - self.utilities.way_cost(module, &nearest);
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
                    let Some(promise) = self.promises[place] else {
                        continue;
                    };
                    let way = self.utilities.way_cost(module, self.tree.pose_at(place));
                    let offered = Prospect {
                        gain: promise.gain - way,
                        ..promise
                    };
                    best = best.max(Some((offered, Reverse(self.tree.spots[place]))));
                }
            }
        }
        best.map(|(offered, Reverse(spot))| {
            let undocking = self.utilities.undocking(module);
            let whole = Prospect {
                gain: offered.gain - undocking,
                ..offered
            };
            (whole, spot)
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::generate::{GeneratorParameters, generate};
    use crate::model::Scenario;

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
                assert_eq!(*tree.pose_at(place), problem.target().spots()[spot].pose);
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
