//! Values of every type of the package, as our own side puts them on the wire.

use std::time::Duration;

use formation_model::ModuleSize;
use formation_msgs as wire;
use formation_msgs::InterfaceType;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, TestRunner};
use serde::Serialize;
use serde_json::Value;

use super::codec::{self, encode, full_name};
use super::core_values;

/// The size of the modules in samples.
const SIZE: ModuleSize = ModuleSize::METRE;

/// One value and its encoding.
pub struct Sample {
    pub type_name: String,
    pub value: Value,
    pub bytes: Vec<u8>,
}

fn draw<S: Strategy>(runner: &mut TestRunner, strategy: &S) -> S::Value {
    strategy.new_tree(runner).unwrap().current()
}

struct Collection(Vec<Sample>);

impl Collection {
    fn add<T: InterfaceType + Serialize>(&mut self, value: &T) {
        for little_endian in [true, false] {
            self.0.push(Sample {
                type_name: full_name::<T>(),
                value: serde_json::to_value(value).unwrap(),
                bytes: encode(value, little_endian),
            });
        }
    }

    fn add_all<T: InterfaceType + Serialize>(&mut self, values: &[T]) {
        for value in values {
            self.add(value);
        }
    }

    /// Adds an example of each type that has no sample.
    fn add_examples(&mut self) {
        for codec in codec::all() {
            let type_name = codec.full_name();
            if self.0.iter().any(|sample| sample.type_name == type_name) {
                continue;
            }
            for little_endian in [true, false] {
                let (value, bytes) = (codec.example)(little_endian);
                let type_name = type_name.clone();
                self.0.push(Sample {
                    type_name,
                    value,
                    bytes,
                });
            }
        }
    }

    fn add_target(&mut self, target: &wire::TargetConfiguration) {
        self.add(target);
        self.add(&target.planner);
        self.add_all(&target.planner.policy_options);
        self.add_all(&target.spots);
        self.add_all(&target.edges);
        self.add_all(&target.obstacles);
        self.add(&target.arena);
    }

    fn add_states(&mut self, states: &wire::ModuleStates) {
        self.add(states);
        for state in &states.modules {
            self.add(state);
            self.add(&state.epoch);
            self.add_all(&state.waited_for);
            self.add_all(&state.bodies);
            self.add_all(&state.proposed_removals);
        }
    }

    fn add_roster(&mut self, roster: &wire::Roster) {
        self.add(roster);
        self.add_all(&roster.members);
    }

    fn add_claim(&mut self, claim: &wire::SpotClaim) {
        self.add(claim);
        self.add_all(&claim.selections);
        self.add_all(&claim.evictions);
        self.add_all(&claim.swaps);
    }

    fn add_action(
        &mut self,
        runner: &mut TestRunner,
        target: wire::TargetConfiguration,
        verdict: wire::Verdict,
        progress: wire::Progress,
    ) {
        let scenario = draw(runner, &sentence());
        let message = draw(runner, &sentence());
        self.add(&wire::FormConfigurationGoal {
            scenario,
            expected_modules: target.expected_modules,
            target,
        });
        self.add(&wire::FormConfigurationResult { verdict, message });
        self.add(&wire::FormConfigurationFeedback { progress });
    }

    fn add_services(&mut self, runner: &mut TestRunner, progress: wire::Progress) {
        let (include_waiting, success, revision) = draw(runner, &any::<(bool, bool, u64)>());
        let message = draw(runner, &sentence());
        self.add(&wire::QueryStatusRequest { include_waiting });
        self.add(&wire::QueryStatusResponse {
            target: message.clone(),
            revision,
            progress,
        });
        self.add(&wire::WithdrawTargetRequest { revision });
        self.add(&wire::WithdrawTargetResponse {
            success,
            message: message.clone(),
        });
        let (module_id, x, y, theta) = draw(runner, &any::<(u32, i16, i16, i16)>());
        self.add(&wire::AddModuleRequest {
            module_id,
            x: x.into(),
            y: y.into(),
            theta: theta.into(),
        });
        self.add(&wire::AddModuleResponse {
            success,
            message: message.clone(),
        });
        self.add(&wire::RemoveModuleRequest {
            module_id,
            incarnation: revision,
        });
        self.add(&wire::RemoveModuleResponse {
            success,
            message: message.clone(),
        });
        self.add(&wire::StopFormationRequest {
            resume: include_waiting,
        });
        self.add(&wire::StopFormationResponse {
            success,
            message: message.clone(),
        });
        self.add(&wire::RetireModuleRequest {
            module_id,
            rejoin: include_waiting,
        });
        self.add(&wire::PushModuleRequest {
            module_id,
            x: 0.5,
            y: -1.5,
            order: u64::from(module_id),
        });
        self.add(&wire::PushModuleResponse {
            success,
            message: message.clone(),
        });
        self.add(&wire::RetireModuleResponse { success, message });
    }
}

pub fn header() -> impl Strategy<Value = wire::Header> {
    (any::<i32>(), 0..1_000_000_000_u32, "[a-z]{0,7}").prop_map(|(sec, nanosec, frame_id)| {
        wire::Header {
            stamp: wire::Time { sec, nanosec },
            frame_id,
        }
    })
}

fn verdict() -> impl Strategy<Value = wire::Verdict> {
    let ids = || proptest::collection::vec(any::<u32>(), 0..4);
    (
        header(),
        any::<(u64, u32, u8, u32, u32)>(),
        ids(),
        ids(),
        ids(),
        proptest::collection::vec("\\PC{0,12}", 0..4),
    )
        .prop_map(
            |(header, numbers, open_spots, unassigned_modules, assigned, violations)| {
                let (number, convener, outcome, filled_spots, spots) = numbers;
                wire::Verdict {
                    header,
                    session: number / 2,
                    epoch: wire::Epoch { number, convener },
                    outcome,
                    filled_spots,
                    spots,
                    open_spots,
                    unassigned_modules,
                    assignments: assigned
                        .into_iter()
                        .map(|module_id| wire::SpotSelection {
                            spot_id: module_id / 2,
                            module_id,
                        })
                        .collect(),
                    blocked_spots: Vec::new(),
                    collision_free: filled_spots == spots,
                    collision_reason: "they met".to_owned(),
                    violations,
                }
            },
        )
}

fn docking_request() -> impl Strategy<Value = wire::DockingRequest> {
    (header(), any::<(u32, u64, bool, u32)>()).prop_map(
        |(header, (module_id, request, docks, other_module_id))| wire::DockingRequest {
            header,
            module_id,
            request,
            action: if docks {
                wire::DockingRequest::ACTION_DOCK
            } else {
                wire::DockingRequest::ACTION_UNDOCK
            },
            other_module_id,
        },
    )
}

fn docking_result() -> impl Strategy<Value = wire::DockingResult> {
    (header(), any::<(u32, u64, bool)>(), "\\PC{0,12}").prop_map(
        |(header, (module_id, request, success), reason)| wire::DockingResult {
            header,
            module_id,
            request,
            success,
            reason,
        },
    )
}

fn progress() -> impl Strategy<Value = wire::Progress> {
    (
        any::<(u8, u64, u32, u32, u32, u32, u32, u32, u32)>(),
        proptest::collection::vec(any::<u32>(), 0..4),
    )
        .prop_map(|(numbers, waiting_for)| {
            let (stage, number, convener, expected, joined, planned, agreed, settled, to_fill) =
                numbers;
            wire::Progress {
                stage,
                epoch: wire::Epoch { number, convener },
                expected,
                joined,
                planned,
                agreed,
                settled,
                to_fill,
                waiting_for,
            }
        })
}

/// What is said to people.
fn sentence() -> impl Strategy<Value = String> {
    "\\PC{0,12}"
}

/// The same values on every run: `count` of each topic, and their parts as values of their own.
pub fn samples(count: usize) -> Vec<Sample> {
    let mut runner = TestRunner::new_with_rng(
        Config::default(),
        proptest::test_runner::TestRng::deterministic_rng(
            proptest::test_runner::RngAlgorithm::ChaCha,
        ),
    );
    let mut samples = Collection(Vec::new());
    for _ in 0..count {
        let header = draw(&mut runner, &header());
        let target = wire::TargetConfiguration {
            header: header.clone(),
            ..wire::TargetConfiguration::new(&draw(&mut runner, &core_values::announcement()), SIZE)
        };
        samples.add_target(&target);
        let states = draw(&mut runner, &core_values::module_states());
        samples.add_states(&wire::ModuleStates::new(
            header,
            Duration::ZERO,
            &states,
            SIZE,
        ));
        samples.add_roster(&wire::Roster::new(
            &draw(&mut runner, &core_values::roster_message()),
            SIZE,
        ));
        samples.add_claim(&(&draw(&mut runner, &core_values::claim())).into());
        let notice = draw(&mut runner, &core_values::eviction_notice());
        samples.add(&wire::Eviction::from(&notice));
        let heartbeat = wire::Heartbeat::new(&draw(&mut runner, &core_values::heartbeats()), SIZE);
        samples.add_all(&heartbeat.modules);
        let (stop, removals) = draw(&mut runner, &core_values::commands());
        let command = wire::OperatorCommand::new(stop, &removals);
        samples.add(&command.stop);
        samples.add_all(&command.removals);
        samples.add(&command);
        samples.add(&heartbeat);
        let verdict = draw(&mut runner, &verdict());
        samples.add(&verdict);
        samples.add(&draw(&mut runner, &docking_request()));
        samples.add(&draw(&mut runner, &docking_result()));
        let progress = draw(&mut runner, &progress());
        samples.add(&progress);
        samples.add_action(&mut runner, target, verdict, progress.clone());
        samples.add_services(&mut runner, progress);
    }
    samples.add_examples();
    samples.0
}

/// The longest little-endian sample of a type, which has the most entries in its lists.
pub fn longest_of(samples: &[Sample], type_name: &str) -> Vec<u8> {
    samples
        .iter()
        .filter(|sample| sample.type_name == type_name && sample.bytes[1] == 1)
        .map(|sample| sample.bytes.clone())
        .max_by_key(Vec::len)
        .unwrap()
}
