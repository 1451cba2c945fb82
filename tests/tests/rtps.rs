//! The packets of a whole run, taken apart by Wireshark's dissector, which we did not write.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use formation_tests::{
    Domain, Namespace, Tool, on_path, program, root, scenario_path, tool_or_skip,
};

/// What tshark prints of a capture. What begins as RTPS does is RTPS, whatever protocol its ports are registered for.
fn dissected(file: &Path, arguments: &[&str]) -> Vec<String> {
    let output = Command::new("tshark")
        .args(["-o", "udp.try_heuristic_first:TRUE", "-r"])
        .arg(file)
        .args(arguments)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.lines().map(str::to_owned).collect()
}

/// As tshark prints a GUID prefix.
fn hexadecimal(prefix: &[u8; 12]) -> String {
    prefix.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A file of this test run, removed with this value together with its log.
struct Capture(PathBuf);

impl Drop for Capture {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
        let _ = std::fs::remove_file(self.0.with_extension("pcapng.log"));
    }
}

#[test]
fn no_packet_of_figure_1_is_malformed() {
    if tool_or_skip(Tool::Tshark, on_path(&["tshark"])).is_none() {
        return;
    }
    let Some(network) = Namespace::with_loopback() else {
        return;
    };
    let domain = &*Domain::alone();
    let name = format!("formation-{}.pcapng", std::process::id());
    let capture = Capture(std::env::temp_dir().join(name));
    let run = network
        .command()
        .arg(root().join("tests/rtps_capture.sh"))
        .args([
            program("formation"),
            scenario_path("figure1_ladder17"),
            capture.0.clone(),
        ])
        .arg(domain)
        .env_remove("ROS_LOCALHOST_ONLY")
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let output = format!(
        "{}{}",
        String::from_utf8_lossy(&run.stdout),
        String::from_utf8_lossy(&run.stderr)
    );
    assert!(run.status.success(), "{output}");
    assert!(output.contains("COMPLETE"), "{output}");

    let fields = [
        "-Y",
        "rtps",
        "-T",
        "fields",
        "-e",
        "rtps.sm.id",
        "-e",
        "rtps.param.topicName",
    ];
    let packets = dissected(&capture.0, &fields);
    assert!(packets.len() > 5_000, "only {} packets", packets.len());
    let mut nodes = BTreeSet::new();
    let mut kinds = BTreeSet::new();
    for packet in &packets {
        let (submessages, topics) = packet.split_once('\t').unwrap();
        kinds.extend(submessages.split(','));
        // Each node announces parameter services of its own. Participants do not count: a process whose DDS library
        // deadlocks restarts with a new one.
        nodes.extend(topics.split(',').filter_map(|topic| {
            let service = topic.strip_prefix("rq/formation/")?;
            Some(service.strip_suffix("/list_parametersRequest")?.to_owned())
        }));
    }
    let modules = (1..=17).map(|id| format!("module_{id}"));
    let expected = modules.chain(["target_publisher", "verifier"].map(str::to_owned));
    assert_eq!(nodes, expected.collect());
    for kind in ["0x06", "0x07", "0x09", "0x15"] {
        assert!(
            kinds.contains(kind),
            "no ACKNACK, HEARTBEAT, INFO_TS or DATA: {kinds:?}"
        );
    }
    let of_other_port = format!("rtps.guidPrefix.src == {}", hexadecimal(b"other port!!"));
    assert_eq!(dissected(&capture.0, &["-Y", &of_other_port]).len(), 1);
    // What the dissector warns of counts as well; 6291456 is its level for warnings. The probes for the start of the capture, to
    // the discard port, are no RTPS: the port that they come from makes them malformed packets of any other protocol.
    let filter = "(_ws.malformed || _ws.expert.severity >= 6291456) && udp.dstport != 9";
    let malformed = dissected(
        &capture.0,
        &["-Y", filter, "-T", "fields", "-e", "rtps.guidPrefix.src"],
    );
    assert_eq!(
        malformed,
        [hexadecimal(b"malformed!!!")],
        "only the packet that is malformed on purpose"
    );
}
