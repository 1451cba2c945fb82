//! The packets of a whole run, taken apart by Wireshark's dissector, which we did not write.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use formation_tests::{alone, program, root, scenario_path};

const ADVICE: &str = "install it (Debian and Ubuntu: `apt-get install tshark`), or set FORMATION_SKIP_TSHARK=1 to go \
                      without this test";

/// What tshark prints of a capture.
fn dissected(file: &Path, arguments: &[&str]) -> Vec<String> {
    let output = Command::new("tshark")
        .arg("-r")
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
    if std::env::var_os("FORMATION_SKIP_TSHARK").is_some_and(|value| value == "1") {
        // Not by a macro: the test harness would keep it to itself.
        writeln!(
            std::io::stderr(),
            "SKIPPED: FORMATION_SKIP_TSHARK=1, so no packet was dissected"
        )
        .unwrap();
        return;
    }
    let there = Command::new("tshark")
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    assert!(
        there.is_ok_and(|status| status.success()),
        "tshark is missing: {ADVICE}"
    );
    let _alone = alone();
    let name = format!("formation-{}.pcapng", std::process::id());
    let capture = Capture(std::env::temp_dir().join(name));
    let run = Command::new("unshare")
        .args(["--user", "--map-root-user", "--net"])
        .arg(root().join("tests/rtps_capture.sh"))
        .args([
            program("formation"),
            scenario_path("figure1_ladder17"),
            capture.0.clone(),
        ])
        .arg("97")
        .env_remove("ROS_LOCALHOST_ONLY")
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .stdin(Stdio::null())
        .output()
        .unwrap_or_else(|error| panic!("cannot start `unshare` of util-linux: {error}"));
    let told = format!(
        "{}{}",
        String::from_utf8_lossy(&run.stdout),
        String::from_utf8_lossy(&run.stderr)
    );
    assert!(
        run.status.success(),
        "{told}\nif tshark may not capture, {ADVICE}"
    );
    assert!(told.contains("COMPLETE"), "{told}");

    let fields = [
        "-Y",
        "rtps",
        "-T",
        "fields",
        "-e",
        "rtps.guidPrefix.src",
        "-e",
        "rtps.sm.id",
    ];
    let packets = dissected(&capture.0, &fields);
    assert!(packets.len() > 5_000, "only {} packets", packets.len());
    let mut senders = BTreeSet::new();
    let mut kinds = BTreeSet::new();
    for packet in &packets {
        let (sender, submessages) = packet.split_once('\t').unwrap();
        senders.insert(sender);
        kinds.extend(submessages.split(','));
    }
    // Seventeen modules, the target publisher, the verifier, and the sender of the malformed packet.
    assert_eq!(senders.len(), 20, "{senders:?}");
    for kind in ["0x06", "0x07", "0x09", "0x15"] {
        assert!(
            kinds.contains(kind),
            "no ACKNACK, HEARTBEAT, INFO_TS or DATA: {kinds:?}"
        );
    }
    // What the dissector warns of counts as well; 6291456 is its level for warnings.
    let filter = "_ws.malformed || _ws.expert.severity >= 6291456";
    let malformed = dissected(
        &capture.0,
        &["-Y", filter, "-T", "fields", "-e", "rtps.guidPrefix.src"],
    );
    let on_purpose: String = b"malformed!!!"
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    assert_eq!(
        malformed,
        [on_purpose],
        "only the packet that is malformed on purpose"
    );
}
