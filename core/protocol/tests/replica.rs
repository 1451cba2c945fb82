//! Several modules in one process.

use std::time::Duration;

use formation_model::{
    BodyReport, Heartbeat, Incarnation, Message, ModuleId, ModulePhase, ModuleState, Pose,
    SourceId, Whereabouts,
};
use formation_protocol::{
    Agent, AgentParameters, Arrived, Command, Identity, Input, Output, Replica,
};

const OWN: SourceId = SourceId(1);
const OTHER: SourceId = SourceId(2);

fn at(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

fn agent(module: u32) -> Agent {
    let identity = Identity {
        is_first_run: true,
        ..Identity::single(ModuleId(module).run(Incarnation(5)), Pose::default())
    };
    Agent::new(identity, AgentParameters::default(), Duration::ZERO).published_by(OWN)
}

/// The process of modules 4 and 5.
fn replica() -> Replica {
    let mut replica = Replica::default();
    for module in [4, 5] {
        replica.add(Duration::ZERO, agent(module));
    }
    replica
}

/// A heartbeat of a module, with the number of its second.
fn beat(module: u32, incarnation: u64, second: u64) -> Message {
    Message::Heartbeat(Heartbeat {
        sequence: second,
        uptime: at(second),
        ..Heartbeat::first(ModuleId(module).run(Incarnation(incarnation)))
    })
}

fn receive(
    replica: &mut Replica,
    now: Duration,
    source: SourceId,
    sender: Option<usize>,
    message: Message,
) {
    let received = Arrived {
        source: Some(source),
        sender,
        message,
    };
    replica.handle_messages(now, [received]);
}

fn live(replica: &Replica) -> Vec<u32> {
    replica.living().keys().map(|module| module.0).collect()
}

fn refusals(replica: &Replica) -> Vec<String> {
    let agents = replica.agents().iter();
    agents.map(|agent| agent.refusals().to_string()).collect()
}

#[test]
fn modules_of_a_process_know_the_same_peers_and_each_other() {
    let mut replica = replica();
    receive(&mut replica, at(1), OTHER, None, beat(9, 1, 1));
    receive(&mut replica, at(1), OWN, Some(0), beat(4, 5, 1));
    receive(&mut replica, at(1), OWN, Some(1), beat(5, 5, 1));
    assert_eq!(live(&replica), [4, 5, 9]);
    assert_eq!(refusals(&replica), ["", ""]);
    // The other process has fallen silent.
    receive(&mut replica, at(8), OWN, Some(0), beat(4, 5, 8));
    receive(&mut replica, at(8), OWN, Some(1), beat(5, 5, 8));
    assert_eq!(live(&replica), [4, 5]);
    replica.handle_departed(at(8), OTHER);
    receive(&mut replica, at(8), SourceId(3), None, beat(9, 2, 1));
    assert_eq!(live(&replica), [4, 5, 9]);
}

/// Shows M4.
#[test]
fn a_duplicate_of_one_module_silences_that_alone() {
    let mut replica = replica();
    for (index, module) in [(0, 4), (1, 5)] {
        receive(&mut replica, at(1), OWN, Some(index), beat(module, 5, 1));
    }
    // Module 5 of an earlier start: that of this process, which has not listened for long, stands back.
    receive(&mut replica, at(2), OTHER, None, beat(5, 3, 60));
    assert_eq!(
        refusals(&replica),
        ["stale_incarnation 1", "duplicate_module 1"]
    );
    let mut senders = Vec::new();
    for index in [0, 1] {
        while replica.poll_output(index).is_some() {}
        let retire = |agent: &mut Agent| agent.handle(at(3), Input::Command(Command::Retire));
        replica.with(index, retire);
        while let Some(output) = replica.poll_output(index) {
            if let Output::Publish(Message::ModuleState(state)) = output {
                senders.push(state.module);
            }
        }
    }
    assert_eq!(senders, [ModuleId(4)]);
}

/// Shows M4, M7.
#[test]
fn a_module_stands_back_while_a_later_run_sends_that_the_process_knows_as_that_module() {
    let mut replica = replica();
    let later = BodyReport {
        module: ModuleId(5),
        incarnation: Incarnation(9),
        epoch: None,
        sequence: 1,
        whereabouts: Whereabouts::Seen(Pose::default()),
    };
    let naming = ModuleState {
        sequence: 1,
        bodies: vec![later],
        ..ModuleState::standing(ModuleId(8).run(Incarnation(1)), Pose::default())
    };
    for second in 1..30 {
        receive(&mut replica, at(second), OTHER, None, beat(5, 9, second));
        if second == 2 {
            let naming = Message::ModuleState(naming.clone().into());
            receive(&mut replica, at(second), OTHER, None, naming);
        }
        replica.with(1, |agent| agent.handle(at(second), Input::Timeout));
        let own = replica.agents()[1].run().incarnation;
        assert_eq!(own, Incarnation(5), "after {second} s");
    }
}

/// Shows C5.
#[test]
fn a_module_that_is_added_knows_what_the_others_know() {
    let mut replica = Replica::default();
    replica.add(Duration::ZERO, agent(4));
    let state = ModuleState {
        sequence: 1,
        phase: ModulePhase::Listening,
        ..ModuleState::standing(ModuleId(9).run(Incarnation(1)), Pose::default())
    };
    receive(&mut replica, at(1), OTHER, None, beat(9, 1, 1));
    receive(
        &mut replica,
        at(1),
        OTHER,
        None,
        Message::ModuleState(state.into()),
    );
    replica.add(at(2), agent(5));
    // Its own table was empty: what it gives to its store comes from that of the process.
    let memory = replica.with(1, Agent::memory);
    let known: Vec<u32> = memory.bodies.iter().map(|body| body.module.0).collect();
    assert_eq!(known, [9]);
}
