//! What the launcher and the Python package compute without processes.
//!
//! A [`CheckedPlan`] is the plan of the core, checked by the verifier; the others are what `formation check`, `explain`, `generate`,
//! `import` and `simulate` print. *Invariant*: both users get the same numbers, as both print the same values.

#[cfg(feature = "simulator")]
mod campaign;
mod cgshop_solution;
mod check;
mod checked_plan;
mod explain;
#[cfg(feature = "maps")]
mod import;
mod motion;
mod policy_instance;
mod scenario_text;
mod spread;
mod stopwatch;
mod swap;
mod table;
mod trace;
mod warnings;

#[cfg(feature = "simulator")]
pub use campaign::{Campaign, Figures, SIMULATED_MODULES_MAX, campaign_parameters, counted_u64};
pub use cgshop_solution::{CgshopSolution, NoCgshopSolution};
pub use check::{CheckReport, docked_count};
pub use checked_plan::{
    ByAllocationError, CheckedPlan, GuaranteeBroken, PlanReport, PlanStage, PlanTurn,
    SPEED_UNITS_PER_S,
};
pub use explain::{ExplanationReport, explanation_text};
#[cfg(feature = "maps")]
pub use import::{ImportError, ImportOptions, import, map_bytes_max};
pub use policy_instance::PolicyInstance;
pub use scenario_text::{as_in_a_file, field_percent, generated, to_yaml, whole_yaml};
pub use spread::WithoutSpread;
pub use table::aligned;
pub use trace::{TraceError, TraceVerdict, read_trace, verify_trace};
pub use warnings::of as oddities;
