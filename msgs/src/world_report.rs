//! What travels on `world_report`.

#![expect(missing_docs, reason = "the .msg file documents the fields")]

use serde::{Deserialize, Serialize};

use crate::standard::Header;

/// See `WorldReport.msg`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorldReport {
    pub header: Header,
    pub contacts: u64,
    pub contacts_above_touch: u64,
    pub fastest_contact: f64,
    pub deepest_overlap: f64,
    pub wall_contacts: u64,
    pub docking_attempts: u64,
    pub docking_failures: u64,
    pub folds: u64,
    pub lost_poses: u64,
}
