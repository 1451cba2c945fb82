//! An allocation that is known before the first turn, and what each unit claims of it.

use formation_baselines::auction::AuctionCounts;
use formation_model::Topology;

use super::{OpenInstance, at_once};
use crate::assignment::{Instance, SpotTable};

/// The allocation of a policy that decides at once.
#[derive(Clone, Debug, Default)]
pub(crate) struct WholeAllocation {
    /// The spot of each module; `None` for modules that held one before, and for those that get none.
    pub(crate) spot_of: Vec<Option<usize>>,
    /// Whether docked modules stay docked where their spots are adjacent.
    pub(crate) keeps_links: bool,
    /// The messages of the auction; `None` under every other policy.
    pub(crate) auction: Option<AuctionCounts>,
}

impl WholeAllocation {
    /// Allocates the free spots to the modules without one; `None` for policies that decide turn by turn.
    pub(crate) fn of(instance: &Instance, table: &SpotTable) -> Option<Self> {
        let policy = at_once(instance.problem.parameters().policy)?;
        let open = OpenInstance::new(instance, table);
        let (columns, auction) = policy.allocate_counting(&open);
        let mut spot_of = vec![None; instance.module_count()];
        let mut is_taken = vec![false; instance.target.spots().len()];
        for (module, column) in (0..open.modules().len()).zip(columns) {
            // A spot beyond the list, or given twice, is left to its first module: the checks of plans then name the hole.
            let spot = column.and_then(|column| open.spot_position(column));
            let spot = spot.filter(|&spot| !std::mem::replace(&mut is_taken[spot], true));
            spot_of[open.module_position(module)] = spot;
        }
        Some(Self {
            spot_of,
            keeps_links: policy.keeps_links(),
            auction,
        })
    }

    /// The largest group of some docked modules that stay docked on their spots, ascending; of equally large ones, that of the
    /// lowest module. One module alone stays docked to nothing.
    pub(crate) fn staying(&self, instance: &Instance, members: &[usize]) -> Vec<usize> {
        let links = instance.links.induced_by(members);
        let target = instance.target.topology();
        let is_kept = |&(one, other): &(usize, usize)| {
            let spots = (self.spot_of[members[one]], self.spot_of[members[other]]);
            matches!(spots, (Some(one), Some(other)) if target.has_edge(one, other))
        };
        let kept: Vec<(usize, usize)> = links.edges().iter().copied().filter(is_kept).collect();
        let groups = Topology::new(members.len(), &kept).components().into_iter();
        let largest = groups.rev().max_by_key(Vec::len).unwrap_or_default();
        largest.into_iter().map(|node| members[node]).collect()
    }
}
