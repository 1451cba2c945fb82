//! Acting: units move along paths (`on_paths`) at the same time, wait for each other's steps, and move only while every member shows
//! agreement.

mod first_motion;
mod off_path;
mod on_paths;

use std::collections::BTreeSet;
use std::time::Duration;

use formation_model::{
    DriveState, ModuleId, ModulePhase, ModuleState, Pose, RosterMember, SenderTime, Service, SpotId,
};
use formation_motion::MotionGoal;
use formation_motion::paths::{MotionError, Obstruction};

use super::super::context::Context;
use super::super::event::Event;
use super::super::io::Output;
use super::super::robot::SettledOn;
use super::super::roster_plan::Place;
use super::invalid_start::fault_of;
use super::off_path::OffPath;
use super::proofs::Proofs;
use super::{HeldPlan, Stage, Transition};
use on_paths::Advance;

/// This module's task in the plan, and its progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Task {
    /// It has no spot, and has made way if others needed its place.
    Spare,
    /// Its unit waits for others.
    Waiting,
    /// It undocks the links that the plan breaks.
    Undocking,
    /// It moves since `since`, to its spot or the end of a step; since `held` it is halted because agreement lapsed. The time
    /// until then counts as if it had moved just before it continues.
    Moving {
        since: Duration,
        held: Option<Duration>,
    },
    /// It stands between two steps of its path.
    Pausing,
    /// It stands on its spot and docks.
    Docking,
    /// It stands on its spot, docked.
    Settled,
    /// It could not reach its spot.
    Failed,
}

/// A plan on which all members have agreed.
#[derive(Clone, Hash)]
pub(crate) struct Acting {
    pub held: HeldPlan,
    agreed_at: Duration,
    /// When nobody can be in motion by an earlier plan any more.
    idle_at: Duration,
    pub(super) task: Task,
    /// The number of steps of its path that it has done.
    pub(super) steps_done: u32,
    /// The number of steps after which it last published that it stands and waits.
    pub(super) stopped_after: Option<u32>,
    asked_to_dock: BTreeSet<ModuleId>,
    pub(super) proofs: Proofs,
    /// The progress of all members.
    pub(super) progress: Advance,
    /// Where this module is measured while that is off its way.
    off_path: Option<OffPath>,
}

/// What a part of a step leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Continuation {
    Wait,
    /// The next task may begin at once.
    Again,
}

impl Acting {
    /// All members show the same digest.
    pub fn begin(held: HeldPlan, context: &mut Context) -> Self {
        let (now, epoch) = (context.now, held.epoch());
        let idle_at = held.idle_at(context);
        let peers = context.peers.table_mut();
        peers.note_same_plan(now, &held.roster_plan.members);
        let is_first = !context.session.was_in_force;
        context.session.note_in_force(&held.roster);
        context.settle_removals(&held.roster);
        context.set_shortfall(None);
        context.pacing.relax(context.parameters.epoch_interval);
        context.mark_state_changed();
        context.emit(Event::Agreed(epoch));
        context.robot.torn_off.clear();
        let has_place = held.place.is_some();
        let has_steps = held
            .motion
            .route
            .as_ref()
            .is_some_and(|route| route.steps() > 0);
        if !has_place {
            context.emit(Event::Spare);
        }
        if epoch.convener == context.module() {
            held.report_open_spots(context);
            if is_first && held.roster.voters.named.is_empty() {
                context.emit(Event::NoVoters);
            }
        }
        let mut acting = Self {
            held,
            agreed_at: now,
            idle_at,
            task: if has_place || has_steps {
                Task::Waiting
            } else {
                Task::Spare
            },
            steps_done: 0,
            stopped_after: None,
            asked_to_dock: BTreeSet::new(),
            proofs: Proofs::default(),
            progress: Advance::from(now),
            off_path: None,
        };
        for member in acting.held.others() {
            if let Some(state) = context.peers.state(member) {
                acting.held.follow_place(state, context);
            }
        }
        if has_place || has_steps {
            acting.report_wait(context);
        }
        acting
    }

    pub fn phase(&self) -> ModulePhase {
        match self.task {
            Task::Spare => ModulePhase::Spare,
            Task::Waiting => ModulePhase::Waiting,
            Task::Undocking
            | Task::Moving { .. }
            | Task::Pausing
            | Task::Docking
            | Task::Failed => ModulePhase::Moving,
            Task::Settled => ModulePhase::Settled,
        }
    }

    pub fn is_settled(&self) -> bool {
        self.task == Task::Settled
    }

    /// Whether it has done its part of the plan.
    pub fn has_acted(&self) -> bool {
        matches!(self.task, Task::Settled | Task::Spare)
    }

    pub fn describe(&mut self, state: &mut ModuleState) {
        self.held.describe(state);
        if self.is_settled() {
            self.proofs.note_settled(state.sequence);
        }
        self.proofs.describe(state);
        if state.drive == DriveState::Moving && self.folds() {
            state.drive = DriveState::Folding;
        }
        if let Some(off) = self.off_path {
            state.drive = match off.is_believed {
                true => DriveState::Displaced,
                false => DriveState::Lost,
            };
        }
        state.steps_done = Some(self.steps_done);
    }

    /// The spot on which it has settled by this plan.
    pub fn settled_on(&self) -> Option<SettledOn> {
        let place = self.held.place.filter(|_| self.is_settled())?;
        Some(SettledOn {
            spot: place.spot,
            target: self.held.roster.target_digest(),
        })
    }

    pub fn steps_done(&self) -> u32 {
        self.steps_done
    }

    /// Whether it moves to another goal than this one, so that a report that the drive has reached this one comes late.
    /// Enforces A7.
    pub fn seeks_other_than(&self, goal: &Pose) -> bool {
        let moves = matches!(self.task, Task::Moving { .. });
        moves && self.goal().is_some_and(|present| present.pose != *goal)
    }

    /// The drive has reached its goal. Returns whether other modules should know this at once.
    pub fn arrive(&mut self) -> bool {
        if !matches!(self.task, Task::Moving { .. }) {
            return true;
        }
        self.end_step()
    }

    /// Ends the task, if it has begun; returns the spot that it was to reach.
    pub fn abandon(&mut self) -> Option<SpotId> {
        match self.task {
            Task::Undocking | Task::Moving { .. } | Task::Pausing | Task::Docking => {
                self.task = Task::Failed;
                Some(self.held.place?.spot)
            }
            Task::Spare | Task::Waiting | Task::Settled | Task::Failed => None,
        }
    }

    /// The modules that act, if they have not settled for longer than a motion may take. None acts while all only plan.
    pub fn stuck_members(&self, context: &Context) -> Vec<ModuleId> {
        let route = self.held.motion.route.as_ref();
        let route = route.filter(|_| !context.parameters.plan_only);
        route.map_or_else(Vec::new, |route| self.stuck_on_paths(route, context))
    }

    /// The goal that is published again with each heartbeat, as a drive stops when goals cease to repeat.
    /// Enforces A4.
    pub fn repeated_goal(&self, context: &Context) -> Option<MotionGoal> {
        if !self.off_path(context).is_empty() {
            return None;
        }
        let moves = matches!(self.task, Task::Moving { held: None, .. });
        let may_move = || self.held.lagging(context).is_empty();
        if moves && !context.holds_still() && may_move() {
            self.goal()
        } else {
            None
        }
    }

    /// Where the module goes at present.
    pub(super) fn goal(&self) -> Option<MotionGoal> {
        let route = self.held.motion.route.as_ref()?;
        route.goal(self.steps_done + 1)
    }

    /// The goals of the present step and of all after it.
    pub fn path_ahead(&self) -> Vec<Pose> {
        let route = self.held.motion.route.iter();
        let ahead = route.flat_map(|route| route.poses_from(self.steps_done + 1));
        ahead.collect()
    }

    /// Waits, moves and docks, as far as is safe now.
    pub fn step(mut self: Box<Self>, context: &mut Context) -> Transition {
        while self.advance(context) == Continuation::Again {}
        Transition::Stay(Stage::Acting(self))
    }

    /// Enforces A1, A2, S4, H1.
    fn advance(&mut self, context: &mut Context) -> Continuation {
        if self.held.note_mismatch(context) {
            return Continuation::Wait;
        }
        self.watch_place(context);
        // A new epoch follows. To settle now would give up a pin for a target that has come back.
        let is_moving = matches!(self.task, Task::Moving { .. });
        if !is_moving && context.has_replaced(&self.held.roster.target) {
            return Continuation::Wait;
        }
        let first_motion = self.first_motion(context);
        if context.now < first_motion {
            context.wake_at(first_motion);
            return Continuation::Wait;
        }
        let mut lagging = self.held.lagging_now(context);
        if context.holds_still() && lagging.is_empty() {
            lagging.push(context.module());
        }
        lagging.extend(self.off_path(context));
        if let Some(error) = self.held.refusal() {
            if lagging.is_empty()
                && !context.parameters.plan_only
                && let Some(reason) = self.reason_to_leave(error, context)
            {
                context.cannot_move_past_bodies(reason);
            }
            return Continuation::Wait;
        }
        let service = context.robot.service;
        let listed = self.held.listed_service();
        let has_steps = self.held.motion.route.as_ref();
        let has_steps = has_steps.is_some_and(|route| route.steps() > 0);
        let makes_room = has_steps && service == Service::Retired && listed == Service::Retired;
        if service == Service::Active || makes_room {
            return self.carry_on_along_path(&lagging, context);
        }
        // A module out of service undocks as soon as a plan without it is agreed on. Along the paths of a plan with it, it may be part of
        // a body that turns.
        let takes_part = listed == Service::Active && self.held.motion.route.is_some();
        if lagging.is_empty() && !takes_part && self.held.place.is_none() {
            let links = context.robot.links.clone();
            context.undock(links);
        }
        Continuation::Wait
    }

    /// Why this module has to leave service, as there are no paths, if so.
    /// Enforces S6, X13.
    fn reason_to_leave(&self, error: &MotionError, context: &Context) -> Option<Event> {
        let own = context.module();
        let is_concerned = match context.robot.service {
            Service::Active => true,
            Service::Retired => self.held.making_room().contains(&own),
            Service::MotionFailed => false,
        };
        if !is_concerned {
            return None;
        }
        match error {
            MotionError::Starts(_) => {
                fault_of(own, error, &self.held.roster).map(Event::InvalidStart)
            }
            MotionError::Unreachable {
                modules, reason, ..
            } => {
                let in_the_way = self.in_the_way(modules, reason);
                if in_the_way.contains(&own) {
                    return Some(Event::CannotMakeWay(error.clone()));
                }
                // Those that are in the way leave before the others.
                let leaves = in_the_way.is_empty() && modules.contains(&own);
                leaves.then(|| Event::CannotReach(error.clone()))
            }
            MotionError::TooManyCorners(module) => {
                (*module == own).then(|| Event::CannotReach(error.clone()))
            }
            MotionError::FieldTooLarge(_) => {
                let is_farthest = self.farthest() == Some(own);
                is_farthest.then(|| Event::CannotReach(error.clone()))
            }
            _ => None,
        }
    }

    /// The retired members that keep a unit from its spots: those of them that the reason names, or all if others than obstacles may be
    /// in the way and it names none.
    fn in_the_way(&self, unit: &[ModuleId], reason: &Obstruction) -> Vec<ModuleId> {
        let making_room = self.held.making_room().into_iter();
        let (named, is_by_modules) = match reason {
            Obstruction::NoPassing(named) => (&named[..], true),
            Obstruction::WalledIn(_) | Obstruction::Full => (&[][..], true),
            Obstruction::Obstacles | Obstruction::NoTurn | Obstruction::NoExit => (&[][..], false),
        };
        let (blamed, others): (Vec<_>, Vec<_>) =
            making_room.partition(|module| unit.contains(module) || named.contains(module));
        match blamed.is_empty() && is_by_modules {
            true => others,
            false => blamed,
        }
    }

    /// The member without a pin that is farthest from the target, of equals the highest.
    fn farthest(&self) -> Option<ModuleId> {
        let target = self.held.roster.target.target.as_ref()?;
        let spot = target.spots().first()?;
        let members = RosterMember::active(&self.held.roster.members);
        let free = members.filter(|member| member.module.pin.is_none());
        let far = free
            .max_by_key(|member| (member.module.pose.distance_to(&spot.pose), member.module.id));
        far.map(|member| member.module.id)
    }

    /// Stays on its spot. It undocks from modules that the target does not have there, such as a failed neighbour, and docks to
    /// those that the target has: a plan without them has parted them.
    /// Enforces P2.
    pub(super) fn stay(&mut self, place: Place, lagging: &[ModuleId], context: &mut Context) {
        let unwanted = context.links_except(|link| self.held.ends_linked_to(link));
        if !unwanted.is_empty() {
            if lagging.is_empty() {
                context.undock(unwanted);
            }
        } else if context.parameters.plan_only || self.is_docked(place, lagging, context) {
            self.task = Task::Settled;
            context.robot.settled_on = self.settled_on();
            context.mark_state_changed();
        }
    }

    /// Sets off to the present goal.
    pub(super) fn move_on(&mut self, context: &mut Context) {
        self.task = Task::Moving {
            since: context.now,
            held: None,
        };
        if let Some(goal) = self.goal() {
            send_goal(goal, context);
        }
    }

    /// Halts when agreement lapses, continues when it is back, and fails when the time is up.
    /// Enforces A3, X4, X10.
    pub(super) fn watch_motion(
        &mut self,
        mut since: Duration,
        held: Option<Duration>,
        lagging: &[ModuleId],
        context: &mut Context,
    ) {
        let stopped = context.holds_still();
        if stopped || !lagging.is_empty() {
            if held.is_none() {
                let held = Some(context.now);
                self.task = Task::Moving { since, held };
                context.stand_still();
                let off_path = self.off_path(context);
                if !off_path.is_empty() {
                    context.emit(Event::KeepingClear(off_path));
                } else if !stopped {
                    context.emit(Event::AgreementLapsed(lagging.to_vec()));
                }
            }
            return;
        }
        // The time for which it was held does not count.
        since += held.map_or(Duration::ZERO, |held| context.now.saturating_sub(held));
        self.task = Task::Moving { since, held: None };
        let overdue_at = since + context.parameters.motion_limit;
        if context.now >= overdue_at {
            context.stand_still();
            let spot = self.held.place.map(|place| place.spot);
            context.emit(Event::MotionOverdue(spot));
            self.abandon();
            context.fail_motion(spot);
            return;
        }
        context.wake_at(overdue_at);
        if !context.robot.moving
            && let Some(goal) = self.goal()
        {
            // The drive halted, because agreement lapsed or because its goal did not repeat in time.
            context.mark_state_changed();
            send_goal(goal, context);
        }
        if let Some(until) = self.held.in_force_until() {
            let margin = Duration::from_millis(1);
            context.wake_at(until + margin);
        }
    }

    /// Docks to the settled neighbours, and has settled when it is docked to all that are placed before it.
    /// Enforces X2, X11.
    pub(super) fn dock(&mut self, place: Place, lagging: &[ModuleId], context: &mut Context) {
        let is_there = self.off_path.is_none() && self.parent_has_settled(context);
        if !self.is_docked(place, lagging, context) || !is_there {
            return;
        }
        self.task = Task::Settled;
        self.proofs.note_docked(&self.held, place, context);
        context.robot.settled_on = Some(SettledOn {
            spot: place.spot,
            target: self.held.roster.target_digest(),
        });
        context.mark_state_changed();
        context.emit(Event::Settled(place.spot));
    }

    /// Whether it is docked to all holders next to its spot that are placed before it. Asks the ports to dock to those that have
    /// settled.
    fn is_docked(&mut self, place: Place, lagging: &[ModuleId], context: &mut Context) -> bool {
        let mut missing = self.held.docks_with(place);
        missing.retain(|module| !context.robot.links.contains(module));
        for &module in missing.iter().filter(|_| lagging.is_empty()) {
            if self.has_settled(module, context) && self.asked_to_dock.insert(module) {
                context.robot.ports_busy.insert(module);
                context.outbox.push(Output::Dock(module));
            }
        }
        missing.is_empty()
    }

    pub(super) fn has_settled(&self, module: ModuleId, context: &Context) -> bool {
        if module == context.module() {
            self.has_acted()
        } else {
            self.held.has_acted(module, context.peers.get(module))
        }
    }

    /// A member that has not done its part.
    pub(super) fn find_unsettled(&self, context: &Context) -> Option<ModuleId> {
        let mut members = self.held.roster_plan.members.keys();
        members
            .find(|&&module| !self.has_settled(module, context))
            .copied()
    }

    /// Whether every member has done its part once, so that none moves by this plan any more.
    pub fn have_all_acted(&mut self, context: &Context) -> bool {
        if self.held.is_carried_out || !self.has_acted() {
            return self.held.is_carried_out;
        }
        let unsettled = self.held.unsettled.take();
        let unsettled = unsettled.filter(|&module| !self.has_settled(module, context));
        self.held.unsettled = unsettled.or_else(|| self.find_unsettled(context));
        self.held.is_carried_out = self.held.unsettled.is_none();
        self.held.is_carried_out
    }
}

fn send_goal(goal: MotionGoal, context: &mut Context) {
    context.robot.moving = true;
    context.robot.pose_at = SenderTime(context.now);
    context.outbox.push(Output::Move(goal));
}
