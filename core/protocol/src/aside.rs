//! Modules without a spot that stand on one: they make room before any unit acts.
//!
//! The plan gives spots to the modules that suit them best, wherever the others stand. A member that gets no spot and covers
//! one that another module takes moves to the nearest place of a lattice around it that is a unit away from every spot, from
//! every other module, and from every body. Retired members make room as well; those whose motion failed cannot.

use std::collections::{BTreeMap, BTreeSet};

use formation_model::{
    MICRO_PER_UNIT, MicroUnits, ModuleId, Plan, Pose, Roster, Service, SpotId,
    body::COVERING_DISTANCE,
};

/// The greatest distance that a module goes along each axis, in units.
const STEPS_MAX: i64 = 400;

/// The modules that make room, ascending, and where each of them goes.
/// Enforces S6.
pub(super) fn asides(roster: &Roster, plan: &Plan) -> Vec<(ModuleId, Pose)> {
    let Some(target) = &roster.target.target else {
        return Vec::new();
    };
    let taken: BTreeSet<SpotId> = plan.assignments.values().copied().collect();
    let spots = target.spots().iter();
    let wanted = spots.clone().filter(|spot| taken.contains(&spot.id));
    let wanted = Places::of(wanted.map(|spot| spot.pose));
    let in_the_way: Vec<(ModuleId, Pose)> = roster
        .members
        .iter()
        .filter(|member| member.service != Service::MotionFailed)
        .map(|member| &member.module)
        .filter(|module| !plan.assignments.contains_key(&module.id))
        .filter(|module| !wanted.are_clear_of(&module.pose, COVERING_DISTANCE))
        .map(|module| (module.id, module.pose))
        .collect();
    if in_the_way.is_empty() {
        return Vec::new();
    }
    let mut occupied = Places::of(spots.map(|spot| spot.pose));
    for member in &roster.members {
        occupied.add(member.module.pose);
    }
    for pose in roster
        .bodies
        .iter()
        .flat_map(|body| body.whereabouts.poses())
    {
        occupied.add(*pose);
    }
    let mut asides = Vec::with_capacity(in_the_way.len());
    for (module, from) in in_the_way {
        if let Some(pose) = nearest_clear(&from, &occupied) {
            occupied.add(pose);
            asides.push((module, pose));
        }
    }
    asides
}

/// The nearest place of the unit lattice around a pose that is a unit away from all occupied ones, the lowest of equals.
fn nearest_clear(from: &Pose, occupied: &Places) -> Option<Pose> {
    // A place on ring n is at most n times the square root of two away, so later rings may hold a nearer one.
    let mut best: Option<(MicroUnits, Pose)> = None;
    for ring in 1..=STEPS_MAX {
        if best.is_some_and(|(distance, _)| distance.0 <= ring * MICRO_PER_UNIT) {
            break;
        }
        let side = -ring..=ring;
        let cells = side.clone().flat_map(|right| {
            let is_corner = right.abs() == ring;
            side.clone()
                .filter(move |up| is_corner || up.abs() == ring)
                .map(move |up| (right, up))
        });
        for (right, up) in cells {
            let pose = Pose {
                x: MicroUnits(from.x.0 + right * MICRO_PER_UNIT),
                y: MicroUnits(from.y.0 + up * MICRO_PER_UNIT),
                theta: from.theta,
            };
            if pose.is_within_limits() && occupied.are_clear_of(&pose, MicroUnits::ONE) {
                let found = (from.distance_to(&pose), pose);
                best = Some(best.map_or(found, |best| best.min(found)));
            }
        }
    }
    best.map(|(_, pose)| pose)
}

/// Poses by the unit square that they lie in.
struct Places(BTreeMap<(i64, i64), Vec<Pose>>);

impl Places {
    fn of(poses: impl Iterator<Item = Pose>) -> Self {
        let mut places = Self(BTreeMap::new());
        for pose in poses {
            places.add(pose);
        }
        places
    }

    fn add(&mut self, pose: Pose) {
        self.0.entry(square(&pose)).or_default().push(pose);
    }

    /// Whether all of them are at least this far away, which is at most a unit.
    fn are_clear_of(&self, pose: &Pose, distance: MicroUnits) -> bool {
        let (x, y) = square(pose);
        let squares = (-1..=1).flat_map(|right| (-1..=1).map(move |up| (x + right, y + up)));
        let mut near = squares.filter_map(|square| self.0.get(&square)).flatten();
        near.all(|other| other.distance_to(pose) >= distance)
    }
}

fn square(pose: &Pose) -> (i64, i64) {
    let along = |coordinate: MicroUnits| coordinate.0.div_euclid(MICRO_PER_UNIT);
    (along(pose.x), along(pose.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shows S6.
    #[test]
    fn the_nearest_clear_place_is_a_unit_away_from_all_others() {
        let at = |x: f64, y: f64| Pose::from_units(x, y, 0.0).unwrap();
        let occupied = |poses: &[(f64, f64)]| Places::of(poses.iter().map(|&(x, y)| at(x, y)));
        let here = at(0.2, 0.0);
        assert_eq!(
            nearest_clear(&here, &occupied(&[(0.2, 0.0)])),
            Some(at(-0.8, 0.0))
        );
        let row = occupied(&[(-1.0, 0.0), (0.0, 0.0), (1.0, 0.0)]);
        assert_eq!(nearest_clear(&here, &row), Some(at(0.2, -1.0)));
        let block: Vec<(f64, f64)> = (-3..=3)
            .flat_map(|x| (-3..=3).map(move |y| (f64::from(x), f64::from(y))))
            .collect();
        let found = nearest_clear(&here, &occupied(&block)).unwrap();
        assert_eq!(found, at(0.2, -4.0));
        assert!(occupied(&block).are_clear_of(&found, MicroUnits::ONE));
        let border = at(-1.0e6, 0.0);
        assert_eq!(
            nearest_clear(&border, &occupied(&[(-1.0e6, 0.0)])),
            Some(at(-1.0e6, -1.0))
        );
    }
}
