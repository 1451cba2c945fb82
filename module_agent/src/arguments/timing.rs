//! How long agents wait.

use std::time::Duration;

use formation_protocol::{AgentParameters, ParametersError};
use ros_runtime::parameters::{ParameterError, Tunable, Tunables, seconds, switch};

/// How long agents wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AgentTiming(pub AgentParameters);

/// Whether a module may move depends on how old the heartbeats of others can be.
const ALIKE: &str = "every member relies on the others having the same, so restart all processes with the new value";

impl Tunables for AgentTiming {
    const HEADING: &'static str = "Times";

    fn table() -> Vec<Tunable<Self>> {
        let time = |name, field: fn(&mut Self) -> &mut Duration, help| {
            Tunable::new(name, seconds(), field, help)
        };
        vec![
            time("heartbeat_s", |own| &mut own.0.heartbeat, "Time between two heartbeats")
                .at_start(ALIKE),
            time(
                "suspicion_s",
                |own| &mut own.0.suspicion,
                "A module that is silent for longer is considered failed; a process that starts listens this long",
            )
            .at_start(ALIKE),
            time(
                "lease_s",
                |own| &mut own.0.lease,
                "A module moves only on heartbeats of all members younger than this; less than the suspicion",
            )
            .at_start(ALIKE),
            time(
                "convene_s",
                |own| &mut own.0.convene,
                "The k-th lowest module of the best clique convenes after k times this",
            ),
            time(
                "gather_s",
                |own| &mut own.0.gather,
                "A gathering of an unknown number of modules ends when no further one froze within this",
            ),
            time(
                "gather_limit_s",
                |own| &mut own.0.gather_limit,
                "A gathering that lacks modules ends after this, with those that are there",
            ),
            time(
                "stuck_s",
                |own| &mut own.0.stuck,
                "A claimant, or a member that owes agreement, is left out after this time without progress",
            ),
            time(
                "plan_limit_s",
                |own| &mut own.0.plan_limit,
                "A member that computes its plan is left out after this time; stuck_s does not apply to it",
            ),
            time(
                "motion_limit_s",
                |own| &mut own.0.motion_limit,
                "A unit must reach its spots within this after it starts to move",
            ),
            time(
                "epoch_interval_s",
                |own| &mut own.0.epoch_interval,
                "The least time between two epochs; it doubles with every epoch that does not agree",
            ),
            time(
                "epoch_interval_limit_s",
                |own| &mut own.0.epoch_interval_limit,
                "The greatest time between two epochs",
            ),
            time(
                "pose_interval_s",
                |own| &mut own.0.pose_interval,
                "The least time between two published poses of a moving module",
            ),
            Tunable::new(
                "plan_only",
                switch(),
                |own: &mut Self| &mut own.0.plan_only,
                "Agree on a plan, and do not move",
            ),
        ]
    }

    fn check(&self) -> Result<(), ParameterError> {
        let validated = self.0.validated();
        // The error names the limits; as parameters they end in their unit.
        validated.map(drop).map_err(
            |ParametersError::Order {
                 longer,
                 longer_value,
                 shorter,
                 shorter_value,
             }| {
                ParameterError::new(
                    &format!("{longer}_s"),
                    format!(
                        "must be greater than {shorter}_s ({shorter_value:?}), got {longer_value:?}"
                    ),
                )
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use ros_runtime::settings::Settings;

    use super::*;

    #[test]
    fn the_parameters_of_ros_2_and_of_the_agents_are_the_same() {
        let given = AgentParameters {
            gather: Duration::from_millis(1_234),
            plan_only: true,
            ..AgentParameters::default()
        };
        let read = |timing: AgentParameters| {
            let declarations = AgentTiming(timing).declarations();
            let parameters = Settings::default()
                .declare("module_4", declarations)
                .unwrap();
            let read = AgentTiming::default().read(parameters.values());
            read.map_err(|error| error.to_string())
        };
        assert_eq!(read(given), Ok(AgentTiming(given)));
        let unsafe_lease = AgentParameters {
            lease: Duration::from_secs(6),
            ..given
        };
        assert_eq!(
            read(unsafe_lease).unwrap_err(),
            "parameter `suspicion_s`: must be greater than lease_s (6s), got 5s"
        );
    }
}
