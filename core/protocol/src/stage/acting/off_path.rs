//! Robots are where they are measured. While a plan is carried out, each member compares its own measured pose, and those that the
//! others publish, with what the plan lets the module do at present: the line of the step that it may take, and no more. The time
//! at which it should be somewhere is never compared, so delays displace nobody.
//!
//! A module that is off its way halts, and the others halt with it: they keep clear both of the cells that it holds and of the place
//! where it is measured. It goes on if it is measured on its way again. If it stands elsewhere for long enough, an epoch begins from
//! where it stands.

use std::time::Duration;

use formation_model::{
    BODY_WIDTH, DriveState, MICRO_PER_UNIT, MicroUnits, ModuleId, ModuleState, Pose, polyline,
};

use super::{Acting, Task};
use crate::context::Context;
use crate::event::{EpochReason, Event};
use crate::stage::HeldPlan;
use crate::stage::off_path::OffPath;

/// How much longer others wait for an epoch that the displaced module opens itself.
const LEFT_TO_ITSELF: Duration = Duration::from_secs(1);

/// How many standard deviations a body is wider on each side.
const DEVIATIONS: i64 = 2;

/// A module cannot be this far off modules that stand on their spots and to which its ports are locked.
const BEYOND_PORTS: MicroUnits = MicroUnits(MICRO_PER_UNIT / 2);

impl HeldPlan {
    /// How far a module may be off its way: half of what lies between two bodies on adjacent cells, or twice the tolerance of its
    /// drive if that is more.
    fn path_limit(&self, context: &Context) -> MicroUnits {
        let target = self.roster.target.target.as_ref();
        let width = target.map_or(BODY_WIDTH, |target| target.surroundings().body_width());
        let share = (MICRO_PER_UNIT - width.0) / 2;
        MicroUnits(share.max(2 * context.own.position_tolerance.0))
    }

    /// How far a pose is off what the plan lets a member do that has done this many steps, and takes the next one or stands; `None` if
    /// it is no member.
    fn off_by(
        &self,
        module: ModuleId,
        (done, stands): (u32, bool),
        pose: &Pose,
    ) -> Option<MicroUnits> {
        let Some((unit, member)) = self.motion.paths.place_of(module) else {
            let from = self.roster.member(module)?.module.pose;
            return Some(from.distance_to(pose).max(turned_off(&from, &from, pose)));
        };
        let last = member.waypoints.len().checked_sub(1)?;
        let done = (done as usize).min(last);
        let from = member.waypoints[done].pose;
        let next = if stands { done } else { done + 1 };
        let to = member.waypoints[last.min(next)].pose;
        let across = polyline::distance(pose, &[from, to])?;
        let turned = turned_off(&from, &to, pose);
        if stands || across.0 == 0 {
            return Some(across.max(turned));
        }
        // Where its unit turns about a centre, a drive may take the chord or the arc.
        let way = unit.poses_after(done, member).skip(1);
        let way = way.take_while(|pose| *pose != to);
        let arc = way.filter_map(|bend| polyline::distance(&bend, &[from, to]));
        let arc = arc.max().unwrap_or_default();
        let across = MicroUnits((across.0 - arc.0).max(0));
        Some(across.max(turned))
    }

    /// Whether the ports of a module that is far off its place are locked to one that stands on its own.
    /// Enforces X15.
    fn contradicts_ports<'a>(
        &self,
        distance: MicroUnits,
        links: impl IntoIterator<Item = &'a ModuleId>,
        context: &Context,
    ) -> bool {
        let stands = |&link: &ModuleId| {
            let peer = context.peers.get(link);
            self.settled_state(link, peer).is_some_and(|state| {
                let off = self.off_by_state(state);
                off.is_some_and(|off| off <= self.path_limit(context))
            })
        };
        distance >= BEYOND_PORTS && links.into_iter().any(stands)
    }

    fn off_by_state(&self, state: &ModuleState) -> Option<MicroUnits> {
        let is_of_plan = state.epoch == Some(self.epoch())
            && self.roster_plan.members.get(&state.module) == Some(&state.incarnation);
        let done = state.steps_done.unwrap_or_default();
        is_of_plan.then(|| self.off_by(state.module, (done, false), &state.pose))?
    }

    /// Notes whether another member shows that it is off its way. Each judges itself, by its own tolerance.
    pub(crate) fn follow_place(&mut self, state: &ModuleState, context: &Context) {
        let module = state.module;
        let is_off = state.drive.is_off_way();
        let Some(distance) = is_off.then(|| self.off_by_state(state)).flatten() else {
            self.motion.off_path.remove(&module);
            return;
        };
        let limit = self.path_limit(context);
        let known = self.motion.off_path.get(&module).copied();
        let mut next = OffPath::next(known, (state.pose, distance, true), limit, context.now);
        next.is_believed = state.drive != DriveState::Lost;
        self.motion.off_path.insert(module, next);
    }
}

/// How far the corners of a body are off that is turned out of the headings between two poses.
fn turned_off(from: &Pose, to: &Pose, pose: &Pose) -> MicroUnits {
    let (whole, turned) = (to.turn_from(from).0, pose.turn_from(from).0);
    let is_between = whole.min(0) <= turned && turned <= whole.max(0);
    let is_half_turn = whole.abs() > 3 * MICRO_PER_UNIT;
    if is_between || is_half_turn {
        return MicroUnits(0);
    }
    let off = pose
        .heading_difference(from)
        .min(pose.heading_difference(to));
    // Half the diagonal of a module is 0.64 units.
    MicroUnits(off.0 * 16 / 25)
}

impl Acting {
    /// Compares the measured pose of this module with what the plan lets it do now.
    /// Enforces X14, X15.
    pub(super) fn watch_place(&mut self, context: &mut Context) {
        let module = context.module();
        let limit = self.held.path_limit(context);
        let pose = context.robot.pose;
        // Before a step it stands where the last one ended.
        let stands = matches!(self.task, Task::Waiting | Task::Undocking | Task::Pausing);
        let off = self.held.off_by(module, (self.steps_done, stands), &pose);
        let deviation = context.robot.deviation;
        let bound = context.own.deviation_limit;
        let (limit, bound) = match self.task {
            Task::Settled => (context.spot_limit(), bound),
            // A body is wider by what its localisation leaves open, and must not reach out of its cells.
            _ => (limit, bound.min(MicroUnits(limit.0 / DEVIATIONS))),
        };
        let is_lost = deviation > bound;
        let Some(distance) = off.filter(|&off| off > limit || is_lost) else {
            // Also if that was found in an earlier epoch.
            context.robot.is_localised = true;
            if self.off_path.take().is_some() {
                context.mark_state_changed();
                context.emit(Event::BackOnPath);
            }
            return;
        };
        let known = self.off_path;
        for other in context.outbox.withdraw_docking() {
            context.robot.ports_busy.remove(&other);
            self.asked_to_dock.remove(&other);
        }
        let measured = (pose, distance, !context.robot.moving);
        let mut next = OffPath::next(known, measured, limit, context.now);
        let links = &context.robot.links;
        let contradicts_ports = next.counts_at() <= context.now
            && self.held.contradicts_ports(distance, links, context);
        next.is_believed = !contradicts_ports && !is_lost;
        context.robot.is_localised = next.is_believed;
        if known.map(|known| known.is_believed) != Some(next.is_believed) {
            context.mark_state_changed();
            context.emit(if contradicts_ports {
                Event::PortsContradictPose(distance)
            } else if is_lost {
                Event::LocalisationLost(deviation)
            } else {
                Event::OffPath(distance)
            });
        }
        self.off_path = Some(next);
        context.wake_at(next.counts_at());
    }

    pub(in crate::stage) fn is_off_path(&self) -> bool {
        self.off_path.is_some()
    }

    /// The modules that are off their ways: while there are any, no module moves.
    pub(super) fn off_path(&self, context: &Context) -> Vec<ModuleId> {
        let own = self.off_path.map(|_| context.module());
        own.into_iter()
            .chain(self.held.motion.off_path.keys().copied())
            .collect()
    }

    /// The modules that have been moved by others, for which a plan is to be made from where they stand.
    /// Enforces E3.
    pub(crate) fn displaced(&self, context: &mut Context) -> Option<EpochReason> {
        let own = self.off_path.map(|off| (context.module(), off));
        let others = self.held.motion.off_path.iter();
        let others = others.map(|(&module, &off)| (module, off));
        let mut displaced = Vec::new();
        for (module, off) in own.into_iter().chain(others) {
            let is_own = module == context.module();
            let due = off.counts_at()
                + if is_own {
                    Duration::ZERO
                } else {
                    LEFT_TO_ITSELF
                };
            context.wake_at(due);
            let counts = off.stands && off.is_believed && context.now >= due;
            if counts
                && (self.held.plan.assignments.contains_key(&module)
                    || self.find_unsettled(context).is_some())
            {
                displaced.push((module, off.distance));
            }
        }
        (!displaced.is_empty()).then_some(EpochReason::Displaced(displaced))
    }
}
