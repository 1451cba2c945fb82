//! A recording of a real run: what it holds, by readers that we did not write, and the report that is made of it.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use formation_tests::{Domain, Finished, Peer, Python, Running, scenario_path};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(90);

fn run(domain: &str, recording: &Path) -> Finished {
    run_with(domain, recording, &[])
}

fn run_with(domain: &str, recording: &Path, more: &[&str]) -> Finished {
    let scenario = scenario_path("mcs_detach");
    let arguments = [
        "run",
        scenario.to_str().unwrap(),
        "--modules-per-process",
        "4",
        "--timeout",
        "60",
        "--json",
        "--record",
        recording.to_str().unwrap(),
    ];
    let arguments = [&arguments[..], more].concat();
    Running::start("formation", domain, &arguments).finish(PATIENCE)
}

fn report(recording: &Path, directory: &Path) -> Finished {
    let [recording, directory] = [recording, directory].map(|path| path.to_str().unwrap());
    let arguments = ["report", recording, "--report", directory];
    Running::start("formation", "0", &arguments).finish(PATIENCE)
}

/// CycloneDDS on all topics, and on those of this many modules, which later compares what it took with a recording.
fn other_subscriber(domain: &str, modules: u32) -> Option<Child> {
    let arguments = ["--domain", domain, "--modules", &modules.to_string()];
    let script = "tests/python/compare_recording.py";
    Some(Python::find()?.start(script, &arguments, Stdio::inherit()))
}

/// What the subscriber says of a recording, by topic: both readers find the same samples in the file, and CycloneDDS received
/// some of them.
fn compared(mut other: Child, recording: &Path) -> Value {
    writeln!(other.stdin.as_mut().unwrap(), "{}", recording.display()).unwrap();
    let topics = line_of(&mut other);
    assert!(other.wait().unwrap().success());
    for (topic, found) in topics.as_object().unwrap() {
        let count = |key: &str| found[key].as_u64().unwrap();
        let recorded = count("recorded");
        assert_eq!(count("by_rosbags"), recorded, "{topic} {found}");
        // CycloneDDS fills the end of a sample up.
        let is_of_driver = topic.ends_with("/pose") || topic.ends_with("/docking_result");
        assert!(
            is_of_driver || count("reencoded") == recorded,
            "{topic} {found}"
        );
        assert!(recorded > count("only_recorded"), "{topic} {found}");
    }
    topics
}

fn line_of(child: &mut Child) -> Value {
    let mut line = String::new();
    let output = child.stdout.as_mut().unwrap();
    BufReader::new(output).read_line(&mut line).unwrap();
    serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error} in {line:?}"))
}

#[test]
fn a_recording_holds_the_bytes_that_another_vendor_receives() {
    let domain = Domain::for_processes(5);
    let Some(mut other) = other_subscriber(&domain, 0) else {
        return;
    };
    assert_eq!(line_of(&mut other)["ready"], true);
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("out.mcap");
    let finished = run(&domain, &recording);
    assert_eq!(finished.status, 0, "{}", finished.stderr);

    let topics = compared(other, &recording);
    for (topic, found) in topics.as_object().unwrap() {
        assert_eq!(
            found["reliable"],
            topic != "/formation/heartbeats",
            "{topic}"
        );
    }
    // Of the other topics either side may lack a sample: a newer state replaces one that was not sent yet.
    for (topic, expected) in [
        ("target", 1),
        ("claims", 2),
        ("evictions", 0),
        ("verdict", 1),
    ] {
        let found = &topics[format!("/formation/{topic}")];
        if expected == 0 && found.is_null() {
            continue;
        }
        assert_eq!(found["only_recorded"], 0, "{topic} {found}");
        assert_eq!(found["only_received"], 0, "{topic} {found}");
        assert!(
            found["recorded"].as_u64().unwrap() >= expected,
            "{topic} {found}"
        );
    }
    for topic in ["module_states", "roster", "heartbeats"] {
        assert!(
            topics[format!("/formation/{topic}")].is_object(),
            "{topic} in {topics}"
        );
    }
}

#[test]
fn the_topics_of_each_driven_module_are_recorded() {
    let domain = Domain::for_processes(7);
    let Some(mut other) = other_subscriber(&domain, 7) else {
        return;
    };
    assert_eq!(line_of(&mut other)["ready"], true);
    let Some(python) = Python::find() else {
        return;
    };
    let scenario = scenario_path("mcs_detach");
    let driver = format!(
        "{} --scenario '{}' --speed 20",
        python.command("tests/python/drive_modules.py"),
        scenario.display()
    );
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("out.mcap");
    let finished = run_with(&domain, &recording, &["--driver", &driver]);
    assert_eq!(finished.status, 0, "{}", finished.stderr);
    let topics = compared(other, &recording);
    for module in 1..=7 {
        for topic in ["goal_pose", "path", "pose"] {
            let topic = format!("/formation/module_{module}/{topic}");
            assert!(topics[&topic].is_object(), "{topic} in {topics}");
        }
    }
    // Paths are latched; of the other topics, a newer sample replaces one that was not taken yet.
    for (topic, found) in topics.as_object().unwrap() {
        if topic.ends_with("/path") {
            assert_eq!(found["only_received"], 0, "{topic} {found}");
        }
    }
    let docked = |topic: &&String| topic.contains("/module_") && topic.ends_with("/docking");
    let topics = topics.as_object().unwrap();
    assert!(
        topics.keys().filter(docked).count() > 0,
        "one module undocks"
    );
}

#[test]
fn the_report_of_a_recording_shows_the_run_and_what_is_damaged() {
    let domain = Domain::for_processes(4);
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("out.mcap");
    let finished = run(&domain, &recording);
    assert_eq!(finished.status, 0, "{}", finished.stderr);

    let directory = folder.path().join("whole");
    let reported = report(&recording, &directory);
    assert_eq!(reported.status, 0, "{}", reported.stderr);
    let verdict = "COMPLETE: all 7 spots are filled, hole-free";
    assert!(reported.stdout.contains(verdict), "{}", reported.stdout);
    let page = std::fs::read_to_string(directory.join("report.html")).unwrap();
    assert!(page.contains(verdict));
    for picture in ["before.svg", "after.svg"] {
        assert!(directory.join(picture).is_file(), "{picture}");
    }

    // As the writer of the MCAP project compresses them, in a file and in a bag of two files.
    if let Some(python) = Python::find() {
        for kind in ["zstd", "lz4", "bag"] {
            let to = folder.path().join(format!("as_{kind}"));
            let paths = [&recording, &to].map(|path| path.to_str().unwrap());
            let arguments = [paths[0], paths[1], kind];
            let script = "tests/python/compress_recording.py";
            let child = python.start(script, &arguments, Stdio::inherit());
            let output = child.wait_with_output().unwrap();
            assert!(output.status.success(), "{}", python.advice());
            let directory = folder.path().join(format!("of_{kind}"));
            let again = report(&to, &directory);
            assert_eq!(again.status, 0, "{kind}: {}", again.stderr);
            let counts = |text: &str| text.split_once("report: ").unwrap().0.to_owned();
            assert_eq!(counts(&again.stdout), counts(&reported.stdout), "{kind}");
        }
    }

    let whole = std::fs::read(&recording).unwrap();
    let cut = folder.path().join("cut.mcap");
    std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let directory = folder.path().join("cut");
    let reported = report(&cut, &directory);
    assert_eq!(reported.status, 1, "{}", reported.stdout);
    assert!(
        reported.stderr.contains("cut.mcap: is damaged after"),
        "{}",
        reported.stderr
    );
    assert!(directory.join("report.html").is_file());

    let text = folder.path().join("text.mcap");
    std::fs::write(&text, "no recording, but some text").unwrap();
    let refused = report(&text, &folder.path().join("text"));
    assert_eq!(refused.status, 2, "{}", refused.stdout);
    assert!(
        refused.stderr.contains("is no MCAP file"),
        "{}",
        refused.stderr
    );
}

/// A target of one spot as it was announced some time ago, or is now.
fn announced(revision: u64, spot: u32, age: Duration) -> Value {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap() - age;
    let planner = json!({
        "policy": "exact", "order": 0, "d_max": -1, "exact_finish": false, "weight_loc": 1.0,
        "weight_dock": 0.1, "weight_undock": 0.05, "cut_price": 1.0, "spread": 0.001, "keep_all_spots": false,
    });
    json!({
        "header": {"stamp": {"sec": since_1970.as_secs(), "nanosec": since_1970.subsec_nanos()}},
        "revision": revision, "expected_modules": 1,
        "spots": [{"id": spot, "x": 2.0, "y": 0.0}], "planner": planner,
    })
}

/// Shows C7.
#[test]
fn a_module_ignores_who_plays_a_recording_and_says_so() {
    let domain = &*Domain::for_processes(6);
    let (Some(mut player), Some(claims)) = (
        Peer::start("put", "target", domain),
        Peer::start("take", "claims", domain),
    ) else {
        return;
    };
    player.await_ready();
    let module = Running::start(
        "module_agent",
        domain,
        &["--module", "1", "--x", "0", "--y", "0"],
    );
    player.put(&announced(3, 8, Duration::from_secs(4)));
    let warning = "ignores a participant that plays a recording";
    assert!(module.wait_for_log(0, warning, PATIENCE).is_some());
    // It sends anew what its recording holds, by now as fresh as can be.
    player.put(&announced(4, 8, Duration::ZERO));
    let mut announcer = Peer::start("put", "target", domain).unwrap();
    announcer.await_ready();
    announcer.put(&announced(2, 9, Duration::ZERO));
    let claim = claims.taken();
    assert_eq!(claim["selections"][0]["spot_id"], 9, "{claim}");
    assert_eq!(module.stop().status, 0);
}
