//! Identifiers and numbers as people read them; every program uses these words.

use std::fmt::Display;

use crate::Identifier;

/// Longer lists are cut in sentences.
const NAMES_MAX: usize = 10;

/// The texts of some items, with a separator between each two.
#[must_use]
pub fn joined(items: impl IntoIterator<Item = impl Display>, separator: &str) -> String {
    let texts: Vec<String> = items.into_iter().map(|item| item.to_string()).collect();
    texts.join(separator)
}

/// A number with its noun, in the plural where English requires it: `1 module`, `3 modules`.
#[must_use]
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {}", plural(noun, count))
}

/// A list for a sentence: `module 3`, `modules 3, 4 and 7`, or `modules 1, 2, ... and 12 more` after ten numbers.
#[must_use]
pub fn listed<I: Identifier>(ids: impl IntoIterator<Item = I>) -> String {
    let numbers: Vec<u32> = ids.into_iter().map(Identifier::number).collect();
    if numbers.is_empty() {
        return format!("no {}", I::NOUN);
    }
    let noun = plural(I::NOUN, numbers.len());
    format!("{noun} {}", enumerated(&numbers, NAMES_MAX))
}

/// A list of which at most `shown_max` items are shown: `3, 4 and 7`, or `1, 2 and 12 more`.
pub fn enumerated(items: impl IntoIterator<Item = impl Display>, shown_max: usize) -> String {
    let texts: Vec<String> = items.into_iter().map(|item| item.to_string()).collect();
    let (shown, more) = texts.split_at(texts.len().min(shown_max));
    match (shown, more.len()) {
        ([], _) => "nothing".to_owned(),
        ([most @ .., last], 0) if !most.is_empty() => format!("{} and {last}", most.join(", ")),
        (shown, 0) => shown.join(", "),
        (shown, more) => format!("{} and {more} more", shown.join(", ")),
    }
}

/// The complete list, however long: `module 3`, `modules 1-4, 7`.
#[must_use]
pub fn listed_in_full<I: Identifier>(ids: impl IntoIterator<Item = I>) -> String {
    let ids: Vec<I> = ids.into_iter().collect();
    let noun = plural(I::NOUN, ids.len());
    format!("{noun} {}", ranges(ids).replace(',', ", "))
}

/// Ascending identifiers as command-line options take them, `1-4,7`.
#[must_use]
pub fn ranges<I: Identifier>(ids: impl IntoIterator<Item = I>) -> String {
    let mut ranges: Vec<(u32, u32)> = Vec::new();
    for id in ids {
        let id = id.number();
        match ranges.last_mut() {
            Some((_, last)) if last.checked_add(1) == Some(id) => *last = id,
            _ => ranges.push((id, id)),
        }
    }
    let written = ranges.into_iter().map(|(first, last)| match first == last {
        true => first.to_string(),
        false => format!("{first}-{last}"),
    });
    joined(written, ",")
}

fn plural(noun: &str, count: usize) -> String {
    format!("{noun}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ModuleId, SpotId};

    fn modules(ids: &[u32]) -> impl Iterator<Item = ModuleId> + '_ {
        ids.iter().copied().map(ModuleId)
    }

    #[test]
    fn lists_are_cut_in_sentences() {
        assert_eq!(listed(modules(&[])), "no module");
        assert_eq!(listed([SpotId(3)]), "spot 3");
        assert_eq!(listed(modules(&[7, 3, 4])), "modules 7, 3 and 4");
        let many: Vec<u32> = (1..=12).collect();
        assert_eq!(
            listed(modules(&many)),
            "modules 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 and 2 more"
        );
    }

    #[test]
    fn complete_lists_are_short() {
        assert_eq!(ranges(modules(&[1, 2, 3, 5, 7, 8])), "1-3,5,7-8");
        assert_eq!(
            ranges(modules(&[u32::MAX - 1, u32::MAX])),
            "4294967294-4294967295"
        );
        assert_eq!(ranges(modules(&[])), "");
        assert_eq!(listed_in_full(modules(&[1, 2, 5])), "modules 1-2, 5");
        assert_eq!(listed_in_full([SpotId(9)]), "spot 9");
        assert_eq!(counted(1, "spot"), "1 spot");
        assert_eq!(counted(0, "spot"), "0 spots");
    }
}
