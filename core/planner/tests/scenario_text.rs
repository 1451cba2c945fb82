//! Reading any text as a scenario ends with a scenario that can be planned or with a helpful error.
//!
//! `FORMATION_FUZZ_CASES` sets the number of cases of each test; `tests/soak_fuzz.sh` runs a million.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::fmt::Write;
use std::sync::Arc;

use formation_model::Scenario;
use formation_planner as planner;
use formation_verify as verify;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};

const VALID: [&str; 3] = [
    include_str!("../../../launch_scripts/scenarios/figure1_ladder17.yaml"),
    include_str!("../../../launch_scripts/scenarios/mcs_detach.yaml"),
    include_str!("../../../launch_scripts/scenarios/undersupply.yaml"),
];

/// Valid scenarios up to this size are planned as well.
const PLANNED_MAX: usize = 20;

/// The number of cases of each test.
#[allow(
    clippy::disallowed_methods,
    reason = "the core does no I/O; its tests may"
)]
fn cases(usual: u32) -> ProptestConfig {
    let cases = std::env::var("FORMATION_FUZZ_CASES").ok();
    let cases = cases.map_or(usual, |cases| cases.parse().unwrap());
    ProptestConfig::with_cases(cases)
}

/// Reads a text, and plans the scenario if it is valid.
fn try_all(text: &str) {
    match Scenario::from_yaml(text) {
        Err(error) => assert!(!error.to_string().trim().is_empty()),
        Ok(scenario) => {
            let problem = scenario.problem().clone();
            let size = problem.modules().len().max(problem.target().spots().len());
            if size <= PLANNED_MAX {
                let planned = planner::plan(Arc::new(problem.clone()));
                let spots = problem.target().spots().len();
                let filled = problem.modules().len().min(spots);
                assert_eq!(planned.plan.assignments.len(), filled, "{text}");
            }
        }
    }
}

/// Words of scenarios, and words that do not belong there.
fn token() -> impl Strategy<Value = String> {
    let words = [
        "target",
        "spots",
        "edges",
        "configurations",
        "singletons",
        "modules",
        "leader",
        "planner",
        "weights",
        "loc",
        "id",
        "x",
        "y",
        "theta",
        "name",
        "frame_id",
        "policy",
        "d_max",
        ":",
        ": ",
        "- ",
        "\n",
        "\n  ",
        "\n    ",
        "{",
        "}",
        "[",
        "]",
        ",",
        ", ",
        "&a ",
        "*a",
        "<<: *a",
        "!!int ",
        "!x ",
        "\"",
        "'",
        "|",
        ">",
        "?",
        "#",
        "---\n",
        "...\n",
        "null",
        "~",
        "true",
        ".nan",
        "-.inf",
        "1e308",
        "1e999",
        "-0",
        "0x7fffffffffffffff",
        "18446744073709551616",
        "4294967295",
        "4294967296",
        "-1",
        "1.0",
        "7",
        "\t",
        "\u{feff}",
        "\u{0}",
        "\u{2028}",
        "\u{1f916}",
    ];
    prop_oneof![
        8 => select(words.to_vec()).prop_map(str::to_owned),
        1 => any::<i64>().prop_map(|number| number.to_string()),
        1 => any::<f64>().prop_map(|number| number.to_string()),
    ]
}

/// One change of a valid scenario.
#[derive(Clone, Debug)]
enum Change {
    /// Removes a line.
    Drop(Index),
    /// Repeats a line.
    Repeat(Index),
    /// Swaps two lines.
    Swap(Index, Index),
    /// Replaces a number.
    Number(Index, String),
    /// Inserts a word.
    Insert(Index, String),
    /// Cuts the text.
    Cut(Index),
}

fn change() -> impl Strategy<Value = Change> {
    let at = any::<Index>;
    prop_oneof![
        1 => at().prop_map(Change::Drop),
        1 => at().prop_map(Change::Repeat),
        1 => (at(), at()).prop_map(|(one, other)| Change::Swap(one, other)),
        4 => (at(), token()).prop_map(|(place, token)| Change::Number(place, token)),
        2 => (at(), token()).prop_map(|(place, token)| Change::Insert(place, token)),
        1 => at().prop_map(Change::Cut),
    ]
}

/// The byte ranges of the numbers in a text.
fn numbers(text: &str) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let mut begin = None;
    for (index, character) in text.char_indices().chain([(text.len(), ' ')]) {
        let belongs = character.is_ascii_digit() || (begin.is_some() && character == '.');
        match (begin, belongs) {
            (None, true) => begin = Some(index),
            (Some(start), false) => {
                found.push((start, index));
                begin = None;
            }
            _ => {}
        }
    }
    found
}

fn boundary(text: &str, index: Index) -> usize {
    let mut at = index.index(text.len() + 1);
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

fn changed(text: &str, change: &Change) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    if lines.is_empty() {
        return String::new();
    }
    match change {
        Change::Drop(index) => {
            lines.remove(index.index(lines.len()));
            lines.join("\n")
        }
        Change::Repeat(index) => {
            let line = index.index(lines.len());
            lines.insert(line, lines[line]);
            lines.join("\n")
        }
        Change::Swap(one, other) => {
            let (one, other) = (one.index(lines.len()), other.index(lines.len()));
            lines.swap(one, other);
            lines.join("\n")
        }
        Change::Number(index, token) => {
            let found = numbers(text);
            if found.is_empty() {
                return text.to_owned();
            }
            let (start, end) = found[index.index(found.len())];
            format!("{}{token}{}", &text[..start], &text[end..])
        }
        Change::Insert(index, token) => {
            let at = boundary(text, *index);
            format!("{}{token}{}", &text[..at], &text[at..])
        }
        Change::Cut(index) => text[..boundary(text, *index)].to_owned(),
    }
}

proptest! {
    #![proptest_config(cases(1_000))]

    #[test]
    fn arbitrary_bytes(bytes in vec(any::<u8>(), 0..300)) {
        try_all(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn arbitrary_words(words in vec(token(), 0..80)) {
        try_all(&words.concat());
    }

    #[test]
    fn changed_scenarios(scenario in select(VALID.to_vec()), changes in vec(change(), 1..5)) {
        let text = changes.iter().fold(scenario.to_owned(), |text, change| changed(&text, change));
        try_all(&text);
    }
}

#[test]
fn valid_scenarios_are_planned_correctly() {
    for text in VALID {
        let problem = Arc::new(Scenario::from_yaml(text).unwrap().problem().clone());
        try_all(text);
        let planned = planner::plan(Arc::clone(&problem));
        let decisions: Vec<_> = planned
            .decisions
            .iter()
            .map(|(_, decision)| decision.clone())
            .collect();
        let checked = verify::check_plan(&problem, &decisions, &planned.plan);
        assert_eq!(checked, Ok(()));
    }
}

/// Nine lists of nine references each would be 387 million entries.
#[test]
fn aliases_do_not_multiply() {
    let mut text = String::from("a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]\n");
    for level in 1..10 {
        let below = format!("*a{}", level - 1);
        let references = vec![below; 9].join(", ");
        writeln!(text, "a{level}: &a{level} [{references}]").unwrap();
    }
    let inside = format!("{text}target: *a9\n");
    assert!(Scenario::from_yaml(&text).is_err());
    assert!(Scenario::from_yaml(&inside).is_err());
}

#[test]
fn deep_nesting_is_refused_without_a_stack_overflow() {
    for (open, close) in [
        ("[", "]"),
        ("{a: ", "}"),
        ("- ", ""),
        ("? ", ""),
        ("a:\n ", ""),
    ] {
        for depth in [100, 10_000] {
            let value = open.repeat(depth) + "1" + &close.repeat(depth);
            for text in [
                value.clone(),
                format!("target: {value}"),
                format!("target:\n  spots: {value}"),
            ] {
                assert!(Scenario::from_yaml(&text).is_err(), "{open:?} {depth} deep");
            }
        }
    }
    // Blocks that are indented ever deeper.
    let mut text = String::new();
    for depth in 0..3_000 {
        writeln!(text, "{}a:", " ".repeat(depth)).unwrap();
    }
    assert!(Scenario::from_yaml(&text).is_err());
}
