//! An allocation that is known before the first turn, and what each unit claims of it.

use formation_baselines::auction::AuctionCounts;
use formation_model::{GivenAllocation, kept_groups, largest_group};

use super::{OpenInstance, at_once};
use crate::assignment::{Holder, Instance, SpotTable};

/// The allocation of a policy that decides at once, or the one that the target gives.
#[derive(Clone, Debug, Default)]
pub(crate) struct WholeAllocation {
    /// The spot of each module; `None` for modules that held one before, and for those that get none.
    pub(crate) spot_of: Vec<Option<usize>>,
    /// Whether docked modules stay docked where their spots are adjacent.
    pub(crate) keeps_links: bool,
    /// For each module, whether it leaves its configuration; empty if that follows from the spots.
    leaves: Vec<bool>,
    /// The messages of the auction; `None` under every other policy.
    pub(crate) auction: Option<AuctionCounts>,
}

impl WholeAllocation {
    /// Allocates the free spots to the modules without one; `None` for policies that decide turn by turn.
    pub(crate) fn of(instance: &Instance, table: &SpotTable) -> Option<Self> {
        if let Some(given) = instance.target.given() {
            return Some(Self::given(given, instance, table));
        }
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
            leaves: Vec::new(),
            auction,
        })
    }

    /// The allocation that a target gives; [`PlanningProblem::check_given`](formation_model::PlanningProblem::check_given) has
    /// found it possible.
    fn given(given: &GivenAllocation, instance: &Instance, table: &SpotTable) -> Self {
        let modules = instance.problem.modules().iter().enumerate();
        let is_open = |position: usize, spot: usize| {
            table.spot_of(position).is_none() && table.holder(spot) == Holder::Free
        };
        let spot = |(position, id)| {
            let spot = instance.target.position_of(*given.spots().get(&id)?)?;
            is_open(position, spot).then_some(spot)
        };
        let ids = modules.map(|(position, module)| (position, module.id));
        Self {
            spot_of: ids.clone().map(spot).collect(),
            keeps_links: true,
            leaves: ids.map(|(_, id)| given.detached().contains(&id)).collect(),
            auction: None,
        }
    }

    /// The modules of a unit that stay docked on their spots, ascending; fewer than two if none do.
    ///
    /// Of a whole configuration those stay that the target does not detach. Otherwise it is the largest group that ends on
    /// adjacent spots along its links; of equally large ones, that of the lowest module.
    pub(crate) fn staying(&self, instance: &Instance, members: &[usize]) -> Vec<usize> {
        if !self.leaves.is_empty() && is_whole(instance, members) {
            let members = members.iter().copied();
            let stays = |&member: &usize| !self.leaves[member] && self.spot_of[member].is_some();
            return members.filter(stays).collect();
        }
        let links = instance.links.induced_by(members);
        let spot_of = |node: usize| self.spot_of[members[node]];
        let groups = kept_groups(&links, instance.target.topology(), spot_of);
        let largest = largest_group(groups).into_iter();
        largest.map(|node| members[node]).collect()
    }
}

/// Whether a unit is a configuration as it started, and not what is left of one.
fn is_whole(instance: &Instance, members: &[usize]) -> bool {
    let problem = &instance.problem;
    let takes_turns =
        |other: usize| problem.modules()[other].pin.is_none() && !problem.is_cut_off(other);
    members.iter().all(|&member| {
        let mut others = instance.links.neighbours(member).iter();
        others.all(|other| members.binary_search(other).is_ok() || !takes_turns(*other))
    })
}
