//! Whose process it may be.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::process::Command;

#[test]
fn only_the_leader_of_a_configuration_is_taken() {
    let scenario = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../launch_scripts/scenarios/figure1_ladder17.yaml"
    );
    for (module, expected) in [
        (
            "9",
            "module 9 does not lead its configuration, module 12 does",
        ),
        ("17", "module 17 belongs to no configuration"),
        ("99", "there is no module 99"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_leader_agent"))
            .args(["--module", module, "--scenario", scenario])
            .args(["--discovery-range", "LOCALHOST", "--domain", "74"])
            .output()
            .unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains(expected), "{stderr}");
        assert!(stderr.contains(scenario), "{stderr}");
    }
}
