//! The planner: which module takes which spot, and in which order the modules move there.
//!
//! Every agent steps through the same [turns](Planning) and reaches the same plan, bit for bit. [`plan`] runs all turns at
//! once, offline.

mod assembly;
pub mod assignment;
mod barrier;
pub mod baseline;
mod cost;
mod explanation;
mod given;
#[cfg(test)]
mod grid;
pub mod placement;
pub mod policies;
mod rooted_tree;
mod statistics;
mod turns;
mod value;

pub use barrier::Barrier;
pub use cost::{PLAN_TIME_MAX, PlanSize, PlanTooLong};
pub use explanation::{Alternative, ConcernedTurn, Explanation, TurnOutcome};
pub use given::{detached_by, given_by, plan_with_allocation};
pub use statistics::{Changes, Disconnected, MessageCounts, Statistics};
pub use turns::{
    ClaimRefused, PlanOutcome, PlannedTurns, Planning, Swapped, SwappedModule, Turn, plan,
    plan_releasing_pins,
};
pub use value::{Utilities, betweenness, share_of_shortest_paths};
