//! The user's choices about planning.

use serde::{Deserialize, Deserializer, Serialize};
use thiserror::Error;

use crate::{
    FieldError, MicroUnits, PaperBundle, PaperOptions, Policy, QuantiseError, WEIGHT_LIMIT,
};

/// The order in which units take their turns. Digests contain the numbers.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum TurnOrder {
    /// By distance of the unit's leader from the target's centre, the paper's order.
    #[default]
    Rank = 0,
    /// Larger configurations first, then by rank; this breaks fewer links.
    SizeFirst = 1,
}

/// Values of the key `motion` of scenario files from before modules moved along paths only. It has no effect any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum FormerMotion {
    Auto,
    Paths,
    Straight,
}

/// The weights of the cost of taking a spot; always `loc > dock > undock >= 0`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "RawWeights", into = "RawWeights")]
pub struct Weights {
    loc: MicroUnits,
    dock: MicroUnits,
    undock: MicroUnits,
}

/// The weights as they stand in a scenario file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawWeights {
    loc: f64,
    dock: f64,
    undock: f64,
}

impl Default for RawWeights {
    fn default() -> Self {
        Weights::default().into()
    }
}

impl From<Weights> for RawWeights {
    fn from(weights: Weights) -> Self {
        Self {
            loc: weights.loc.to_units(),
            dock: weights.dock.to_units(),
            undock: weights.undock.to_units(),
        }
    }
}

impl TryFrom<RawWeights> for Weights {
    type Error = FieldError;

    fn try_from(raw: RawWeights) -> Result<Self, FieldError> {
        Self::from_units(raw.loc, raw.dock, raw.undock)
            .map_err(|error| FieldError::new("weights", error))
    }
}

/// Why a set of weights was refused.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum WeightsError {
    /// A weight is not finite or too large.
    #[error("{name} {source}")]
    Weight {
        /// `loc`, `dock` or `undock`.
        name: &'static str,
        /// What is wrong with it.
        #[source]
        source: QuantiseError,
    },
    /// The order of the weights contradicts the paper's cost model.
    #[error(
        "must satisfy loc > dock > undock >= 0, got loc {}, dock {}, undock {}", loc.to_units(), dock.to_units(), undock.to_units()
    )]
    Order {
        /// The cost of one unit of distance.
        loc: MicroUnits,
        /// The cost of one docking.
        dock: MicroUnits,
        /// The cost of one undocking.
        undock: MicroUnits,
    },
}

impl Weights {
    /// Validates and quantises a set of weights.
    ///
    /// # Errors
    /// Refuses what is not finite, is above [`WEIGHT_LIMIT`], or breaks `loc > dock > undock >= 0`.
    pub fn from_units(loc: f64, dock: f64, undock: f64) -> Result<Self, WeightsError> {
        let quantise = |name, value| {
            MicroUnits::from_units_within(value, WEIGHT_LIMIT)
                .map_err(|source| WeightsError::Weight { name, source })
        };
        let (loc, dock, undock) = (
            quantise("loc", loc)?,
            quantise("dock", dock)?,
            quantise("undock", undock)?,
        );
        if loc > dock && dock > undock && undock >= MicroUnits::ZERO {
            Ok(Self { loc, dock, undock })
        } else {
            Err(WeightsError::Order { loc, dock, undock })
        }
    }

    /// The cost of one unit of distance.
    pub fn loc(&self) -> MicroUnits {
        self.loc
    }

    /// The cost of one docking, per link end.
    pub fn dock(&self) -> MicroUnits {
        self.dock
    }

    /// The cost of one undocking, per link end.
    pub fn undock(&self) -> MicroUnits {
        self.undock
    }
}

impl Default for Weights {
    fn default() -> Self {
        Self {
            loc: MicroUnits(1_000_000),
            dock: MicroUnits(100_000),
            undock: MicroUnits(50_000),
        }
    }
}

/// The price, in units of utility, of each cut when a configuration chooses its spots; never negative.
///
/// A cut is a link that the configuration breaks, or an edge between a spot that it takes and a free one that it leaves: on
/// trees, one more piece for later turns. Like the utility, the price decides between places for equally many modules, but
/// it enters no total. At zero the utility decides alone; above the longest distance, the number of cuts decides first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct CutPrice(MicroUnits);

impl CutPrice {
    /// No price.
    pub const ZERO: Self = Self(MicroUnits::ZERO);

    /// The cost of one unit of distance at the default weights.
    pub const ONE: Self = Self(MicroUnits::ONE);

    /// Validates and quantises a price.
    ///
    /// # Errors
    /// Refuses what is not finite, negative, or above [`WEIGHT_LIMIT`].
    pub fn from_units(price: f64) -> Result<Self, CutPriceError> {
        let price = MicroUnits::from_units_within(price, WEIGHT_LIMIT)?;
        if price < MicroUnits::ZERO {
            return Err(CutPriceError::Negative(price));
        }
        Ok(Self(price))
    }

    /// The price of one cut.
    pub fn per_cut(&self) -> MicroUnits {
        self.0
    }
}

impl Default for CutPrice {
    fn default() -> Self {
        Self::ONE
    }
}

impl TryFrom<f64> for CutPrice {
    type Error = FieldError;

    fn try_from(price: f64) -> Result<Self, FieldError> {
        Self::from_units(price).map_err(|error| FieldError::new("cut_price", error))
    }
}

impl From<CutPrice> for f64 {
    fn from(price: CutPrice) -> Self {
        price.0.to_units()
    }
}

/// Why a price of cuts was refused.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum CutPriceError {
    /// The price is not finite or too large.
    #[error(transparent)]
    Number(#[from] QuantiseError),
    /// The price is below zero.
    #[error("must not be negative, got {0}")]
    Negative(MicroUnits),
}

/// The weight of the square of a distance, per unit, in the choice of spots: the choice counts a distance `d` as
/// `d + spread * d^2`; from 0 to 1.
///
/// Sums of plain distances leave open who goes where along a line, and a little noise then sends modules past each other.
/// The square decides for equally long ways. Like the price of cuts, it enters no total. At zero the plain distance decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct Spread(MicroUnits);

/// The greatest spread.
const SPREAD_MAX: f64 = 1.0;

impl Spread {
    /// The plain distance decides, as in the paper.
    pub const ZERO: Self = Self(MicroUnits::ZERO);

    /// Validates and quantises a spread.
    ///
    /// # Errors
    /// Refuses what does not lie between 0 and 1.
    pub fn from_units(spread: f64) -> Result<Self, SpreadError> {
        if (0.0..=SPREAD_MAX).contains(&spread)
            && let Ok(spread) = MicroUnits::from_units(spread)
        {
            return Ok(Self(spread));
        }
        Err(SpreadError(spread))
    }

    /// The weight per unit of distance.
    pub fn per_unit(&self) -> MicroUnits {
        self.0
    }
}

impl Default for Spread {
    fn default() -> Self {
        Self(MicroUnits(1_000))
    }
}

impl TryFrom<f64> for Spread {
    type Error = FieldError;

    fn try_from(spread: f64) -> Result<Self, FieldError> {
        Self::from_units(spread).map_err(|error| FieldError::new("spread", error))
    }
}

impl From<Spread> for f64 {
    fn from(spread: Spread) -> Self {
        spread.0.to_units()
    }
}

/// A spread that was refused.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("must lie between 0 and {SPREAD_MAX}, got {0}")]
pub struct SpreadError(f64);

/// All choices of the user about planning, as they stand in a scenario file; every replica holds the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "RawPlannerParameters")]
pub struct PlannerParameters {
    /// The planner.
    pub policy: Policy,
    /// How the policy `paper` reads the paper.
    #[serde(skip_serializing_if = "PaperOptions::are_default")]
    pub paper: PaperOptions,
    /// The order in which units take their turns.
    pub order: TurnOrder,
    /// The greatest number of evictions of one chain; `None` is unbounded. In a scenario file of the policy `paper` that
    /// does not set it, it is the bundle's.
    pub d_max: Option<u32>,
    /// With a bounded `d_max`, let the last turn move singletons so that their allocation is utility-optimal given the
    /// blocks. Without a bound it always is. Only for the policy `exact`.
    pub exact_finish: bool,
    /// The weights of the cost of taking a spot.
    pub weights: Weights,
    /// The price of each cut when a configuration chooses its spots. Only for the policy `exact`.
    pub cut_price: CutPrice,
    /// The weight of the square of a distance in the choice of spots. The policy `paper` ignores it.
    pub spread: Spread,
    /// Keep every spot even when there are fewer modules than spots, instead of trimming the target. The policy `paper`
    /// never trims.
    pub keep_all_spots: bool,
}

impl PlannerParameters {
    /// The policy `paper` with the readings and the `D_max` of a bundle.
    #[must_use]
    pub fn of_paper(bundle: PaperBundle) -> Self {
        Self {
            policy: Policy::Paper,
            paper: bundle.options(),
            d_max: Some(bundle.d_max()),
            ..Self::default()
        }
    }

    /// The same choices under another policy. A `d_max` of the policy `paper` is not that of others, and the other way round: one
    /// that is not bounded becomes its default.
    #[must_use]
    pub fn under(self, policy: Policy) -> Self {
        let default = match policy {
            Policy::Paper => Some(PaperBundle::default().d_max()),
            _ => None,
        };
        match (self.policy, policy) {
            (own, other) if own == other => self,
            (Policy::Paper, _) => Self {
                policy,
                paper: PaperOptions::default(),
                d_max: default,
                ..self
            },
            _ => Self {
                policy,
                d_max: self.d_max.or(default),
                ..self
            },
        }
    }

    /// The spread of the policy: the paper's knows none.
    #[must_use]
    pub fn spread_in_use(&self) -> Spread {
        match self.policy {
            Policy::Paper => Spread::ZERO,
            _ => self.spread,
        }
    }

    /// Whether the target is trimmed if there are fewer modules than spots.
    #[must_use]
    pub fn trims_target(&self) -> bool {
        !self.keep_all_spots && !matches!(self.policy, Policy::Paper | Policy::Given)
    }
}

/// The section `planner` of a scenario file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, default, rename = "PlannerParameters")]
#[derive(Default)]
struct RawPlannerParameters {
    policy: Policy,
    paper: Option<PaperOptions>,
    order: TurnOrder,
    /// `None` if the file does not mention it, which differs from `null`.
    #[serde(deserialize_with = "mentioned")]
    d_max: Option<Option<u32>>,
    exact_finish: bool,
    weights: Weights,
    cut_price: CutPrice,
    spread: Spread,
    keep_all_spots: bool,
    /// Deprecated.
    motion: Option<FormerMotion>,
}

/// Distinguishes a field that is `null` from one that is missing.
fn mentioned<'de, D: Deserializer<'de>>(value: D) -> Result<Option<Option<u32>>, D::Error> {
    Option::deserialize(value).map(Some)
}

impl TryFrom<RawPlannerParameters> for PlannerParameters {
    type Error = FieldError;

    fn try_from(raw: RawPlannerParameters) -> Result<Self, FieldError> {
        let is_paper = raw.policy == Policy::Paper;
        if raw.paper.is_some() && !is_paper {
            let reason = "belongs to `policy: paper`, which is not set";
            return Err(FieldError::new("planner.paper", reason));
        }
        if raw.motion == Some(FormerMotion::Straight) {
            let reason = "modules move along paths only: leave this key out";
            return Err(FieldError::new("planner.motion", reason));
        }
        let of_bundle = is_paper.then(|| PaperBundle::default().d_max());
        Ok(Self {
            policy: raw.policy,
            paper: raw.paper.unwrap_or_default(),
            order: raw.order,
            d_max: raw.d_max.unwrap_or(of_bundle),
            exact_finish: raw.exact_finish,
            weights: raw.weights,
            cut_price: raw.cut_price,
            spread: raw.spread,
            keep_all_spots: raw.keep_all_spots,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_must_keep_the_papers_order() {
        assert_eq!(Weights::from_units(1.0, 0.1, 0.05), Ok(Weights::default()));
        assert!(matches!(
            Weights::from_units(0.1, 1.0, 0.05),
            Err(WeightsError::Order { .. })
        ));
        assert!(matches!(
            Weights::from_units(1.0, f64::NAN, 0.0),
            Err(WeightsError::Weight { name: "dock", .. })
        ));
    }

    #[test]
    fn a_spread_lies_between_zero_and_one() {
        assert_eq!(Spread::from_units(0.001), Ok(Spread::default()));
        assert_eq!(Spread::from_units(0.0), Ok(Spread::ZERO));
        assert!(Spread::from_units(1.0).is_ok());
        for spread in [-0.001, 1.001, f64::NAN, f64::INFINITY] {
            let refused = Spread::from_units(spread).unwrap_err().to_string();
            let expected = format!("must lie between 0 and 1, got {spread}");
            assert_eq!(refused, expected);
        }
    }

    #[test]
    fn a_cut_is_never_rewarded() {
        assert_eq!(CutPrice::from_units(1.0), Ok(CutPrice::default()));
        assert_eq!(CutPrice::from_units(0.0), Ok(CutPrice::ZERO));
        assert!(matches!(
            CutPrice::from_units(-0.5),
            Err(CutPriceError::Negative(_))
        ));
        for price in [100.5, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                CutPrice::from_units(price),
                Err(CutPriceError::Number(_))
            ));
        }
    }
}
