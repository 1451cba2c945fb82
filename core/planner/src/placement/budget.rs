//! What all placements of one plan may spend on their searches.

/// The search nodes of one plan. [`crate::cost`] has the time that they take.
const NODES_MAX: u64 = 12_000_000;

/// The search nodes that are left to the placements of a plan.
///
/// Every replica counts the same nodes, so that all of them end a search at the same matching; with a time limit they could
/// differ. A search node is a pair that the search for a whole configuration tries; everything else is counted in its multiples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SearchBudget {
    left: u64,
}

impl SearchBudget {
    /// The budget of a whole plan.
    pub(crate) fn of_plan() -> Self {
        Self::of(NODES_MAX)
    }

    pub(crate) fn of(nodes: u64) -> Self {
        Self { left: nodes }
    }

    /// Half of it: a dry run of all turns leaves the other half to the turns.
    pub(crate) fn half(self) -> Self {
        Self {
            left: self.left / 2,
        }
    }

    /// The search nodes that were spent since it was `before`.
    pub(crate) fn spent_since(self, before: Self) -> u64 {
        before.left - self.left
    }

    /// The share of the next placement, if `configurations` are to be placed with that one. What it leaves over is for those
    /// that follow.
    pub(crate) fn share(self, configurations: usize) -> u64 {
        self.left / configurations.max(1) as u64
    }

    /// Takes away what a placement has spent. The first round of each placement always runs, even where nothing is left.
    pub(crate) fn spend(&mut self, nodes: u64) {
        self.left = self.left.saturating_sub(nodes);
    }
}
