//! The verifier and CycloneDDS, a DDS implementation that we did not write, on one loopback interface.

use std::collections::BTreeSet;
use std::thread;
use std::time::Duration;

use async_channel::bounded;
use formation_model::FormationStage;
use formation_tests::{Domain, Peer};
use formation_verify::{ObserverParameters, Outcome};
use ros_runtime::environment::{DiscoveryRange, Environment, Overrides};
use ros_runtime::settings::Settings;
use ros_runtime::topic_statistics::RefusalKind;
use serde_json::{Value, json};
use verifier::judging::Judging;
use verifier::verification::{End, News, VerifierProcess};

fn settings(domain: &str) -> Settings {
    let overrides = Overrides {
        domain: Some(domain.parse().unwrap()),
        range: Some(DiscoveryRange::Localhost),
    };
    Settings {
        namespace: "/formation".parse().unwrap(),
        environment: Environment::resolve(overrides, |_| None).unwrap(),
        ..Settings::default()
    }
}

#[test]
fn another_vendor_announces_a_target_talks_nonsense_and_reads_the_verdict() {
    let domain = &*Domain::for_processes(4);
    let Some(mut target) = Peer::start("put", "target", domain) else {
        return;
    };
    let mut garbler = Peer::start("garble", "module_states", domain).unwrap();
    let mut liar = Peer::start("put", "heartbeats", domain).unwrap();
    let reader = Peer::start("take", "verdict", domain).unwrap();
    // The verifier's time limit is for what they publish, not for their start.
    for peer in [&target, &garbler, &liar] {
        peer.await_ready();
    }
    let process = VerifierProcess {
        settings: settings(domain),
        judging: Judging(ObserverParameters {
            time_limit: Duration::from_secs(10),
            ..ObserverParameters::default()
        }),
        plan_only: false,
        event_log: false,
        keep_watching: false,
        trace: None,
        linger: Duration::from_secs(1),
    };
    let (_stop, stopped) = bounded(1);
    let watching = thread::spawn(move || {
        let mut stages = BTreeSet::new();
        let judgement = process.run(&stopped, |news| {
            if let News::Progress(progress) = news {
                stages.insert(progress.stage);
            }
        });
        (stages, judgement.unwrap())
    });
    let spots = json!([{"id": 1, "x": 1.0, "y": 2.0}, {"id": 2, "x": 2.0, "y": 2.0}]);
    target.put(&json!({
        "header": {"frame_id": "map"},
        "revision": 1,
        "name": "pair",
        "expected_modules": 2,
        "spots": spots,
        "edges": [{"first": 1, "second": 2}],
        "planner": {"d_max": -1, "weight_loc": 1.0, "weight_dock": 0.1, "weight_undock": 0.05},
    }));
    garbler.put(&Value::Null);
    // A best-effort sample does not reach a subscription that is not matched yet, so it repeats.
    let beat = json!({"module_id": 4, "incarnation": 1, "sequence": 1, "phase": 1});
    while !watching.is_finished() {
        liar.put(&json!({"modules": [beat, beat]}));
        thread::sleep(Duration::from_millis(200));
    }
    let (stages, judgement) = watching.join().unwrap();
    let Some(End::Judged(verdict)) = judgement.end else {
        panic!("expected a verdict, got {:?}", judgement.end);
    };
    assert!(
        stages.contains(&FormationStage::Gathering),
        "the target was not understood: {stages:?}, {}",
        judgement.statistics
    );
    assert_eq!(verdict.outcome, Outcome::Failed, "no module ever came");
    let refused = |topic: &str| &judgement.statistics.topics()[topic].refused;
    assert_eq!(refused("module_states")[&RefusalKind::Malformed], 1);
    assert!(refused("heartbeats")[&RefusalKind::Invalid] > 0);
    assert_eq!(judgement.statistics.topics()["heartbeats"].received, 0);
    let read = reader.taken();
    assert_eq!(read["outcome"], 3);
    assert!(
        read["violations"]
            .as_array()
            .is_some_and(|sentences| !sentences.is_empty())
    );
}
