//! The rules of the protocol, and the code that says of itself that it enforces or shows one.
//!
//! A documentation line `Enforces A1, T2.` stands at what enforces a rule, `Shows A1.` at a test, and `Lacks A1.` at a deliberate bug.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use formation_tests::root;

use super::files::{self, TextFile};

const PAGE: &str = "docs/rules_in_code.md";
const HEAD: &str = "\
# Rules in the code

<!-- Written from the documentation lines `Enforces`, `Shows` and `Lacks` of the code by
     `FORMATION_UPDATE_DOCUMENTS=1 cargo test -p formation_tests --test all documents::rules`. -->

Where each rule of the [protocol](protocol.md#rules) is enforced, and the tests that show it. A deliberate bug is an agent that lacks
the rule, which `sim/tests/mutations.rs` must find.

| rule | enforced | shown | bugs |
|---|---|---|---|
";

/// What the code says of one rule: items as `file::name`, ascending.
#[derive(Default)]
struct Tagged {
    enforced: BTreeSet<String>,
    shown: BTreeSet<String>,
    lacking: BTreeSet<String>,
}

/// The rules of the page on the protocol, in its order.
fn rules() -> Vec<String> {
    let page = TextFile::read("docs/protocol.md");
    let lines = page.text.lines();
    let rules: Vec<String> = lines
        .filter_map(|line| line.strip_prefix("**")?.split_once(".**"))
        .map(|(rule, _)| rule.to_owned())
        .filter(|rule| is_rule(rule))
        .collect();
    assert!(rules.len() > 30, "found {} rules", rules.len());
    rules
}

/// Whether a word has the shape of a rule's name, such as `A1`.
fn is_rule(word: &str) -> bool {
    let Some((letter, number)) = word.split_at_checked(1) else {
        return false;
    };
    letter.chars().all(char::is_uppercase)
        && !number.is_empty()
        && number.chars().all(|one| one.is_ascii_digit())
}

/// The kind of a tag and the rules that it names, if the line is one.
fn tag(line: &str) -> Option<(&str, Vec<&str>)> {
    let line = line.trim_start();
    let text = line.strip_prefix("/// ").or(line.strip_prefix("//! "))?;
    let (kind, names) = text.strip_suffix('.')?.split_once(' ')?;
    let names: Vec<&str> = names.split(", ").collect();
    let is_tag =
        ["Enforces", "Shows", "Lacks"].contains(&kind) && names.iter().all(|one| is_rule(one));
    is_tag.then_some((kind, names))
}

/// The item that follows documentation: the first line that is neither that nor an attribute.
fn item<'a>(lines: impl Iterator<Item = &'a str>) -> (String, bool) {
    let mut is_test = false;
    let mut lines = lines.map(str::trim_start);
    let head = lines.find(|line| {
        is_test |= line.starts_with("#[test]");
        !line.starts_with("//") && !line.starts_with('#') && !line.starts_with(')')
    });
    let head = head.unwrap_or_default();
    // A visibility such as `pub(in crate::stage)`.
    let head = match head.strip_prefix("pub(") {
        Some(rest) => rest.split_once(") ").map_or("", |(_, item)| item),
        None => head.strip_prefix("pub ").unwrap_or(head),
    };
    let kinds = [
        "const", "fn", "struct", "enum", "static", "trait", "type", "mod",
    ];
    let mut words = head.split([' ', '(', '<', ',', ':', '{', ';']);
    let name = words.find(|word| !kinds.contains(word));
    (name.unwrap_or_default().to_owned(), is_test)
}

/// What the code says of each rule.
fn collected() -> BTreeMap<String, Tagged> {
    let mut found: BTreeMap<String, Tagged> = BTreeMap::new();
    for file in files::all().iter().filter(|file| file.ends_with(".rs")) {
        let lines: Vec<&str> = file.text.lines().collect();
        for (at, line) in lines.iter().enumerate() {
            let Some((kind, names)) = tag(line) else {
                continue;
            };
            let (item, is_test) = item(lines[at..].iter().copied());
            let place = match line.starts_with("//!") {
                true => file.path.clone(),
                false => format!("{}::{item}", file.path),
            };
            assert_eq!(kind == "Shows", is_test, "{place}: only tests show a rule");
            for name in names {
                let tagged = found.entry(name.to_owned()).or_default();
                match kind {
                    "Enforces" => tagged.enforced.insert(place.clone()),
                    "Shows" => tagged.shown.insert(place.clone()),
                    _ => tagged.lacking.insert(item.clone()),
                };
            }
        }
    }
    found
}

#[test]
fn every_rule_of_the_protocol_is_enforced_and_shown_in_the_code() {
    let rules = rules();
    let found = collected();
    for rule in &rules {
        let tagged = found.get(rule);
        assert!(
            tagged.is_some_and(|tagged| !tagged.enforced.is_empty()),
            "nothing enforces {rule}"
        );
        assert!(
            tagged.is_some_and(|tagged| !tagged.shown.is_empty() || !tagged.lacking.is_empty()),
            "no test shows {rule}"
        );
    }
    for rule in found.keys() {
        assert!(
            rules.contains(rule),
            "the code names {rule}, which docs/protocol.md does not have"
        );
    }
}

#[test]
fn the_page_on_rules_has_all_that_the_code_says() {
    let found = collected();
    let mut page = HEAD.to_owned();
    let listed = |items: &BTreeSet<String>| -> String {
        let quoted: Vec<String> = items.iter().map(|item| format!("`{item}`")).collect();
        quoted.join("<br>")
    };
    for rule in rules() {
        let tagged = &found[&rule];
        let _ = writeln!(
            page,
            "| {rule} | {} | {} | {} |",
            listed(&tagged.enforced),
            listed(&tagged.shown),
            listed(&tagged.lacking)
        );
    }
    if std::env::var_os("FORMATION_UPDATE_DOCUMENTS").is_some() {
        std::fs::write(root().join(PAGE), &page).unwrap();
    }
    assert!(
        TextFile::read(PAGE).text == page,
        "{PAGE} is out of date; its first lines say what writes it"
    );
}
