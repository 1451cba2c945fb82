//! Well-formed messages with hostile values, from the bytes to the agents and the observer behind the border.
//!
//! `FORMATION_FUZZ_CASES` says how many cases each test tries; `tests/soak_fuzz.sh` tries a million.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use crate::common::cases;
use crate::common::codec::{self, Codec, read};
use crate::common::hostile::Writer;
use formation_generate::Random;
use formation_model::{Incarnation, Message, ModuleId, ModuleSize, Pose, SourceId};
use formation_motion::MotionReport;
use formation_msgs as wire;
use formation_msgs::IntoCore;
use formation_protocol::{Agent, AgentParameters, Identity, Input, Output};
use formation_verify::{Observer, ObserverParameters};
use proptest::prelude::*;
use serde_reflection::Registry;

/// Each type of the package and the description of its fields.
type Described = Vec<(Codec, Registry)>;

thread_local! {
    static CODECS: Rc<Described> = Rc::new(
        codec::all()
            .into_iter()
            .map(|codec| {
                let registry = (codec.trace)();
                (codec, registry)
            })
            .collect(),
    );
}

fn codecs() -> Rc<Described> {
    CODECS.with(Rc::clone)
}

/// The messages of one sample, as the process at the border makes them.
fn messages(name: &str, payload: &[u8]) -> Vec<Message> {
    fn of<T: serde::de::DeserializeOwned + IntoCore<V>, V>(payload: &[u8]) -> Option<V> {
        let (sample, _) = read::<T>(payload).ok()?;
        sample.into_core(ModuleSize::METRE).ok()
    }
    let one = |message: Option<Message>| message.into_iter().collect();
    match name {
        "Heartbeat" => of::<wire::Heartbeat, Vec<_>>(payload)
            .into_iter()
            .flatten()
            .map(Message::Heartbeat)
            .collect(),
        "ModuleStates" => of::<wire::ModuleStates, Vec<_>>(payload)
            .into_iter()
            .flatten()
            .map(|state| Message::ModuleState(Arc::new(state)))
            .collect(),
        "Roster" => one(of::<wire::Roster, _>(payload).map(Message::Roster)),
        "SpotClaim" => {
            one(of::<wire::SpotClaim, _>(payload).map(|claim| Message::Claim(Arc::new(claim))))
        }
        "OperatorCommand" => of::<wire::OperatorCommand, Vec<_>>(payload).unwrap_or_default(),
        "Eviction" => one(of::<wire::Eviction, _>(payload).map(Message::Eviction)),
        "TargetConfiguration" => one(of::<wire::TargetConfiguration, _>(payload)
            .map(|target| Message::Target(Arc::new(target)))),
        _ => Vec::new(),
    }
}

fn agent(module: u32) -> Agent {
    let identity = Identity::single(
        ModuleId(module).run(Incarnation(3)),
        Pose::from_units(f64::from(module), 0.0, 0.0).unwrap(),
    );
    Agent::new(identity, AgentParameters::default(), Duration::ZERO)
}

/// Does what an agent wants done, and keeps what it says.
fn drain(agent: &mut Agent, now: Duration, said: &mut Vec<Message>) {
    // An agent that always wants more would never let its host read the network again.
    for _ in 0..10_000 {
        let Some(output) = agent.poll_output() else {
            return;
        };
        let report = match output {
            Output::Publish(message) => {
                said.push(message);
                continue;
            }
            Output::Move(goal) => MotionReport::Arrived {
                goal: goal.pose,
                pose: goal.pose,
            },
            Output::Halt => MotionReport::Halted(agent.pose()),
            Output::Dock(other) => MotionReport::Docked(other),
            Output::Undock(other) => MotionReport::Undocked(other),
            Output::Event(_)
            | Output::Persist { .. }
            | Output::Compute(_)
            | Output::BeginRun { .. } => continue,
        };
        agent.handle(now, Input::Motion(report));
    }
    panic!("the agent does not come to an end");
}

/// A real target, so that agents have something to quarrel about.
fn target() -> Message {
    let scenario = formation_model::Scenario::from_yaml(
        "target: {spots: [{id: 1, x: 5.0, y: 5.0}, {id: 2, x: 6.0, y: 5.0}], edges: [[1, 2]]}\n\
         singletons: [{id: 1, x: 1.0, y: 0.0}, {id: 2, x: 2.0, y: 0.0}]",
    )
    .unwrap();
    let announcement = formation_model::TargetAnnouncement::new(scenario.problem(), 1);
    Message::Target(Arc::new(announcement))
}

proptest! {
    #![proptest_config(cases(1_500))]

    /// The generator keeps to the types: whatever it writes honestly is read, and written again alike.
    #[test]
    fn honest_lengths_are_read_and_lies_are_harmless(seed in any::<u64>(), may_lie in any::<bool>()) {
        for (codec, registry) in &*codecs() {
            let (payload, lied) = Writer::payload(registry, codec.name, seed, may_lie);
            let decoded = (codec.decode)(&payload);
            (codec.accept)(&payload);
            if !lied {
                let decoded = decoded.map_err(|error| format!("{}: {error}", codec.full_name()));
                prop_assert_eq!(decoded.map(|decoded| decoded.bytes), Ok(payload));
            }
        }
    }

    /// Two agents and an observer receive many such messages from three processes, mixed with each other's messages and
    /// with passing time.
    #[test]
    fn agents_and_observers_tolerate_whatever_passes_validation(seed in any::<u64>()) {
        let codecs = codecs();
        let mut random = Random::from_seed(seed);
        let mut agents = [agent(1), agent(2)];
        let mut observer = Observer::new(ObserverParameters::default());
        let mut now = Duration::ZERO;
        let mut queued: Vec<(SourceId, Message)> = vec![(SourceId(9), target())];
        for _ in 0..40 {
            now += Duration::from_millis(random.below(2_000));
            let (codec, registry) = &codecs[random.index(codecs.len())];
            let (payload, _) = Writer::payload(registry, codec.name, random.below(u64::MAX), false);
            let source = SourceId(u128::from(random.below(3)) + 10);
            queued.extend(messages(codec.name, &payload).into_iter().map(|message| (source, message)));
            for (source, message) in std::mem::take(&mut queued) {
                observer.handle(now, &message);
                for (index, agent) in agents.iter_mut().enumerate() {
                    if source == SourceId(index as u128) {
                        continue;
                    }
                    agent.handle(now, Input::Message { source: Some(source), message: message.clone() });
                    let mut said = Vec::new();
                    drain(agent, now, &mut said);
                    queued.extend(said.into_iter().map(|message| (SourceId(index as u128), message)));
                }
            }
            for (index, agent) in agents.iter_mut().enumerate() {
                agent.handle(now, Input::Timeout);
                let mut said = Vec::new();
                drain(agent, now, &mut said);
                queued.extend(said.into_iter().map(|message| (SourceId(index as u128), message)));
            }
            let _ = observer.progress();
            let _ = observer.agreement();
            observer.review(now);
        }
    }
}

/// The two tests above would show nothing if no hostile value ever got behind the border.
#[test]
fn some_of_every_kind_passes_the_border() {
    let mut passed: BTreeMap<&str, usize> = BTreeMap::from([
        ("Heartbeat", 0),
        ("ModuleStates", 0),
        ("OperatorCommand", 0),
        ("Roster", 0),
        ("SpotClaim", 0),
        ("Eviction", 0),
        ("TargetConfiguration", 0),
    ]);
    for (codec, registry) in &*codecs() {
        if let Some(count) = passed.get_mut(codec.name) {
            for seed in 0..100_000 {
                let (payload, _) = Writer::payload(registry, codec.name, seed, false);
                *count += messages(codec.name, &payload).len();
            }
        }
    }
    for (name, count) in &passed {
        assert!(*count > 0, "no {name} passed: {passed:?}");
    }
}
