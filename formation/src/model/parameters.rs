//! What the user may choose about planning.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::model::{MicroUnits, QuantiseError, WEIGHT_LIMIT};

/// Which planner decides.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// Utility-optimal common subtrees and eviction chains.
    #[default]
    Exact,
    /// Algorithms 1 and 2 of the paper, as literally as they can be run.
    Paper,
    /// Bertsekas' auction; treats every module as a singleton.
    Auction,
    /// A central optimal assignment; treats every module as a singleton.
    Hungarian,
}

/// In which order units take their turns.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum TurnOrder {
    /// By distance of the unit's leader from the target's centre, the paper's order.
    #[default]
    Rank,
    /// Larger configurations first, then by rank: breaks fewer links.
    SizeFirst,
}

/// The weights of the cost of taking a spot; always `loc > dock > undock >= 0`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Weights {
    loc: MicroUnits,
    dock: MicroUnits,
    undock: MicroUnits,
}

/// Why a set of weights was refused.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum WeightsError {
    /// A weight is no number that can be used.
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
        /// The weight of one unit of way.
        loc: MicroUnits,
        /// The weight of one docking.
        dock: MicroUnits,
        /// The weight of one undocking.
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

    /// The cost of one unit of way.
    #[must_use]
    pub fn loc(&self) -> MicroUnits {
        self.loc
    }

    /// The cost of one docking, per link end.
    #[must_use]
    pub fn dock(&self) -> MicroUnits {
        self.dock
    }

    /// The cost of one undocking, per link end.
    #[must_use]
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

/// What a configuration pays for each cut when it chooses its spots; never below zero.
///
/// A cut is a link that it breaks, or an edge between a spot that it takes and a free one that it leaves: on trees, a
/// piece that later turns find cut off. The price decides between places for equally many modules, as the utility
/// does, but is charged to nobody. At zero the utility decides alone; a price above all ways makes it decide only
/// between equally few cuts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CutPrice(MicroUnits);

impl CutPrice {
    /// Nothing is charged.
    pub const ZERO: Self = Self(MicroUnits::ZERO);

    /// What a way of one unit costs at the default weights.
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
    #[must_use]
    pub fn per_cut(&self) -> MicroUnits {
        self.0
    }
}

impl Default for CutPrice {
    fn default() -> Self {
        Self::ONE
    }
}

/// Why a price of cuts was refused.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum CutPriceError {
    /// The price is no number that can be used.
    #[error(transparent)]
    Number(#[from] QuantiseError),
    /// The price is below zero.
    #[error("must not be negative, got {0}")]
    Negative(MicroUnits),
}

/// Everything the user may choose about planning; part of the input that every replica shares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PlannerParameters {
    /// Which planner decides.
    pub policy: Policy,
    /// In which order units take their turns.
    pub order: TurnOrder,
    /// At most how many evictions one chain may make; `None` is unbounded. The paper used 3.
    pub d_max: Option<u32>,
    /// With a bounded `d_max`, let the last turn move singletons as far as it takes to make their allocation
    /// utility-optimal given the blocks. Without a bound it always is. Only for the policy `exact`.
    pub exact_finish: bool,
    /// The weights of the cost of taking a spot.
    pub weights: Weights,
    /// What a configuration pays for each cut when it chooses its spots. Only for the policy `exact`.
    pub cut_price: CutPrice,
    /// Keep every spot even when there are fewer modules than spots, instead of trimming the target.
    pub keep_all_spots: bool,
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
