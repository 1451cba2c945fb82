//! Reports as people look at them: in a browser, with the mouse, by keyboard and on a phone.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use formation_tests::{Domain, Python, Running, Tool, on_path, scenario_path, tool_or_skip};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(120);

/// A page of 100 modules is no larger than this.
const PAGE_BYTES_MAX: u64 = 2_000_000;

/// A name that would break out of every place into which it is written.
const HOSTILE_NAME: &str = "</script><script>window.hostile=1</script><img src=x onerror='window.hostile=2'> {{film}} & \"q\" ]]>";

fn launch(domain: &str, arguments: &[&str]) -> formation_tests::Finished {
    let finished = Running::start("formation", domain, arguments).finish(PATIENCE);
    assert_eq!(finished.status, 0, "{arguments:?}: {}", finished.stderr);
    finished
}

/// Where the run whose report is in this directory is recorded.
fn recording_of(directory: &Path) -> PathBuf {
    directory.with_file_name("recorded.mcap")
}

/// Has a report written and says what the browser is to find in it.
fn case(command: &str, scenario: &Path, directory: &Path, title: &str, played: bool) -> Value {
    let domain = &*Domain::for_processes(4);
    let mut arguments = vec![
        command,
        scenario.to_str().unwrap(),
        "--json",
        "--report",
        directory.to_str().unwrap(),
    ];
    let recording = recording_of(directory);
    if command == "run" {
        let recording = recording.to_str().unwrap();
        arguments.extend(["--modules-per-process", "2", "--record", recording]);
    }
    let json = launch(domain, &arguments).json();
    let written = fs::read_to_string(directory.join("report.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&written).unwrap(), json);
    let count = |key: &str| json[key].as_array().unwrap().len();
    let filled = count("assignments");
    json!({
        "directory": directory,
        "title": title,
        "modules": filled + count("unassigned"),
        "spots": filled + count("open_spots"),
        "filled": filled,
        "played": played,
    })
}

/// Has a scenario of 500 modules planned, of whose page only the first screen is looked at.
fn five_hundred(directory: &Path) -> Value {
    let arguments = "generate --modules 500 --spots 500 --seed 1";
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    let generated = launch(&Domain::for_processes(4), &arguments);
    let scenario = directory.with_extension("yaml");
    fs::write(&scenario, generated.stdout).unwrap();
    let title = "500-modules-500-spots-singletons-seed-1";
    let mut case = case("plan", &scenario, directory, title, false);
    case["first_screen_only"] = true.into();
    case
}

/// Has a report made of the recording of a run, whose case is given.
fn recorded(mut run: Value, recording: &Path, directory: &Path) -> Value {
    let arguments = [
        "report",
        recording.to_str().unwrap(),
        "--report",
        directory.to_str().unwrap(),
    ];
    launch(&Domain::for_processes(4), &arguments);
    run["directory"] = directory.to_str().unwrap().into();
    run["title"] = "recorded".into();
    run
}

/// Has the reports written at which the browser looks.
fn cases(directory: &Path) -> Vec<Value> {
    let place = |name: &str| directory.join(name);
    let hundred = place("hundred.yaml");
    let generated = launch(
        &Domain::for_processes(4),
        &[
            "generate",
            "--modules",
            "100",
            "--spots",
            "100",
            "--configuration-size",
            "4",
            "--seed",
            "7",
        ],
    );
    fs::write(&hundred, generated.stdout).unwrap();
    let hostile = place("hostile.yaml");
    let scenario = fs::read_to_string(scenario_path("undersupply")).unwrap();
    let name = serde_json::to_string(HOSTILE_NAME).unwrap();
    fs::write(
        &hostile,
        scenario.replace("name: undersupply", &format!("name: {name}")),
    )
    .unwrap();
    let run = case(
        "run",
        &scenario_path("mcs_detach"),
        &place("run"),
        "mcs-detach",
        true,
    );
    let mut rooms = case(
        "plan",
        &scenario_path("two_rooms"),
        &place("rooms"),
        "two-rooms",
        true,
    );
    rooms["walls"] = true.into();
    let recording = recording_of(&place("run"));
    vec![
        recorded(run.clone(), &recording, &place("recorded")),
        run,
        rooms,
        five_hundred(&place("five_hundred")),
        case(
            "plan",
            &scenario_path("figure1_ladder17"),
            &place("figure1"),
            "figure1-ladder17",
            true,
        ),
        case(
            "plan",
            &hundred,
            &place("hundred"),
            "100-modules-100-spots-configurations-of-4-seed-7",
            true,
        ),
        case("plan", &hostile, &place("hostile"), HOSTILE_NAME, false),
    ]
}

#[test]
fn reports_are_watched_in_a_browser() {
    let browser = on_path(&["chromium", "chromium-browser", "google-chrome"])
        .and_then(|_| on_path(&["chromedriver"]));
    if tool_or_skip(Tool::Browser, browser).is_none() {
        return;
    }
    let Some(python) = Python::find() else {
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let cases = cases(directory.path());
    let size = fs::metadata(directory.path().join("hundred/report.html"))
        .unwrap()
        .len();
    assert!(size < PAGE_BYTES_MAX, "the page has {size} bytes");
    let mut child = python.start("tests/python/report_page.py", &[], Stdio::piped());
    let mut input = child.stdin.take().unwrap();
    writeln!(input, "{}", json!(cases)).unwrap();
    drop(input);
    let output = child.wait_with_output().unwrap();
    assert!(
        output.status.success(),
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    print!("{}", String::from_utf8_lossy(&output.stdout));
}
