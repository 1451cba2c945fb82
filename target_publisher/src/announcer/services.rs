//! The services by which people and programs ask how the formation fares, or withdraw its target.

use formation_msgs::{
    QueryStatusRequest, QueryStatusResponse, WithdrawTargetRequest, WithdrawTargetResponse,
};

use ros_runtime::services;

services! {
    /// The serving ends.
    FormationServices,
    /// What one of them was asked.
    Question in "formation_msgs":
    QueryStatus query_status "query_status": QueryStatusRequest => QueryStatusResponse;
    WithdrawTarget withdraw_target "withdraw_target": WithdrawTargetRequest => WithdrawTargetResponse;
}
