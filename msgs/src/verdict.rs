//! What travels on `verdict`.

use serde::{Deserialize, Serialize};

use crate::claim::SpotSelection;
use crate::epoch::Epoch;
use crate::standard::Header;

/// See `Verdict.msg`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the .msg file documents the fields")]
pub struct Verdict {
    pub header: Header,
    pub epoch: Epoch,
    pub outcome: u8,
    pub filled_spots: u32,
    pub spots: u32,
    pub open_spots: Vec<u32>,
    pub unassigned_modules: Vec<u32>,
    pub assignments: Vec<SpotSelection>,
    pub violations: Vec<String>,
}

#[expect(missing_docs, reason = "the .msg file documents the constants")]
impl Verdict {
    pub const OUTCOME_COMPLETE: u8 = 1;
    pub const OUTCOME_PARTIAL: u8 = 2;
    pub const OUTCOME_FAILED: u8 = 3;
}
