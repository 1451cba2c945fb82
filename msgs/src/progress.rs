//! How far a formation has come, in answers and feedback.

#![expect(missing_docs, reason = "the .msg files document fields and constants")]

use formation_model::FormationStage;
use formation_verify as verify;
use serde::{Deserialize, Serialize};

use crate::epoch::Epoch;

/// See `Progress.msg`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Progress {
    pub stage: u8,
    pub epoch: Epoch,
    pub expected: u32,
    pub joined: u32,
    pub planned: u32,
    pub agreed: u32,
    pub settled: u32,
    pub to_fill: u32,
    pub waiting_for: Vec<u32>,
}

impl Progress {
    pub const STAGE_WAITING_FOR_TARGET: u8 = 1;
    pub const STAGE_GATHERING: u8 = 2;
    pub const STAGE_PLANNING: u8 = 3;
    pub const STAGE_AGREEING: u8 = 4;
    pub const STAGE_ACTING: u8 = 5;
    pub const STAGE_DONE: u8 = 6;
}

impl From<&verify::Progress> for Progress {
    fn from(progress: &verify::Progress) -> Self {
        let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        Self {
            stage: match progress.stage {
                FormationStage::WaitingForTarget => Self::STAGE_WAITING_FOR_TARGET,
                FormationStage::Gathering => Self::STAGE_GATHERING,
                FormationStage::Planning => Self::STAGE_PLANNING,
                FormationStage::Agreeing => Self::STAGE_AGREEING,
                FormationStage::Acting => Self::STAGE_ACTING,
                FormationStage::Done => Self::STAGE_DONE,
            },
            epoch: progress.epoch.as_ref().into(),
            expected: progress.expected.map_or(0, count),
            joined: count(progress.joined),
            planned: count(progress.planned),
            agreed: count(progress.agreed),
            settled: count(progress.settled),
            to_fill: count(progress.to_fill),
            waiting_for: progress.waiting_for.iter().map(|module| module.0).collect(),
        }
    }
}
