//! Judges a formation, independently of the planner.

pub mod judging;
pub mod trace;
pub mod verdict_report;
pub mod verification;
