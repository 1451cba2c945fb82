//! How long agents wait.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use clap::Args;
use formation::agent::AgentParameters;

use crate::outcome::Failure;

/// The longest time that an argument may name: a week.
const SECONDS_MAX: f64 = 604_800.0;

/// A time in seconds, greater than zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seconds(pub Duration);

impl FromStr for Seconds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.trim()
            .parse::<f64>()
            .ok()
            .filter(|seconds| (0.001..=SECONDS_MAX).contains(seconds))
            .map(|seconds| Self(Duration::from_secs_f64(seconds)))
            .ok_or_else(|| format!("must be seconds from 0.001 to {SECONDS_MAX}, got `{text}`"))
    }
}

impl fmt::Display for Seconds {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.as_secs_f64().fmt(formatter)
    }
}

macro_rules! timing_arguments {
    ($($(#[doc = $help:literal])+ $argument:ident => $parameter:ident,)+) => {
        /// How long the agents wait, in seconds.
        #[derive(Clone, Copy, Debug, Args)]
        #[command(next_help_heading = "Times")]
        pub struct TimingArguments {
            $(
                $(#[doc = $help])+
                #[arg(long, value_name = "SECONDS", default_value_t = Seconds(AgentParameters::default().$parameter))]
                pub $argument: Seconds,
            )+
            /// Agree on a plan, and stay where the modules are
            #[arg(long, help_heading = "Motion")]
            pub plan_only: bool,
        }

        impl TimingArguments {
            /// The agents' parameters.
            ///
            /// # Errors
            /// Names the two times that stand in an order in which the protocol would not be safe.
            pub fn parameters(&self) -> Result<AgentParameters, Failure> {
                AgentParameters {
                    $($parameter: self.$argument.0,)+
                    plan_only: self.plan_only,
                }
                .validated()
                .map_err(Failure::bad_input)
            }
        }
    };
}

timing_arguments! {
    /// Between two heartbeats
    heartbeat_s => heartbeat,
    /// A module that was not heard for so long is taken for dead; a process that starts listens for so long
    suspicion_s => suspicion,
    /// A module moves only while every member was heard within this; less than the suspicion
    lease_s => lease,
    /// The k-th lowest live module steps in as convener after k times this
    convene_s => convene,
    /// Without a known number of modules, a gathering ends when nothing new came for so long
    gather_s => gather,
    /// A gathering that lacks modules ends after this, with those that are there
    gather_limit_s => gather_limit,
    /// A claimant, or a member that owes agreement, is taken for dead after so long without progress
    stuck_s => stuck,
    /// A unit must reach its spots within this time of starting to move
    motion_limit_s => motion_limit,
    /// The least time between two epochs; it doubles with every epoch that does not agree
    epoch_interval_s => epoch_interval,
    /// The greatest time between two epochs
    epoch_interval_limit_s => epoch_interval_limit,
    /// The least time between two announcements of the pose on the way
    pose_interval_s => pose_interval,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_finite_and_positive() {
        assert_eq!("0.5".parse(), Ok(Seconds(Duration::from_millis(500))));
        for bad in ["0", "-1", "inf", "NaN", "1e9", "soon", ""] {
            assert!(bad.parse::<Seconds>().is_err(), "{bad}");
        }
    }
}
