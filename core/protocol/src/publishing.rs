//! The states and heartbeats of an agent.

use std::sync::Arc;
use std::time::Duration;

use formation_model::{Heartbeat, Message, ModuleState};

use super::Agent;
use super::io::Output;
use super::outbox::HeartbeatContent;

/// After the return of a missed module the next heartbeat follows so many times sooner, together with what else returns until then.
const RETURN_SPEEDUP: u32 = 4;

/// The time since the last multiple of a period.
fn into_period(now: Duration, period: Duration) -> Duration {
    let into = now.as_nanos().checked_rem(period.as_nanos());
    let into = into.and_then(|nanos| u64::try_from(nanos).ok());
    into.map_or(Duration::ZERO, Duration::from_nanos)
}

impl Agent {
    /// Publishes the state if it changed, and the heartbeat if it is due or shows something new.
    /// Enforces C4.
    pub(super) fn publish_due(&mut self) {
        let may_publish =
            self.stage.may_publish_state(&self.context) && !self.succession.is_standing_back();
        let now = self.context.now;
        if self.context.outbox.states.changed && may_publish {
            let states = &mut self.context.outbox.states;
            states.changed = false;
            states.pose_at = now;
            states.sequence += 1;
            let state = self.state();
            self.context.publish(Message::ModuleState(state.into()));
        }
        let new = HeartbeatContent {
            incarnation: self.context.own.run.incarnation,
            epoch: self.epoch(),
            digest: self.digest(),
            phase: self.phase(),
            stop: self.context.stop,
        };
        // What the store does not hold is not shown yet, but for a command: a stop does not wait for a disk.
        let is_writing = self.context.outbox.is_writing();
        let shown = self.context.outbox.heartbeats.shown;
        let shown = shown
            .filter(|_| is_writing)
            .map_or(new, |shown| HeartbeatContent {
                stop: new.stop,
                ..shown
            });
        let heartbeats = &mut self.context.outbox.heartbeats;
        let is_known = |known: HeartbeatContent| !shown.is_urgent_after(known);
        if heartbeats.shown.is_some_and(is_known) && now < heartbeats.due {
            return;
        }
        heartbeats.shown = Some(shown);
        heartbeats.sequence += 1;
        let due = self.after(self.context.parameters.heartbeat);
        self.context.outbox.heartbeats.due = due;
        let heartbeat = self.heartbeat(shown);
        self.context.publish(Message::Heartbeat(heartbeat));
        if let Some(goal) = self.stage.repeated_goal(&self.context) {
            self.context.outbox.push(Output::Move(goal));
        }
    }

    /// The time after this span, with that of the other modules of its process.
    fn after(&self, span: Duration) -> Duration {
        let now = self.context.now;
        if self.context.own.shares_samples {
            (now + span).saturating_sub(into_period(now, span))
        } else {
            now + span
        }
    }

    /// A module came that the latest heartbeat lists as missed: the others wait for the next one, which comes sooner.
    /// Enforces C4.
    pub(super) fn hurry_heartbeat(&mut self) {
        let due = self.after(self.context.parameters.heartbeat / RETURN_SPEEDUP);
        let heartbeats = &mut self.context.outbox.heartbeats;
        heartbeats.due = heartbeats.due.min(due);
    }

    fn state(&mut self) -> ModuleState {
        let context = &self.context;
        let (at, drive) = context.robot.drive_state(context.now);
        let mut state = ModuleState {
            knows: context.session.knows(),
            sequence: context.outbox.states.sequence,
            epoch: self.epoch(),
            digest: self.digest(),
            phase: self.phase(),
            service: context.robot.service,
            at,
            drive,
            links: context.robot.links.clone(),
            configuration: context.own.configuration,
            leader: context.own.leader,
            bodies: context.bodies.of_outdated_runs(),
            ..ModuleState::standing(context.own.run, context.robot.pose)
        };
        self.stage.describe(&mut state, &mut self.context);
        state
    }

    fn heartbeat(&mut self, shown: HeartbeatContent) -> Heartbeat {
        let applied_turns = self.applied_turns();
        let steps_done = self.stage.steps_done();
        let own = self.context.own;
        let roster = self.stage.roster().map(Arc::clone);
        let misses = self
            .context
            .misses(roster.as_deref().map(|roster| &**roster));
        let session = &self.context.session;
        let heartbeats = &mut self.context.outbox.heartbeats;
        Heartbeat {
            module: own.run.module,
            incarnation: shown.incarnation,
            knows: session.knows(),
            voters: session.voters_digest(),
            sequence: heartbeats.sequence,
            uptime: self.context.now.saturating_sub(own.started),
            epoch: shown.epoch,
            digest: shown.digest,
            digest_since: heartbeats.digest_since(shown.digest),
            applied_turns,
            steps_done,
            phase: shown.phase,
            stop: shown.stop,
            misses,
        }
    }
}
