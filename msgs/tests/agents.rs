//! Everything that agents publish while they form, lose members and restart is unchanged after a round trip as messages.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::common::codec::over_the_wire;
use formation_generate::{GeneratorParameters, Grouping, generate};
use formation_model::{Message, ModuleId, ModuleSize, RosterMessage, Scenario};
use formation_msgs as wire;
use formation_msgs::IntoCore;
use formation_sim::{Cluster, ClusterParameters, NetworkParameters, Observation};

const SIZE: ModuleSize = ModuleSize::METRE;

/// How many messages exercise which part of the message types.
#[derive(Debug, Default)]
struct Coverage {
    messages: usize,
    plans: usize,
    claims_with_evictions: usize,
    claims_with_detached: usize,
    states_with_marks: usize,
    heartbeats_with_digest: usize,
}

/// Sends one message over the wire and expects it back as it was.
fn check(said: &Message, coverage: &mut Coverage) {
    coverage.messages += 1;
    match said {
        Message::Target(announcement) => {
            let sent = over_the_wire(wire::TargetConfiguration::new(announcement, SIZE));
            let back = sent.into_core(SIZE);
            assert_eq!(back.as_ref(), Ok(&**announcement));
        }
        Message::ModuleState(state) => {
            let states = [(**state).clone()];
            let sent = over_the_wire(wire::ModuleStates::new(
                wire::Header::default(),
                Duration::ZERO,
                &states,
                SIZE,
            ));
            assert_eq!(sent.into_core(SIZE), Ok(states.to_vec()));
            coverage.states_with_marks += usize::from(!state.waited_for.is_empty());
        }
        Message::Roster(roster) => {
            let sent = over_the_wire(wire::Roster::new(roster, SIZE));
            assert_eq!(sent.into_core(SIZE).as_ref(), Ok(roster));
            coverage.plans += usize::from(matches!(roster, RosterMessage::Plan(_)));
        }
        Message::Claim(claim) => {
            let sent = over_the_wire(wire::SpotClaim::from(&**claim));
            assert_eq!(sent.into_core(SIZE).as_ref(), Ok(&**claim));
            coverage.claims_with_evictions += usize::from(!claim.decision.evictions.is_empty());
            coverage.claims_with_detached += usize::from(!claim.decision.detached.is_empty());
        }
        Message::Eviction(notice) => {
            let sent = over_the_wire(wire::Eviction::from(notice));
            assert_eq!(sent.into_core(SIZE).as_ref(), Ok(notice));
        }
        // No agent sends commands, or messages of another session.
        Message::OtherSessionState(_) | Message::Stop(_) | Message::Removal(_) => {}
        Message::Heartbeat(heartbeat) => {
            let sent = over_the_wire(wire::Heartbeat::new([heartbeat], SIZE));
            assert_eq!(sent.into_core(SIZE), Ok(vec![heartbeat.clone()]));
            coverage.heartbeats_with_digest += usize::from(heartbeat.digest.is_some());
        }
    }
}

#[test]
fn what_agents_say_passes_the_border_unchanged() {
    let mut coverage = Coverage::default();
    for seed in 0..12 {
        let generated = GeneratorParameters::new(12, 12, seed).grouped(Grouping::Mixed);
        let scenario = Scenario::try_from(generate(&generated).unwrap()).unwrap();
        let parameters = ClusterParameters {
            network: NetworkParameters::rough(),
            ..ClusterParameters::default()
        };
        let mut cluster = Cluster::new(scenario.problem(), parameters, seed);
        cluster.announce_problem(scenario.problem(), 1);
        // One module is lost on the way and comes back, so that a second epoch refers to the first.
        let any_moves = |cluster: &Cluster| {
            cluster.running().into_iter().any(|module| {
                cluster
                    .standing(module)
                    .is_some_and(|standing| standing.moving)
            })
        };
        assert!(
            cluster.run_until(Duration::from_secs(300), any_moves),
            "seed {seed}"
        );
        let lost: ModuleId = *cluster.running().last().unwrap();
        cluster.crash(lost);
        cluster.run_until(cluster.now() + Duration::from_secs(60), |_| false);
        cluster.restart(lost);
        cluster.run_until(
            cluster.now() + Duration::from_secs(120),
            Cluster::has_formed,
        );
        for (_, observation) in cluster.take_observations() {
            if let Observation::Published(_, said) = observation {
                check(&said, &mut coverage);
            }
        }
    }
    // A run without messages would pass as well: each kind of content must have occurred.
    let kinds = BTreeMap::from([
        ("plans", coverage.plans),
        ("claims with evictions", coverage.claims_with_evictions),
        (
            "claims with detached modules",
            coverage.claims_with_detached,
        ),
        ("states with marks", coverage.states_with_marks),
        ("heartbeats with a digest", coverage.heartbeats_with_digest),
    ]);
    assert!(kinds.values().all(|&count| count > 0), "{coverage:?}");
}
