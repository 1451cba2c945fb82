//! What the process does with a file that it cannot write, when it is killed, and when its DDS library no longer receives.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use formation_tests::{Domain, Running, Signal, scenario_path};
use recorder::read::read;

const PATIENCE: Duration = Duration::from_secs(30);

#[test]
fn a_file_that_cannot_be_written_is_named() {
    let output = Command::new(env!("CARGO_BIN_EXE_recorder"))
        .arg("/nowhere/out.mcap")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.starts_with("error: /nowhere/out.mcap: "), "{said}");
}

#[test]
fn a_recorder_that_no_longer_receives_rejoins_and_records_each_sample_once() {
    let domain = Domain::for_processes(4);
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("out.mcap");
    let scenario = scenario_path("mcs_detach");
    let arguments = ["--scenario", scenario.to_str().unwrap()];
    let publisher = Running::start("target_publisher", &domain, &arguments);
    let recorder = Running::start("recorder", &domain, &[recording.to_str().unwrap()]);
    assert!(
        recorder
            .wait_for_log(0, "joined the ROS 2 graph", PATIENCE)
            .is_some()
    );
    await_target(&recording, &recorder);
    recorder.rejoin(PATIENCE);
    let finished = recorder.stop();
    assert_eq!(finished.status, 0, "{}", finished.stderr);
    let mut topics = Vec::new();
    let summary = read(&recording, |sample| topics.push(sample.topic.to_owned())).unwrap();
    assert_eq!((summary.damage, summary.lost), (None, Some(0)));
    assert_eq!(topics, ["/formation/target"]);
    assert_eq!(publisher.stop().status, 0);
}

/// Waits until a recording has the target.
fn await_target(recording: &Path, recorder: &Running) {
    // A chunk is written within a second.
    let deadline = Instant::now() + PATIENCE;
    let has_target = || {
        let mut count = 0;
        read(recording, |_| count += 1).is_ok_and(|_| count > 0)
    };
    while !has_target() {
        assert!(Instant::now() < deadline, "{:?}", recorder.log_since(0));
        thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn a_killed_recorder_leaves_a_readable_file_up_to_its_last_chunk() {
    let domain = Domain::for_processes(4);
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("out.mcap");
    let arguments = [recording.to_str().unwrap()];
    let recorder = Running::start("recorder", &domain, &arguments);
    let scenario = scenario_path("mcs_detach");
    let arguments = ["--scenario", scenario.to_str().unwrap()];
    let publisher = Running::start("target_publisher", &domain, &arguments);
    await_target(&recording, &recorder);
    recorder.signal(Signal::KILL);
    let mut topics = Vec::new();
    let summary = read(&recording, |sample| topics.push(sample.topic.to_owned()));
    assert!(summary.unwrap().damage.is_some());
    assert_eq!(topics, ["/formation/target"]);
    assert_eq!(publisher.stop().status, 0);
}
