//! What travels in the action `FormConfiguration`.

#![expect(missing_docs, reason = "the .action file documents the fields")]

use serde::{Deserialize, Serialize};

use crate::progress::Progress;
use crate::target::TargetConfiguration;
use crate::verdict::Verdict;

/// The goal of `FormConfiguration.action`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename = "FormConfiguration_Goal")]
pub struct FormConfigurationGoal {
    pub scenario: String,
    pub target: TargetConfiguration,
    pub expected_modules: u32,
}

/// The result of `FormConfiguration.action`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "FormConfiguration_Result")]
pub struct FormConfigurationResult {
    pub verdict: Verdict,
    pub message: String,
}

/// The feedback of `FormConfiguration.action`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "FormConfiguration_Feedback")]
pub struct FormConfigurationFeedback {
    pub progress: Progress,
}
