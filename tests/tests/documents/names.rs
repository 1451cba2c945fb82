//! One name stands for one thing: no two types that others can use have the same.
//!
//! A type may share its name with the message that carries it: `formation_msgs` has those.

use std::collections::BTreeMap;

use super::files;

/// The crate with the messages.
const MESSAGES: &str = "msgs";

/// The crate of a source file, unless it is one of tests.
fn crate_of(path: &str) -> Option<&str> {
    let (name, rest) = path.split_once("/src/")?;
    let is_of_tests =
        path.starts_with("tests/") || rest.contains("tests/") || rest.ends_with("tests.rs");
    (!is_of_tests).then_some(name)
}

/// The name of a type that a line at the margin declares, and whether other crates can use it.
fn declared(line: &str) -> Option<(&str, bool)> {
    let (visibility, rest) = line.strip_prefix("pub")?.split_once(' ')?;
    let (kind, rest) = rest.split_once(' ')?;
    let is_type = matches!(kind, "struct" | "enum" | "trait" | "type" | "union");
    let name = rest
        .split(|symbol: char| !symbol.is_alphanumeric() && symbol != '_')
        .next()?;
    is_type.then_some((name, visibility.is_empty()))
}

#[test]
fn no_two_types_share_a_name() {
    let mut places: BTreeMap<String, Vec<(String, String, bool)>> = BTreeMap::new();
    for file in files::all()
        .into_iter()
        .filter(|file| file.ends_with(".rs"))
    {
        let Some(owner) = crate_of(&file.path) else {
            continue;
        };
        for line in file.text.lines() {
            if let Some((name, is_public)) = declared(line) {
                let place = (owner.to_owned(), file.path.clone(), is_public);
                places.entry(name.to_owned()).or_default().push(place);
            }
        }
    }
    assert!(places.len() > 500, "only {} types were found", places.len());
    let mut shared = Vec::new();
    for (name, places) in &places {
        for (at, (owner, path, is_public)) in places.iter().enumerate() {
            let other = places[at + 1..].iter().find(|(other, _, other_is_public)| {
                let are_public = *is_public && *other_is_public;
                let has_message = owner == MESSAGES || other == MESSAGES;
                owner == other || are_public && !has_message
            });
            if let Some((_, other, _)) = other {
                shared.push(format!("{name}: {path} and {other}"));
            }
        }
    }
    assert!(
        shared.is_empty(),
        "types with one name:\n{}",
        shared.join("\n")
    );
}
