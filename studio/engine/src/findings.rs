//! What is wrong with a drawing, and which modules, spots and boxes it is about.

use serde::Serialize;

/// What a sentence is about.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Named {
    /// The identifiers of modules.
    pub modules: Vec<u32>,
    /// The identifiers of spots.
    pub spots: Vec<u32>,
    /// The positions of boxes among the obstacles.
    pub obstacles: Vec<usize>,
}

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Grade {
    /// There is no plan.
    Error,
    /// There is one, and it may not be what was meant.
    Warning,
}

/// One thing that is wrong or odd.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// How bad it is.
    pub severity: Grade,
    /// The words of `formation check`.
    pub text: String,
    /// What it is about.
    #[serde(flatten)]
    pub place: Named,
}

impl Finding {
    /// An error in these words.
    pub fn error(text: &str) -> Self {
        Self::of(Grade::Error, text)
    }

    /// A warning in these words.
    pub fn warning(text: &str) -> Self {
        Self::of(Grade::Warning, text)
    }

    fn of(severity: Grade, text: &str) -> Self {
        Self {
            severity,
            text: text.to_owned(),
            place: Named::named_in(text),
        }
    }
}

impl Named {
    /// What a sentence names: "module 3", "modules 1, 4 and 7-9", "spot 2", "obstacles[5]".
    ///
    /// The core names what it refuses in words alone, which are the same in every user's message.
    pub fn named_in(text: &str) -> Self {
        let mut place = Self::default();
        let mut rest = text;
        while let Some(start) = rest.find(|character: char| character.is_ascii_lowercase()) {
            rest = &rest[start..];
            let end = rest
                .find(|character: char| !character.is_ascii_lowercase())
                .unwrap_or(rest.len());
            let (word, after) = rest.split_at(end);
            rest = after;
            match word {
                "module" | "modules" => place.modules.extend(numbers_at(after)),
                "spot" | "spots" => place.spots.extend(numbers_at(after)),
                "obstacles" => {
                    let number = after.strip_prefix('[').and_then(|it| it.split_once(']'));
                    place
                        .obstacles
                        .extend(number.and_then(|(it, _)| it.parse::<usize>().ok()));
                }
                _ => {}
            }
        }
        for list in [&mut place.modules, &mut place.spots] {
            list.sort_unstable();
            list.dedup();
        }
        place
    }
}

/// The longest range that is spelled out.
const RANGE_MAX: u32 = 10_000;

/// The numbers of a list such as ` 1, 4 and 7-9` with which a text begins.
fn numbers_at(text: &str) -> Vec<u32> {
    let mut numbers = Vec::new();
    let mut rest = text;
    while let Some(after) = [", ", " and ", " "]
        .iter()
        .find_map(|between| rest.strip_prefix(between))
    {
        let Some((first, after)) = number_at(after) else {
            break;
        };
        let to = after.strip_prefix('-').and_then(number_at);
        let (last, after) = to.unwrap_or((first, after));
        if first <= last && last - first <= RANGE_MAX {
            numbers.extend(first..=last);
        }
        rest = after;
    }
    numbers
}

/// The number with which a text begins, and what is behind it.
fn number_at(text: &str) -> Option<(u32, &str)> {
    let end = text
        .find(|character: char| !character.is_ascii_digit())
        .unwrap_or(text.len());
    let number = text[..end].parse().ok()?;
    Some((number, &text[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_sentence_names_is_found() {
        let place = Named::named_in(
            "modules 1, 4 and 7-9 overlap spot 2; obstacles[5]: covers spots 3 and 2, of module 4.",
        );
        assert_eq!(place.modules, [1, 4, 7, 8, 9]);
        assert_eq!(place.spots, [2, 3]);
        assert_eq!(place.obstacles, [5]);
        let nothing = "modules: more than spots; 3 modules will stay without a spot, module";
        assert_eq!(Named::named_in(nothing), Named::default());
        assert_eq!(Named::named_in("modules 1-4294967295"), Named::default());
    }
}
