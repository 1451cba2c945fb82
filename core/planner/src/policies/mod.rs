//! Policies that decide at once: instance in, allocation out. Each is a file of this folder.
//!
//! The allocation is computed before the first turn; each unit then claims its spots in its turn, so that all replicas check
//! and carry it out like any other plan. Begin at [`AllocationPolicy`]; `docs/own_policy.md` has the steps for one of your own.

mod auction;
mod hungarian;
mod open_instance;
mod whole_allocation;

use formation_baselines::auction::AuctionCounts;
use formation_model::{Policy, for_each_own_policy};

pub use open_instance::OpenInstance;
pub(crate) use whole_allocation::WholeAllocation;

/// A policy that decides at once.
///
/// It must depend on the instance alone: no clock, random numbers, hash order or floats in comparisons, because every replica
/// computes it anew and the results must be equal.
pub trait AllocationPolicy: Sync {
    /// The spot of each module, both by their positions in the instance's lists; `None` leaves a module without one. Every
    /// spot at most once, and as many modules placed as there are spots for.
    fn allocate(&self, instance: &OpenInstance) -> Vec<Option<usize>>;

    /// The same, with the number of messages if it is an auction.
    fn allocate_counting(
        &self,
        instance: &OpenInstance,
    ) -> (Vec<Option<usize>>, Option<AuctionCounts>) {
        (self.allocate(instance), None)
    }

    /// Whether docked modules stay docked where their spots are adjacent.
    fn keeps_links(&self) -> bool {
        true
    }
}

macro_rules! declare_own {
    ($($name:ident, $sentence:literal, $source:literal;)*) => {
        $(mod $name;)*

        /// The policy of one's own of that name.
        fn own(name: &str) -> Option<&'static dyn AllocationPolicy> {
            match name {
                $(stringify!($name) => Some($name::POLICY),)*
                _ => None,
            }
        }
    };
}

for_each_own_policy!(declare_own);

/// The policy, if it decides at once; `None` for one that decides turn by turn, and for `given`, which decides nothing.
pub(crate) fn at_once(policy: Policy) -> Option<&'static dyn AllocationPolicy> {
    match policy {
        Policy::Exact | Policy::Paper | Policy::Given => None,
        Policy::Auction => Some(auction::POLICY),
        Policy::Hungarian => Some(hungarian::POLICY),
        Policy::Own(policy) => own(policy.name()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_policy_of_ones_own_has_its_file() {
        for (policy, _) in Policy::all() {
            let needs_none = matches!(policy, Policy::Exact | Policy::Paper | Policy::Given);
            assert_eq!(at_once(policy).is_none(), needs_none, "{policy:?}");
        }
    }
}
