//! The time limits and rates of an agent, each with its default.

use std::time::Duration;

use thiserror::Error;

/// How an agent waits, and for how long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AgentParameters {
    /// Between two heartbeats.
    pub heartbeat: Duration,
    /// A module that was not heard for so long is taken for dead; a process that starts listens for so long before it convenes.
    pub suspicion: Duration,
    /// A module moves only while every member's latest heartbeat is younger than this; less than `suspicion`.
    pub lease: Duration,
    /// The k-th lowest live module steps in as convener after k times this.
    pub convene: Duration,
    /// Without a known number of modules, a gathering ends when nothing new came for so long.
    pub gather: Duration,
    /// A gathering that lacks modules ends after this at the latest, with those that are there.
    pub gather_limit: Duration,
    /// A claimant, or a member that owes agreement, is taken for dead after so long without progress.
    pub stuck: Duration,
    /// A unit must reach its spots within this time of starting to move.
    pub motion_limit: Duration,
    /// The least time between two epochs; it doubles with every epoch that does not agree.
    pub epoch_interval: Duration,
    /// The greatest time between two epochs.
    pub epoch_interval_limit: Duration,
    /// The least time between two announcements of the pose on the way.
    pub pose_interval: Duration,
    /// Agree, but never set off: for those who only want to see what would be decided.
    pub plan_only: bool,
}

impl Default for AgentParameters {
    fn default() -> Self {
        Self {
            heartbeat: Duration::from_millis(500),
            suspicion: Duration::from_secs(5),
            lease: Duration::from_millis(2_500),
            convene: Duration::from_millis(1_000),
            gather: Duration::from_millis(2_000),
            gather_limit: Duration::from_secs(30),
            stuck: Duration::from_secs(10),
            motion_limit: Duration::from_secs(120),
            epoch_interval: Duration::from_secs(1),
            epoch_interval_limit: Duration::from_secs(16),
            pose_interval: Duration::from_millis(200),
            plan_only: false,
        }
    }
}

/// Why a set of time limits was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ParametersError {
    /// A limit must be longer than another for the protocol to be safe.
    #[error("{longer} ({longer_value:?}) must be greater than {shorter} ({shorter_value:?})")]
    Order {
        /// The name of the limit that must be longer.
        longer: &'static str,
        /// What was given for it.
        longer_value: Duration,
        /// The name of the limit that must be shorter.
        shorter: &'static str,
        /// What was given for it.
        shorter_value: Duration,
    },
}

impl AgentParameters {
    /// Checks that the limits stand in the order on which the protocol's safety rests.
    ///
    /// # Errors
    /// Names the first pair of limits that stand in the wrong order.
    pub fn validated(self) -> Result<Self, ParametersError> {
        let pairs = [
            ("heartbeat", self.heartbeat, "zero", Duration::ZERO),
            ("lease", self.lease, "heartbeat", self.heartbeat),
            ("suspicion", self.suspicion, "lease", self.lease),
            ("gather_limit", self.gather_limit, "gather", self.gather),
            ("stuck", self.stuck, "lease", self.lease),
            ("motion_limit", self.motion_limit, "lease", self.lease),
        ];
        for (longer, longer_value, shorter, shorter_value) in pairs {
            if longer_value <= shorter_value {
                return Err(ParametersError::Order {
                    longer,
                    longer_value,
                    shorter,
                    shorter_value,
                });
            }
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_valid_and_a_long_lease_is_not() {
        assert!(AgentParameters::default().validated().is_ok());
        let wrong = AgentParameters {
            lease: Duration::from_secs(6),
            ..AgentParameters::default()
        };
        assert_eq!(
            wrong.validated().unwrap_err().to_string(),
            "suspicion (5s) must be greater than lease (6s)"
        );
    }
}
