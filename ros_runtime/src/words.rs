//! Values that are written as one of a few words.

/// A value that is written as one of a few words.
pub trait Words: Copy + PartialEq + 'static {
    /// Every word and what it means.
    const WORDS: &'static [(&'static str, Self)];

    /// The word for this value.
    fn word(self) -> &'static str {
        let mut words = Self::WORDS.iter();
        let entry = words.find(|(_, value)| *value == self);
        debug_assert!(entry.is_some(), "a value without a word");
        entry.map_or("", |(word, _)| word)
    }

    /// The value of a word, in capitals or not.
    ///
    /// # Errors
    /// Names the words that there are, and the nearest one.
    fn from_word(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let mut words = Self::WORDS.iter();
        let entry = words.find(|(word, _)| word.eq_ignore_ascii_case(text));
        entry.map(|(_, value)| *value).ok_or_else(|| {
            let words: Vec<&str> = Self::WORDS.iter().map(|(word, _)| *word).collect();
            let (listed, nearest) = (words.join(", "), suggestion(text, words));
            format!("must be one of {listed}, got `{text}`{nearest}")
        })
    }
}

/// Parses and displays a type by its words.
macro_rules! by_words {
    ($($type:ty),+) => {$(
        impl std::str::FromStr for $type {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                $crate::words::Words::from_word(text)
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.write_str($crate::words::Words::word(*self))
            }
        }
    )+};
}
pub(crate) use by_words;

/// "; did you mean `...`?" with the candidate that is nearest to what was typed, if one is near enough to be meant.
pub(crate) fn suggestion<'a>(typed: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    let typed = typed.to_lowercase();
    candidates
        .into_iter()
        .map(|candidate| {
            (
                strsim::osa_distance(&typed, &candidate.to_lowercase()),
                candidate,
            )
        })
        .filter(|(distance, candidate)| *distance <= 1 + candidate.chars().count() / 4)
        .min()
        .map(|(_, candidate)| format!("; did you mean `{candidate}`?"))
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_recognised_and_another_word_is_not() {
        let flags = ["--remap", "--param", "--params-file", "--log-level"];
        for (typed, nearest) in [
            ("--remp", "; did you mean `--remap`?"),
            ("--parma", "; did you mean `--param`?"),
            ("--LOG-LEVLE", "; did you mean `--log-level`?"),
            ("--verbose", ""),
            ("x", ""),
        ] {
            assert_eq!(suggestion(typed, flags), nearest);
        }
    }
}
