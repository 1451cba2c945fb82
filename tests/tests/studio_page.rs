//! The page of `formation studio` in a headless Chromium, as a teacher, a watcher and an attacker use it.

use std::process::Stdio;

use formation_tests::{Domain, Python, Tool, on_path, program, scenario_path, tool_or_skip};
use serde_json::{Value, json};

/// Runs a part of `tests/python/studio.py`; `None`, after a line that says so, where there is no browser.
fn seen(part: &str) -> Option<Vec<Value>> {
    let browser = on_path(&["chromium", "chromium-browser", "google-chrome"])
        .and_then(|_| on_path(&["chromedriver"]));
    tool_or_skip(Tool::Browser, browser)?;
    let python = Python::find()?;
    let domain = Domain::for_processes(12);
    let folder = scenario_path("singletons_10");
    let (formation, folder) = (program("formation"), folder.parent().unwrap().to_owned());
    let arguments = [
        formation.to_str().unwrap(),
        &domain,
        folder.to_str().unwrap(),
        part,
    ];
    let child = python.start("tests/python/studio.py", &arguments, Stdio::piped());
    let output = child.wait_with_output().unwrap();
    let (said, errors) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert!(output.status.success(), "{part}: {said}\n{errors}");
    Some(
        said.lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect(),
    )
}

#[test]
fn a_lesson_is_drawn_planned_run_disturbed_and_goes_on_with_the_next_target() {
    let Some(seen) = seen("lesson") else {
        return;
    };
    let next = json!([[1, 6], [2, 6], [3, 4], [3, 5], [3, 6], [4, 6], [5, 6]]);
    let expected = [
        json!({ "formed": 8 }),
        json!({ "replanned": 7 }),
        json!({ "pushed": 7 }),
        json!({ "next": next }),
        json!({ "faults": [] }),
    ];
    assert_eq!(seen, expected);
}

#[test]
fn shipped_scenarios_are_shown_and_exported_and_errors_are_marked() {
    let Some(seen) = seen("drawn") else {
        return;
    };
    let (loaded, rest): (Vec<_>, Vec<_>) =
        seen.iter().partition(|line| line.get("loaded").is_some());
    assert!(loaded.len() >= 20, "{loaded:?}");
    assert!(
        loaded.iter().all(|line| line["equal"] == true),
        "{loaded:?}"
    );
    let wrong = "target.edges: the target is disconnected; spot 8 cannot be reached from spot 1";
    assert_eq!(rest[0], &json!({ "policy": true }));
    let ending = rest[1]["simulated"].as_str().unwrap();
    assert!(ending.ends_with("no promise broken"), "{ending}");
    assert_eq!(rest[1]["events"], true);
    let expected = [
        json!({ "wrong": wrong, "refused": wrong }),
        json!({ "by_keyboard": 2 }),
        json!({ "after_undo": 1, "faults": [] }),
    ];
    assert_eq!(rest[2..], expected.iter().collect::<Vec<_>>());
}

#[test]
fn hostile_scenarios_stay_text_and_start_nothing() {
    let Some(seen) = seen("pasted") else {
        return;
    };
    assert_eq!(seen[0], json!({ "broken": false, "name": true }));
    let refused = seen[1]["million"].as_str().unwrap();
    assert!(refused.contains("4 MiB"), "{refused}");
    assert_eq!(seen[1]["running"], false);
}

#[test]
fn strangers_are_refused() {
    let Some(seen) = seen("strangers") else {
        return;
    };
    let expected = json!({
        "host": 403, "origin": 403, "null": 403, "site": 403, "token": 404, "none": 404, "form": 415, "method": 405,
        "events": 403, "file": 404, "running": false,
    });
    assert_eq!(seen, [expected]);
}

#[test]
fn a_run_that_was_started_by_hand_is_watched_and_not_touched() {
    let Some(seen) = seen("attached") else {
        return;
    };
    assert_eq!(seen[0], json!({ "seen": 10, "hidden": true }));
    let order = seen[1]["order"].as_str().unwrap();
    assert!(order.contains("only watches"), "{order}");
    assert_eq!(seen[1]["faults"], json!([]));
}
