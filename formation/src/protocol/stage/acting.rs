//! Acting: one unit after another moves, and only while every member shows agreement.

use std::collections::BTreeSet;
use std::time::Duration;

use crate::model::{ModuleId, ModulePhase, ModuleState, Service, SpotId, digest};

use super::super::body::SettledOn;
use super::super::context::Context;
use super::super::event::Event;
use super::super::io::{MotionGoal, Output};
use super::held_plan::Place;
use super::proofs::Proofs;
use super::{HeldPlan, Stage, Step};

/// This module's task in the plan, and its progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Task {
    /// It has no spot.
    Spare,
    /// Its unit's turn has not come.
    Waiting,
    /// It undocks the links that the plan breaks.
    Undocking,
    /// It moves since `since`; `held` while it is halted because agreement lapsed.
    Moving { since: Duration, held: bool },
    /// It stands on its spot and docks.
    Docking,
    /// It stands on its spot, docked.
    Settled,
    /// It could not reach its spot.
    Failed,
}

/// A plan on which all members have agreed.
#[derive(Clone, Hash)]
pub(in crate::protocol) struct Acting {
    pub held: HeldPlan,
    agreed_at: Duration,
    task: Task,
    asked_to_dock: BTreeSet<ModuleId>,
    proofs: Proofs,
    /// The modules that were last reported as waited for.
    reported: Vec<ModuleId>,
    /// The step of the plan that is due now, if any is left, and since when.
    step_since: (Option<usize>, Duration),
}

/// What a part of a step leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    Wait,
    /// The next task may begin at once.
    Again,
}

impl Acting {
    /// All members show the same digest. The plan was complete here at `planned_at`.
    pub fn begin(held: HeldPlan, planned_at: Duration, context: &mut Context) -> Self {
        let (now, epoch) = (context.now, held.epoch());
        let stuck = context.parameters.stuck;
        context.peers.note_agreement(now, stuck, &held.members);
        let basis = held.roster.quorum_basis();
        context.memory.quorum.note_agreed(epoch, &basis);
        context.memory.mismatches = 0;
        context.pacing.relax(context.parameters.epoch_interval);
        context.mark_state_changed();
        context.emit(Event::Agreed(epoch));
        let has_place = held.place.is_some();
        if !has_place {
            context.emit(Event::Spare);
        }
        if epoch.convener == context.module() {
            held.report_open_spots(context);
        }
        let moves = has_place || held.aside().is_some();
        Self {
            held,
            agreed_at: now,
            task: if moves { Task::Waiting } else { Task::Spare },
            asked_to_dock: BTreeSet::new(),
            proofs: Proofs::default(),
            reported: Vec::new(),
            step_since: (Some(0), planned_at),
        }
    }

    pub fn phase(&self) -> ModulePhase {
        match self.task {
            Task::Spare => ModulePhase::Spare,
            Task::Waiting => ModulePhase::Waiting,
            Task::Undocking | Task::Moving { .. } | Task::Docking | Task::Failed => {
                ModulePhase::Moving
            }
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
    }

    /// The drive has reached its goal.
    pub fn arrive(&mut self) {
        if matches!(self.task, Task::Moving { .. }) {
            self.task = match self.held.place {
                Some(_) => Task::Docking,
                None => Task::Spare,
            };
        }
    }

    /// Ends the task, if it has begun; returns the spot that it was to reach.
    pub fn abandon(&mut self) -> Option<SpotId> {
        match self.task {
            Task::Undocking | Task::Moving { .. } | Task::Docking => {
                self.task = Task::Failed;
                Some(self.held.place?.spot)
            }
            Task::Spare | Task::Waiting | Task::Settled | Task::Failed => None,
        }
    }

    /// The modules that act, if they have not settled for longer than a motion may take. None acts while all only plan.
    pub fn stuck_members(&self, context: &Context) -> Vec<ModuleId> {
        if context.parameters.plan_only {
            return Vec::new();
        }
        let (step, since) = self.step_since;
        let limit = context.parameters.motion_limit + context.parameters.stuck;
        let is_overdue = context.now.saturating_sub(since) > limit;
        step.filter(|_| is_overdue)
            .map(|step| self.unsettled_in(step, context))
            .unwrap_or_default()
    }

    /// The goal that is published again with each heartbeat, as a drive stops when goals cease to repeat.
    pub fn repeated_goal(&self, context: &Context) -> Option<MotionGoal> {
        let moves = matches!(self.task, Task::Moving { held: false, .. });
        let lease = context.parameters.lease;
        let may_move =
            || context.bugs.ignore_lapses() || self.held.lagging(context, lease).is_empty();
        if moves && !context.stop.stopped && may_move() {
            self.held.goal()
        } else {
            None
        }
    }

    /// Waits, moves and docks, as far as is safe now.
    pub fn step(mut self: Box<Self>, context: &mut Context) -> Step {
        while self.advance(context) == Progress::Again {}
        Step::Stay(Stage::Acting(self))
    }

    fn advance(&mut self, context: &mut Context) -> Progress {
        if self.held.note_mismatch(context) {
            return Progress::Wait;
        }
        // A module that the roster left out stops within the lease, since the members no longer show its epoch.
        let first_motion = self.agreed_at + context.bugs.lease_wait(context.parameters.lease);
        if context.now < first_motion {
            context.wake_at(first_motion);
            return Progress::Wait;
        }
        let mut lagging = self.held.lagging_for_motion(context);
        if context.stop.stopped && lagging.is_empty() {
            lagging.push(context.module());
        }
        let to_act = self.step_to_act(context);
        let step = to_act.as_ref().map(|&(step, _)| step);
        if self.step_since.0 != step || !lagging.is_empty() {
            self.step_since = (step, context.now);
        }
        match self.held.place {
            None if self.held.aside().is_some() && !self.has_acted() => {
                self.make_room(to_act, &lagging, context)
            }
            None => {
                // A module out of service undocks as soon as a plan without it is agreed on.
                if lagging.is_empty() && context.body.service != Service::Active {
                    let links = context.body.links.clone();
                    context.undock(links);
                }
                Progress::Wait
            }
            Some(place) if context.body.service == Service::Active => {
                self.carry_on(place, to_act, &lagging, context)
            }
            Some(_) => Progress::Wait,
        }
    }

    /// One step of this module's task; `lagging` members forbid every motion.
    fn carry_on(
        &mut self,
        place: Place,
        to_act: Option<(usize, Vec<ModuleId>)>,
        lagging: &[ModuleId],
        context: &mut Context,
    ) -> Progress {
        match self.task {
            Task::Waiting if self.held.unit_of(place).pinned => {
                self.stay(lagging, context);
                Progress::Wait
            }
            Task::Waiting => {
                let earlier = to_act
                    .filter(|&(step, _)| step < self.held.step_of_unit(place.unit))
                    .filter(|_| !context.bugs.ignore_acting_order());
                if let Some((_, unsettled)) = earlier {
                    if self.reported != unsettled {
                        self.reported.clone_from(&unsettled);
                        context.emit(Event::WaitingFor(unsettled));
                    }
                } else if lagging.is_empty() && !context.parameters.plan_only {
                    self.set_off(place, context);
                    return Progress::Again;
                }
                Progress::Wait
            }
            Task::Undocking => {
                let broken = context.links_except(|link| self.held.keeps_link_to(link));
                if broken.is_empty() && lagging.is_empty() {
                    self.move_to_spot(context);
                }
                Progress::Wait
            }
            Task::Moving { since, held } => {
                self.watch_motion(since, held, lagging, context);
                Progress::Wait
            }
            Task::Docking => {
                self.dock(place, lagging, context);
                Progress::Wait
            }
            Task::Spare | Task::Settled | Task::Failed => Progress::Wait,
        }
    }

    /// Moves off a spot that another module takes: undocks from all modules, and goes where it is in no way.
    fn make_room(
        &mut self,
        to_act: Option<(usize, Vec<ModuleId>)>,
        lagging: &[ModuleId],
        context: &mut Context,
    ) -> Progress {
        let is_due = to_act.is_some_and(|(_, modules)| modules.contains(&context.module()));
        match self.task {
            Task::Waiting if is_due && lagging.is_empty() && !context.parameters.plan_only => {
                self.proofs = Proofs::of_making_room(&self.held, context);
                self.task = Task::Undocking;
                context.body.settled_on = None;
                context.mark_state_changed();
                context.emit(Event::MakingRoom);
                let links = context.body.links.clone();
                context.undock(links);
                return Progress::Again;
            }
            Task::Undocking if context.body.links.is_empty() && lagging.is_empty() => {
                self.move_to_spot(context);
            }
            Task::Moving { since, held } => self.watch_motion(since, held, lagging, context),
            _ => {}
        }
        Progress::Wait
    }

    /// Stays on its spot, and undocks from modules that the target does not have there, such as a failed neighbour.
    fn stay(&mut self, lagging: &[ModuleId], context: &mut Context) {
        let unwanted = context.links_except(|link| self.held.ends_linked_to(link));
        if unwanted.is_empty() {
            self.task = Task::Settled;
            context.mark_state_changed();
        } else if lagging.is_empty() {
            context.undock(unwanted);
        }
    }

    /// Begins to undock the links that the plan breaks.
    fn set_off(&mut self, place: Place, context: &mut Context) {
        self.proofs = Proofs::of_departure(&self.held, place, context);
        self.task = Task::Undocking;
        context.mark_state_changed();
        context.emit(Event::MotionBegun(place.spot));
        let broken = context.links_except(|link| self.held.keeps_link_to(link));
        context.undock(broken);
    }

    fn move_to_spot(&mut self, context: &mut Context) {
        self.task = Task::Moving {
            since: context.now,
            held: false,
        };
        if let Some(goal) = self.held.goal() {
            send_goal(goal, context);
        }
    }

    /// Halts when agreement lapses, continues when it is back, and fails when the time is up.
    fn watch_motion(
        &mut self,
        since: Duration,
        held: bool,
        lagging: &[ModuleId],
        context: &mut Context,
    ) {
        // The limit counts from the end of a stop.
        let since = if context.stop.stopped {
            context.now
        } else {
            since
        };
        let overdue_at = since + context.parameters.motion_limit;
        if context.now >= overdue_at {
            context.stand_still();
            let spot = self.abandon();
            if let Some(spot) = spot {
                context.emit(Event::MotionOverdue(spot));
            }
            context.fail_motion(spot);
            return;
        }
        context.wake_at(overdue_at);
        let hold = context.stop.stopped || !lagging.is_empty() && !context.bugs.ignore_lapses();
        self.task = Task::Moving { since, held: hold };
        if hold && !held {
            context.stand_still();
            if !context.stop.stopped {
                context.emit(Event::AgreementLapsed(lagging.to_vec()));
            }
            return;
        }
        if !hold
            && !context.body.moving
            && let Some(goal) = self.held.goal()
        {
            // The drive halted, because agreement lapsed or because its goal did not repeat in time.
            send_goal(goal, context);
        }
        if let Some(lapse) = self.next_lapse(context) {
            context.wake_at(lapse);
        }
    }

    /// When the oldest heartbeat of a member becomes older than the lease, unless a newer one comes.
    fn next_lapse(&self, context: &Context) -> Option<Duration> {
        let margin = Duration::from_millis(1);
        let members = context.peers.along(&self.held.members);
        members
            .filter_map(|(_, _, peer)| peer?.age(context.now))
            .map(|age| context.now + context.parameters.lease.saturating_sub(age) + margin)
            .min()
    }

    /// Docks to the settled neighbours, and has settled when it is docked to all that are placed before it.
    fn dock(&mut self, place: Place, lagging: &[ModuleId], context: &mut Context) {
        let mut missing = self.held.docks_with(place);
        missing.retain(|module| !context.body.links.contains(module));
        if missing.is_empty() {
            self.task = Task::Settled;
            context.body.settled_on = Some(SettledOn {
                spot: place.spot,
                target: digest::of_target(&self.held.roster.target),
            });
            context.mark_state_changed();
            context.emit(Event::Settled(place.spot));
            return;
        }
        if !lagging.is_empty() {
            return;
        }
        for module in missing {
            if self.has_settled(module, context) && self.asked_to_dock.insert(module) {
                context.body.ports_busy.insert(module);
                context.outbox.push(Output::Dock(module));
            }
        }
    }

    fn has_settled(&self, module: ModuleId, context: &Context) -> bool {
        if module == context.module() {
            self.has_acted()
        } else {
            self.held.has_acted(&context.peers, module)
        }
    }

    /// The modules of a step that have not done their part.
    fn unsettled_in(&self, step: usize, context: &Context) -> Vec<ModuleId> {
        let modules = self.held.step_modules(step).into_iter();
        modules
            .filter(|&module| !self.has_settled(module, context))
            .collect()
    }

    /// The first step of which not all modules have done their part, with those that have not.
    fn step_to_act(&self, context: &Context) -> Option<(usize, Vec<ModuleId>)> {
        let steps = 0..self.held.steps();
        steps
            .map(|step| (step, self.unsettled_in(step, context)))
            .find(|(_, unsettled)| !unsettled.is_empty())
    }
}

fn send_goal(goal: MotionGoal, context: &mut Context) {
    context.body.moving = true;
    context.outbox.push(Output::Move(goal));
}
