//! The faults of a driver outside the process.

use std::time::Duration;

use thiserror::Error;

use formation_model::DockingRequest;

/// A fault of a driver, described by its message.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the message of each variant describes it")]
pub enum DriveFault {
    #[error(
        "its driver reported no pose within pose_limit_s ({} s) while it was to move",
        limit.as_secs_f64()
    )]
    NoPose { limit: Duration },
    #[error(
        "does not stand still within halt_limit_s ({} s) after its goals ceased",
        limit.as_secs_f64()
    )]
    NotStanding { limit: Duration },
    #[error(
        "its driver did not answer the request to {request} within docking_limit_s ({} s)",
        limit.as_secs_f64()
    )]
    DockingUnanswered {
        request: DockingRequest,
        limit: Duration,
    },
    #[error("its driver cannot {request}: {reason}")]
    DockingRefused {
        request: DockingRequest,
        reason: String,
    },
}
