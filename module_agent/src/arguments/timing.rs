//! How long agents wait.

use clap::Args;
use formation::protocol::{AgentParameters, ParametersError};
use ros_runtime::arguments::{SECONDS, Seconds};
use ros2_client::ParameterValue;

use ros_runtime::outcome::Failure;
use ros_runtime::parameters::{Change, Declaration, ParameterError, Range, Values};

macro_rules! timing_arguments {
    ($($(#[doc = $help:literal])+ $argument:ident => $parameter:ident, $change:expr;)+) => {
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

        /// Declares the agents' parameters for ROS 2, with these values unless something is assigned.
        pub(crate) fn agent_declarations(values: &AgentParameters) -> Vec<Declaration> {
            vec![
                $(Declaration {
                    name: stringify!($argument),
                    description: concat!("In seconds:", $($help),+),
                    value: ParameterValue::Double(values.$parameter.as_secs_f64()),
                    range: SECONDS,
                    change: $change,
                },)+
                Declaration {
                    name: PLAN_ONLY,
                    description: "Agree on a plan, and do not set off",
                    value: ParameterValue::Boolean(values.plan_only),
                    range: Range::Any,
                    change: Change::AtRunTime,
                },
            ]
        }

        /// The agents' parameters as ROS 2 has them now.
        pub(crate) fn agent_parameters(values: &Values) -> Result<AgentParameters, ParameterError> {
            AgentParameters {
                $($parameter: values.seconds(stringify!($argument))?,)+
                plan_only: values.boolean(PLAN_ONLY)?,
            }
            .validated()
            // The error names the limits; as parameters they end in their unit.
            .map_err(|ParametersError::Order { longer, longer_value, shorter, shorter_value }| {
                ParameterError::new(
                    &format!("{longer}_s"),
                    format!("must be greater than {shorter}_s ({shorter_value:?}), got {longer_value:?}"),
                )
            })
        }
    };
}

const PLAN_ONLY: &str = "plan_only";

/// Whether a module may move rests on how old the others' heartbeats can be.
const ALIKE: Change = Change::AtStart(
    "whoever takes part relies on the others having the same, so restart all processes with the new value",
);

timing_arguments! {
    /// Between two heartbeats
    heartbeat_s => heartbeat, ALIKE;
    /// A module that was not heard for so long is taken for dead; a process that starts listens for so long
    suspicion_s => suspicion, ALIKE;
    /// A module moves only while every member was heard within this; less than the suspicion
    lease_s => lease, ALIKE;
    /// The k-th lowest live module steps in as convener after k times this
    convene_s => convene, Change::AtRunTime;
    /// Without a known number of modules, a gathering ends when nothing new came for so long
    gather_s => gather, Change::AtRunTime;
    /// A gathering that lacks modules ends after this, with those that are there
    gather_limit_s => gather_limit, Change::AtRunTime;
    /// A claimant, or a member that owes agreement, is taken for dead after so long without progress
    stuck_s => stuck, Change::AtRunTime;
    /// A unit must reach its spots within this time of starting to move
    motion_limit_s => motion_limit, Change::AtRunTime;
    /// The least time between two epochs; it doubles with every epoch that does not agree
    epoch_interval_s => epoch_interval, Change::AtRunTime;
    /// The greatest time between two epochs
    epoch_interval_limit_s => epoch_interval_limit, Change::AtRunTime;
    /// The least time between two announcements of the pose on the way
    pose_interval_s => pose_interval, Change::AtRunTime;
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::time::Duration;

    use super::*;
    use ros_runtime::parameters::Parameters;

    #[test]
    fn parameters_of_ros_2_and_of_the_agents_are_the_same() {
        let given = AgentParameters {
            gather: Duration::from_millis(1_234),
            plan_only: true,
            ..AgentParameters::default()
        };
        let of = |values: &AgentParameters| {
            let (parameters, _) =
                Parameters::declare(agent_declarations(values), &BTreeMap::new()).unwrap();
            agent_parameters(parameters.values()).map_err(|error| error.to_string())
        };
        assert_eq!(of(&given), Ok(given));
        let unsafe_lease = AgentParameters {
            lease: Duration::from_secs(6),
            ..given
        };
        assert_eq!(
            of(&unsafe_lease).unwrap_err(),
            "parameter `suspicion_s`: must be greater than lease_s (6s), got 5s"
        );
    }
}
