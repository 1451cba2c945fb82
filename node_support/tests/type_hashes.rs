//! The type hashes that nodes compute are those of the generator of ROS 2, which `msgs/type_hashes.txt` keeps.

use std::fmt::Write;
use std::fs;

use formation_msgs::INTERFACES;
use ros_runtime::type_hash::Interfaces;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../msgs/type_hashes.txt");

/// With this variable set, the test rewrites the file.
const UPDATE: &str = "FORMATION_UPDATE_TYPE_HASHES";

#[test]
fn hashes_are_those_of_the_generator() {
    let interfaces = Interfaces::with(INTERFACES).unwrap();
    let kept = fs::read_to_string(FILE).unwrap();
    let mut computed: String = kept
        .lines()
        .take_while(|line| line.starts_with('#'))
        .map(|line| format!("{line}\n"))
        .collect();
    for name in interfaces.names() {
        let hash = interfaces.hash(name).unwrap();
        writeln!(computed, "{name} {hash}").unwrap();
    }
    if std::env::var_os(UPDATE).is_some() {
        fs::write(FILE, &computed).unwrap();
    }
    let kept = fs::read_to_string(FILE).unwrap();
    let advice = format!(
        "after a change of an interface, run `{UPDATE}=1 cargo test -p formation_node_support --test type_hashes`; the test \
         `type_hashes_are_those_of_the_generator` of tests/tests/rclpy.rs then compares the file with the generator"
    );
    for (kept, computed) in kept.lines().zip(computed.lines()) {
        assert_eq!(kept, computed, "{advice}");
    }
    assert_eq!(kept.lines().count(), computed.lines().count(), "{advice}");
}
