//! What the visualiser publishes of a real run, as another vendor's DDS decodes it.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::collections::BTreeSet;
use std::time::Duration;

use formation_tests::{Domain, Peer, Running, root, scenario_path};
use serde_json::Value;

const PATIENCE: Duration = Duration::from_secs(90);

/// The most samples that are examined; a run of this test publishes far fewer pictures.
const SAMPLES_MAX: usize = 2_000;

fn names_of(picture: &Value) -> BTreeSet<&str> {
    let markers = picture["markers"].as_array().unwrap();
    markers
        .iter()
        .filter_map(|marker| marker["ns"].as_str())
        .collect()
}

fn count_of(picture: &Value, name: &str) -> usize {
    let markers = picture["markers"].as_array().unwrap();
    markers.iter().filter(|marker| marker["ns"] == name).count()
}

#[test]
fn another_vendor_decodes_the_markers_and_transforms_of_a_run() {
    let domain = &*Domain::for_processes(4);
    let visualiser = Running::start("visualiser", domain, &["--rate", "20"]);
    let (Some(markers), Some(transforms), Some(fixed)) = (
        Peer::take(
            "markers",
            "visualization_msgs/msg/MarkerArray",
            true,
            domain,
        ),
        Peer::take("/tf", "tf2_msgs/msg/TFMessage", false, domain),
        Peer::take("/tf_static", "tf2_msgs/msg/TFMessage", true, domain),
    ) else {
        return;
    };
    let path = scenario_path("mcs_detach");
    let arguments = [
        "run",
        path.to_str().unwrap(),
        "--modules-per-process",
        "4",
        "--timeout",
        "60",
        // That of a visualiser that is given none.
        "--session",
        "0",
    ];
    let run = Running::start("formation", domain, &arguments).finish(PATIENCE);
    assert_eq!(run.status, 0, "{}{}", run.stdout, run.stderr);

    let mut seen = BTreeSet::new();
    let on_the_way = (0..SAMPLES_MAX)
        .map(|_| markers.taken())
        .inspect(|picture| seen.extend(names_of(picture).into_iter().map(str::to_owned)))
        .find(|picture| count_of(picture, "claims") == 1 && count_of(picture, "trails") > 0);
    let picture =
        on_the_way.expect("no picture shows a module on its way to the spot that it claims");
    assert_eq!(count_of(&picture, "modules"), 7, "{picture}");
    for name in [
        "links",
        "target_spots",
        "target_edges",
        "spot_labels",
        "module_labels",
    ] {
        assert!(seen.contains(name), "{name} is never drawn: {seen:?}");
    }
    let module = picture["markers"]
        .as_array()
        .unwrap()
        .iter()
        .find(|marker| marker["ns"] == "modules" && marker["id"] == 5)
        .unwrap();
    assert_eq!(module["header"]["frame_id"], "map");
    assert_eq!(module["type"], 1, "a cube");
    assert_eq!(module["scale"]["x"], 0.9);

    let moved = (0..SAMPLES_MAX)
        .map(|_| transforms.taken())
        .find(|sample| sample["transforms"].as_array().unwrap().len() == 7)
        .unwrap();
    let transform = &moved["transforms"][4];
    assert_eq!(transform["child_frame_id"], "module_5");
    assert_eq!(transform["header"]["frame_id"], "map");
    let rotation = &transform["transform"]["rotation"];
    let length: f64 = ["x", "y", "z", "w"]
        .map(|part| rotation[part].as_f64().unwrap().powi(2))
        .iter()
        .sum();
    assert!((length - 1.0).abs() < 1e-9, "{rotation}");
    let spots = fixed.taken();
    assert_eq!(spots["transforms"][6]["child_frame_id"], "spot_7");
    assert_eq!(
        spots["transforms"][6]["transform"]["translation"]["y"],
        10.0
    );
    assert_eq!(visualiser.stop().status, 0);
}

#[test]
fn the_rviz_configuration_has_the_topic_and_quality_of_the_visualiser() {
    let text = std::fs::read_to_string(root().join("launch_scripts/rviz/formation.rviz")).unwrap();
    for line in [
        "Value: /formation/markers",
        "Durability Policy: Transient Local",
        "Reliability Policy: Reliable",
        "Fixed Frame: map",
    ] {
        assert!(text.contains(line), "{line}");
    }
}
