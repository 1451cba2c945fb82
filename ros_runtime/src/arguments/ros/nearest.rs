//! What a person may have meant.

/// The candidate that is nearest to what was typed, if any is near enough to be meant.
///
/// Distance counts insertions, deletions, replacements and swaps of neighbours (the optimal string alignment distance).
pub fn nearest<'a>(typed: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let typed = &typed.to_lowercase();
    candidates
        .into_iter()
        .map(|candidate| (distance(typed, &candidate.to_lowercase()), candidate))
        .filter(|(distance, candidate)| *distance <= 1 + candidate.chars().count() / 4)
        .min()
        .map(|(_, candidate)| candidate)
}

/// "; did you mean `...`?", or nothing.
pub fn suggestion<'a>(typed: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    nearest(typed, candidates)
        .map(|candidate| format!("; did you mean `{candidate}`?"))
        .unwrap_or_default()
}

fn distance(one: &str, other: &str) -> usize {
    let (one, other): (Vec<char>, Vec<char>) = (one.chars().collect(), other.chars().collect());
    // The last three rows of the table suffice.
    let mut before_last: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=other.len()).collect();
    for row in 1..=one.len() {
        let mut current = vec![row];
        for column in 1..=other.len() {
            let differs = usize::from(one[row - 1] != other[column - 1]);
            let mut least = (last[column] + 1)
                .min(current[column - 1] + 1)
                .min(last[column - 1] + differs);
            let swapped = row > 1
                && column > 1
                && one[row - 1] == other[column - 2]
                && one[row - 2] == other[column - 1];
            if swapped {
                least = least.min(before_last[column - 2] + 1);
            }
            current.push(least);
        }
        before_last = std::mem::replace(&mut last, current);
    }
    last[other.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_forgiven_and_another_word_is_not() {
        let flags = ["--remap", "--param", "--params-file", "--log-level"];
        assert_eq!(nearest("--remp", flags), Some("--remap"));
        assert_eq!(nearest("--parma", flags), Some("--param"));
        assert_eq!(nearest("--LOG-LEVLE", flags), Some("--log-level"));
        assert_eq!(nearest("--verbose", flags), None);
        assert_eq!(suggestion("x", flags), "");
    }

    #[test]
    fn the_distance_is_that_of_the_literature() {
        for (one, other, expected) in [("", "abc", 3), ("abc", "acb", 1), ("kitten", "sitting", 3)]
        {
            assert_eq!(distance(one, other), expected, "{one} {other}");
        }
    }
}
