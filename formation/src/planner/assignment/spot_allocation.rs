//! The turn of a single module: the paper's `spotAllocation` (Algorithm 1) with chain eviction.

use crate::planner::assignment::Instance;
use crate::planner::assignment::eviction::{Allocation, ChainSearch, Step};

/// One module losing its spot to another, by position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Displacement {
    /// The module that loses its spot.
    pub(crate) evicted: usize,
    /// The module that takes it.
    pub(crate) by: usize,
    /// The spot that changes hands.
    pub(crate) from: usize,
    /// Where the evicted module goes; `None` when it is dropped.
    pub(crate) to: Option<usize>,
}

/// Places one module by the best chain, and appends the evictions that it makes in the order of the chain.
///
/// Returns the spot that the module takes; `None` means NO_SPOT_FOUND.
pub(crate) fn allocate(
    instance: &Instance,
    search: &mut ChainSearch,
    allocation: &mut Allocation,
    module: usize,
    evictions: &mut Vec<Displacement>,
) -> Option<usize> {
    let chain = search.insert(instance, allocation, module);
    evictions.extend(displacements_of(&chain));
    chain.first().and_then(|step| step.to)
}

/// The evictions that a chain makes, in its order; a ring closes without one.
pub(crate) fn displacements_of(chain: &[Step]) -> impl Iterator<Item = Displacement> + '_ {
    chain.windows(2).filter_map(|pair| {
        Some(Displacement {
            evicted: pair[1].module,
            by: pair[0].module,
            from: pair[0].to?,
            to: pair[1].to,
        })
    })
}
