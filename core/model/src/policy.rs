//! The planners by name.

use std::fmt;

use serde::de::{self, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Gives `$use` the policies that decide at once and are no baselines, a line each: the name, which is also that of the file
/// in `core/planner/src/policies`; what it does, in a sentence; and its source.
///
/// A line here and the file make a policy: scenarios, messages, agents and `formation policies` know it then.
#[macro_export]
macro_rules! for_each_own_policy {
    ($use:ident) => {
        $use! {
            nearest, "Greedy: the nearest pair of a module and a spot first, then the nearest of those left.", "docs/own_policy.md";
        }
    };
}

/// What is known of a policy besides its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct PolicyEntry {
    /// The name in scenario files and messages.
    pub name: &'static str,
    /// What it does, in a sentence.
    pub sentence: &'static str,
    /// Where it is from.
    pub source: &'static str,
}

macro_rules! list_policies {
    ($($name:ident, $sentence:literal, $source:literal;)*) => {
        const OWN: &[PolicyEntry] = &[$(PolicyEntry {
            name: stringify!($name),
            sentence: $sentence,
            source: $source,
        }),*];

        const NAME_LIST: &[&str] = &["exact", "paper", "auction", "hungarian", "given" $(, stringify!($name))*];

        impl Policy {
            /// The names of all policies.
            pub const NAMES: &'static str =
                concat!("exact, paper, auction, hungarian, given" $(, ", ", stringify!($name))*);
        }
    };
}

for_each_own_policy!(list_policies);

/// The planner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Policy {
    /// Utility-optimal common subtrees and eviction chains.
    #[default]
    Exact,
    /// Algorithms 1 and 2 of the paper, by the readings of [`PaperOptions`](crate::PaperOptions).
    Paper,
    /// Bertsekas' auction, which treats every module as a singleton.
    Auction,
    /// A central optimal assignment, which treats every module as a singleton.
    Hungarian,
    /// What the target gives: each module takes the spot that its table names.
    Given,
    /// A policy of one's own.
    Own(OwnPolicy),
}

/// One of the policies of [`for_each_own_policy`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct OwnPolicy {
    name: &'static str,
}

impl OwnPolicy {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.name
    }
}

impl Policy {
    const BUILT_IN: [(Self, PolicyEntry); 5] = [
        (
            Self::Exact,
            PolicyEntry {
                name: "exact",
                sentence: "Turn by turn: configurations keep the most links that the target allows, single modules evict each other along chains.",
                source: "the paper's Algorithms 1 and 2 with exact searches; docs/planning.md",
            },
        ),
        (
            Self::Paper,
            PolicyEntry {
                name: "paper",
                sentence: "Turn by turn: the paper's algorithms as printed, by readings that can be chosen.",
                source: "the paper's Algorithms 1 and 2; docs/paper.md",
            },
        ),
        (
            Self::Auction,
            PolicyEntry {
                name: "auction",
                sentence: "At once: the greatest sum of utilities, by an auction; breaks all links.",
                source: "D. P. Bertsekas, Interfaces 20(4), 1990",
            },
        ),
        (
            Self::Hungarian,
            PolicyEntry {
                name: "hungarian",
                sentence: "At once: the greatest sum of utilities, by the Hungarian method; breaks all links.",
                source: "H. W. Kuhn, Naval Research Logistics Quarterly 2, 1955; J. Munkres, Journal of SIAM 5(1), 1957",
            },
        ),
        (
            Self::Given,
            PolicyEntry {
                name: "given",
                sentence: "As the target says: its list `allocation`, which any program may have computed, is checked and carried out.",
                source: "docs/own_policy.md",
            },
        ),
    ];

    /// All policies, those of one's own last.
    pub fn all() -> impl Iterator<Item = (Self, PolicyEntry)> {
        let own = OWN.iter().map(|entry| {
            let policy = OwnPolicy { name: entry.name };
            (Self::Own(policy), *entry)
        });
        Self::BUILT_IN.into_iter().chain(own)
    }

    /// The name in scenario files and messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Paper => "paper",
            Self::Auction => "auction",
            Self::Hungarian => "hungarian",
            Self::Given => "given",
            Self::Own(own) => own.name,
        }
    }

    /// The policy of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let mut all = Self::all();
        all.find(|(_, entry)| entry.name == name)
            .map(|(policy, _)| policy)
    }
}

impl Serialize for Policy {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

struct NameVisitor;

impl Visitor<'_> for NameVisitor {
    type Value = Policy;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("a name")
    }

    fn visit_str<E: de::Error>(self, name: &str) -> Result<Policy, E> {
        Policy::named(name).ok_or_else(|| E::unknown_variant(name, NAME_LIST))
    }
}

impl<'de> Deserialize<'de> for Policy {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_str(NameVisitor)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn each_policy_has_a_name_of_its_own_and_is_found_by_it() {
        let names: Vec<&str> = Policy::all().map(|(_, entry)| entry.name).collect();
        assert_eq!(names.join(", "), Policy::NAMES);
        assert_eq!(names, NAME_LIST);
        assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len());
        for (policy, entry) in Policy::all() {
            assert_eq!(policy.name(), entry.name);
            assert_eq!(Policy::named(entry.name), Some(policy));
            assert!(entry.sentence.ends_with('.'), "{}", entry.name);
        }
        assert_eq!(Policy::named("exakt"), None);
    }
}
