//! `formation check` as a user meets it: bad input gets one line that names the place, and exit status 2.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// A valid scenario, of which each case below spoils one place.
const VALID: &str = "\
name: small
target:
  spots:
    - {id: 1, x: 0.0, y: 0.0}
    - {id: 2, x: 1.0, y: 0.0}
    - {id: 3, x: 2.0, y: 0.0}
    - {id: 4, x: 3.0, y: 0.0}
  edges: [[1, 2], [2, 3], [3, 4]]
configurations:
  - id: 1
    leader: 2
    modules:
      - {id: 1, x: 0.0, y: 5.0}
      - {id: 2, x: 1.0, y: 5.0}
    edges: [[1, 2]]
singletons:
  - {id: 3, x: 5.0, y: 5.0}
  - {id: 4, x: 7.0, y: 5.0}
planner:
  weights: {loc: 1.0, dock: 0.1, undock: 0.05}
";

pub fn formation(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

pub fn check(path: &Path) -> (Option<i32>, String, String) {
    let output = formation(&["check", path.to_str().unwrap()]);
    (
        output.status.code(),
        String::from_utf8(output.stdout).unwrap(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

#[test]
fn a_byte_order_mark_at_the_start_of_a_file_is_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("marked.yaml");
    fs::write(&path, format!("\u{feff}{VALID}")).unwrap();
    let (status, stdout, stderr) = check(&path);
    assert_eq!((status, stderr.as_str()), (Some(0), ""));
    assert!(stdout.contains("small; 4 modules"), "{stdout}");
}

#[test]
fn output_that_nothing_reads_ends_the_program_quietly_with_a_failure() {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(["generate", "--modules", "4", "--spots", "4", "--seed", "1"])
        .stdout(writer)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "");
}

/// Checks that the file is refused with status 2 and exactly one line, and returns what follows the file's name.
fn refusal(path: &Path) -> String {
    let (status, stdout, stderr) = check(path);
    assert_eq!(status, Some(2), "{stderr}");
    assert_eq!(stdout, "");
    assert_eq!(stderr.matches('\n').count(), 1, "{stderr}");
    stderr
        .strip_prefix(&format!("error: {}: ", path.display()))
        .unwrap_or_else(|| panic!("the error does not name the file: {stderr}"))
        .trim_end()
        .to_owned()
}

/// The same of a file with this text.
pub fn refusal_of(directory: &Path, text: &str) -> String {
    let path = directory.join("scenario.yaml");
    fs::write(&path, text).unwrap();
    refusal(&path)
}

#[test]
fn bad_scenarios_are_refused_in_one_line_that_names_the_place() {
    let directory = tempfile::tempdir().unwrap();
    let cases = [
        // Unknown keys, at every level.
        (
            "name: small",
            "nmae: small",
            "line 1 column 1: unknown field `nmae`, expected one of `name`,",
        ),
        (
            "  edges: [[1, 2], [2, 3], [3, 4]]",
            "  edgse: []",
            "line 8 column 3: target: unknown field `edgse`",
        ),
        (
            "{id: 3, x: 2.0, y: 0.0}",
            "{id: 3, x: 2.0, y: 0.0, z: 1.0}",
            "line 6 column 31: target.spots[2]: unknown field `z`",
        ),
        (
            "    leader: 2",
            "    chief: 2",
            "line 11 column 5: configurations[0]: unknown field `chief`",
        ),
        (
            "undock: 0.05",
            "redock: 0.05",
            "line 20 column 34: planner.weights: unknown field `redock`",
        ),
        // The target.
        (
            "{id: 4, x: 3.0, y: 0.0}",
            "{id: 2, x: 3.0, y: 0.0}",
            "target.spots[3].id: spot 2 is used twice",
        ),
        (
            "[3, 4]]",
            "[3, 9]]",
            "target.edges[2]: spot 9 is not in the target",
        ),
        (
            "[3, 4]]",
            "[4, 4]]",
            "target.edges[2]: joins spot 4 to itself",
        ),
        (
            "[3, 4]]",
            "[2, 1], [3, 4]]",
            "target.edges[2]: spot 1 and spot 2 are joined twice",
        ),
        (
            "[2, 3], [3, 4]]",
            "[3, 4]]",
            "target.edges: the target is disconnected; spot 3 cannot be reached from spot 1",
        ),
        (
            "x: 3.0, y: 0.0",
            "x: .nan, y: 0.0",
            "target.spots[3].x: must be a finite number, got NaN (spot 4)",
        ),
        (
            "x: 3.0, y: 0.0",
            "x: 3.0, y: -.inf",
            "target.spots[3].y: must be a finite number, got -inf (spot 4)",
        ),
        (
            "x: 3.0, y: 0.0",
            "x: 3.0e7, y: 0.0",
            "target.spots[3].x: must lie within +-1000000, got 30000000 (spot 4)",
        ),
        // The modules.
        (
            "x: 7.0, y: 5.0",
            "x: 7.0, y: 5.0, theta: .inf",
            "singletons[1].theta: must be a finite number, got inf (module 4)",
        ),
        (
            "x: 7.0, y: 5.0",
            "x: 7.0, y: 5.0, theta: 90",
            "singletons[1].theta: 90 is beyond a full turn of 2π; headings are in radians (module 4)",
        ),
        (
            "x: 3.0, y: 0.0",
            "x: 3.0, y: 0.0, theta: -6.3",
            "target.spots[3].theta: -6.3 is beyond a full turn of 2π; headings are in radians (spot 4)",
        ),
        // Sizes.
        (
            "name: small",
            "module_size: 0",
            "module_size: must lie between 0.001 m and 1000 m, got 0",
        ),
        (
            "name: small",
            "body_width: 1.5",
            "body_width: must lie between 0.1 units and 1, the pitch of the lattice, got 1.5",
        ),
        // Obstacles and walls.
        (
            "name: small",
            "obstacles: [{x: 2.0, y: 0.4, width: 0.2, height: 0.2}]",
            "obstacles[0]: spot 3 lies on it",
        ),
        (
            "name: small",
            "arena: {x: 3.5, y: 2.5, width: 8, height: 6}\nobstacles: [{x: 3.5, y: 2.5, width: 8, height: 2}]",
            "no module would move: no way leads to the target from modules 1-4",
        ),
        (
            "x: 1.0, y: 5.0",
            "x: .NaN, y: 5.0",
            "configurations[0].modules[1].x: must be a finite number, got NaN (module 2)",
        ),
        (
            "{id: 4, x: 7.0",
            "{id: 3, x: 7.0",
            "singletons[1].id: module 3 is used twice",
        ),
        (
            "{id: 4, x: 7.0",
            "{id: 2, x: 7.0",
            "singletons[1].id: module 2 is used twice: in configuration 1 and in singletons",
        ),
        (
            "singletons:",
            "  - {id: 2, modules: [{id: 2, x: 8.0, y: 8.0}]}\nsingletons:",
            "configurations[1].modules[0].id: module 2 is used twice: in configuration 1 and in configuration 2",
        ),
        (
            "singletons:",
            "  - {id: 1, modules: [{id: 9, x: 8.0, y: 8.0}]}\nsingletons:",
            "configurations[1].id: configuration 1 is used twice",
        ),
        (
            "singletons:",
            "  - {id: 2, modules: []}\nsingletons:",
            "configurations[1].modules: configuration 2 has no modules",
        ),
        (
            "    leader: 2",
            "    leader: 3",
            "configurations[0].leader: module 3 is not in configuration 1",
        ),
        (
            "    edges: [[1, 2]]",
            "    edges: []",
            "configurations[0].edges: configuration 1 is disconnected; module 2 cannot be reached from module 1",
        ),
        (
            "    edges: [[1, 2]]",
            "    edges: [[1, 2], [2, 2]]",
            "configurations[0].edges[1]: joins module 2 to itself",
        ),
        (
            "    edges: [[1, 2]]",
            "    edges: [[1, 2], [2, 3]]",
            "configurations[0].edges[1]: module 3 is not in configuration 1",
        ),
        (
            "{id: 4, x: 7.0",
            "{id: 4294967295, x: 7.0",
            "singletons[1].id: 4294967295 is reserved",
        ),
        // The planner.
        (
            "loc: 1.0, dock: 0.1",
            "loc: 0.1, dock: 1.0",
            "line 20 column 3: planner: weights: must satisfy loc > dock > undock >= 0",
        ),
        (
            "undock: 0.05",
            "undock: -0.05",
            "line 20 column 3: planner: weights: must satisfy loc > dock > undock >= 0",
        ),
        (
            "undock: 0.05",
            "undock: .nan",
            "line 20 column 3: planner: weights: undock must be a finite number, got NaN",
        ),
        (
            "planner:",
            "planner:\n  policy: magic",
            "line 20 column 11: planner.policy: unknown variant `magic`",
        ),
        // Wrong types.
        (
            "name: small",
            "name: [small]",
            "line 1 column 7: name: must be text, got a list",
        ),
        (
            "{id: 4, x: 3.0",
            "{id: four, x: 3.0",
            "line 7 column 12: target.spots[3].id: must be a whole number from 0 to 4294967295, got the text \"four\"",
        ),
        (
            "{id: 4, x: 3.0",
            "{id: -4, x: 3.0",
            "line 7 column 12: target.spots[3].id: must be a whole number from 0 to 4294967295, got -4",
        ),
        (
            "[3, 4]]",
            "[3]]",
            "line 8 column 27: target.edges[2]: must be a list of 2 values, got 1",
        ),
        // The same key twice would silently lose the first.
        (
            "singletons:",
            "name: other\nsingletons:",
            "line 1 column 1: duplicate field `name`",
        ),
        // No YAML.
        (
            "edges: [[1, 2]]",
            "edges: [[1, 2]",
            "line 16 column 1: did not find expected",
        ),
        (
            "target:",
            "\ttarget:",
            "line 2 column 1: a tab stands where only spaces may",
        ),
    ];
    let mut wrong = Vec::new();
    for (place, spoiled, expected) in cases {
        assert_eq!(VALID.matches(place).count(), 1, "{place} is not one place");
        let message = refusal_of(directory.path(), &VALID.replace(place, spoiled));
        if !message.starts_with(expected) {
            wrong.push(format!(
                "{spoiled:?} should give\n  {expected}\nbut gave\n  {message}"
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn whole_files_that_are_no_scenario_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let two_documents = format!("{VALID}---\n{VALID}");
    // A star of 65 arms.
    let nodes = |kind: &str| {
        let nodes: Vec<String> = (0..=65)
            .map(|id| format!("{{id: {id}, x: {id}, y: 0}}"))
            .collect();
        let edges: Vec<String> = (1..=65).map(|id| format!("[0, {id}]")).collect();
        format!(
            "{kind}: [{}], edges: [{}]",
            nodes.join(", "),
            edges.join(", ")
        )
    };
    let crowded_spot = format!("target: {{{}}}", nodes("spots"));
    let crowded_module = format!(
        "target: {{spots: [{{id: 1, x: 0, y: 0}}]}}\nconfigurations: [{{id: 1, {}}}]",
        nodes("modules")
    );
    for (text, expected) in [
        ("", "line 1 column 1: missing field `target`"),
        (
            "just some prose",
            "line 1 column 1: must be a mapping of fields to values, got the text \"just some prose\"",
        ),
        (
            "target: {spots: []}",
            "target.spots: the target needs at least one spot",
        ),
        (
            "target: {spots: [{id: 1, x: 0, y: 0}]}",
            "modules: there is no module to plan for",
        ),
        (
            &crowded_spot,
            "target.edges: spot 0 has 65 neighbours; at most 64 are supported",
        ),
        (
            &crowded_module,
            "configurations[0].edges: module 0 has 65 neighbours; at most 64 are supported",
        ),
        ("singletons: []", "line 1 column 1: missing field `target`"),
        (
            &two_documents,
            "is no scenario: deserializing from YAML containing more than one document",
        ),
    ] {
        let message = refusal_of(directory.path(), text);
        assert!(
            message.starts_with(expected),
            "{text:?} should give\n  {expected}\nbut gave\n  {message}"
        );
    }
}

#[test]
fn hostile_yaml_is_refused_without_harm() {
    let directory = tempfile::tempdir().unwrap();
    let nested = format!("target: {}", "[".repeat(100_000));
    assert_eq!(
        refusal_of(directory.path(), &nested),
        "line 1 column 73: brackets are nested more than 64 deep"
    );
    let name = format!("name: {}", "a".repeat(300));
    assert_eq!(
        refusal_of(directory.path(), &VALID.replace("name: small", &name)),
        "name: is 300 bytes long; at most 255 are supported"
    );
    assert!(refusal_of(directory.path(), &"a".repeat(1_000_000)).len() < 1_000);
    let mut aliases = String::from("a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n");
    for level in 1..30 {
        let repeated = vec![format!("*a{}", level - 1); 10].join(", ");
        aliases.push_str(&format!("a{level}: &a{level} [{repeated}]\n"));
    }
    aliases.push_str("name: *a29\n");
    assert!(refusal_of(directory.path(), &aliases).contains("unknown field `a0`"));
}

#[test]
fn files_that_cannot_be_read_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    assert_eq!(
        refusal(&directory.path().join("missing.yaml")),
        "there is no such file"
    );
    assert_eq!(refusal(directory.path()), "is a directory, not a file");
    let binary = directory.path().join("binary.yaml");
    fs::write(&binary, b"name: \xff\xfe").unwrap();
    assert_eq!(refusal(&binary), "is no UTF-8 text (byte 7)");
    let large = directory.path().join("large.yaml");
    let comment = "#".repeat(16 * 1024 * 1024 + 1);
    fs::write(&large, comment).unwrap();
    assert_eq!(refusal(&large), "is larger than 16 MiB");
}

#[test]
fn a_valid_scenario_is_summed_up() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("small.yaml");
    fs::write(&path, VALID).unwrap();
    let summary = "small; 4 modules (1 configuration, 2 singletons); 4 spots (tree)";
    assert_eq!(
        check(&path),
        (
            Some(0),
            format!("{}: {summary}\n", path.display()),
            String::new()
        )
    );
}

#[test]
fn spots_on_which_bodies_overlap_are_refused_by_name() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("close.yaml");
    let place = "{id: 4, x: 3.0, y: 0.0}";
    assert_eq!(VALID.matches(place).count(), 1);
    fs::write(&path, VALID.replace(place, "{id: 4, x: 2.5, y: 0.0}")).unwrap();
    let (status, _, stderr) = check(&path);
    assert_eq!(status, Some(2), "{stderr}");
    let expected =
        "no module would move: target: spots 3 and 4: bodies overlap; move these spots apart";
    assert!(stderr.contains(expected), "{stderr}");
}

#[test]
fn what_looks_like_a_mistake_is_warned_about() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("odd.yaml");
    for (place, odd, expected, status) in [
        (
            "{id: 4, x: 3.0, y: 0.0}",
            "{id: 4, x: 1.0, y: 0.0}",
            "target.spots: spot 2 and spot 4 are at the same place",
            2,
        ),
        (
            "{id: 4, x: 3.0, y: 0.0}",
            "{id: 4, x: 2.95, y: 0.0}",
            "target.spots: spot 3 and spot 4 are only 0.95 units apart, and a module is 1 unit wide",
            0,
        ),
        (
            "{id: 4, x: 3.0, y: 0.0}",
            "{id: 4, x: 3.5, y: 0.0}",
            "target.edges: spot 3 and spot 4 are joined and 1.5 units apart, docked modules are 1 unit apart",
            0,
        ),
        (
            "{id: 1, x: 0.0, y: 5.0}",
            "{id: 1, x: -1.0, y: 5.0}",
            "configurations: module 1 and module 2 are joined and 2 units apart, docked modules are 1 unit apart",
            0,
        ),
        (
            "{id: 4, x: 7.0, y: 5.0}",
            "{id: 4, x: 5.0, y: 5.0}",
            "modules: module 3 and module 4 are at the same place",
            2,
        ),
        (
            "  - {id: 4, x: 7.0, y: 5.0}\n",
            "",
            "modules: fewer than spots; the target will be trimmed by 1 spot",
            0,
        ),
        (
            "singletons:",
            "singletons:\n  - {id: 5, x: 9.0, y: 9.0}",
            "modules: more than spots; 1 module will stay without a spot",
            0,
        ),
    ] {
        assert_eq!(VALID.matches(place).count(), 1, "{place} is not one place");
        fs::write(&path, VALID.replace(place, odd)).unwrap();
        let (shown, _, stderr) = check(&path);
        assert_eq!(shown, Some(status), "{stderr}");
        let expected = format!("warning: {}: {expected}\n", path.display());
        assert!(stderr.contains(&expected), "{odd:?} gave\n{stderr}");
    }
}

#[test]
fn the_scenarios_of_the_repository_are_valid() {
    let folder = formation_tests::root().join("launch_scripts/scenarios");
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            // The tests of the experiments check the case studies, those of `plan` the paper's counterexamples.
            continue;
        }
        let (status, _, stderr) = check(&path);
        assert_eq!(status, Some(0), "{stderr}");
        assert!(
            stderr.lines().all(|line| line.contains(" than spots; ")),
            "{stderr}"
        );
        names.push(path.file_stem().unwrap().to_str().unwrap().to_owned());
    }
    names.sort();
    assert_eq!(
        names,
        [
            "figure1_ladder17",
            "mcs_detach",
            "oversupply",
            "quadruped_8cm",
            "singletons_10",
            "two_rooms",
            "undersupply"
        ]
    );
}

#[test]
fn wrong_usage_is_refused_with_status_2() {
    for arguments in [
        &[][..],
        &["check"],
        &["check", "a.yaml", "b.yaml"],
        &["frobnicate"],
        &["check", "--no-such-option", "a.yaml"],
    ] {
        let output = formation(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(!output.stderr.is_empty(), "{arguments:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
}

#[test]
fn modules_whose_starts_leave_no_paths_are_named_and_do_not_start() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("close.yaml");
    let close = VALID.replace(
        "{id: 4, x: 7.0, y: 5.0}",
        "{id: 4, x: 5.8, y: 5.0, theta: 0.5}",
    );
    fs::write(&path, &close).unwrap();
    let reason =
        "no module would move: starts: module 3 and module 4 are too close; place these modules";
    let (status, _, stderr) = check(&path);
    assert_eq!(status, Some(2), "{stderr}");
    assert!(stderr.contains(reason), "{stderr}");
    let path_text = path.to_str().unwrap();
    let refused = formation(&["run", path_text]);
    assert_eq!(refused.status.code(), Some(2));
    let stderr = String::from_utf8(refused.stderr).unwrap();
    assert!(stderr.contains(reason), "{stderr}");
    fs::write(&path, format!("{close}  motion: straight\n")).unwrap();
    let stderr = check(&path).2;
    assert!(
        stderr.contains("planner.motion: modules move along paths only: leave this key out"),
        "{stderr}"
    );
}
