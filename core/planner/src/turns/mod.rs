//! Turns: units decide one after another, and every replica recomputes each decision.

mod block_allocation;
mod claiming;
mod decision;
mod follow;
mod outcome;
mod pin_release;
mod planned_turns;
mod planning;
mod separators;
mod start;
mod swapped;
mod trimming;
mod turn_order;
mod turn_result;

pub use outcome::{PlanOutcome, plan};
pub use pin_release::plan_releasing_pins;
pub use planned_turns::PlannedTurns;
pub use planning::{ClaimRefused, Planning, Turn};
pub use swapped::{Swapped, SwappedModule};
