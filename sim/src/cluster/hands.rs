//! What hands do to robots: they push and carry them, alone or docked to others; and what their localisation does.

use std::collections::BTreeSet;

use formation_model::{MicroUnits, ModuleId, ModulePhase, Pose};
use formation_motion::MotionReport;
use formation_protocol::Input;

use super::Cluster;
use crate::faults::{CarryMoment, Fault};
use crate::observation::Observation;
use crate::process::{Way, shifted};

/// How far bodies must be apart to turn in place without touching each other, from centre to centre in units; and along one of the axes
/// if their sides lie along these.
const APART: f64 = 1.45;
const SIDE: f64 = 1.0;

/// Ports reach no further than this from centre to centre, in units: off the lattice, adjacent spots of the tests are up to 2.42 apart.
const REACH: f64 = 2.45;

/// The directions in which a hand tries to put a module, in parts of a full turn.
const DIRECTIONS: u32 = 16;

impl Cluster {
    /// A hand moves a module this far, alone or with all modules that are docked to it: in the given direction, or if other modules
    /// are there, in the next one that is free. A module that is torn off others opens its ports, and reports that. Returns whether
    /// there was room.
    pub fn carry(&mut self, module: ModuleId, with_docked: bool, way: Way) -> bool {
        let carried = match with_docked {
            true => self.docked_group(module),
            false => BTreeSet::from([module]),
        };
        if !self.processes.contains_key(&module) {
            return false;
        }
        let Some(way) = self.free_way(&carried, way) else {
            return false;
        };
        self.note(Fault::Carry {
            module,
            moment: CarryMoment::Any,
            with_docked,
            way,
        });
        let part = self.docked_group(module);
        for &one in &carried {
            self.put(one, way);
        }
        if part != carried {
            self.observe(Observation::Torn(part));
        }
        for &one in &carried {
            let links = self.links(one).cloned().unwrap_or_default();
            for other in links.difference(&carried) {
                self.report(one, MotionReport::Undocked(*other));
                self.report(*other, MotionReport::Undocked(one));
            }
        }
        true
    }

    /// Whether a hand may take a module at this moment.
    pub(crate) fn is_at(&self, moment: CarryMoment, module: ModuleId) -> bool {
        let Some(standing) = self.standing(module) else {
            return false;
        };
        let moves = standing.phase == ModulePhase::Moving;
        match moment {
            CarryMoment::Any => true,
            CarryMoment::Frozen => standing.phase == ModulePhase::Gathered,
            CarryMoment::OnTheWay => moves && standing.moving,
            CarryMoment::Waiting => moves && !standing.moving,
            CarryMoment::Settled => standing.phase == ModulePhase::Settled,
        }
    }

    /// From now on, the poses of a module are measured this far off where it is.
    pub fn mislead(&mut self, module: ModuleId, way: Way) {
        let now = self.now();
        let Some(process) = self.processes.get_mut(&module) else {
            return;
        };
        let (x, y) = std::mem::replace(&mut process.measured_off, way);
        let jump = (MicroUnits(way.0.0 - x.0), MicroUnits(way.1.0 - y.0));
        let measured = shifted(&process.drive.pose_at(process.clock.local(now)), jump);
        let reports: Vec<MotionReport> = process
            .drive
            .put(process.clock.local(now), measured)
            .collect();
        self.note(Fault::Mislead(module, way));
        for report in reports {
            self.report(module, report);
        }
        self.schedule_tick(module);
    }

    /// From now on, the driver of a module states this standard deviation of its poses.
    pub fn state_deviation(&mut self, module: ModuleId, deviation: MicroUnits) {
        self.report(module, MotionReport::Deviation(deviation));
    }

    /// The modules that are docked to a module, directly or through others, and the module itself.
    fn docked_group(&self, module: ModuleId) -> BTreeSet<ModuleId> {
        let mut group = BTreeSet::from([module]);
        let mut open = vec![module];
        while let Some(next) = open.pop() {
            let is_linked = |&other: &ModuleId| {
                let names =
                    |one, other| self.links(one).is_some_and(|links| links.contains(&other));
                names(next, other) || names(other, next)
            };
            let linked: Vec<ModuleId> = self.modules().into_iter().filter(is_linked).collect();
            open.extend(linked.into_iter().filter(|&link| group.insert(link)));
        }
        group
    }

    /// The first way of this length on which the carried modules touch no others where they are put.
    fn free_way(&self, carried: &BTreeSet<ModuleId>, (x, y): Way) -> Option<Way> {
        let (x, y) = (x.to_units(), y.to_units());
        let others: Vec<Pose> = (self.modules().difference(carried))
            .filter_map(|&other| self.body(other))
            .collect();
        let bodies: Vec<Pose> = carried.iter().filter_map(|&one| self.body(one)).collect();
        (0..DIRECTIONS).find_map(|direction| {
            let turn = std::f64::consts::TAU * f64::from(direction) / f64::from(DIRECTIONS);
            let (sine, cosine) = turn.sin_cos();
            let way = (
                MicroUnits::from_units(x * cosine - y * sine).ok()?,
                MicroUnits::from_units(x * sine + y * cosine).ok()?,
            );
            let placed: Vec<Pose> = bodies.iter().map(|body| shifted(body, way)).collect();
            let is_valid = placed.iter().all(Pose::is_within_limits);
            let is_free = is_valid && others.iter().all(|other| leaves_free(&placed, other));
            is_free.then_some(way)
        })
    }

    /// What the ports report that are to dock two modules to each other: they lock if these are near each other.
    pub(super) fn try_to_dock(&self, one: ModuleId, other: ModuleId) -> MotionReport {
        let bodies = self.body(one).zip(self.body(other));
        let is_near = bodies.is_none_or(|(one, other)| one.distance_to(&other).to_units() < REACH);
        match is_near {
            true => MotionReport::Docked(other),
            false => MotionReport::Undocked(other),
        }
    }

    fn put(&mut self, module: ModuleId, way: Way) {
        let now = self.now();
        let Some(process) = self.processes.get_mut(&module) else {
            return;
        };
        let local = process.clock.local(now);
        let there = shifted(&process.drive.pose_at(local), way);
        let reports: Vec<MotionReport> = process.drive.put(local, there).collect();
        let body = process.body();
        self.observe(Observation::Carried(module, body));
        for report in reports {
            self.report(module, report);
        }
        self.schedule_tick(module);
    }

    fn report(&mut self, module: ModuleId, report: MotionReport) {
        let is_mute = self
            .processes
            .get(&module)
            .is_some_and(|process| process.is_mute);
        if !is_mute {
            self.input(module, Input::Motion(report));
        }
    }
}

/// Whether a docked group that is put somewhere leaves a body free: it does not touch that, nor would it if it turned in place.
fn leaves_free(group: &[Pose], other: &Pose) -> bool {
    let is_straight = |pose: &Pose| {
        let quarters = pose.theta.to_units() / std::f64::consts::FRAC_PI_2;
        (quarters - quarters.round()).abs() < 0.01
    };
    let units = |pose: &Pose| (pose.x.to_units(), pose.y.to_units());
    let (x, y) = units(other);
    if is_straight(other) && group.iter().all(is_straight) {
        let beside = |one: &Pose| (units(one).0 - x).abs().max((units(one).1 - y).abs());
        return group.iter().all(|one| beside(one) > SIDE);
    }
    let sums = |of: fn((f64, f64)) -> f64| group.iter().map(|one| of(units(one))).sum::<f64>();
    let count: f64 = group.iter().map(|_| 1.0).sum();
    let centre = (sums(|(x, _)| x) / count, sums(|(_, y)| y) / count);
    let away = |(x, y): (f64, f64)| (x - centre.0).hypot(y - centre.1);
    let radius = group.iter().map(|one| away(units(one))).fold(0.0, f64::max);
    away((x, y)) > radius + APART
}
