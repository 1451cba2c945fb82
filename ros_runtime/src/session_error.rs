//! Why a process could not join the ROS 2 graph, or had to leave it.

use ros2_client::Name;
use thiserror::Error;

use crate::exit::Failure;
use crate::parameters::ParameterError;

/// Why a process could not join the ROS 2 graph, or had to leave it.
#[derive(Debug, Error)]
pub enum SessionError {
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
}

impl From<ParameterError> for SessionError {
    fn from(error: ParameterError) -> Self {
        Self::BadInput(error.to_string())
    }
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::BadInput(_) => Self::BadInput(error.into()),
            SessionError::Failed(_) | SessionError::NotReceiving => Self::Failed(error.into()),
        }
    }
}

/// A fully qualified name, for the library.
pub(crate) fn library_name(name: &str) -> Result<Name, SessionError> {
    Name::parse(name).map_err(|error| bad_name(name, &error))
}

pub(crate) fn bad_name(name: &str, reason: &dyn ToString) -> SessionError {
    let reason = reason.to_string();
    SessionError::BadInput(format!("`{name}` cannot be used in a ROS 2 name: {reason}"))
}
