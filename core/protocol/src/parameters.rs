//! The time limits and rates of an agent, each with its default.

use std::time::Duration;

use thiserror::Error;

use formation_model::Timing;

/// The time limits and rates of an agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AgentParameters {
    /// The time between two heartbeats.
    pub heartbeat: Duration,
    /// A module that is silent for longer than this is considered failed; a process that starts listens for this long before
    /// it convenes.
    pub suspicion: Duration,
    /// A module moves only while every member's latest heartbeat is younger than this; less than `suspicion`.
    pub lease: Duration,
    /// The k-th lowest module of the best clique convenes after k times this.
    pub convene: Duration,
    /// Without a known number of modules, a gathering ends when no module joined it for this long.
    pub gather: Duration,
    /// A gathering that lacks modules ends after this at the latest, with those that have gathered.
    pub gather_limit: Duration,
    /// A claimant, or a member whose agreement is missing, is considered failed after this long without progress.
    pub stuck: Duration,
    /// A member that computes its plan has this long before it is considered failed; `stuck` does not apply to it.
    pub plan_limit: Duration,
    /// A module must reach its spot within this time of starting to move.
    pub motion_limit: Duration,
    /// The least time between two epochs; it doubles with every epoch that does not agree.
    pub epoch_interval: Duration,
    /// The greatest time between two epochs.
    pub epoch_interval_limit: Duration,
    /// The least time between two states of a module that only moved.
    pub pose_interval: Duration,
    /// Plan and agree, but never move: for a look at the plan alone.
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
            plan_limit: Duration::from_secs(60),
            motion_limit: Duration::from_secs(120),
            epoch_interval: Duration::from_secs(1),
            epoch_interval_limit: Duration::from_secs(16),
            pose_interval: Duration::from_millis(200),
            plan_only: false,
        }
    }
}

/// Why a set of time limits is not valid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ParametersError {
    /// A limit must be longer than another for the protocol to be safe.
    #[error("{longer} ({longer_value:?}) must be greater than {shorter} ({shorter_value:?})")]
    Order {
        /// The name of the limit that must be longer.
        longer: &'static str,
        /// The value given for it.
        longer_value: Duration,
        /// The name of the limit that must be shorter.
        shorter: &'static str,
        /// The value given for it.
        shorter_value: Duration,
    },
}

impl AgentParameters {
    /// The times that all members of a roster must have in common.
    #[must_use]
    pub fn timing(&self) -> Timing {
        Timing {
            heartbeat: self.heartbeat,
            suspicion: self.suspicion,
            lease: self.lease,
        }
    }

    /// How old a run must be so that what its former run showed counts for nobody any more, and how long after all members of a roster
    /// froze nobody can be in motion by another one: a lease, and what clocks and delays may add to that.
    pub(super) fn idle_age(&self) -> Duration {
        self.lease + self.heartbeat
    }

    /// Checks that the limits are in the order on which the safety of the protocol depends.
    ///
    /// # Errors
    /// The first pair of limits that is in the wrong order.
    /// Enforces A5.
    pub fn validated(self) -> Result<Self, ParametersError> {
        let pairs = [
            ("heartbeat", self.heartbeat, "zero", Duration::ZERO),
            ("lease", self.lease, "heartbeat", self.heartbeat),
            ("suspicion", self.suspicion, "lease", self.lease),
            ("gather_limit", self.gather_limit, "gather", self.gather),
            ("stuck", self.stuck, "lease", self.lease),
            ("plan_limit", self.plan_limit, "lease", self.lease),
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

    /// Shows A5.
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
