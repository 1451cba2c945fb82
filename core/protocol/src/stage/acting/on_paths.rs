//! Acting along paths: a module takes one step after another, each when the steps that it waits for are done.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_model::{Area, BODY_WIDTH, BodyReport, ModuleId, Pose, polyline};

use super::{Acting, Continuation, Task};
use crate::context::Context;
use crate::event::Event;
use crate::indexed_motion::PathPlace;
use crate::stage::held_plan::HeldPlan;
use crate::stage::proofs::Proofs;
use crate::stage::route::Route;

/// How often the progress of the members is counted within the time after which they are stuck. To count takes longer the more
/// members there are, and each member counts; the time is longer than it needs to be by at most one of these parts.
const COUNTS_PER_LIMIT: u32 = 32;

/// The time without progress of any member after which those that could go on are stuck.
fn stall_limit(context: &Context) -> Duration {
    context.parameters.motion_limit + context.parameters.stuck
}

/// When the members were last seen to make progress.
#[derive(Clone, Copy, Debug, Hash)]
pub(in crate::stage) struct Advance {
    /// The steps that the members have done, and the members that have settled.
    count: u64,
    since: Duration,
    counted: Duration,
}

impl From<Duration> for Advance {
    fn from(now: Duration) -> Self {
        Self {
            count: 0,
            since: now,
            counted: now,
        }
    }
}

impl HeldPlan {
    /// Whether a body may stand in the way of a member that has yet to move there. This module has done `own_steps` steps.
    /// Enforces B4.
    pub(crate) fn has_in_the_way(
        &self,
        body: &BodyReport,
        own_steps: u32,
        context: &Context,
    ) -> bool {
        let target = self.roster.target.target.as_ref();
        let width = target.map_or(BODY_WIDTH, |target| target.surroundings().body_width());
        let area_of = |ends: (&Pose, &Pose)| Area::of_bodies(ends.into(), width);
        let standing: Vec<Area> = polyline::lines(body.whereabouts.poses())
            .map(|ends| Area::around_line(ends, width))
            .collect();
        let is_in_the_way = |(module, (unit, member)): (ModuleId, PathPlace<'_>)| {
            let done = if module == context.module() {
                own_steps
            } else {
                self.steps_done_by(module, context.peers.get(module))
            };
            let ahead: Vec<Pose> = unit.poses_after(done as usize, member).collect();
            let leaves = ahead.len() > 1;
            let mut ways = polyline::lines(&ahead).filter(|_| leaves).map(area_of);
            ways.any(|way| standing.iter().any(|area| area.overlaps(&way)))
        };
        self.places().into_iter().any(is_in_the_way)
    }
}

impl Acting {
    /// One step of this module's task; `lagging` members forbid every motion.
    pub(in crate::stage) fn carry_on_along_path(
        &mut self,
        lagging: &[ModuleId],
        context: &mut Context,
    ) -> Continuation {
        self.note_progress(lagging, context);
        let may_begin = lagging.is_empty() && !context.parameters.plan_only;
        match self.task {
            Task::Waiting if self.is_pinned() => {
                if let Some(place) = self.held.place {
                    self.stay(place, lagging, context);
                }
                Continuation::Wait
            }
            Task::Waiting | Task::Pausing if may_begin => self.begin_step(context),
            Task::Undocking => {
                let broken = self.broken_links(context);
                if !broken.is_empty() {
                    context.undock(broken);
                } else if may_begin && self.have_companions_undocked(context) {
                    return self.leave(context);
                }
                Continuation::Wait
            }
            Task::Moving { since, held } => {
                self.watch_motion(since, held, lagging, context);
                Continuation::Wait
            }
            Task::Docking => {
                if let Some(place) = self.held.place {
                    self.dock(place, lagging, context);
                }
                Continuation::Wait
            }
            Task::Pausing => {
                // Between two steps it stands until agreement is back.
                if context.robot.is_at_rest() {
                    self.publish_stop(context);
                }
                Continuation::Wait
            }
            Task::Waiting | Task::Spare | Task::Settled | Task::Failed => Continuation::Wait,
        }
    }

    fn is_pinned(&self) -> bool {
        let place = self.held.place;
        place.is_some_and(|place| self.held.unit_of(place).pinned)
    }

    fn steps(&self) -> u32 {
        self.held.motion.route.as_ref().map_or(0, Route::steps)
    }

    /// Begins the next step if all that it waits for is done.
    /// Enforces X8.
    fn begin_step(&mut self, context: &mut Context) -> Continuation {
        let Some(route) = &self.held.motion.route else {
            return Continuation::Wait;
        };
        let step = self.steps_done + 1;
        let done = |module| self.done_by(module, context);
        let is_free = route.awaited(step, done).is_empty();
        if !is_free {
            if self.task == Task::Pausing && context.robot.is_at_rest() {
                self.publish_stop(context);
            }
            return Continuation::Wait;
        }
        let begins_apart = step == 1 || route.is_apart(step) && !route.is_apart(self.steps_done);
        if self.task == Task::Waiting {
            match self.held.place {
                Some(place) => {
                    self.proofs = Proofs::of_departure(&self.held, place, context);
                    context.emit(Event::MotionBegun(place.spot));
                }
                None => {
                    self.proofs = Proofs::of_making_way(&self.held, context);
                    context.robot.settled_on = None;
                    context.emit(Event::MakingRoom);
                }
            }
            context.mark_state_changed();
        }
        if begins_apart {
            self.task = Task::Undocking;
            return Continuation::Again;
        }
        self.leave(context)
    }

    /// Whether the next step may wait for steps of another module.
    pub(in crate::stage) fn waits_for(&self, module: ModuleId) -> bool {
        if !matches!(self.task, Task::Waiting | Task::Pausing) {
            return false;
        }
        let done = |other: ModuleId| if other == module { 0 } else { u32::MAX };
        let route = self.held.motion.route.as_ref();
        route.is_some_and(|route| !route.awaited(self.steps_done + 1, done).is_empty())
    }

    /// The module is free to take its next step, or has taken all of them.
    fn leave(&mut self, context: &mut Context) -> Continuation {
        if self.steps_done < self.steps() {
            if self.begins_segment() {
                context.mark_state_changed();
            }
            self.move_on(context);
            return Continuation::Wait;
        }
        context.mark_state_changed();
        if self.held.place.is_some() {
            self.task = Task::Docking;
            return Continuation::Again;
        }
        self.task = Task::Spare;
        Continuation::Wait
    }

    /// Whether the next step leads elsewhere than the one before, or begins after a stop, or when others have left its
    /// cells. Observers interpolate between the states that are published then, so a module seems to be nowhere before it
    /// may be there.
    fn begins_segment(&self) -> bool {
        let step = self.steps_done + 1;
        let has_stopped =
            self.stopped_after == Some(self.steps_done) || self.task == Task::Undocking;
        let route = self.held.motion.route.as_ref();
        has_stopped || !route.is_some_and(|route| route.goes_on(step) && !route.has_waits(step))
    }

    /// Whether the modules of its unit may overlap each other during the present step.
    pub(in crate::stage) fn folds(&self) -> bool {
        let route = self.held.motion.route.as_ref();
        route.is_some_and(|route| route.folds(self.steps_done + 1))
    }

    /// Publishes once where the module stands while it waits.
    fn publish_stop(&mut self, context: &mut Context) {
        if self.stopped_after != Some(self.steps_done) {
            self.stopped_after = Some(self.steps_done);
            context.mark_state_changed();
        }
    }

    /// Whether the unit to which this module's unit docks has settled, if there is one.
    /// Enforces X11.
    pub(in crate::stage) fn parent_has_settled(&self, context: &Context) -> bool {
        let route = self.held.motion.route.as_ref();
        route.is_none_or(|route| {
            let mut parents = route.parents();
            parents.all(|parent| self.has_settled(parent, context))
        })
    }

    /// The links that this module gives up before its next step; those of its spot stay if it stands on it already, and those to
    /// modules that take the step with it. A module that makes way takes none with the others.
    /// Enforces X2.
    fn broken_links(&self, context: &Context) -> BTreeSet<ModuleId> {
        let stays = self.steps() == self.steps_done;
        let route = self.held.motion.route.as_ref();
        let is_apart = route.is_none_or(|route| route.is_apart(self.steps_done + 1));
        let companions = self.companions();
        context.links_except(|link| {
            self.held.keeps_link_to(link)
                || !is_apart && companions.contains(&link)
                || stays && self.held.ends_linked_to(link)
        })
    }

    /// The modules that take the next step as one body, with this one.
    fn companions(&self) -> BTreeSet<ModuleId> {
        let route = self.held.motion.route.as_ref();
        route.map_or_else(BTreeSet::new, |route| route.companions(self.steps_done + 1))
    }

    /// Whether all that take the next step as one body are docked to no other module: else they would be torn.
    /// Enforces X2.
    fn have_companions_undocked(&self, context: &Context) -> bool {
        let companions = self.companions();
        let undocked = |&module: &ModuleId| {
            let state = context.peers.state(module);
            state.is_none_or(|state| state.links.is_subset(&companions))
        };
        let own = context.module();
        let others = companions.iter().filter(|&&module| module != own);
        self.steps() == self.steps_done || others.into_iter().all(undocked)
    }

    /// A step has ended. Returns whether other modules should know this at once.
    /// Enforces X9.
    pub(in crate::stage) fn end_step(&mut self) -> bool {
        self.steps_done += 1;
        self.task = Task::Pausing;
        let route = self.held.motion.route.as_ref();
        route.is_none_or(|route| route.is_awaited(self.steps_done))
    }

    fn done_by(&self, module: ModuleId, context: &Context) -> u32 {
        if module == context.module() {
            self.steps_done
        } else {
            self.held.steps_done_by(module, context.peers.get(module))
        }
    }

    /// Counts now and then what the members have done.
    fn note_progress(&mut self, lagging: &[ModuleId], context: &Context) {
        let now = context.now;
        if !lagging.is_empty() {
            self.progress.since = now;
        }
        if now < self.progress.counted + stall_limit(context) / COUNTS_PER_LIMIT {
            return;
        }
        let count = self.count_progress(context);
        let since = if count == self.progress.count {
            self.progress.since
        } else {
            now
        };
        self.progress = Advance {
            count,
            since,
            counted: now,
        };
    }

    fn count_progress(&self, context: &Context) -> u64 {
        let members = self.held.roster_plan.members.keys();
        members
            .map(|&module| {
                let has_settled = self.has_settled(module, context);
                u64::from(self.done_by(module, context)) + u64::from(has_settled)
            })
            .sum()
    }

    /// The modules that could go on and do not, if no member has made progress for longer than a step may take.
    /// Enforces X12.
    pub(in crate::stage) fn stuck_on_paths(
        &self,
        route: &Route,
        context: &Context,
    ) -> Vec<ModuleId> {
        let is_overdue = context.now.saturating_sub(self.progress.since) > stall_limit(context);
        if !is_overdue || self.count_progress(context) != self.progress.count {
            // A count that has changed since begins the time again.
            return Vec::new();
        }
        let done = |module| self.done_by(module, context);
        let mut stuck = Vec::new();
        for unit in route.units() {
            let steps = u32::try_from(unit.steps.len()).unwrap_or(u32::MAX);
            for member in &unit.modules {
                let (module, taken) = (member.module, done(member.module));
                let could_go_on = if taken < steps {
                    route.awaited_by(unit, taken + 1, done).is_empty()
                } else {
                    member.spot.is_some_and(|spot| {
                        let partners = self.held.partners_of(module, spot);
                        let has_settled = |&partner: &ModuleId| self.has_settled(partner, context);
                        !self.has_settled(module, context) && partners.iter().all(has_settled)
                    })
                };
                if could_go_on {
                    stuck.push(module);
                }
            }
        }
        stuck
    }
}
