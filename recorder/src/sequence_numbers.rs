//! Which samples of a publisher were received, by their sequence numbers.

use std::collections::BTreeMap;

/// More ranges are joined, the oldest first: a publisher of best-effort samples leaves a gap with each loss.
const RANGES_MAX: usize = 1_024;

/// The sequence numbers of one publisher that were received.
#[derive(Clone, Debug, Default)]
pub(crate) struct SequenceNumbers {
    /// The first number of each range, with its last.
    ranges: BTreeMap<u64, u64>,
    /// How many numbers are missing between ranges that were joined.
    joined_gaps: u64,
}

impl SequenceNumbers {
    /// Takes in a number; returns whether it is new.
    pub(crate) fn insert(&mut self, number: u64) -> bool {
        let before = self.ranges.range(..=number).next_back();
        let before = before.map(|(&first, &last)| (first, last));
        if before.is_some_and(|(_, last)| number <= last) {
            return false;
        }
        let first = match before {
            Some((first, last)) if last.saturating_add(1) == number => first,
            _ => number,
        };
        let after = number.saturating_add(1);
        let last = self.ranges.remove(&after).unwrap_or(number);
        self.ranges.insert(first, last);
        if self.ranges.len() > RANGES_MAX
            && let Some((first, end)) = self.ranges.pop_first()
            && let Some((next, last)) = self.ranges.pop_first()
        {
            self.joined_gaps += next - end - 1;
            self.ranges.insert(first, last);
        }
        true
    }

    /// How many numbers between the first and the last are missing.
    pub(crate) fn missing(&self) -> u64 {
        let ends = self.ranges.values();
        let gaps = ends.zip(self.ranges.keys().skip(1));
        let gaps: u64 = gaps.map(|(end, next)| next - end - 1).sum();
        self.joined_gaps + gaps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(numbers: impl IntoIterator<Item = u64>) -> SequenceNumbers {
        let mut received = SequenceNumbers::default();
        for number in numbers {
            assert!(received.insert(number), "{number} is new");
        }
        received
    }

    #[test]
    fn gaps_are_counted_and_repetitions_found_in_any_order() {
        let mut received = of([5, 6, 9, 3, 7]);
        assert_eq!(received.missing(), 2);
        for known in [3, 5, 6, 7, 9] {
            assert!(!received.insert(known), "{known}");
        }
        assert!(received.insert(8) && received.insert(4));
        assert_eq!(received.missing(), 0);
        assert_eq!(received.ranges, BTreeMap::from([(3, 9)]));
    }

    #[test]
    fn memory_is_bounded_whatever_is_lost() {
        let received = of((0..10_000).map(|number| 3 * number));
        assert_eq!(received.ranges.len(), RANGES_MAX);
        assert_eq!(received.missing(), 2 * 9_999);
    }
}
