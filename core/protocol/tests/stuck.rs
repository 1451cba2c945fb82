//! A member that makes no progress, at the one that waits for it.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    Epoch, Heartbeat, Incarnation, Message, ModuleId, ModulePhase, ModuleRun, ModuleState, Pose,
    RosterMessage, Scenario, TargetAnnouncement,
};
use formation_protocol::{Agent, AgentParameters, Identity, Input, Output};

const SCENARIO: &str = "
target: {spots: [{id: 1, x: 5, y: 5}, {id: 2, x: 6, y: 5}, {id: 3, x: 7, y: 5}], edges: [[1, 2], [2, 3]]}
singletons: [{id: 1, x: 1, y: 1}, {id: 2, x: 1, y: 3}, {id: 3, x: 1, y: 5}]
";

const OTHER: ModuleRun = ModuleRun {
    module: ModuleId(2),
    incarnation: Incarnation(7),
};

/// Module 1 of three.
fn agent(parameters: AgentParameters) -> Agent {
    let identity = Identity {
        is_first_run: true,
        ..Identity::single(
            ModuleId(1).run(Incarnation(5)),
            Pose::from_units(1.0, 1.0, 0.0).unwrap(),
        )
    };
    let mut agent = Agent::new(identity, parameters, Duration::ZERO);
    let scenario = Scenario::from_yaml(SCENARIO).unwrap();
    let target = Message::Target(Arc::new(TargetAnnouncement {
        expected_modules: Some(3),
        ..TargetAnnouncement::new(scenario.problem(), 1)
    }));
    handle(&mut agent, Duration::ZERO, target);
    agent
}

fn handle(agent: &mut Agent, now: Duration, message: Message) {
    let source = None;
    agent.handle(now, Input::Message { source, message });
}

/// The heartbeat and the state in which the other module shows that it has frozen, at this half of a second.
fn frozen(half: u32, epoch: Option<Epoch>) -> [Message; 2] {
    let phase = if epoch.is_some() {
        ModulePhase::Gathered
    } else {
        ModulePhase::Listening
    };
    let heartbeat = Heartbeat {
        sequence: u64::from(half),
        uptime: HALF * half,
        epoch,
        phase,
        ..Heartbeat::first(OTHER)
    };
    let state = ModuleState {
        knows: true,
        sequence: u64::from(half),
        epoch,
        phase,
        ..ModuleState::standing(OTHER, Pose::from_units(1.0, 3.0, 0.0).unwrap())
    };
    [
        Message::Heartbeat(heartbeat),
        Message::ModuleState(Arc::new(state)),
    ]
}

const HALF: Duration = Duration::from_millis(500);

/// Module 3 is absent, so the other one is needed for a majority. It freezes in each epoch to which it is called, and never claims.
/// Shows M6.
#[test]
fn a_stuck_member_that_is_needed_for_a_quorum_is_called_again() {
    let parameters = AgentParameters::default();
    let mut agent = agent(parameters);
    let (mut called, mut rosters) = (BTreeSet::new(), BTreeSet::new());
    for half in 1..240 {
        let now = HALF * half;
        for message in frozen(half, called.last().copied()) {
            handle(&mut agent, now, message);
        }
        agent.handle(now, Input::Timeout);
        while let Some(output) = agent.poll_output() {
            match output {
                Output::Publish(Message::Roster(RosterMessage::Gather { epoch, .. })) => {
                    called.insert(epoch);
                }
                Output::Publish(Message::Roster(RosterMessage::Plan(roster))) => {
                    rosters.insert((roster.epoch, roster.members.len()));
                }
                _ => {}
            }
        }
    }
    assert!(rosters.len() > 1, "{called:?} {rosters:?}");
    assert!(rosters.iter().all(|&(_, members)| members == 2));
}
