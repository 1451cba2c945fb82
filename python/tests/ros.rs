//! The ROS part with rclpy over Fast DDS, and real processes.

use formation_tests::{Domain, Rclpy, Running, scenario_path};

use crate::package::assembled;

#[test]
#[ignore = "takes a minute; tests/soak_python.sh runs it"]
fn a_formation_is_announced_followed_and_changed_from_python() {
    let Some(rclpy) = Rclpy::find() else {
        return;
    };
    let package = assembled();
    let domain = &*Domain::for_processes(4);
    let scenario = scenario_path("singletons_10");
    let scenario = scenario.to_str().unwrap();
    let hosted = ["--modules", "1-10", "--scenario", scenario, "--speed", "50"];
    let _programs = [
        Running::start("target_publisher", domain, &[]),
        Running::start("verifier", domain, &["--keep-watching"]),
        Running::start("module_agent", domain, &hosted),
    ];
    let arguments = [package.path().to_str().unwrap(), scenario];
    let lab = rclpy.start("python/tests/ros_lab.py", domain, &arguments);
    let said = lab.finish();
    for expected in [
        "followed to settled",
        "verdict COMPLETE 10 of 10 as planned",
        "added ",
        "refused to remove",
        "nobody serves",
    ] {
        assert!(said.contains(expected), "{expected} is missing in {said}");
    }
}
