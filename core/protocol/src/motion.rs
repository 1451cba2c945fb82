//! Reports of the drive and ports, links as other modules report them, and commands.

use std::sync::Arc;

use formation_model::{ModulePhase, ModuleState, Service};
use formation_motion::MotionReport;

use super::Agent;
use super::event::Event;
use super::io::Command;
use super::stage::Stage;

impl Agent {
    pub(super) fn handle_motion(&mut self, report: MotionReport) {
        let now = self.context.now;
        let body = &mut self.context.robot;
        match report {
            MotionReport::Pose(pose) => {
                body.stand_at(pose, now);
                let published = self.context.outbox.states.pose_at;
                if now < published + self.context.parameters.pose_interval {
                    return;
                }
            }
            MotionReport::Deviation(deviation) => {
                body.deviation = deviation;
                return;
            }
            MotionReport::Arrived { goal, pose } => {
                body.stand_at(pose, now);
                let acting = match &mut self.stage {
                    Stage::Acting(acting) => Some(acting),
                    _ => None,
                };
                if acting
                    .as_ref()
                    .is_some_and(|acting| acting.seeks_other_than(&goal))
                {
                    return;
                }
                (body.moving, body.has_failed) = (false, false);
                // A goal that waited for the store meanwhile would have the module set off again.
                self.context.outbox.withdraw_goals();
                if acting.is_some_and(|acting| !acting.arrive()) {
                    return;
                }
            }
            MotionReport::Halted(pose) => {
                body.stand_at(pose, now);
                (body.moving, body.has_failed) = (false, false);
                self.context.outbox.withdraw_goals();
            }
            MotionReport::Docked(module) => {
                body.ports_busy.remove(&module);
                body.torn_off.remove(&module);
                body.links.insert(module);
            }
            MotionReport::Undocked(module) => {
                if !body.ports_busy.remove(&module) {
                    body.torn_off.insert(module);
                }
                body.links.remove(&module);
            }
            MotionReport::Failed => {
                self.handle_failure();
                return;
            }
        }
        self.context.mark_state_changed();
    }

    /// Enforces S1.
    fn handle_failure(&mut self) {
        // It may move on for a while: it freezes, as any other, once its drive has reported that it stands.
        self.context.stand_still();
        self.context.robot.ports_busy.clear();
        self.context.robot.has_failed = true;
        let spot = match &mut self.stage {
            Stage::Acting(acting) => acting.abandon(),
            _ => None,
        };
        self.context.fail_motion(spot);
    }

    /// A module that is out of service stays a member: it freezes, computes and agrees like any other, and votes. Only
    /// the plan passes it over: a spare takes its spot, or the spot is reported open. It undocks from all modules, and moves off a spot that
    /// another one takes. One whose drive failed stays so until it is measured to stand: it would never get there.
    /// Enforces S2, S4.
    pub(super) fn handle_command(&mut self, command: Command) {
        let (service, event) = match command {
            Command::Retire if self.context.robot.has_failed => {
                (Service::MotionFailed, Event::Retired)
            }
            Command::Retire => (Service::Retired, Event::Retired),
            Command::Rejoin => (Service::Active, Event::Rejoined),
        };
        if self.context.robot.service == service {
            return;
        }
        self.context.robot.service = service;
        self.context.robot.kept_by = None;
        self.context.mark_state_changed();
        self.context.emit(event);
        if service == Service::Active
            && let Stage::Acting(acting) = &self.stage
        {
            self.context.robot.settled_on = acting.settled_on();
        }
        if service != Service::Active {
            self.context.leave_spot();
            if let Stage::Acting(acting) = &mut self.stage {
                acting.abandon();
            }
        }
    }

    /// Follows the links that neighbours reported before this module settled.
    pub(super) fn adjust_links_to_neighbours(&mut self) {
        let neighbours = self.stage.held_plan().map(|held| held.neighbours());
        for module in neighbours.unwrap_or_default() {
            if let Some(state) = self.context.peers.state(module).map(Arc::clone) {
                self.adjust_links_to(&state);
            }
        }
    }

    /// Follows the links that another module reports: it docked to this one, or undocked from it.
    /// Enforces X2.
    pub(super) fn adjust_links_to(&mut self, state: &ModuleState) {
        let other = state.module;
        let Some(held) = self.stage.held_plan() else {
            return;
        };
        if state.epoch != self.stage.epoch() {
            return;
        }
        let body = &mut self.context.robot;
        let reports_link = state.links.contains(&self.context.own.run.module);
        let is_linked = body.links.contains(&other);
        if !reports_link {
            // It knows of that as well, so that a link which it reports later is a new one.
            body.torn_off.remove(&other);
        }
        let may_be_docked = !body.torn_off.contains(&other) && !self.stage.is_off_path();
        if reports_link == is_linked {
            return;
        }
        let is_wanted = held.ends_linked_to(other);
        let has_settled = state.phase == ModulePhase::Settled;
        let is_settled = self.stage.is_settled();
        let has_left = state.phase == ModulePhase::Moving;
        // One that comes to its spot undocked docks there, or follows the link of this module.
        let may_be_apart = if is_wanted {
            has_left && !is_settled
        } else {
            has_left || has_settled
        };
        if is_linked && may_be_apart {
            body.links.remove(&other);
        } else if !is_linked && is_wanted && has_settled && is_settled && may_be_docked {
            body.links.insert(other);
        } else {
            return;
        }
        self.context.mark_state_changed();
    }
}
