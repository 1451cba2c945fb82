//! Independent checks of a plan, and of a formation by the messages on its topics.
//!
//! This shares no code with the planner: plans are recomputed or replayed from their decisions. So a fault in the planner
//! cannot hide itself.

mod observer;
mod plan;
mod replay;
mod source_guard;
mod swaps;
pub mod trace;
mod violation;

pub use observer::{
    Agreement, CollisionRisk, Counts, Observer, ObserverParameters, Outcome, Progress, Timings,
    Verdict,
};
pub use plan::{check_plan, check_swapped_plan, hole_of};
pub use source_guard::{Admission, SourceGuard};
pub use violation::{Missing, Violation};
