//! The spots grouped by position, so that searches can skip those that are too far away to matter.

use formation_model::{MicroUnits, Pose, Target};

/// The number of places of a leaf.
pub(super) const LEAF_SIZE: usize = 8;

/// The number of adjacent leaves of a branch.
pub(super) const BRANCH_SIZE: usize = 16;

/// Marks a place without a spot.
const NO_SPOT: usize = usize::MAX;

/// Leaves of up to [`LEAF_SIZE`] neighbouring spots, and branches of up to [`BRANCH_SIZE`] leaves.
///
/// The spots are halved along the longer side of their bounding box until each part fits a leaf (J. L. Bentley,
/// "Multidimensional binary search trees used for associative searching", Communications of the ACM 18, 1975). A leaf's
/// spots take its *places*; places left over stay empty.
#[derive(Clone, Debug)]
pub(crate) struct SpotTree {
    /// The spot at each place; [`NO_SPOT`] at an empty one.
    spots: Vec<usize>,
    /// The place of each spot.
    places: Vec<usize>,
    pub(super) leaf_boxes: Vec<PositionBox>,
    pub(super) branch_boxes: Vec<PositionBox>,
}

/// An axis-aligned rectangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct PositionBox {
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

    /// The point of the box nearest to a pose. No point of the box is nearer, also after the distances are rounded down.
    pub(super) fn nearest_to(&self, pose: &Pose) -> Pose {
        Pose {
            x: pose.x.clamp(self.low.0, self.high.0),
            y: pose.y.clamp(self.low.1, self.high.1),
            theta: pose.theta,
        }
    }
}

impl SpotTree {
    pub(super) fn new(target: &Target) -> Self {
        let poses: Vec<Pose> = target.spots().iter().map(|spot| spot.pose).collect();
        let leaf_count = poses.len().div_ceil(LEAF_SIZE);
        let mut order: Vec<usize> = (0..poses.len()).collect();
        let mut spots = vec![NO_SPOT; leaf_count * LEAF_SIZE];
        // Each entry: a range of `order`, the first leaf that it fills, and the number of these leaves.
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
            places,
            spots,
        }
    }

    pub(super) fn place_count(&self) -> usize {
        self.spots.len()
    }

    pub(super) fn leaf_count(&self) -> usize {
        self.leaf_boxes.len()
    }

    pub(super) fn branch_count(&self) -> usize {
        self.branch_boxes.len()
    }

    /// The spot at a place; `None` at an empty one.
    pub(super) fn spot_at(&self, place: usize) -> Option<usize> {
        Some(self.spots[place]).filter(|&spot| spot != NO_SPOT)
    }

    pub(super) fn place_of(&self, spot: usize) -> usize {
        self.places[spot]
    }
}
