//! The swap of spots after the claims, as `plan` and `run` print it.

use formation_model::text::{counted, enumerated};
use formation_planner::{Swapped, SwappedModule};
use serde::Serialize;

/// The modules that the text names.
const NAMED_MAX: usize = 20;

/// What `--json` prints of a swap.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SwapReport {
    /// The modules whose spots changed after the claims.
    modules: Vec<SwappedModule>,
    /// By how much the total utility fell.
    given_up_utility: f64,
    /// By how much the total distance rose.
    added_distance: f64,
}

impl From<&Swapped> for SwapReport {
    fn from(swapped: &Swapped) -> Self {
        Self {
            modules: swapped.modules.clone(),
            given_up_utility: swapped.utility.to_units(),
            added_distance: swapped.distance.to_units(),
        }
    }
}

impl SwapReport {
    /// A sentence.
    pub fn text(&self) -> String {
        let modules = self.modules.iter().map(change);
        let named = match self.modules.len() > NAMED_MAX {
            true => String::new(),
            false => format!(": {}", enumerated(modules, usize::MAX)),
        };
        format!(
            "swapped after the claims, as no motion leads to the spots claimed: {}{named}; given up: {:.3} units of total \
             distance, {:.3} of total utility",
            counted(self.modules.len(), "module"),
            self.added_distance,
            self.given_up_utility,
        )
    }
}

/// From which spot to which a module changes.
pub fn change(one: &SwappedModule) -> String {
    let module = one.module;
    match (one.claimed, one.spot) {
        (Some(claimed), Some(spot)) => format!("{module} from {claimed} to {spot}"),
        (Some(claimed), None) => format!("{module} from {claimed} to none"),
        (None, Some(spot)) => format!("{module} to {spot}"),
        (None, None) => module.to_string(),
    }
}
