//! How the policy `paper` reads what the paper leaves open. `docs/paper.md` has the reasons.

use std::fmt;

use serde::de::value::MapAccessDeserializer;
use serde::de::{self, IntoDeserializer, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use thiserror::Error;

use crate::FieldError;

/// The greatest MAX that is accepted.
pub const CANDIDATES_LIMIT: u32 = 10_000;

/// A named set of readings.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum PaperBundle {
    /// The pseudo-code and the formulas as they are printed.
    #[default]
    Literal,
    /// What the text around them promises, where the pseudo-code falls short of it.
    Charitable,
}

/// Which candidate a configuration takes if it can have none whole (Algorithm 2, line 16).
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Fallback {
    /// The last one that was checked: that of least utility.
    #[default]
    Last = 0,
    /// The one of which the fewest spots are refused; of these, the one of greatest utility.
    Fewest = 1,
}

/// Which module of a configuration is matched to which spot of a candidate.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Embedding {
    /// The first embedding in the order of the search.
    #[default]
    First = 0,
    /// The embedding of greatest utility.
    Best = 1,
}

/// What a module that has just been evicted counts as its best other spot (Algorithm 1, line 13, in the recursion).
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Evicted {
    /// Every spot but the contested one, so also the one that it has lost.
    #[default]
    Literal = 0,
    /// No spot that it has lost in this chain.
    Lost = 1,
}

/// The value of a spot on targets with cycles. On trees both are equal.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum SpotValue {
    /// The number of shortest paths through the spot, divided by the number of all shortest paths between other spots: the
    /// formula as printed.
    #[default]
    RatioOfSums = 0,
    /// The mean over pairs of other spots of the share of their shortest paths that run through the spot: betweenness
    /// centrality as defined by the source that the paper cites.
    MeanOfRatios = 1,
}

/// The order in which modules take their spots in the acting phase.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum ActingOrder {
    /// The spot of greatest value, then the spots next to it, and so on outward; those of one layer by value.
    #[default]
    Layers = 0,
    /// An order in which every spot has a free corridor at its turn, if there is one.
    Corridors = 1,
}

/// The readings of the policy `paper`; other policies have no use for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "RawPaper", into = "RawPaper")]
pub struct PaperOptions {
    /// Which candidate is taken if none can be had whole.
    pub fallback: Fallback,
    /// Which embedding of a candidate counts.
    pub embedding: Embedding,
    /// What an evicted module counts.
    pub evicted: Evicted,
    /// The value of a spot.
    pub val: SpotValue,
    /// The acting order.
    pub acting: ActingOrder,
    max: u32,
}

impl PaperBundle {
    /// The readings of the bundle.
    #[must_use]
    pub fn options(self) -> PaperOptions {
        match self {
            Self::Literal => PaperOptions {
                fallback: Fallback::Last,
                embedding: Embedding::First,
                evicted: Evicted::Literal,
                val: SpotValue::RatioOfSums,
                acting: ActingOrder::Layers,
                max: 20,
            },
            Self::Charitable => PaperOptions {
                fallback: Fallback::Fewest,
                embedding: Embedding::Best,
                evicted: Evicted::Lost,
                val: SpotValue::MeanOfRatios,
                acting: ActingOrder::Layers,
                max: 20,
            },
        }
    }

    /// The bundle's `D_max`, for which the user may set another.
    #[must_use]
    pub fn d_max(self) -> u32 {
        match self {
            Self::Literal | Self::Charitable => 3,
        }
    }
}

impl Default for PaperOptions {
    fn default() -> Self {
        PaperBundle::default().options()
    }
}

/// A MAX that was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("must be from 1 to {CANDIDATES_LIMIT}, got {0}")]
pub struct MaxRefused(u64);

/// An option of a policy by name that was refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum OptionRefused {
    /// The policy has no such option.
    #[error("the policy `paper` of this version has no option `{0}`; it has {KEYS}")]
    Key(String),
    /// The option has no such value.
    #[error("`{key}` cannot be `{value}`; it can be {known}")]
    Value {
        /// The option.
        key: &'static str,
        /// The value.
        value: String,
        /// The values that it can have.
        known: &'static str,
    },
}

const KEYS: &str = "fallback, embedding, evicted, val, acting, max";

impl PaperOptions {
    pub(super) fn are_default(&self) -> bool {
        *self == Self::default()
    }

    /// MAX: the greatest number of candidates of a configuration.
    #[must_use]
    pub fn max(&self) -> usize {
        self.max as usize
    }

    /// The same with another MAX.
    ///
    /// # Errors
    /// Refuses 0 and what is above [`CANDIDATES_LIMIT`].
    pub fn with_max(self, max: u64) -> Result<Self, MaxRefused> {
        let accepted = u32::try_from(max).ok();
        let accepted = accepted.filter(|max| (1..=CANDIDATES_LIMIT).contains(max));
        accepted.map_or(Err(MaxRefused(max)), |max| Ok(Self { max, ..self }))
    }

    /// All options as names and values.
    #[must_use]
    pub fn named(&self) -> [(&'static str, String); 6] {
        [
            ("fallback", self.fallback.name().to_owned()),
            ("embedding", self.embedding.name().to_owned()),
            ("evicted", self.evicted.name().to_owned()),
            ("val", self.val.name().to_owned()),
            ("acting", self.acting.name().to_owned()),
            ("max", self.max.to_string()),
        ]
    }

    /// Sets an option by name.
    ///
    /// # Errors
    /// Names the option or the value that is unknown.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), OptionRefused> {
        match key {
            "fallback" => self.fallback = Fallback::named("fallback", value)?,
            "embedding" => self.embedding = Embedding::named("embedding", value)?,
            "evicted" => self.evicted = Evicted::named("evicted", value)?,
            "val" => self.val = SpotValue::named("val", value)?,
            "acting" => self.acting = ActingOrder::named("acting", value)?,
            "max" => {
                let number = value.parse().ok();
                let set = number.and_then(|max| self.with_max(max).ok());
                *self = set.ok_or_else(|| OptionRefused::Value {
                    key: "max",
                    value: value.to_owned(),
                    known: "1 to 10000",
                })?;
            }
            _ => return Err(OptionRefused::Key(key.to_owned())),
        }
        Ok(())
    }
}

macro_rules! reading {
    ($reading:ident: $($variant:ident $name:literal),+; $known:literal) => {
        impl $reading {
            /// The name in scenario files and messages.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name),+
                }
            }

            fn named(key: &'static str, value: &str) -> Result<Self, OptionRefused> {
                match value {
                    $($name => Ok(Self::$variant),)+
                    _ => Err(OptionRefused::Value { key, value: value.to_owned(), known: $known }),
                }
            }
        }
    };
}

reading!(Fallback: Last "last", Fewest "fewest"; "last or fewest");
reading!(Embedding: First "first", Best "best"; "first or best");
reading!(Evicted: Literal "literal", Lost "lost"; "literal or lost");
reading!(SpotValue: RatioOfSums "ratio_of_sums", MeanOfRatios "mean_of_ratios"; "ratio_of_sums or mean_of_ratios");
reading!(ActingOrder: Layers "layers", Corridors "corridors"; "layers or corridors");

/// The readings as they stand in a scenario file: the name of a bundle, or a bundle and what differs from it.
#[derive(Serialize)]
#[serde(untagged)]
enum RawPaper {
    Bundle(PaperBundle),
    Readings(RawReadings),
}

impl<'de> Deserialize<'de> for RawPaper {
    fn deserialize<D: Deserializer<'de>>(value: D) -> Result<Self, D::Error> {
        value.deserialize_any(RawPaperVisitor)
    }
}

struct RawPaperVisitor;

impl<'de> Visitor<'de> for RawPaperVisitor {
    type Value = RawPaper;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("literal, charitable, or readings such as {bundle: literal, max: 40}")
    }

    fn visit_str<E: de::Error>(self, name: &str) -> Result<RawPaper, E> {
        PaperBundle::deserialize(name.into_deserializer()).map(RawPaper::Bundle)
    }

    fn visit_map<A: MapAccess<'de>>(self, readings: A) -> Result<RawPaper, A::Error> {
        RawReadings::deserialize(MapAccessDeserializer::new(readings)).map(RawPaper::Readings)
    }
}

#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawReadings {
    bundle: PaperBundle,
    #[serde(skip_serializing_if = "Option::is_none")]
    fallback: Option<Fallback>,
    #[serde(skip_serializing_if = "Option::is_none")]
    embedding: Option<Embedding>,
    #[serde(skip_serializing_if = "Option::is_none")]
    evicted: Option<Evicted>,
    #[serde(skip_serializing_if = "Option::is_none")]
    val: Option<SpotValue>,
    #[serde(skip_serializing_if = "Option::is_none")]
    acting: Option<ActingOrder>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max: Option<u64>,
}

impl TryFrom<RawPaper> for PaperOptions {
    type Error = FieldError;

    fn try_from(raw: RawPaper) -> Result<Self, FieldError> {
        let readings = match raw {
            RawPaper::Bundle(bundle) => return Ok(bundle.options()),
            RawPaper::Readings(readings) => readings,
        };
        let bundle = readings.bundle.options();
        let options = Self {
            fallback: readings.fallback.unwrap_or(bundle.fallback),
            embedding: readings.embedding.unwrap_or(bundle.embedding),
            evicted: readings.evicted.unwrap_or(bundle.evicted),
            val: readings.val.unwrap_or(bundle.val),
            acting: readings.acting.unwrap_or(bundle.acting),
            max: bundle.max,
        };
        let max = readings.max.unwrap_or(u64::from(bundle.max));
        let with_max = options.with_max(max);
        with_max.map_err(|error| FieldError::new("paper.max", error))
    }
}

impl From<PaperOptions> for RawPaper {
    fn from(options: PaperOptions) -> Self {
        for bundle in [PaperBundle::Literal, PaperBundle::Charitable] {
            if bundle.options() == options {
                return Self::Bundle(bundle);
            }
        }
        Self::Readings(RawReadings {
            bundle: PaperBundle::Literal,
            fallback: Some(options.fallback),
            embedding: Some(options.embedding),
            evicted: Some(options.evicted),
            val: Some(options.val),
            acting: Some(options.acting),
            max: Some(options.max.into()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_option_can_be_set_by_the_name_under_which_it_is_listed() {
        let charitable = PaperBundle::Charitable.options().with_max(200).unwrap();
        let mut options = PaperOptions::default();
        for (key, value) in charitable.named() {
            options.set(key, &value).unwrap();
        }
        assert_eq!(options, charitable);
        let refused = options.set("evicted", "best").unwrap_err();
        assert_eq!(
            refused.to_string(),
            "`evicted` cannot be `best`; it can be literal or lost"
        );
        assert!(options.set("max", "0").is_err() && options.set("max", "x").is_err());
        assert_eq!(
            options.set("colour", "red").unwrap_err().to_string(),
            "the policy `paper` of this version has no option `colour`; it has fallback, embedding, evicted, val, acting, max"
        );
    }
}
