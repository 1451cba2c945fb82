//! What is asked and answered through the services in `srv/`.

#![expect(missing_docs, reason = "the .srv files document the fields")]

use serde::{Deserialize, Serialize};

use crate::progress::Progress;

/// The request of `QueryStatus.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "QueryStatus_Request")]
pub struct QueryStatusRequest {
    pub include_waiting: bool,
}

/// The response of `QueryStatus.srv`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "QueryStatus_Response")]
pub struct QueryStatusResponse {
    pub target: String,
    pub revision: u64,
    pub progress: Progress,
}

/// The request of `WithdrawTarget.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "WithdrawTarget_Request")]
pub struct WithdrawTargetRequest {
    pub revision: u64,
}

/// The response of `WithdrawTarget.srv`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "WithdrawTarget_Response")]
pub struct WithdrawTargetResponse {
    pub success: bool,
    pub message: String,
}

/// The request of `AddModule.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename = "AddModule_Request")]
pub struct AddModuleRequest {
    pub module_id: u32,
    pub x: f64,
    pub y: f64,
    pub theta: f64,
}

/// The response of `AddModule.srv`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "AddModule_Response")]
pub struct AddModuleResponse {
    pub success: bool,
    pub message: String,
}

/// The request of `RemoveModule.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "RemoveModule_Request")]
pub struct RemoveModuleRequest {
    pub module_id: u32,
    pub incarnation: u64,
}

/// The response of `RemoveModule.srv`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "RemoveModule_Response")]
pub struct RemoveModuleResponse {
    pub success: bool,
    pub message: String,
}

/// The request of `StopFormation.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "StopFormation_Request")]
pub struct StopFormationRequest {
    pub resume: bool,
}

/// The response of `StopFormation.srv`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "StopFormation_Response")]
pub struct StopFormationResponse {
    pub success: bool,
    pub message: String,
}

/// The request of `RetireModule.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "RetireModule_Request")]
pub struct RetireModuleRequest {
    pub module_id: u32,
    pub rejoin: bool,
}

/// The response of `RetireModule.srv`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "RetireModule_Response")]
pub struct RetireModuleResponse {
    pub success: bool,
    pub message: String,
}
