//! The part of a target that can be formed although bodies stand on some of its spots.

use std::sync::Arc;

use crate::problem::cut_off;
use crate::standing_bodies::standing_by;
use crate::{Area, BlockedSpot, BodyReport, PlanningModule, Roster, RosterMember, Target};

/// A part of a target that bodies leave open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenPart {
    /// Its spots.
    pub target: Arc<Target>,
    /// How many of them the active members can fill that have a way there.
    pub room: usize,
}

/// The part of a target that can be formed although some of its spots are blocked: of the connected parts of the others,
/// the one with room for the most active members that `standing` bodies leave a way there; of equals the one with the most settled
/// members, then the largest, then the one with the lowest spot. `None` if every spot is blocked.
/// Enforces B3.
fn open_part(
    target: &Arc<Target>,
    members: &[RosterMember],
    blocked: &[BlockedSpot],
    standing: &[Area],
) -> Option<OpenPart> {
    let active = RosterMember::active(members);
    let pins: Vec<usize> = active
        .clone()
        .filter_map(|member| target.position_of(member.module.pin?))
        .collect();
    let parts = target.topology().components_within(|position| {
        let spot = target.spots()[position].id;
        let find = blocked.binary_search_by_key(&spot, |blocked| blocked.spot);
        find.is_err()
    });
    let parts = parts.into_iter().rev().filter_map(|part| {
        let is_in = |pin: &&usize| part.binary_search(pin).is_ok();
        let settled = pins.iter().filter(is_in).count();
        let target = target.restricted_to(&part).map(Arc::new)?;
        let room = part
            .len()
            .min(with_a_way(&target, active.clone(), standing));
        Some((settled, OpenPart { target, room }))
    });
    let best = parts.max_by_key(|(settled, part)| (part.room, *settled, part.target.spots().len()));
    best.map(|(_, part)| part)
}

/// The number of members that bodies leave a way to a target.
fn with_a_way<'a>(
    target: &Target,
    members: impl Iterator<Item = &'a RosterMember>,
    standing: &[Area],
) -> usize {
    let modules = members.map(|member| {
        let mut module = member.module.clone();
        module.pin = module
            .pin
            .filter(|&spot| target.position_of(spot).is_some());
        module
    });
    let modules: Vec<PlanningModule> = modules.collect();
    let cut_off = cut_off(target, &modules, standing);
    modules.len() - cut_off.into_iter().filter(|&is_cut_off| is_cut_off).count()
}

impl Roster {
    /// The part of its target that bodies leave open; `None` when they leave none, or the target is withdrawn.
    pub fn open_target(&self) -> Option<Arc<Target>> {
        self.open_part_by(&self.bodies).map(|part| part.target)
    }

    /// The open part if these were the bodies of modules that are not members.
    pub fn open_part_by(&self, bodies: &[BodyReport]) -> Option<OpenPart> {
        let target = self.target.target.as_ref()?;
        let standing = standing_by(self, bodies);
        open_part(target, &self.members, &self.blocked_by(bodies), &standing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blocked_spots::tests::{at, member, row};
    use crate::{BODY_WIDTH, ModuleId, Service, SpotId};

    /// Shows B3.
    #[test]
    fn the_part_with_room_for_the_most_modules_is_formed() {
        let target = row(7);
        let blocked = |spot| {
            [BlockedSpot {
                spot: SpotId(spot),
                module: ModuleId(9),
            }]
        };
        let module = |id, pin| member(id, pin, Service::Active, at(9.0, 9.0));
        let ids = |members: &[RosterMember], spot: u32| {
            let part = open_part(&target, members, &blocked(spot), &[]).unwrap();
            let spots = part.target.spots().iter().map(|spot| spot.id.0);
            spots.collect::<Vec<_>>()
        };
        let four: Vec<RosterMember> = (1..=4).map(|id| module(id, None)).collect();
        assert_eq!(ids(&four, 3), [4, 5, 6, 7]);
        assert_eq!(ids(&four, 4), [1, 2, 3], "the lowest of equals");
        let two = [module(1, Some(1)), module(2, None)];
        assert_eq!(ids(&two, 3), [1, 2], "where a module has settled");
        let everything: Vec<BlockedSpot> = (1..=7).flat_map(blocked).collect();
        assert_eq!(open_part(&target, &two, &everything, &[]), None);
    }

    /// A wall of bodies stands round the larger part.
    /// Shows B3.
    #[test]
    fn a_part_to_which_no_way_leads_is_not_formed() {
        let blocked = [BlockedSpot {
            spot: SpotId(3),
            module: ModuleId(9),
        }];
        let members = [1, 2].map(|id| member(id, None, Service::Active, at(-3.0, 4.0)));
        let around = (-1..=1).flat_map(|up: i32| (3..=8).map(move |right| (right, up)));
        let wall = around.filter(|&(right, up)| up != 0 || right == 3 || right == 8);
        let wall: Vec<Area> = wall
            .map(|(right, up)| Area::of_body(&at(f64::from(right), f64::from(up)), BODY_WIDTH))
            .collect();
        let part = |standing: &[Area]| open_part(&row(7), &members, &blocked, standing).unwrap();
        let spots = |part: &OpenPart| part.target.spots().len();
        assert_eq!((spots(&part(&[])), part(&[]).room), (4, 2));
        assert_eq!((spots(&part(&wall)), part(&wall).room), (2, 2));
    }
}
