//! Why a process could not join the ROS 2 graph, or had to leave it.

use std::time::Duration;

use ros2_client::Name;
use thiserror::Error;

use crate::exit::Failure;
use crate::parameters::ParameterError;

/// Why a process could not join the ROS 2 graph, or had to leave it.
#[derive(Debug, Error)]
pub enum RosContextError {
    /// A name, a parameter or the network of the machine cannot be used.
    #[error("{0}")]
    BadInput(String),
    /// The DDS library refused, or the node cannot do its work.
    #[error("{0}")]
    Failed(String),
    /// The DDS library has ended its threads, as it does when the process was stopped and continues.
    #[error(
        "the DDS library no longer receives, as happens when a process is stopped and continues"
    )]
    NotReceiving,
    /// The machine got addresses after the DDS library had read them, which it does once.
    #[error("this machine is now reached at {0}, where the DDS library does not listen yet")]
    NewAddresses(String),
    /// The network was away for longer than the DDS library remembers others, which it does not match again.
    #[error(
        "a publisher of `{0}` is back that was lost, and the DDS library does not match it again"
    )]
    PublisherIsBack(String),
    /// The wall clock of this machine was set back by this much, and the library reads no best-effort samples until it is
    /// there again.
    #[error(
        "the clock of this machine was set back by {:.1} s, and the DDS library would read no heartbeat for as long",
        .0.as_secs_f64()
    )]
    ClockSetBack(Duration),
    /// By the heartbeats of others, the clock that counts on while the wall clock is set stood still for this long.
    #[error(
        "the clock of this machine stood still for {:.1} s, and others take its heartbeats for old ones",
        .0.as_secs_f64()
    )]
    ClockStoodStill(Duration),
}

impl RosContextError {
    /// Whether the process receives again once it has joined the graph anew.
    #[must_use]
    pub fn ends_with_rejoining(&self) -> bool {
        matches!(
            self,
            Self::NotReceiving
                | Self::NewAddresses(_)
                | Self::PublisherIsBack(_)
                | Self::ClockSetBack(_)
                | Self::ClockStoodStill(_)
        )
    }
}

impl From<ParameterError> for RosContextError {
    fn from(error: ParameterError) -> Self {
        Self::BadInput(error.to_string())
    }
}

impl From<RosContextError> for Failure {
    fn from(error: RosContextError) -> Self {
        match error {
            RosContextError::BadInput(_) => Self::BadInput(error.into()),
            RosContextError::Failed(_)
            | RosContextError::NotReceiving
            | RosContextError::NewAddresses(_)
            | RosContextError::PublisherIsBack(_)
            | RosContextError::ClockSetBack(_)
            | RosContextError::ClockStoodStill(_) => Self::Failed(error.into()),
        }
    }
}

/// A fully qualified name, for the library.
pub(crate) fn library_name(name: &str) -> Result<Name, RosContextError> {
    Name::parse(name).map_err(|error| bad_name(name, &error))
}

pub(crate) fn bad_name(name: &str, reason: &dyn ToString) -> RosContextError {
    let reason = reason.to_string();
    RosContextError::BadInput(format!("`{name}` cannot be used in a ROS 2 name: {reason}"))
}
