//! What is asked and answered through the services in `srv/`.

use serde::{Deserialize, Serialize};

use crate::progress::Progress;

/// The request of `QueryStatus.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "QueryStatus_Request")]
#[expect(missing_docs, reason = "the .srv file documents the fields")]
pub struct QueryStatusRequest {
    pub include_waiting: bool,
}

/// The response of `QueryStatus.srv`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "QueryStatus_Response")]
#[expect(missing_docs, reason = "the .srv file documents the fields")]
pub struct QueryStatusResponse {
    pub target: String,
    pub revision: u64,
    pub progress: Progress,
}

/// The request of `WithdrawTarget.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "WithdrawTarget_Request")]
#[expect(missing_docs, reason = "the .srv file documents the fields")]
pub struct WithdrawTargetRequest {
    pub revision: u64,
}

/// The response of `WithdrawTarget.srv`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "WithdrawTarget_Response")]
#[expect(missing_docs, reason = "the .srv file documents the fields")]
pub struct WithdrawTargetResponse {
    pub success: bool,
    pub message: String,
}
