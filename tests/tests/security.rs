//! Programs that must protect their messages and cannot.

use std::time::Duration;

use formation_tests::{Domain, Running, scenario_path};

const ENFORCED: [(&str, &str); 2] = [
    ("ROS_SECURITY_ENABLE", "true"),
    ("ROS_SECURITY_STRATEGY", "Enforce"),
];

#[test]
fn every_program_refuses_dds_where_security_is_enforced() {
    let domain = &*Domain::for_processes(1);
    let scenario = scenario_path("singletons_10");
    let scenario = scenario.to_str().unwrap();
    let configuration = scenario_path("mcs_detach");
    let configuration = configuration.to_str().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("run.mcap");
    let recording = recording.to_str().unwrap();
    let of_scenario = ["--scenario", scenario];
    let programs: [(&str, &[&str]); 8] = [
        ("module_agent", &["--module", "1", "--x", "0", "--y", "0"]),
        (
            "leader_agent",
            &["--module", "1", "--scenario", configuration],
        ),
        ("target_publisher", &of_scenario),
        ("verifier", &of_scenario),
        ("visualiser", &[]),
        ("recorder", &[recording]),
        ("world", &of_scenario),
        ("formation", &["run", scenario]),
    ];
    for (name, arguments) in programs {
        let refused = Running::start_with(&ENFORCED, name, domain, arguments);
        let refused = refused.finish(Duration::from_secs(20));
        assert_eq!(refused.status, 2, "{name}: {}", refused.stderr);
        let is_explained = refused.stderr.contains("no security over DDS");
        assert!(is_explained, "{name}: {}", refused.stderr);
        let has_joined = refused.stderr.contains("joined the ROS 2 graph");
        assert!(!has_joined, "{name}: {}", refused.stderr);
    }
}

#[test]
fn a_misspelled_strategy_is_refused_and_security_that_is_not_enforced_is_a_warning() {
    let domain = &*Domain::for_processes(1);
    let scenario = scenario_path("singletons_10");
    let arguments = ["--scenario", scenario.to_str().unwrap()];
    let misspelled = [ENFORCED[0], ("ROS_SECURITY_STRATEGY", "Enforced")];
    let refused = Running::start_with(&misspelled, "target_publisher", domain, &arguments);
    let refused = refused.finish(Duration::from_secs(20));
    assert_eq!(refused.status, 2, "{}", refused.stderr);
    let is_named = refused.stderr.contains("ROS_SECURITY_STRATEGY");
    assert!(is_named, "{}", refused.stderr);
    let permissive = Running::start_with(&ENFORCED[..1], "target_publisher", domain, &arguments);
    let warned = permissive.wait_for_log(0, "messages are not protected", Duration::from_secs(20));
    assert!(warned.is_some(), "{:?}", permissive.log_since(0));
    let joined = permissive.wait_for_log(0, "announced the target", Duration::from_secs(20));
    assert!(joined.is_some(), "{:?}", permissive.log_since(0));
}
