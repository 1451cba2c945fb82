//! The planners that are compared.

use formation_model::{CutPrice, PaperBundle, PlannerParameters, Policy, Spread, TurnOrder};
use serde::{Deserialize, Serialize};

/// A planner and its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Contender {
    /// Algorithms 1 and 2 of the paper as printed, `paper: literal`.
    PaperPolicy,
    /// The same in the most favourable reading, `paper: charitable`.
    PaperCharitable,
    /// Ours with default parameters: units take turns in the paper's order.
    Ours,
    /// Ours with the turn order in which larger configurations come first.
    OursSizeFirst,
    /// Ours with this price of a cut, in tenths of the cost of a unit of distance.
    OursAtPrice(u32),
    /// The auction that the paper compares with.
    Auction,
    /// An optimal assignment by a central solver.
    Hungarian,
}

use Contender::{Auction, Ours, OursSizeFirst, PaperCharitable, PaperPolicy};

pub(crate) const PAPER_AND_OURS: [Contender; 2] = [PaperPolicy, Ours];
pub(crate) const READINGS_AND_OURS: [Contender; 3] = [PaperPolicy, PaperCharitable, Ours];
pub(crate) const WITH_SIZE_FIRST: [Contender; 4] =
    [PaperPolicy, PaperCharitable, Ours, OursSizeFirst];
pub(crate) const WITH_AUCTION: [Contender; 3] = [PaperPolicy, Ours, Auction];

impl Contender {
    /// The planner's parameters; all others have their defaults. Distances count as in the paper, without a spread.
    #[must_use]
    pub fn parameters(self) -> PlannerParameters {
        let (policy, order) = match self {
            Self::PaperPolicy => return PlannerParameters::of_paper(PaperBundle::Literal),
            Self::PaperCharitable => return PlannerParameters::of_paper(PaperBundle::Charitable),
            Self::Ours | Self::OursAtPrice(_) => (Policy::Exact, TurnOrder::Rank),
            Self::OursSizeFirst => (Policy::Exact, TurnOrder::SizeFirst),
            Self::Auction => (Policy::Auction, TurnOrder::Rank),
            Self::Hungarian => (Policy::Hungarian, TurnOrder::Rank),
        };
        let cut_price = match self {
            Self::OursAtPrice(tenths) => {
                CutPrice::from_units(f64::from(tenths) / 10.0).unwrap_or_default()
            }
            _ => CutPrice::default(),
        };
        PlannerParameters {
            policy,
            order,
            cut_price,
            spread: Spread::ZERO,
            ..PlannerParameters::default()
        }
    }

    /// The name in tables.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::PaperPolicy => "paper policy",
            Self::PaperCharitable => "paper policy, charitable",
            Self::Ours => "ours",
            Self::OursSizeFirst => "ours, size first",
            Self::OursAtPrice(_) => "ours, another price",
            Self::Auction => "auction",
            Self::Hungarian => "Hungarian",
        }
    }

    /// The name in CSV files: the label in small letters with underscores.
    #[must_use]
    pub fn key(self) -> String {
        let label = self.label().to_lowercase();
        label.replace(", ", "_").replace(' ', "_")
    }
}
