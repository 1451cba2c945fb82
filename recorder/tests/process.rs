//! What the process does with a file that it cannot write, when it is killed, when its DDS library no longer receives, and when it plays
//! a recording.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use formation_tests::{Domain, Finished, Running, Signal, scenario_path};
use recorder::read::read;
use recorder::replay::replay;

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

/// What a file has of each topic, by its name in this namespace.
fn counts(file: &Path, namespace: &str) -> BTreeMap<String, u64> {
    let samples = replay(file).unwrap().samples.into_iter();
    samples
        .filter_map(|(topic, count)| Some((topic.strip_prefix(namespace)?.to_owned(), count)))
        .collect()
}

/// The file is recorded once more from what is played, next to an idle module that would take a target.
#[test]
fn a_recording_is_played_below_another_name_and_no_module_hears_it() {
    let domain = &*Domain::for_processes(6);
    let folder = tempfile::tempdir().unwrap();
    let (out, again) = (
        folder.path().join("out.mcap"),
        folder.path().join("again.mcap"),
    );
    let scenario = scenario_path("mcs_detach");
    let form = ["run", scenario.to_str().unwrap(), "--json", "--record"];
    let form = [
        &form[..],
        &[out.to_str().unwrap(), "--modules-per-process", "4"],
    ]
    .concat();
    let finished = Running::start("formation", domain, &form).finish(PATIENCE);
    assert_eq!(finished.status, 0, "{}", finished.stderr);
    let session = format!("session:={}", finished.json()["session"]);
    let module = ["--module", "1", "--x", "0", "--y", "0"];
    let module = [&module[..], &["--ros-args", "-p", &session]].concat();
    let module = Running::start("module_agent", domain, &module);
    assert!(module.wait_for_log(0, "joined", PATIENCE).is_some());
    let below = [again.to_str().unwrap(), "--namespace", "/replay"];
    let recorder = Running::start("recorder", domain, &below);
    assert!(recorder.wait_for_log(0, "joined", PATIENCE).is_some());
    let again_below = ["replay", out.to_str().unwrap(), "--rate", "2"];
    let played = Running::start("formation", domain, &again_below).finish(PATIENCE);
    assert_eq!(played.status, 0, "{}", played.stderr);
    assert_eq!(recorder.stop().status, 0);

    let (mut first, mut second) = (counts(&out, "/formation/"), counts(&again, "/replay/"));
    // Best effort: one may be lost.
    assert!(second.remove("heartbeats").unwrap() > 0);
    first.remove("heartbeats");
    assert_eq!(second, first);
    let [first, second] = [&out, &again].map(|file| replay(file).unwrap());
    assert_eq!(second.session, first.session);
    let assigned = |verdict: Option<formation_msgs::Verdict>| verdict.unwrap().assignments;
    assert_eq!(assigned(second.verdict), assigned(first.verdict));
    let log = module.log_since(0);
    let is_heard = |text: &str| text.contains("epoch") || text.contains("ignores");
    assert!(!log.iter().any(|line| is_heard(&line.text)), "{log:#?}");
    assert_eq!(module.stop().status, 0);
}

#[test]
fn a_recording_is_not_played_where_modules_listen() {
    let finished = |program: &str, arguments: &[&str]| {
        Running::start(program, &Domain::alone(), arguments).finish(PATIENCE)
    };
    let refused = finished("recorder", &["out.mcap", "--replay"]);
    assert_eq!(refused.status, 2, "{}", refused.stderr);
    let says = |run: &Finished, text: &str| assert!(run.stderr.contains(text), "{}", run.stderr);
    says(&refused, "name another namespace");
    let missing = finished("formation", &["replay", "/nowhere/out.mcap"]);
    assert_eq!(missing.status, 2, "{}", missing.stderr);
    says(&missing, "/nowhere/out.mcap");
}
