//! The spots that bodies block, and the part of a target that they leave open.

use crate::body_form::BodyForm;
use crate::{
    Area, BlockedSpot, BodyReport, ModuleId, Pose, Roster, RosterMember, Service, SpotId, Target,
    Whereabouts,
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
}

#[cfg(test)]
pub(crate) mod tests {
    use std::cmp::Ordering;
    use std::sync::Arc;

    use super::*;
    use crate::{Epoch, Incarnation, PlanningModule, Polyline, Pose, RawSpot, RawTarget};

    pub(crate) fn at(x: f64, y: f64) -> Pose {
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

    pub(crate) fn member(id: u32, pin: Option<u32>, service: Service, pose: Pose) -> RosterMember {
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
    pub(crate) fn row(count: u32) -> Arc<Target> {
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
