//! From the text of a YAML file to values. Errors name the place, what stands there and what is needed, in the words of
//! people who write such files.

use std::fmt;

use serde::Deserializer;
use serde::de::{
    DeserializeOwned, DeserializeSeed, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor,
};
use serde_yaml::{Mapping, Value};
use thiserror::Error;

/// Why a text was not understood.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}{reason}", place(*.location))]
pub struct YamlError {
    /// The line and the column, from 1; none if the text as a whole is wrong.
    pub location: Option<(usize, usize)>,
    /// What is wrong, after the path of the field.
    pub reason: String,
}

fn place(location: Option<(usize, usize)>) -> String {
    match location {
        Some((line, column)) => format!("line {line} column {column}: "),
        None => "is no scenario: ".to_owned(),
    }
}

impl YamlError {
    /// The path of the field, if the reason begins with one, and the rest of the reason.
    #[must_use]
    pub fn field_and_reason(&self) -> (Option<&str>, &str) {
        let is_path = |path: &&str| !path.is_empty() && !path.contains([' ', '`']);
        match self.reason.split_once(": ") {
            Some((path, rest)) if is_path(&path) => (Some(path), rest),
            _ => (None, &self.reason),
        }
    }
}

/// A merge key takes in the fields of other mappings (<https://yaml.org/type/merge.html>).
const MERGE: &str = "<<";

/// Some editors begin a text, or a document in it, with this mark.
const BYTE_ORDER_MARK: char = '\u{feff}';

/// Reads a text, with its merge keys.
///
/// # Errors
/// Names the line and the field that is wrong, and why.
pub fn read<T: DeserializeOwned>(text: &str) -> Result<T, YamlError> {
    let text = without_marks(text);
    match serde_yaml::from_str(&text) {
        Ok(value) => Ok(value),
        Err(_) if text.contains(MERGE) => read_merged(&text),
        Err(error) => Err(YamlError::new(&error, &text)),
    }
}

/// The text without byte order marks before its first field.
fn without_marks(text: &str) -> String {
    let mut kept = String::with_capacity(text.len());
    let mut is_before = true;
    for line in text.split_inclusive('\n') {
        let bare = match is_before {
            true => line.trim_start_matches(BYTE_ORDER_MARK),
            false => line,
        };
        let after_marker = bare.strip_prefix("---").filter(|_| is_before);
        match after_marker.map(str::trim_start) {
            Some(rest) if rest.starts_with(BYTE_ORDER_MARK) => {
                kept.push_str("--- ");
                kept.push_str(rest.trim_start_matches(BYTE_ORDER_MARK));
            }
            _ => kept.push_str(bare),
        }
        let is_prelude = ["", "---"].contains(&bare.trim()) || bare.starts_with(['#', '%']);
        is_before &= is_prelude;
    }
    kept
}

/// Replaces the merge keys by the fields that they name, and reads the result.
fn read_merged<T: DeserializeOwned>(text: &str) -> Result<T, YamlError> {
    let in_text = |error: serde_yaml::Error| YamlError::new(&error, text);
    let mut value: Value = serde_yaml::from_str(text).map_err(in_text)?;
    let mut path = Vec::new();
    merge(&mut value, &mut path).map_err(|reason| YamlError {
        location: location_of(text, &path),
        reason: format!("{}{reason}", prefix(&path)),
    })?;
    let merged = serde_yaml::to_string(&value).map_err(in_text)?;
    serde_yaml::from_str(&merged).map_err(|error| {
        // The place in the merged text is not the one in the text that people wrote.
        let error = YamlError::new(&error, &merged);
        YamlError {
            location: location_of(text, &path_of(&error.reason)),
            ..error
        }
    })
}

/// The line and the column, from 1, of the field at a path such as `configurations[0].modules[2].id`; `None` where the text has no
/// such field, or is no YAML.
#[must_use]
pub fn place_of_field(text: &str, field: &str) -> Option<(usize, usize)> {
    location_of(&without_marks(text), &path_of(&format!("{field}: ")))
}

/// A step of the way to a field.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Segment {
    Field(String),
    Entry(usize),
}

/// A path as it precedes a reason; empty for the whole text.
fn prefix(path: &[Segment]) -> String {
    let mut text = String::new();
    for step in path {
        match step {
            Segment::Field(name) if text.is_empty() => text.push_str(name),
            Segment::Field(name) => text.push_str(&format!(".{name}")),
            Segment::Entry(index) => text.push_str(&format!("[{index}]")),
        }
    }
    if text.is_empty() { text } else { text + ": " }
}

/// The path that precedes a reason; as far as it can be read.
fn path_of(reason: &str) -> Vec<Segment> {
    let Some((path, _)) = reason.split_once(": ") else {
        return Vec::new();
    };
    let mut steps = Vec::new();
    for part in path.split(['.', '[']) {
        let entry = part.strip_suffix(']').and_then(|index| index.parse().ok());
        match entry {
            Some(index) => steps.push(Segment::Entry(index)),
            None if part.contains(' ') => break,
            None => steps.push(Segment::Field(part.to_owned())),
        }
    }
    steps
}

/// Takes in what the merge keys of a value name; a field that the mapping has itself, or that an earlier mapping of a list
/// has, stays. On an error, `path` leads to it.
fn merge(value: &mut Value, path: &mut Vec<Segment>) -> Result<(), &'static str> {
    match value {
        Value::Mapping(mapping) => {
            resolve(mapping)?;
            for (key, value) in mapping.iter_mut() {
                let name = key.as_str().unwrap_or("?");
                path.push(Segment::Field(name.to_owned()));
                merge(value, path)?;
                path.pop();
            }
        }
        Value::Sequence(entries) => {
            for (index, entry) in entries.iter_mut().enumerate() {
                path.push(Segment::Entry(index));
                merge(entry, path)?;
                path.pop();
            }
        }
        Value::Tagged(tagged) => merge(&mut tagged.value, path)?,
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => {}
    }
    Ok(())
}

/// Replaces the merge key of a mapping, and those of the mappings that it names.
fn resolve(mapping: &mut Mapping) -> Result<(), &'static str> {
    let Some(merged) = mapping.remove(MERGE) else {
        return Ok(());
    };
    for mut fields in mappings(merged)? {
        resolve(&mut fields)?;
        for (key, value) in fields {
            mapping.entry(key).or_insert(value);
        }
    }
    Ok(())
}

/// The mappings that a merge key names.
fn mappings(merged: Value) -> Result<Vec<Mapping>, &'static str> {
    const REASON: &str = "`<<` takes a mapping of fields, or a list of such mappings";
    let entries = match merged {
        Value::Sequence(entries) => entries,
        one => vec![one],
    };
    let fields = entries.into_iter().map(|entry| match entry {
        Value::Mapping(fields) => Ok(fields),
        _ => Err(REASON),
    });
    fields.collect()
}

/// Where a field stands in a text: the line and the column of its value, or of the mapping that takes it in by a merge key.
fn location_of(text: &str, path: &[Segment]) -> Option<(usize, usize)> {
    let found = Seeker { path }.deserialize(serde_yaml::Deserializer::from_str(text));
    let location = found.err()?.location()?;
    Some((location.line(), location.column()))
}

/// Fails at the value to which a path leads, so that the parser says where that is.
#[derive(Clone, Copy)]
struct Seeker<'p> {
    path: &'p [Segment],
}

impl<'de> DeserializeSeed<'de> for Seeker<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Seeker<'_> {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("another value")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(key) = map.next_key::<Value>()? {
            match self.path {
                [Segment::Field(name), path @ ..] if key.as_str() == Some(name) => {
                    map.next_value_seed(Seeker { path })?;
                }
                _ => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
        }
        Err(A::Error::custom("is here"))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let [Segment::Entry(index), path @ ..] = self.path else {
            return Err(A::Error::custom("is here"));
        };
        for _ in 0..*index {
            list.next_element::<IgnoredAny>()?;
        }
        list.next_element_seed(Seeker { path })?;
        Err(A::Error::custom("is here"))
    }
}

impl YamlError {
    fn new(error: &serde_yaml::Error, text: &str) -> Self {
        let location = error.location();
        let location = location.map(|place| (place.line(), place.column()));
        let mut message = error.to_string();
        if let Some((line, column)) = location {
            message = message.replacen(&format!(" at line {line} column {column}"), "", 1);
        }
        let line = location.and_then(|(line, _)| text.lines().nth(line.saturating_sub(1)));
        let line = line.unwrap_or_default();
        let is_tab = location
            .is_some_and(|(_, column)| line.chars().nth(column.saturating_sub(1)) == Some('\t'));
        let mut reason = match is_tab {
            true => "a tab stands where only spaces may, as they do for indentation".to_owned(),
            false => with_suggestion(in_plain_words(message.trim())),
        };
        if line.contains(BYTE_ORDER_MARK) {
            reason.push_str("; the line has a byte order mark (U+FEFF)");
        }
        Self {
            location,
            reason: visible(&reason),
        }
    }
}

impl From<serde_yaml::Error> for YamlError {
    fn from(error: serde_yaml::Error) -> Self {
        Self::new(&error, "")
    }
}

/// The message with code points instead of characters that nobody sees.
fn visible(message: &str) -> String {
    let mut text = String::with_capacity(message.len());
    for symbol in message.chars() {
        let is_hidden =
            matches!(symbol, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | BYTE_ORDER_MARK);
        match is_hidden || symbol.is_control() && !symbol.is_whitespace() {
            true => text.push_str(&format!("U+{:04X}", u32::from(symbol))),
            false => text.push(symbol),
        }
    }
    text
}

/// What must stand at the place, and what does.
fn in_plain_words(message: &str) -> String {
    let kinds = ["invalid type: ", "invalid value: ", "invalid length "];
    let found = kinds
        .iter()
        .find_map(|kind| Some((message.find(kind)?, *kind)));
    let Some((start, kind)) = found else {
        return message.to_owned();
    };
    let rest = &message[start + kind.len()..];
    // What is quoted may say "expected" as well.
    let Some((got, wanted)) = rest.rsplit_once(", expected ") else {
        return message.to_owned();
    };
    let path = &message[..start];
    let got = match kind {
        "invalid length " => got.to_owned(),
        _ => given(got, wanted),
    };
    format!("{path}must be {}, got {got}", needed(wanted))
}

/// What is needed, by what the reader of a value says that it expects.
fn needed(wanted: &str) -> String {
    let count = wanted
        .split(' ')
        .find_map(|word| word.parse::<usize>().ok());
    match (wanted, count) {
        ("u32", _) => format!("a whole number from 0 to {}", u32::MAX),
        ("u8" | "u16" | "u64" | "usize", _) => "a whole number that is not negative".to_owned(),
        ("i8" | "i16" | "i32" | "i64" | "isize", _) => "a whole number".to_owned(),
        ("f32" | "f64", _) => "a number".to_owned(),
        ("a string" | "string", _) => "text".to_owned(),
        ("a boolean" | "bool", _) => "true or false".to_owned(),
        ("field identifier" | "variant identifier" | "a YAML tag starting with '!'", _) => {
            "a name".to_owned()
        }
        ("a sequence", _) => "a list".to_owned(),
        (_, Some(count)) if wanted.contains("array") || wanted.contains("sequence") => {
            format!("a list of {count} values")
        }
        _ if wanted == "a map" || wanted.starts_with("struct ") => {
            "a mapping of fields to values".to_owned()
        }
        _ if wanted.starts_with("enum ") => "the name of a choice".to_owned(),
        _ => wanted.to_owned(),
    }
}

/// What stands there instead.
fn given(got: &str, wanted: &str) -> String {
    // Some numbers are followed by the name of their type.
    let number = |text: &str| text.split('`').nth(1).unwrap_or(text).to_owned();
    if let Some(text) = got.strip_prefix("string ") {
        let bare = text.trim_matches('"');
        // What was quoted and need not be; other text, such as 007, was no number without quotes either.
        let unquoted = serde_yaml::from_str(bare).unwrap_or_default();
        let is_needed = match unquoted {
            Value::Number(_) => !["a string", "string"].contains(&wanted),
            Value::Bool(_) => wanted.contains("bool"),
            _ => false,
        };
        return match is_needed {
            true => format!("the text {text}; write {bare} without quotes"),
            false => format!("the text {text}"),
        };
    }
    for kind in ["integer ", "floating point ", "boolean ", "character "] {
        if let Some(value) = got.strip_prefix(kind) {
            return number(value);
        }
    }
    match got {
        "sequence" => "a list".to_owned(),
        "map" => "a mapping".to_owned(),
        "unit value" | "Option value" => "nothing".to_owned(),
        _ => got.to_owned(),
    }
}

/// Names the known word that is nearest to an unknown one, if one is near.
fn with_suggestion(message: String) -> String {
    let Some((_, after)) = message
        .split_once("unknown field `")
        .or_else(|| message.split_once("unknown variant `"))
    else {
        return message;
    };
    let Some((unknown, known)) = after.split_once("`, ") else {
        return message;
    };
    let known = known.split('`').skip(1).step_by(2);
    let nearest = known.min_by_key(|word| distance(unknown, word));
    let most = (unknown.chars().count() / 3).min(3);
    match nearest.filter(|word| distance(unknown, word) <= most) {
        Some(word) => format!("{message}; did you mean `{word}`?"),
        None => message,
    }
}

/// The characters to insert, remove, replace or swap with their neighbour to make one word of another (optimal string
/// alignment), without regard to case.
fn distance(one: &str, other: &str) -> usize {
    let letters = |word: &str| word.to_lowercase().chars().take(64).collect::<Vec<char>>();
    let (one, other) = (letters(one), letters(other));
    let mut rows: Vec<Vec<usize>> = vec![(0..=other.len()).collect()];
    for (row, &letter) in (1..).zip(&one) {
        let mut costs = vec![row];
        for (column, &its) in (1..).zip(&other) {
            let replaced = rows[row - 1][column - 1] + usize::from(letter != its);
            let mut cost = replaced
                .min(rows[row - 1][column] + 1)
                .min(costs[column - 1] + 1);
            let is_swap =
                row > 1 && column > 1 && letter == other[column - 2] && its == one[row - 2];
            if is_swap {
                cost = cost.min(rows[row - 2][column - 2] + 1);
            }
            costs.push(cost);
        }
        rows.push(costs);
    }
    rows[one.len()][other.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fields_place_is_found_and_otherwise_that_of_its_mapping() {
        let text = "a: 1\nb:\n  - {x: 1}\n  - {x: 2, y: 3}\n";
        let of = |path: &[Segment]| location_of(text, path);
        let field = |name: &str| Segment::Field(name.to_owned());
        assert_eq!(
            of(&[field("b"), Segment::Entry(1), field("y")]),
            Some((4, 15))
        );
        assert_eq!(
            of(&[field("b"), Segment::Entry(1), field("z")]).map(|place| place.0),
            Some(4)
        );
        assert_eq!(
            path_of("b[1].y: is wrong: x"),
            [field("b"), Segment::Entry(1), field("y")]
        );
        assert_eq!(prefix(&path_of("b[1].y: is wrong")), "b[1].y: ");
        assert_eq!(place_of_field(text, "b[1].y"), Some((4, 15)));
    }

    #[test]
    fn words_are_compared_by_their_changes() {
        assert_eq!(distance("nmae", "name"), 1);
        assert_eq!(distance("edgse", "edges"), 1);
        assert_eq!(distance("Target", "target"), 0);
        assert_eq!(distance("", "abc"), 3);
        assert_eq!(distance("kitten", "sitting"), 3);
    }
}
