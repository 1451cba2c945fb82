//! `formation generate` as a user meets it.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn generate(arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_formation"))
        .arg("generate")
        .args(arguments.split_whitespace())
        .output()
        .unwrap()
}

fn check(path: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_formation"))
        .arg("check")
        .arg(path)
        .output()
        .unwrap()
}

#[test]
fn what_is_generated_passes_the_check() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("generated.yaml");
    for (arguments, expected) in [
        (
            "--modules 20 --spots 20 --seed 1",
            "20 modules (0 configurations, 20 singletons); 20 spots (tree)",
        ),
        (
            "--modules 23 --spots 30 --configuration-size 5 --seed 2 --degree 4",
            "23 modules (4 configurations, 3 singletons); 30 spots (tree)",
        ),
        (
            "--modules 1000 --spots 1000 --configuration-size 10 --seed 18446744073709551615",
            "1000 spots (tree)",
        ),
    ] {
        let output = generate(arguments);
        assert!(output.status.success(), "{arguments}");
        assert_eq!(
            output.stdout,
            generate(arguments).stdout,
            "{arguments} gives two scenarios"
        );
        fs::write(&path, &output.stdout).unwrap();
        let check = check(&path);
        let summary = String::from_utf8(check.stdout).unwrap();
        assert!(check.status.success(), "{arguments}");
        assert!(summary.trim_end().ends_with(expected), "{summary}");
    }
    // The largest is valid as well, but where starts may touch there are no paths.
    let seed = u64::MAX;
    let largest = generate(&format!(
        "--modules 10000 --spots 10000 --configuration-size 10 --touching --seed {seed}"
    ));
    fs::write(&path, &largest.stdout).unwrap();
    let check = check(&path);
    let stderr = String::from_utf8(check.stderr).unwrap();
    let reason = format!("error: {}: no module would move: starts: ", path.display());
    assert!(stderr.contains(&reason), "{stderr}");
    assert_ne!(
        generate("--modules 9 --spots 9 --seed 1").stdout,
        generate("--modules 9 --spots 9 --seed 2").stdout
    );
}

#[test]
fn modules_start_apart_and_move_along_paths_unless_they_may_touch() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("generated.yaml");
    let mode_of = |arguments: &str| {
        let output = generate(arguments);
        assert!(output.status.success(), "{arguments}");
        fs::write(&path, &output.stdout).unwrap();
        let plan = Command::new(env!("CARGO_BIN_EXE_formation"))
            .args(["plan", "--json"])
            .arg(&path)
            .output()
            .unwrap();
        let report: serde_json::Value = serde_json::from_slice(&plan.stdout).unwrap();
        report["motion"]["mode"].as_str().unwrap().to_owned()
    };
    for grouping in ["", "--mixed", "--configuration-size 4"] {
        let arguments = format!("--modules 20 --spots 20 {grouping} --seed 1");
        assert_eq!(mode_of(&arguments), "paths", "{arguments}");
        assert_eq!(mode_of(&format!("{arguments} --touching")), "none");
    }
    let arguments = "--modules 20 --spots 20 --seed 1";
    for apart in ["--apart", "--apart 3"] {
        assert_eq!(
            generate(&format!("{arguments} {apart}")).stdout,
            generate(arguments).stdout
        );
    }
}

#[test]
fn what_would_be_planned_for_minutes_is_refused_by_name() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("generated.yaml");
    let output = generate("--modules 10000 --spots 10000 --touching --seed 1");
    fs::write(&path, &output.stdout).unwrap();
    let check = check(&path);
    assert_eq!(check.status.code(), Some(2));
    let stderr = String::from_utf8(check.stderr).unwrap();
    let expected = "modules: a plan for 10000 modules and 10000 spots may take 750 s, and real processes are given at \
                    most 30 s: use fewer modules\n";
    assert!(stderr.ends_with(expected), "{stderr}");
}

#[test]
fn options_out_of_range_are_refused_by_name() {
    for (arguments, expected) in [
        (
            "--modules 0 --spots 5 --seed 1",
            "--modules must be 1 to 10000, got 0",
        ),
        (
            "--modules 5 --spots 10001 --seed 1",
            "--spots must be 1 to 10000, got 10001",
        ),
        (
            "--modules 5 --spots 5 --seed 1 --degree 5",
            "--degree must be 3 to 4, got 5",
        ),
        (
            "--modules 5 --spots 5 --seed 1 --configuration-size 6",
            "--configuration-size must be 1 to 5, got 6",
        ),
        ("--modules 5 --spots 5", "--seed <X>"),
        (
            "--modules 5 --spots 5 --seed 1 --mixed --configuration-size 2",
            "cannot be used with",
        ),
        ("--modules -5 --spots 5 --seed 1", "-5"),
        (
            "--modules 5 --spots 5 --seed 1 --touching --apart 2",
            "cannot be used with",
        ),
    ] {
        let output = generate(arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments}: {stderr}");
        assert!(stderr.contains(expected), "{arguments}: {stderr}");
        assert!(output.stdout.is_empty(), "{arguments}");
    }
}

#[test]
fn a_reader_that_leaves_is_no_panic() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_formation"))
        .args("generate --modules 5000 --spots 5000 --seed 1".split_whitespace())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stderr.is_empty());
}
