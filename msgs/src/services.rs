//! What is asked and answered through the services in `srv/`.

#![expect(missing_docs, reason = "the .srv files document the fields")]

use serde::{Deserialize, Serialize};

use crate::bounds::{ANSWER_BYTES_MAX, shortened};
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

/// The request of `AddModule.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename = "AddModule_Request")]
pub struct AddModuleRequest {
    pub module_id: u32,
    pub x: f64,
    pub y: f64,
    pub theta: f64,
}

/// The request of `PushModule.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename = "PushModule_Request")]
pub struct PushModuleRequest {
    pub module_id: u32,
    pub x: f64,
    pub y: f64,
    pub order: u64,
}

/// The request of `RemoveModule.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "RemoveModule_Request")]
pub struct RemoveModuleRequest {
    pub module_id: u32,
    pub incarnation: u64,
}

/// The request of `StopFormation.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "StopFormation_Request")]
pub struct StopFormationRequest {
    pub resume: bool,
}

/// The request of `RetireModule.srv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "RetireModule_Request")]
pub struct RetireModuleRequest {
    pub module_id: u32,
    pub rejoin: bool,
}

/// The responses that say what will happen, or why nothing does.
macro_rules! answers {
    ($($(#[$documentation:meta])* $response:ident = $name:literal;)+) => {$(
        $(#[$documentation])*
        #[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        #[serde(rename = $name)]
        pub struct $response {
            pub success: bool,
            pub message: String,
        }

        impl From<Result<String, String>> for $response {
            /// A longer message is cut to its bound.
            fn from(outcome: Result<String, String>) -> Self {
                Self {
                    success: outcome.is_ok(),
                    message: shortened(outcome.unwrap_or_else(|reason| reason), ANSWER_BYTES_MAX),
                }
            }
        }
    )+};
}

answers! {
    /// The response of `WithdrawTarget.srv`.
    WithdrawTargetResponse = "WithdrawTarget_Response";
    /// The response of `AddModule.srv`.
    AddModuleResponse = "AddModule_Response";
    /// The response of `PushModule.srv`.
    PushModuleResponse = "PushModule_Response";
    /// The response of `RemoveModule.srv`.
    RemoveModuleResponse = "RemoveModule_Response";
    /// The response of `StopFormation.srv`.
    StopFormationResponse = "StopFormation_Response";
    /// The response of `RetireModule.srv`.
    RetireModuleResponse = "RetireModule_Response";
}
