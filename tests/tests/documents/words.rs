//! One word for one thing: words that the glossary or plain technical English replaces are not used.
//!
//! A word counts wherever it stands as a whole word, also within an identifier (`hear_state`, `TargetInlet`), and a phrase
//! also across the end of a line. A word that is written with a capital here counts only so: it is the name of a type.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::files::{self, TextFile};

/// What is not written, alternatives divided by `|`, and what is written instead.
const WORDS: &[(&str, &str)] = &[
    // Plain technical English.
    ("anew", "again; restarts, rejoins, is rebuilt"),
    (
        "tell|tells|telling|told",
        "report, log, notify, publish; know, distinguish",
    ),
    (
        "hear|hears|hearing|heard",
        "receive; handle_* in identifiers",
    ),
    ("bear|bears|bearing|borne", "tolerate; carry"),
    (
        "taken for dead|take for dead|takes for dead",
        "considered failed",
    ),
    (
        "whoever|whomever|nobody|somebody|everybody|anybody|everyone|anyone",
        "any module that, no module, a client, every member",
    ),
    ("beside", "next to, alongside, in the same run"),
    ("for want of", "because it is missing"),
    ("vouch|vouches|vouched|vouching", "count towards the quorum"),
    (
        "outweigh|outweighs|outweighed|outweighing",
        "take precedence over, override",
    ),
    ("let go|lets go|letting go", "undock from, release"),
    (
        "mend|mends|mended|mending",
        "recover, fix, repair, heal (a network cut)",
    ),
    (
        "longest way|longest ways|straight way|straight ways|of way",
        "distance, path",
    ),
    ("fare|fares|fared", "status"),
    ("dear", "expensive"),
    ("so many|so long", "at most N, longer than X"),
    ("of itself", "by itself, its own"),
    ("in vain", "without success, without a reply"),
    ("twice in a row", "in two consecutive epochs"),
    // Names of the field.
    ("inlet|inlets", "subscription queue"),
    ("outlet|outlets", "publisher queue"),
    ("facilities", "node interfaces"),
    ("desk", "endpoints"),
    ("wishes", "goal resolver"),
    ("conduct", "goal tracker, run loop"),
    ("pulse", "DDS liveness watchdog"),
    ("standstill", "DDS deadlock watchdog; no progress"),
    ("tally", "module diagnostics, count"),
    ("Traffic", "topic statistics"),
    ("speakers", "source guard"),
    ("namesake|namesakes", "duplicate module"),
    ("chronicle|chronicles|chronicler", "event log"),
    ("briefing", "latched snapshot"),
    ("strike|strikes|struck", "fault"),
    ("victim|victims", "targets of the fault"),
    ("Cast", "process roles"),
    ("voice", "outbox"),
    ("easel", "visualiser"),
    ("Latched", "TransientLocal"),
    ("Prompt", "ReliableVolatile"),
    ("fleeting", "BestEffort"),
    ("obey|obeys", "handle_command, follow"),
    ("foreign", "external messages"),
];

/// Names that stay as they are, and why.
const KEPT: &[(&str, &str)] = &[
    (
        "standstill_limit",
        "a ROS parameter of the target publisher; parameter names do not change",
    ),
    (
        "a_module_that_is_started_anew_takes_its_part_again",
        "a test that docs/protocol.md and docs/fault_model.md name",
    ),
    (
        "a_second_process_with_a_living_id_is_refused_and_both_are_told",
        "a test that docs/fault_model.md names",
    ),
    (
        "agents_and_observers_bear_whatever_passes_the_border",
        "a test that docs/fault_model.md names",
    ),
    (
        "modules_are_retired_and_added_and_stay_so_when_their_process_joins_anew",
        "a test that docs/protocol.md names",
    ),
    (
        "status_is_told_and_a_withdrawn_target_stays_withdrawn",
        "a test that docs/protocol.md names",
    ),
    (
        "a_driver_that_does_not_follow_a_goal_is_named_with_its_limit_and_harms_nobody",
        "a test that docs/protocol.md names",
    ),
];

/// Where a word may stand: the path or its beginning, the word, and why.
const ALLOWED: &[(&str, &str, &str)] = &[(
    "formation/tests/properties.proptest-regressions",
    "everyone",
    "proptest writes this file",
)];

/// This folder lists the words.
const SELF: &str = "tests/tests/documents";

/// A word of a text, with the number of its line.
#[derive(Clone, Copy)]
struct Word<'a> {
    text: &'a str,
    line: usize,
}

/// The words of a text; underscores and changes of case within identifiers divide words.
fn words(text: &str) -> Vec<Word<'_>> {
    let mut found = Vec::new();
    for (index, line) in text.lines().enumerate() {
        for run in line.split(|symbol: char| !symbol.is_alphabetic()) {
            let mut rest = run;
            while !rest.is_empty() {
                let (text, after) = rest.split_at(end_of_word(rest));
                found.push(Word {
                    text,
                    line: index + 1,
                });
                rest = after;
            }
        }
    }
    found
}

/// Where a capital follows a small letter, or the end.
fn end_of_word(run: &str) -> usize {
    let mut before_is_small = false;
    for (at, symbol) in run.char_indices() {
        if symbol.is_uppercase() && before_is_small {
            return at;
        }
        before_is_small = symbol.is_lowercase();
    }
    run.len()
}

/// Whether the words begin with this phrase.
fn begin_with(words: &[Word<'_>], phrase: &str) -> bool {
    let same = |word: &str, wanted: &str| {
        if wanted.starts_with(char::is_uppercase) {
            word == wanted
        } else {
            word.eq_ignore_ascii_case(wanted)
        }
    };
    let mut count = 0;
    phrase.split(' ').all(|wanted| {
        let fits = words.get(count).is_some_and(|word| same(word.text, wanted));
        count += 1;
        fits
    })
}

/// A phrase of the table, and what to write instead.
type Replaced = (&'static str, &'static str);

/// The phrases of the table by their first word in small letters, as most words of a text begin none.
fn by_first_word() -> BTreeMap<String, Vec<Replaced>> {
    let mut phrases: BTreeMap<String, Vec<Replaced>> = BTreeMap::new();
    for (alternatives, instead) in WORDS {
        for phrase in alternatives.split('|') {
            let first = phrase.split(' ').next().unwrap().to_ascii_lowercase();
            phrases.entry(first).or_default().push((phrase, instead));
        }
    }
    phrases
}

/// The phrases of the table that a file contains, each with its line and what to write instead.
fn findings(
    file: &TextFile,
    table: &BTreeMap<String, Vec<Replaced>>,
) -> Vec<(usize, &'static str, &'static str)> {
    let mut text = file.text.clone();
    for (name, _) in KEPT {
        text = text.replace(name, "");
    }
    let words = words(&text);
    let mut found = Vec::new();
    for (at, word) in words.iter().enumerate() {
        let first = word.text.to_ascii_lowercase();
        for &(phrase, instead) in table.get(&first).into_iter().flatten() {
            let is_allowed = ALLOWED
                .iter()
                .any(|(path, word, _)| file.path.starts_with(path) && *word == phrase);
            if begin_with(&words[at..], phrase) && !is_allowed {
                found.push((word.line, phrase, instead));
            }
        }
    }
    found
}

#[test]
fn words_that_the_glossary_replaces_are_not_used() {
    let mut report = String::new();
    let table = by_first_word();
    for file in files::all().iter().filter(|file| !file.is_in(SELF)) {
        for (line, phrase, instead) in findings(file, &table) {
            writeln!(report, "{}:{line}: \"{phrase}\": {instead}", file.path).unwrap();
        }
    }
    assert!(report.is_empty(), "{report}");
}

#[test]
fn every_exception_is_still_needed() {
    let files = files::all();
    for (name, reason) in KEPT {
        let is_used = |file: &TextFile| !file.is_in(SELF) && file.text.contains(name);
        assert!(
            files.iter().any(is_used),
            "nothing is named {name}: {reason}"
        );
    }
    for (path, word, reason) in ALLOWED {
        let has_it = |file: &TextFile| {
            let words = words(&file.text);
            file.path.starts_with(path) && (0..words.len()).any(|at| begin_with(&words[at..], word))
        };
        assert!(
            files.iter().any(has_it),
            "{path} no longer contains \"{word}\": {reason}"
        );
    }
}

#[test]
fn words_are_found_in_identifiers_and_across_lines() {
    let file = TextFile {
        path: "one.rs".to_owned(),
        text: "fn hear_state(inlet: &TargetInlet) {}\n/// Halted for\n/// want of power; it heartbeats.\n"
            .to_owned(),
    };
    let found: Vec<(usize, &str)> = findings(&file, &by_first_word())
        .into_iter()
        .map(|(line, phrase, _)| (line, phrase))
        .collect();
    assert_eq!(
        found,
        [(1, "hear"), (1, "inlet"), (1, "inlet"), (2, "for want of")]
    );
}
