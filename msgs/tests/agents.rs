//! Everything that agents say while they form, lose members and start again passes the border unchanged.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::common::codec::over_the_wire;
use formation::generate::{GeneratorParameters, Grouping, generate};
use formation::model::{self, Message, ModuleId, RosterMessage, Scenario};
use formation_msgs as wire;
use formation_sim::{Cluster, ClusterParameters, NetworkParameters, Observation};

/// How much of what was said exercises which part of the messages.
#[derive(Debug, Default)]
struct Heard {
    messages: usize,
    plans: usize,
    claims_with_evictions: usize,
    claims_with_detached: usize,
    states_with_marks: usize,
    states_with_bases: usize,
    heartbeats_with_digest: usize,
}

/// Sends one message over the wire and expects it back as it was.
fn check(said: &Message, heard: &mut Heard) {
    heard.messages += 1;
    match said {
        Message::Target(announcement) => {
            let sent = over_the_wire(wire::TargetConfiguration::from(&**announcement));
            let back = model::TargetAnnouncement::try_from(sent);
            assert_eq!(back.as_ref(), Ok(&**announcement));
        }
        Message::ModuleState(state) => {
            let states = [(**state).clone()];
            let sent = over_the_wire(wire::ModuleStates::new(wire::Header::default(), &states));
            assert_eq!(Vec::try_from(sent), Ok(states.to_vec()));
            heard.states_with_marks += usize::from(!state.waited_for.is_empty());
            heard.states_with_bases += usize::from(!state.quorum_bases.is_empty());
        }
        Message::Roster(roster) => {
            let sent = over_the_wire(wire::Roster::from(roster));
            assert_eq!(RosterMessage::try_from(sent).as_ref(), Ok(roster));
            heard.plans += usize::from(matches!(roster, RosterMessage::Plan(_)));
        }
        Message::Claim(claim) => {
            let sent = over_the_wire(wire::SpotClaim::from(&**claim));
            assert_eq!(model::SpotClaim::try_from(sent).as_ref(), Ok(&**claim));
            heard.claims_with_evictions += usize::from(!claim.decision.evictions.is_empty());
            heard.claims_with_detached += usize::from(!claim.decision.detached.is_empty());
        }
        Message::Eviction(notice) => {
            let sent = over_the_wire(wire::Eviction::from(notice));
            assert_eq!(model::EvictionNotice::try_from(sent).as_ref(), Ok(notice));
        }
        Message::Heartbeat(heartbeat) => {
            let sent = over_the_wire(wire::Heartbeat::new([heartbeat]));
            assert_eq!(Vec::try_from(sent), Ok(vec![*heartbeat]));
            heard.heartbeats_with_digest += usize::from(heartbeat.digest.is_some());
        }
    }
}

#[test]
fn what_agents_say_passes_the_border_unchanged() {
    let mut heard = Heard::default();
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
                check(&said, &mut heard);
            }
        }
    }
    // Silence would pass as well; each kind of content must have been heard.
    let kinds = BTreeMap::from([
        ("plans", heard.plans),
        ("claims with evictions", heard.claims_with_evictions),
        ("claims with detached modules", heard.claims_with_detached),
        ("states with marks", heard.states_with_marks),
        ("states with quorum bases", heard.states_with_bases),
        ("heartbeats with a digest", heard.heartbeats_with_digest),
    ]);
    assert!(kinds.values().all(|&count| count > 0), "{heard:?}");
}
