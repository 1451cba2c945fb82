//! `formation compare` and policies that are programs, as a user meets them.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use formation_tests::scenario_path;

fn formation(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(arguments)
        .output()
        .unwrap()
}

fn error_of(arguments: &[&str]) -> (Option<i32>, String) {
    let output = formation(arguments);
    let text = String::from_utf8_lossy(&output.stderr)
        .trim_end()
        .to_owned();
    (output.status.code(), text)
}

fn compare(out: &Path, more: &[&str]) {
    let out = out.to_str().unwrap();
    let output = formation(&[&["compare", out], more].concat());
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
}

const FOUR: [&str; 8] = [
    "--policy=exact",
    "--policy=paper",
    "--policy=hungarian",
    "--policy=nearest",
    "--kinds=mixed,2x3,singletons",
    "--sizes=8,12",
    "--seeds=1-4",
    "--motion",
];

/// An interruption at any byte of the files leaves what a later run continues to the same rows.
#[test]
fn an_interrupted_comparison_ends_with_the_same_rows() {
    let directory = tempfile::tempdir().unwrap();
    let (whole, cut) = (directory.path().join("whole"), directory.path().join("cut"));
    compare(&whole, &FOUR);
    let read = |name: &str| fs::read(whole.join(name)).unwrap();
    let rows = read("rows.jsonl");
    assert_eq!(rows.iter().filter(|&&byte| byte == b'\n').count(), 4 * 24);
    let times = read("times.jsonl");
    fs::create_dir(&cut).unwrap();
    for (rows_kept, times_kept) in [(0, 0), (rows.len() / 3, times.len() / 2), (rows.len(), 10)] {
        fs::write(cut.join("settings.json"), read("settings.json")).unwrap();
        fs::write(cut.join("rows.jsonl"), &rows[..rows_kept]).unwrap();
        fs::write(cut.join("times.jsonl"), &times[..times_kept]).unwrap();
        compare(&cut, &FOUR);
        for name in ["rows.jsonl", "rows.csv", "summary.md"] {
            assert!(fs::read(cut.join(name)).unwrap() == read(name), "{name}");
        }
    }
    let summary = String::from_utf8(read("summary.md")).unwrap();
    assert!(summary.contains("| `nearest` | 24 |"), "{summary}");
    let (status, error) = error_of(&[
        "compare",
        cut.to_str().unwrap(),
        "--policy=exact",
        "--sizes=8",
    ]);
    assert_eq!(status, Some(2));
    assert!(
        error.contains("the results there are of another comparison"),
        "{error}"
    );
}

/// What gives no plan is a row with its reason.
#[test]
fn failures_are_rows() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out");
    let scenario = scenario_path("oversupply");
    let (scenario, missing) = (scenario.to_str().unwrap(), "no_such_file.yaml");
    compare(
        &out,
        &[
            scenario,
            missing,
            "--policy=exact",
            "--policy=given",
            "--policy-program=broken=exit 4",
            "--policy-program=slow=sleep 1000",
            "--program-timeout=0.2",
        ],
    );
    let csv = fs::read_to_string(out.join("rows.csv")).unwrap();
    let ends: Vec<Vec<&str>> = csv
        .lines()
        .skip(1)
        .map(|line| line.split(',').skip(5).take(3).collect())
        .collect();
    let of = |row: usize| ends[row].join(",");
    assert_eq!(of(0), "exact,complete,");
    assert!(csv.contains(
        "given,refused,\"target.allocation: is missing, and the policy `given` needs it\""
    ));
    assert_eq!(of(2), "broken,failed,ended with exit status: 4");
    assert!(csv.contains("slow,failed,\"has not ended within 0.2 s, and was stopped; --program-timeout gives it longer\""));
    assert_eq!(ends.len(), 8);
    assert!(ends[4..].iter().all(|row| row[1] == "no_instance"), "{csv}");
}

/// A program in another language, which gives modules and spots to each other in their order.
#[test]
fn a_program_decides() {
    let program = "python3 -c 'import json, sys; i = json.load(sys.stdin); \
                   print(json.dumps({\"allocation\": [{\"module\": m[\"id\"], \"spot\": s[\"id\"]} \
                   for m, s in zip(i[\"modules\"], i[\"spots\"])]}))'";
    let scenario = scenario_path("figure1_ladder17");
    let scenario = scenario.to_str().unwrap();
    let output = formation(&["plan", scenario, "--json", "--policy-program", program]);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    let plan: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let assignments = plan["assignments"].as_array().unwrap();
    let spots = assignments
        .iter()
        .map(|entry| entry["spot"].as_u64().unwrap());
    assert!(spots.eq(1..=17));
    let refused = error_of(&[
        "plan",
        scenario,
        "--policy-program",
        "echo '{\"allocation\": []}'",
    ]);
    assert_eq!(refused.0, Some(1));
    let expected = "answered what cannot be carried out: allocation: module 1 is missing, although there are spots for all modules";
    assert!(refused.1.ends_with(expected), "{}", refused.1);
}

#[test]
fn every_policy_is_listed_with_its_source() {
    let listed = String::from_utf8(formation(&["policies"]).stdout).unwrap();
    for name in ["exact", "paper", "auction", "hungarian", "given", "nearest"] {
        let mut lines = listed.lines();
        let line = lines
            .find(|line| line.starts_with(&format!("{name}: ")))
            .unwrap();
        assert!(line.ends_with(')'), "{line}");
    }
    let (status, error) = error_of(&["plan", "-", "--policy", "magic"]);
    assert_eq!(status, Some(2));
    assert!(
        error.contains("there is no such policy; there are exact, paper"),
        "{error}"
    );
}
