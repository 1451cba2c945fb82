//! What follows from a plan and a roster: the same for all members, so the agents of a process share it.

use std::collections::BTreeMap;

use formation_model::{Digest, Incarnation, ModuleId, Plan, Pose, Roster, SpotId};
use formation_motion::PlannedMotion;

use super::aside;

/// The place of a module in a plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub spot: SpotId,
    /// The position of its unit in the acting order.
    pub unit: usize,
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
    /// In straight lines: the modules without a spot that move off one before any unit acts, in that order, and where they
    /// go. Along paths they make way like all others.
    pub asides: Vec<(ModuleId, Pose)>,
    /// Each module that moves, with its step in straight lines and its goal. First those make room that do, one by one; then the
    /// units act.
    pub motions: BTreeMap<ModuleId, (usize, Pose)>,
}

impl RosterPlan {
    pub fn of(roster: &Roster, plan: &Plan, motion: &PlannedMotion, digest: Digest) -> Self {
        let members = roster.members.iter();
        let units = plan.assembly.units.iter().enumerate();
        let places = units.clone().flat_map(|(unit, acting)| {
            let placements = acting.placements.iter();
            placements.map(move |&(module, spot)| (module, Place { spot, unit }))
        });
        let asides = match motion {
            PlannedMotion::Straight(_) => aside::asides(roster, plan),
            PlannedMotion::Paths(_) | PlannedMotion::Refused(_) => Vec::new(),
        };
        let target = roster.target.target.as_deref();
        let moving = units.filter(|(_, acting)| !acting.pinned);
        let to_spots = moving.flat_map(|(unit, acting)| {
            let step = asides.len() + unit;
            let goals = acting.placements.iter();
            goals
                .filter_map(move |&(module, spot)| Some((module, (step, target?.spot(spot)?.pose))))
        });
        let making_room = asides.iter().enumerate();
        let making_room = making_room.map(|(step, &(module, pose))| (module, (step, pose)));
        let motions = to_spots.chain(making_room).collect();
        Self {
            digest,
            members: members
                .map(|member| (member.module.id, member.incarnation))
                .collect(),
            places: places.collect(),
            asides,
            motions,
        }
    }
}
