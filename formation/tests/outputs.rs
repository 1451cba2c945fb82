//! What `formation` refuses before it starts anything: places that it could not write to, and drives that cannot turn.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// Two modules with one obvious plan, and bodies that can turn in their cells or not.
fn scenario(folder: &Path, body_width: &str) -> String {
    let path = folder.join("scenario.yaml");
    let text = format!(
        "body_width: {body_width}\ntarget: {{spots: [{{id: 1, x: 0, y: 0}}, {{id: 2, x: 1, y: 0}}], edges: [[1, 2]]}}\n\
         singletons: [{{id: 7, x: 0, y: 3}}, {{id: 8, x: 3, y: 3}}]\n"
    );
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

/// A launcher in a folder where every other program reports that it was started.
fn launcher(folder: &Path) -> String {
    let launcher = folder.join("formation");
    fs::hard_link(env!("CARGO_BIN_EXE_formation"), &launcher).unwrap();
    for program in [
        "module_agent",
        "leader_agent",
        "target_publisher",
        "verifier",
        "recorder",
        "world",
    ] {
        let path = folder.join(program);
        let script = format!("#!/bin/sh\ntouch '{}/started'\n", folder.display());
        fs::write(&path, script).unwrap();
        Command::new("chmod")
            .arg("755")
            .arg(&path)
            .status()
            .unwrap();
    }
    launcher.to_str().unwrap().to_owned()
}

/// The exit status, and the last line of what it says.
fn said(launcher: &str, arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(launcher)
        .args(arguments)
        .env_remove("ROS_DOMAIN_ID")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    let last = text.lines().last().unwrap_or_default().to_owned();
    (output.status.code(), last)
}

#[test]
fn places_that_cannot_be_written_are_refused_before_anything_starts() {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let folder = folder.path();
    let (launcher, scenario) = (launcher(folder), scenario(folder, "0.9"));
    let at = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let file = at("scenario.yaml");
    let (missing, within) = (at("none/out"), at("scenario.yaml/out"));
    let this = folder.to_str().unwrap();
    for (option, path, reason) in [
        ("--trace", this, "is a directory; name a file"),
        ("--record", this, "is a directory; name a file"),
        ("--trace", &missing, "its directory `"),
        ("--record", &missing, "none` does not exist"),
        ("--trace", &within, "cannot be written: Not a directory"),
        ("--record", "/proc/out", "/proc/out: "),
        ("--report", &file, "is a file; name a directory"),
        ("--state-dir", &file, "is a file; name a directory"),
        ("--report", &within, "scenario.yaml` is no directory"),
        ("--state-dir", &within, "scenario.yaml` is no directory"),
    ] {
        let (status, last) = said(&launcher, &["run", &scenario, option, path]);
        assert_eq!(status, Some(2), "{option} {path}: {last}");
        assert!(
            last.starts_with(&format!("error: {option} {path}: ")),
            "{last}"
        );
        assert!(last.contains(reason), "{last}");
    }
    let out = at("out");
    let both = ["run", &scenario, "--trace", &out, "--record", &out];
    let (status, last) = said(&launcher, &both);
    assert_eq!(status, Some(2), "{last}");
    assert!(last.ends_with("out: is the file of --trace too"), "{last}");
    for left in ["started", "out", "none"] {
        assert!(!folder.join(left).exists(), "{left}");
    }
}

#[test]
fn differential_drives_that_cannot_turn_in_their_cells_are_refused() {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let folder = folder.path();
    let launcher = launcher(folder);
    let wide = scenario(folder, "0.71");
    assert_eq!(said(&launcher, &["check", &wide]), (Some(0), String::new()));
    let options: [&[&str]; 3] = [
        &["check", &wide, "--drive", "differential"],
        &[
            "run",
            &wide,
            "--world",
            "--world-option=--drive=differential",
        ],
        &[
            "run",
            &wide,
            "--world",
            "--world-option=--drive",
            "--world-option=differential",
        ],
    ];
    for arguments in options {
        let (status, last) = said(&launcher, arguments);
        assert_eq!(status, Some(2), "{last}");
        assert!(last.contains("body_width: is 0.71 units"), "{last}");
    }
    let narrow = scenario(folder, "0.7");
    let narrow = ["check", &narrow, "--drive", "differential"];
    assert_eq!(said(&launcher, &narrow), (Some(0), String::new()));
    assert!(!folder.join("started").exists());
}
