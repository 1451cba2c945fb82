//! What follows from a plan and a roster: the same for all members, so the agents of a process share it.

use std::collections::BTreeMap;

use formation_model::{Digest, Incarnation, ModuleId, Plan, Roster, SpotId};

/// The place of a module in a plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub spot: SpotId,
    /// The position of its unit in the acting order.
    pub unit: usize,
    /// Its position in the order in which the spots are filled.
    pub order: usize,
}

/// What follows from a plan and a roster.
#[derive(Debug)]
pub(super) struct RosterPlan {
    /// The digest of the plan with its roster.
    pub digest: Digest,
    /// The incarnation of each member in the roster.
    pub members: BTreeMap<ModuleId, Incarnation>,
    /// The places of the modules that the plan assigns to spots.
    pub places: BTreeMap<ModuleId, Place>,
    /// The holder of each spot that the plan fills.
    pub holders: BTreeMap<SpotId, ModuleId>,
}

impl RosterPlan {
    pub fn of(roster: &Roster, plan: &Plan, digest: Digest) -> Self {
        let members = roster.members.iter();
        let units = plan.assembly.units.iter().enumerate();
        let placements = units.flat_map(|(unit, acting)| {
            let placements = acting.placements.iter();
            placements.map(move |&(module, spot)| (module, spot, unit))
        });
        let places = placements.enumerate();
        let places = places.map(|(order, (module, spot, unit))| {
            let place = Place { spot, unit, order };
            (module, place)
        });
        let places: BTreeMap<ModuleId, Place> = places.collect();
        let holders = places.iter().map(|(&module, place)| (place.spot, module));
        Self {
            digest,
            members: members
                .map(|member| (member.module.id, member.incarnation))
                .collect(),
            holders: holders.collect(),
            places,
        }
    }
}
