//! The spots that bodies block, and the part of a target that they leave open.

use std::sync::Arc;

use crate::body_form::BodyForm;
use crate::problem::cut_off;
use crate::standing_bodies::standing_by;
use crate::{
    Area, BlockedSpot, BodyReport, ModuleId, PlanningModule, Pose, Roster, RosterMember, Service,
    SpotId, Target, Whereabouts,
};

/// Whether a module is among these members, which ascend by module.
pub fn lists(members: &[RosterMember], module: ModuleId) -> bool {
    RosterMember::find(members, module).is_some()
}

/// The spots of a target that bodies cover, ascending.
///
/// The bodies are those that `bodies` reports of modules that are not members, and those of members that stay where they are: of
/// those whose motion failed. The spot of an active member that has settled on it is free of other bodies. A body covers a spot if it
/// reaches into its cell: no path leads there.
pub fn blocked_spots(
    target: &Target,
    members: &[RosterMember],
    bodies: &[BodyReport],
) -> Vec<BlockedSpot> {
    let staying = members.iter();
    let staying = staying.filter(|member| member.service == Service::MotionFailed);
    let mut standing: Vec<BodyReport> = staying
        .map(|member| BodyReport {
            module: member.module.id,
            incarnation: member.incarnation,
            epoch: None,
            sequence: 0,
            whereabouts: Whereabouts::Halted(member.module.pose),
        })
        .collect();
    let others = bodies.iter().filter(|body| !lists(members, body.module));
    standing.extend(others.cloned());
    standing.sort_by_key(|body| body.module);
    if standing.is_empty() {
        return Vec::new();
    }
    let active = RosterMember::active(members);
    let mut pins: Vec<SpotId> = active.filter_map(|member| member.module.pin).collect();
    pins.sort_unstable();
    let areas = areas_of(target, &standing, members);
    let spots = target.spots().iter();
    spots
        .filter(|spot| pins.binary_search(&spot.id).is_err())
        .filter_map(|spot| {
            let cell = Area::cell(spot);
            let mut bodies = standing.iter().zip(&areas);
            let (body, _) =
                bodies.find(|(_, areas)| areas.iter().any(|area| area.overlaps(&cell)))?;
            Some(BlockedSpot {
                spot: spot.id,
                module: body.module,
            })
        })
        .collect()
}

/// Whether a retired member stands on a spot, so that it makes way for a module that takes the spot.
pub(crate) fn makes_room(target: &Target, member: &RosterMember) -> bool {
    let pose = member.module.pose;
    let areas = BodyForm::of(Some(target)).areas(&[pose], 0, &[]);
    let mut spots = target.spots().iter();
    member.service == Service::Retired
        && spots.any(|spot| {
            let cell = Area::cell(spot);
            areas.iter().any(|area| area.overlaps(&cell))
        })
}

/// What each body covers.
fn areas_of(target: &Target, bodies: &[BodyReport], members: &[RosterMember]) -> Vec<Vec<Area>> {
    let form = BodyForm::of(Some(target));
    let mut known = 0;
    let of_each = bodies.iter().map(|body| {
        let areas = body_areas(form, body, known, members);
        known += areas.len();
        areas
    });
    of_each.collect()
}

/// What the body of a module that is no member may cover, in few rectangles if `known` others are many.
pub(crate) fn body_areas(
    form: BodyForm,
    body: &BodyReport,
    known: usize,
    members: &[RosterMember],
) -> Vec<Area> {
    let others: Vec<Pose> = match body.whereabouts {
        Whereabouts::OnTheWay(_) => members.iter().map(|member| member.module.pose).collect(),
        _ => Vec::new(),
    };
    form.areas(body.whereabouts.poses(), known, &others)
}

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
    if blocked.is_empty() {
        return Some(OpenPart {
            target: Arc::clone(target),
            room: target.spots().len().min(active.count()),
        });
    }
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
    /// The spots of its target that bodies cover, ascending.
    pub fn blocked_spots(&self) -> Vec<BlockedSpot> {
        self.blocked_by(&self.bodies)
    }

    /// The blocked spots if these were the bodies of modules that are not members.
    pub fn blocked_by(&self, bodies: &[BodyReport]) -> Vec<BlockedSpot> {
        let target = self.target.target.as_ref();
        target.map_or_else(Vec::new, |target| {
            blocked_spots(target, &self.members, bodies)
        })
    }

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
    use std::cmp::Ordering;

    use super::*;
    use crate::{
        BODY_WIDTH, Epoch, Incarnation, PlanningModule, Polyline, Pose, RawSpot, RawTarget,
    };

    fn at(x: f64, y: f64) -> Pose {
        Pose::from_units(x, y, 0.0).unwrap()
    }

    fn report(module: u32, whereabouts: Whereabouts) -> BodyReport {
        BodyReport {
            module: ModuleId(module),
            incarnation: Incarnation(1),
            epoch: None,
            sequence: 1,
            whereabouts,
        }
    }

    fn member(id: u32, pin: Option<u32>, service: Service, pose: Pose) -> RosterMember {
        RosterMember {
            incarnation: Incarnation(1),
            knows: true,
            is_idle: true,
            service,
            module: PlanningModule {
                id: ModuleId(id),
                pose,
                links: [].into(),
                configuration: None,
                leader: None,
                pin: pin.map(SpotId),
            },
        }
    }

    /// Spots 1 to `count` in a row, one unit apart.
    fn row(count: u32) -> Arc<Target> {
        let spot = |id| RawSpot {
            id,
            x: f64::from(id),
            y: 0.0,
            theta: 0.0,
        };
        let raw = RawTarget {
            frame_id: "map".to_owned(),
            spots: (1..=count).map(spot).collect(),
            edges: (1..count).map(|id| [id, id + 1]).collect(),
        };
        Arc::new(Target::try_from(raw).unwrap())
    }

    fn blocked(members: &[RosterMember], bodies: &[BodyReport]) -> Vec<(u32, u32)> {
        blocked_spots(&row(7), members, bodies)
            .into_iter()
            .map(|BlockedSpot { spot, module }| (spot.0, module.0))
            .collect()
    }

    #[test]
    fn a_body_covers_the_spots_on_its_way() {
        let between = [report(
            9,
            Whereabouts::OnTheWay(Polyline::line(at(2.0, 3.0), at(5.0, 0.0))),
        )];
        assert_eq!(blocked(&[], &between), [(4, 9), (5, 9)]);
        let along = [report(
            9,
            Whereabouts::OnTheWay(Polyline::line(at(-3.0, 0.3), at(3.0, 0.0))),
        )];
        assert_eq!(blocked(&[], &along), [(1, 9), (2, 9), (3, 9)]);
        // A path that leads around spots 3 and 4 covers neither.
        let path = [at(2.0, -2.0), at(2.0, 2.0), at(5.0, 2.0), at(5.0, 0.4)];
        let path = Polyline::through(path).unwrap();
        let around = [report(9, Whereabouts::OnTheWay(path))];
        assert_eq!(blocked(&[], &around), [(2, 9), (5, 9)]);
        assert_eq!(blocked(&[], &[report(9, Whereabouts::Removed)]), []);
    }

    /// A planner of paths refuses a spot if a body reaches into its cell.
    #[test]
    fn a_body_covers_the_cells_that_it_reaches_into() {
        let covered = |x, y| {
            let bodies = [report(9, Whereabouts::Seen(at(x, y)))];
            let blocked = blocked_spots(&row(7), &[], &bodies);
            let spots = blocked.iter().map(|blocked| blocked.spot.0);
            spots.collect::<Vec<_>>()
        };
        assert_eq!(covered(3.0, 0.94), [3], "bodies are 0.9 units wide");
        assert_eq!(covered(3.0, 0.95), [0; 0]);
        assert_eq!(covered(3.06, 0.0), [3, 4]);
    }

    #[test]
    fn members_block_only_where_their_motion_failed() {
        let here = at(3.0, 0.0);
        for (service, expected) in [
            (Service::Active, vec![]),
            (Service::Retired, vec![]),
            (Service::MotionFailed, vec![(3, 4)]),
        ] {
            let members = [member(4, None, service, here)];
            // What is claimed of a member's body is ignored.
            let claimed = [report(4, Whereabouts::Seen(at(6.0, 0.0)))];
            assert_eq!(blocked(&members, &claimed), expected);
        }
        let settled = [member(4, Some(3), Service::Active, here)];
        assert_eq!(blocked(&settled, &[report(9, Whereabouts::Seen(here))]), []);
    }

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

    /// Shows B1.
    #[test]
    fn later_runs_and_removals_supersede() {
        let at_epoch = |number: u64, sequence, whereabouts| BodyReport {
            epoch: (number > 0).then_some(Epoch {
                number,
                convener: ModuleId(1),
            }),
            sequence,
            ..report(4, whereabouts)
        };
        let seen = || Whereabouts::Seen(at(0.0, 0.0));
        let on_the_way = Whereabouts::OnTheWay(Polyline::line(at(0.0, 0.0), at(1.0, 0.0)));
        let ascending = [
            at_epoch(0, 1, seen()),
            at_epoch(0, 2, seen()),
            at_epoch(2, 1, seen()),
            at_epoch(2, 0, on_the_way),
            at_epoch(2, 0, Whereabouts::Halted(at(1.0, 0.0))),
            at_epoch(3, 1, seen()),
            report(4, Whereabouts::Removed),
            BodyReport {
                incarnation: Incarnation(2),
                ..report(4, seen())
            },
        ];
        for pair in ascending.windows(2) {
            assert_eq!(pair[0].compare_age(&pair[1]), Ordering::Less, "{pair:?}");
        }
    }
}
