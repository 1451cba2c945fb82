//! Scenario files as people write them: merge keys, byte order marks, values of another kind, crowds and cycles.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::fs;

use crate::check::{check, formation, refusal_of};

/// Two spots in a row, and two modules.
const PAIR: &str = "\
name: pair
target:
  spots:
    - {id: 1, x: 0, y: 0}
    - {id: 2, x: 1, y: 0}
  edges: [[1, 2]]
singletons:
  - {id: 1, x: 0, y: 3}
  - {id: 2, x: 2, y: 3}
";

#[test]
fn merge_keys_take_in_the_fields_of_anchors() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("merged.yaml");
    let first = "- {id: 1, x: 0, y: 0}";
    let second = "- {id: 2, x: 1, y: 0}";
    for (anchored, merged) in [
        ("- &s {id: 1, x: 0, y: 0}", "- {<<: *s, id: 2, x: 1}"),
        (
            "- &s\n      id: 1\n      x: 0\n      y: 0",
            "- <<: *s\n      id: 2\n      x: 1",
        ),
        ("- &s {id: 1, x: 0, y: 0}", "- {id: 2, <<: [{x: 1}, *s]}"),
        // An anchor of what has a merge key itself.
        (
            "- &s {<<: {<<: {y: 0, x: 5}, x: 0}, id: 1}",
            "- {<<: *s, id: 2, x: 1}",
        ),
        (
            "- {id: 1, <<: &s {x: 0, y: 0}}",
            "- {<<: [{<<: {x: 1}}, {<<: *s}], id: 2}",
        ),
    ] {
        fs::write(&path, PAIR.replace(first, anchored).replace(second, merged)).unwrap();
        let (status, stdout, stderr) = check(&path);
        assert_eq!(
            (status, stderr.as_str()),
            (Some(0), ""),
            "{anchored}\n{merged}"
        );
        assert!(stdout.contains("pair; 2 modules"), "{stdout}");
    }
    for (spoiled, expected) in [
        // Twice the same identifier, as nothing overrides it.
        ("- *s", "target.spots[1].id: spot 1 is used twice"),
        (
            "- {<<: *s, id: two}",
            "line 5 column 20: target.spots[1].id: must be a whole number",
        ),
        (
            "- {<<: {x: far}, id: 2, y: 0}",
            "line 5 column 7: target.spots[1].x: must be a number, got the text",
        ),
        (
            "- {<<: *s, id: 2, z: 1}",
            "line 5 column 7: target.spots[1]: unknown field `z`",
        ),
        (
            "- {<<: 3, id: 2}",
            "line 5 column 7: target.spots[1]: `<<` takes a mapping of fields",
        ),
        ("- {<<: *t, id: 2}", "line 5 column 12: unknown anchor"),
    ] {
        let text = PAIR
            .replace(first, "- &s {id: 1, x: 0, y: 0}")
            .replace(second, spoiled);
        let message = refusal_of(directory.path(), &text);
        assert!(
            message.starts_with(expected),
            "{spoiled:?} gave\n  {message}"
        );
    }
}

#[test]
fn byte_order_marks_before_a_document_are_accepted_and_others_are_shown() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("marked.yaml");
    for text in [
        format!("---\n\u{feff}{PAIR}"),
        format!("\u{feff}---\n\u{feff}{PAIR}"),
        format!("# a comment\n\u{feff}---\n{PAIR}"),
        format!("%YAML 1.1\n---\n\n\u{feff}{PAIR}"),
    ] {
        fs::write(&path, &text).unwrap();
        let (status, _, stderr) = check(&path);
        assert_eq!((status, stderr.as_str()), (Some(0), ""), "{text:?}");
    }
    let inside = PAIR.replace("target:", "\u{feff}target:");
    let message = refusal_of(directory.path(), &inside);
    assert!(
        message.ends_with("; the line has a byte order mark (U+FEFF)"),
        "{message}"
    );
}

#[test]
fn values_of_another_kind_are_named_as_people_write_them() {
    let directory = tempfile::tempdir().unwrap();
    let x = "{id: 2, x: 2, y: 3}";
    let spoiled = |from: &str, to: &str| {
        assert_eq!(PAIR.matches(from).count(), 1, "{from} is not one place");
        refusal_of(directory.path(), &PAIR.replace(from, to))
    };
    let whole = "must be a whole number from 0 to 4294967295";
    for (from, to, expected) in [
        (x, "{id: 2, x: \"2\", y: 3}", "line 9 column 16: singletons[1].x: must be a number, got the text \"2\"; write 2 without quotes".to_owned()),
        (x, "{id: '2', x: 2, y: 3}", format!("line 9 column 10: singletons[1].id: {whole}, got the text \"2\"; write 2 without quotes")),
        (x, "{id: 2, x: [2], y: 3}", "line 9 column 16: singletons[1].x: must be a number, got a list".to_owned()),
        (x, "{id: 2, x: {a: 2}, y: 3}", "line 9 column 16: singletons[1].x: must be a number, got a mapping".to_owned()),
        (x, "{id: 2, x: true, y: 3}", "line 9 column 16: singletons[1].x: must be a number, got true".to_owned()),
        (x, "{id: 2, x: ~, y: 3}", "line 9 column 16: singletons[1].x: must be a number, got nothing".to_owned()),
        (x, "{id: 2.5, x: 2, y: 3}", format!("line 9 column 10: singletons[1].id: {whole}, got 2.5")),
        (x, "{id: 4294967296, x: 2, y: 3}", format!("line 9 column 10: singletons[1].id: {whole}, got 4294967296")),
        (x, "{id: 99999999999999999999999, x: 2, y: 3}", format!("line 9 column 10: singletons[1].id: {whole}, got 99999999999999999999999")),
        (x, "{id: 007, x: 2, y: 3}", format!("line 9 column 10: singletons[1].id: {whole}, got the text \"007\"")),
        ("singletons:", "planner: {policy: [exact]}\nsingletons:", "line 7 column 19: planner.policy: must be a name, got a list".to_owned()),
        (x, "{id: 2, x: 2}", "line 9 column 5: singletons[1]: missing field `y`".to_owned()),
        (x, "{id: 2, x: 2, y: 3, y: 4}", "line 9 column 5: singletons[1]: duplicate field `y`".to_owned()),
        (x, "{id: 2, x: 2, y: 3, teta: 4}", "line 9 column 25: singletons[1]: unknown field `teta`".to_owned()),
        (x, "2", "line 9 column 5: singletons[1]: must be an identifier with a position, got 2".to_owned()),
        (x, "[2, 2, 3, 0]", "line 9 column 5: singletons[1]: must be an identifier with a position, got a list".to_owned()),
        ("[[1, 2]]", "[[1, 2, 3]]", "line 6 column 11: target.edges[0]: must be a list of 2 values, got 3".to_owned()),
        ("[[1, 2]]", "[1, 2]", "line 6 column 11: target.edges[0]: must be a list of 2 values, got 1".to_owned()),
        ("[[1, 2]]", "[[1, \"2\"]]", format!("line 6 column 15: target.edges[0][1]: {whole}, got the text \"2\"; write 2 without quotes")),
        ("singletons:", "planner: {keep_all_spots: 'yes'}\nsingletons:", "line 7 column 27: planner.keep_all_spots: must be true or false, got the text \"yes\"".to_owned()),
        ("singletons:", "planner: {keep_all_spots: \"true\"}\nsingletons:", "line 7 column 27: planner.keep_all_spots: must be true or false, got the text \"true\"; write true without quotes".to_owned()),
        ("singletons:", "planner: {d_max: \"3\"}\nsingletons:", format!("line 7 column 18: planner.d_max: {whole}, got the text \"3\"; write 3 without quotes")),
        ("singletons:", "planner: [exact]\nsingletons:", "line 7 column 10: planner: must be a mapping of fields to values, got a list".to_owned()),
        ("  edges:", "\tedges:", "line 6 column 1: a tab stands where only spaces may".to_owned()),
    ] {
        let message = spoiled(from, to);
        assert!(message.starts_with(&expected), "{to:?} should give\n  {expected}\nbut gave\n  {message}");
        for name in ["u32", "u128", "f64", "usize", "struct ", "unit value", "RawModule"] {
            assert!(!message.contains(name), "{message}");
        }
    }
    let suggested = spoiled("singletons:", "singeltons:");
    assert!(
        suggested.ends_with("; did you mean `singletons`?"),
        "{suggested}"
    );
    let suggested = spoiled("singletons:", "planner: {policy: papr}\nsingletons:");
    assert!(
        suggested.ends_with("; did you mean `paper`?"),
        "{suggested}"
    );
}

/// Single modules that crowd each other are no configuration, and each is counted once.
#[test]
fn a_crowd_of_single_modules_is_named_by_pairs() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("crowd.yaml");
    let modules: String = (1..=30)
        .map(|id| {
            format!(
                "  - {{id: {id}, x: {}, y: 9, theta: 0.0{id:02}}}\n",
                f64::from(id) * 0.1
            )
        })
        .collect();
    let start = PAIR.find("  - {id: 1, x: 0, y: 3}").unwrap();
    fs::write(&path, format!("{}{modules}", &PAIR[..start])).unwrap();
    let (_, _, stderr) = check(&path);
    assert!(!stderr.contains("docked"), "{stderr}");
    assert!(
        stderr.contains("module 1 and module 2 are too close"),
        "{stderr}"
    );
    assert!(stderr.contains("this concerns 30 modules"), "{stderr}");
}

/// Squares with a diagonal, of which a grid can keep four links each.
fn squares_with_diagonals(side: u32, count: u32) -> String {
    let mut text = "name: squares\ntarget:\n  spots:\n".to_owned();
    let id = |x: u32, y: u32| y * side + x + 1;
    let cells = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
    let mut edges = Vec::new();
    for (x, y) in cells {
        text += &format!("    - {{id: {}, x: {x}, y: {y}}}\n", id(x, y));
        edges.extend((x + 1 < side).then(|| format!("[{}, {}]", id(x, y), id(x + 1, y))));
        edges.extend((y + 1 < side).then(|| format!("[{}, {}]", id(x, y), id(x, y + 1))));
    }
    text += &format!("  edges: [{}]\nconfigurations:\n", edges.join(", "));
    for square in 0..count {
        let first = 4 * square + 1;
        let [a, b, c, d] = [first, first + 1, first + 2, first + 3];
        let (x, y) = (3 * (square % 8), 3 * (square / 8));
        let module = |id: u32, right: u32, up: u32| {
            format!("{{id: {id}, x: {}, y: -{}}}", x + right, y + up + 3)
        };
        text += &format!(
            "  - {{id: {}, modules: [{}, {}, {}, {}], edges: [[{a}, {b}], [{b}, {c}], [{c}, {d}], [{a}, {d}], [{a}, {c}]]}}\n",
            square + 1,
            module(a, 0, 0),
            module(b, 1, 0),
            module(c, 1, 1),
            module(d, 0, 1)
        );
    }
    text
}

#[test]
fn placements_that_are_proven_to_be_the_best_are_said_to_be() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("squares.yaml");
    fs::write(&path, squares_with_diagonals(8, 12)).unwrap();
    let path = path.to_str().unwrap();
    let output = formation(&["check", path, "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["proven"], true);
    assert_eq!(report["complete"], true);
    let output = formation(&["plan", path]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        text.contains("every placement of a configuration is proven to be the best"),
        "{text}"
    );
}
