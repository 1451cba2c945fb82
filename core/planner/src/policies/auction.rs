//! Bertsekas' auction, the paper's comparison, which `formation_baselines` has. It breaks all links.

use formation_baselines::auction::{self, AuctionCounts};

use super::{AllocationPolicy, OpenInstance};

pub(super) const POLICY: &dyn AllocationPolicy = &Auction;

struct Auction;

impl AllocationPolicy for Auction {
    fn allocate(&self, instance: &OpenInstance) -> Vec<Option<usize>> {
        self.allocate_counting(instance).0
    }

    fn allocate_counting(
        &self,
        instance: &OpenInstance,
    ) -> (Vec<Option<usize>>, Option<AuctionCounts>) {
        let outcome = auction::assign(&instance.utilities());
        (outcome.assignment, Some(outcome.counts))
    }

    fn keeps_links(&self) -> bool {
        false
    }
}
