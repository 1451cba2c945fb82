//! Turns: units decide one after another, and every replica recomputes each decision.

mod block_allocation;
mod decision;
mod outcome;
mod planning;
mod separators;
mod start;
mod trimming;
mod turn_order;
mod turn_result;

pub use outcome::{PlanOutcome, plan};
pub use planning::{ClaimRefused, Planning, Turn};
