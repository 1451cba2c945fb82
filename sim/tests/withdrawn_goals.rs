//! A goal that is withdrawn before it leaves the process moves nothing, so the pin stays.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    Heartbeat, Incarnation, Message, ModuleId, ModulePhase, ModuleRun, ModuleState, Pose, Scenario,
    SourceId, SpotId, TargetAnnouncement,
};
use formation_motion::MotionReport;
use formation_protocol::{
    Agent, AgentParameters, Arrived, Identity, Input, Mutation, Output, Replica,
};

/// One module by itself, on the clock of the test.
struct Alone {
    replica: Replica,
    now: Duration,
    /// The spot in its last GATHERED state.
    pin: Option<SpotId>,
}

impl Alone {
    fn new(mutation: Option<Mutation>) -> Self {
        let identity = Identity::single(ModuleId(4).run(Incarnation(1)), Pose::default());
        let agent = Agent::new(identity, AgentParameters::default(), Duration::ZERO);
        let agent = match mutation {
            Some(mutation) => agent.mutated(mutation),
            None => agent,
        };
        let mut replica = Replica::default();
        replica.add(Duration::ZERO, agent);
        Self {
            replica,
            now: Duration::ZERO,
            pin: None,
        }
    }

    fn handle(&mut self, messages: Vec<Message>) {
        let received = messages.into_iter().map(|message| Arrived {
            source: Some(SourceId(7)),
            sender: None,
            message,
        });
        self.replica.handle_messages(self.now, received);
        self.carry_out();
    }

    /// Arrives wherever it is sent, at once.
    fn carry_out(&mut self) {
        while let Some(output) = self.replica.poll_output(0) {
            let report = match output {
                Output::Move(goal) => MotionReport::Arrived {
                    goal: goal.pose,
                    pose: goal.pose,
                },
                Output::Halt => MotionReport::Halted(self.replica.agents()[0].pose()),
                Output::Publish(Message::ModuleState(state)) => {
                    if state.phase == ModulePhase::Gathered {
                        self.pin = state.spot;
                    }
                    continue;
                }
                _ => continue,
            };
            let now = self.now;
            self.replica
                .with(0, |agent| agent.handle(now, Input::Motion(report)));
        }
    }

    fn until(&mut self, is_there: impl Fn(&Agent) -> bool) {
        while !is_there(&self.replica.agents()[0]) {
            let due = self.replica.agents()[0].poll_timeout();
            self.now = due.max(self.now + Duration::from_millis(1));
            assert!(
                self.now < Duration::from_secs(60),
                "{:?}",
                self.replica.agents()[0].phase()
            );
            let now = self.now;
            self.replica
                .with(0, |agent| agent.handle(now, Input::Timeout));
            self.carry_out();
        }
    }
}

/// A target of some spots in a row from x = 5 on.
fn row(revision: u64, y: i64, spots: u32) -> Message {
    let spots = (1..=spots).map(|id| format!("{{id: {id}, x: {}.0, y: {y}.0}}", 4 + id));
    let spots: Vec<String> = spots.collect();
    let edges = if spots.len() == 2 { "[1, 2]" } else { "" };
    let text = format!(
        "target: {{spots: [{}], edges: [{edges}]}}\nsingletons: [{{id: 4, x: 0.0, y: 0.0}}]\n",
        spots.join(", ")
    );
    let scenario = Scenario::from_yaml(&text).unwrap();
    Message::Target(Arc::new(TargetAnnouncement::new(
        scenario.problem(),
        revision,
    )))
}

/// The pin with which a module freezes for the target that it has settled for, after a plan for another target by which it
/// decided to set off in the moment in which it opened another epoch.
fn pin_after_a_withdrawn_goal(mutation: Option<Mutation>) -> Option<SpotId> {
    let mut module = Alone::new(mutation);
    module.handle(vec![row(1, 5, 1)]);
    module.until(|agent| agent.phase() == ModulePhase::Settled);
    module.handle(vec![row(2, 8, 2)]);
    module.until(|agent| agent.phase() == ModulePhase::Waiting);
    // It sleeps beyond the lease, and wakes to a newcomer for the second spot.
    module.now += Duration::from_secs(5);
    let epoch = module.replica.agents()[0].epoch();
    let run = ModuleRun {
        module: ModuleId(9),
        incarnation: Incarnation(1),
    };
    let heartbeat = Heartbeat {
        uptime: module.now,
        epoch,
        phase: ModulePhase::Spare,
        ..Heartbeat::first(run)
    };
    let state = ModuleState::standing(run, Pose::default());
    module.handle(vec![
        Message::ModuleState(Arc::new(state)),
        Message::Heartbeat(heartbeat),
    ]);
    assert_eq!(module.replica.agents()[0].phase(), ModulePhase::Gathered);
    assert!(module.replica.agents()[0].epoch() > epoch);
    module.handle(vec![row(3, 5, 1)]);
    let for_the_second = module.replica.agents()[0].epoch();
    module.until(|agent| agent.epoch() > for_the_second);
    module.pin
}

/// Shows P1.
#[test]
fn a_pin_is_given_up_when_a_goal_leaves_and_not_before() {
    assert_eq!(pin_after_a_withdrawn_goal(None), Some(SpotId(1)));
    let too_early = Mutation::ForgetPinBeforeGoal;
    assert_eq!(pin_after_a_withdrawn_goal(Some(too_early)), None);
}
