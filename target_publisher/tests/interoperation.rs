//! The target publisher and CycloneDDS, a DDS implementation that we did not write, on one loopback interface.

use formation_tests::{Domain, Peer, Running, ScenarioFile};
use serde_json::json;

const SCENARIO: &str = "
name: three
target: {frame_id: hall, spots: [{id: 3, x: 5.5, y: 5.0, theta: 0.5}, {id: 2, x: 6.5, y: 5.0}], edges: [[3, 2]]}
singletons: [{id: 17, x: 3.0, y: 9.5}]
planner: {d_max: 3}
";

#[test]
fn a_late_subscriber_of_another_vendor_gets_the_target() {
    let domain = &*Domain::for_processes(4);
    let scenario = ScenarioFile::new("interoperation", SCENARIO);
    let arguments = ["--scenario", scenario.path(), "--revision", "7"];
    let more = ["--expected-modules", "1"];
    let publisher = Running::start(
        "target_publisher",
        domain,
        &[arguments.as_slice(), &more].concat(),
    );
    // The target must arrive whether the subscriber is late or not.
    let Some(peer) = Peer::start("take", "target", domain) else {
        return;
    };
    let target = peer.taken();
    assert_eq!(publisher.stop().status, 0);
    assert_eq!(target["revision"], 7);
    assert_eq!(target["name"], "three");
    assert_eq!(target["header"]["frame_id"], "hall");
    assert_ne!(target["header"]["stamp"]["sec"], 0);
    assert_eq!(
        target["spots"],
        json!([
            {"id": 2, "x": 6.5, "y": 5.0, "theta": 0.0},
            {"id": 3, "x": 5.5, "y": 5.0, "theta": 0.5},
        ])
    );
    assert_eq!(target["expected_modules"], 1);
    assert_eq!(target["planner"]["d_max"], 3);
}
