//! Independent checks: of a plan, and of a formation as seen on the topics.
//!
//! Nothing here is shared with the planner: what it decides is recomputed or replayed from its decisions, never asked
//! of it. So a fault in the planner cannot hide itself.

mod observer;
mod plan;
mod replay;
mod report;
mod violation;

pub use observer::{
    Agreement, Counts, Observer, ObserverParameters, Outcome, Progress, Timings, Verdict,
};
pub use plan::check_plan;
pub use report::{AgreementReport, ReportLine, TimingsReport, VerdictReport, outcome_text};
pub use violation::{Missing, Violation};
