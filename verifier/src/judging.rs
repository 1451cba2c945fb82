//! How a formation is judged.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use formation::model::MicroUnits;
use formation::verify::ObserverParameters;
use ros2_client::ParameterValue;

use formation_node::scenario::read_scenario;
use ros_runtime::arguments::{SECONDS, Seconds};
use ros_runtime::outcome::Failure;
use ros_runtime::parameters::{Change, Declaration, ParameterError, Range, Values};

/// How a formation is judged.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Judging")]
pub struct JudgingArguments {
    /// Scenario file whose modules are to take part, so that absent ones can be named
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// A formation that is not done so long after its target was announced has failed
    #[arg(long, alias = "timeout-s", value_name = "SECONDS", default_value_t = Seconds(Duration::from_secs(60)))]
    pub time_limit_s: Seconds,
    /// How far a settled module may stand from its spot, in units
    #[arg(long, value_name = "UNITS", default_value_t = 0.05, value_parser = tolerance)]
    pub tolerance: f64,
    /// By how much its heading may differ, in radians
    #[arg(long, value_name = "RADIANS", default_value_t = 0.05, value_parser = tolerance)]
    pub heading_tolerance: f64,
    /// What is reached but not yet right may take so long to become right
    #[arg(long, value_name = "SECONDS", default_value_t = Seconds(Duration::from_secs(3)))]
    pub grace_s: Seconds,
    /// A member that was not heard for so long does not count as living; the suspicion of the agents
    #[arg(long, value_name = "SECONDS", default_value_t = Seconds(Duration::from_secs(5)))]
    pub silence_s: Seconds,
}

impl JudgingArguments {
    /// The observer's parameters.
    ///
    /// # Errors
    /// Names the file or argument that is wrong.
    pub fn parameters(&self) -> Result<ObserverParameters, Failure> {
        let micro = |argument: &str, value| {
            MicroUnits::from_units(value)
                .map_err(|error| Failure::bad_input(format_args!("{argument}: {error}")))
        };
        let expected = match &self.scenario {
            Some(path) => read_scenario(path)?
                .problem()
                .modules()
                .iter()
                .map(|module| module.id)
                .collect(),
            None => Default::default(),
        };
        Ok(ObserverParameters {
            position_tolerance: micro("--tolerance", self.tolerance)?,
            heading_tolerance: micro("--heading-tolerance", self.heading_tolerance)?,
            time_limit: self.time_limit_s.0,
            grace: self.grace_s.0,
            silence: self.silence_s.0,
            expected,
        })
    }
}

const TIME_LIMIT: &str = "time_limit_s";
const GRACE: &str = "grace_s";
const TOLERANCE: &str = "tolerance";
const HEADING_TOLERANCE: &str = "heading_tolerance";
const TOLERANCE_MAX: f64 = 1.0e3;
const SETTLED: Change = Change::AtStart("a formation is judged by what held when watching began");

/// Declares how a formation is judged, for ROS 2, with these values unless something is assigned.
pub(crate) fn judging_declarations(values: &ObserverParameters) -> Vec<Declaration> {
    let tolerance = Range::Double {
        from: 0.0,
        to: TOLERANCE_MAX,
    };
    let declaration = |name, description, value, range| Declaration {
        name,
        description,
        value: ParameterValue::Double(value),
        range,
        change: SETTLED,
    };
    vec![
        declaration(
            TIME_LIMIT,
            "A formation that is not done so many seconds after its target was announced has failed",
            values.time_limit.as_secs_f64(),
            SECONDS,
        ),
        declaration(
            GRACE,
            "What is reached but not yet right may take so many seconds to become right",
            values.grace.as_secs_f64(),
            SECONDS,
        ),
        declaration(
            TOLERANCE,
            "How far a settled module may stand from its spot, in units",
            values.position_tolerance.to_units(),
            tolerance.clone(),
        ),
        declaration(
            HEADING_TOLERANCE,
            "By how much its heading may differ, in radians",
            values.heading_tolerance.to_units(),
            tolerance,
        ),
    ]
}

/// How a formation is judged, as ROS 2 has it.
pub(crate) fn judging_parameters(
    values: &Values,
    given: ObserverParameters,
) -> Result<ObserverParameters, ParameterError> {
    let micro = |name| {
        MicroUnits::from_units(values.double(name)?)
            .map_err(|error| ParameterError::new(name, error.to_string()))
    };
    Ok(ObserverParameters {
        position_tolerance: micro(TOLERANCE)?,
        heading_tolerance: micro(HEADING_TOLERANCE)?,
        time_limit: values.seconds(TIME_LIMIT)?,
        grace: values.seconds(GRACE)?,
        ..given
    })
}

fn tolerance(text: &str) -> Result<f64, String> {
    text.trim()
        .parse::<f64>()
        .ok()
        .filter(|tolerance| (0.0..=TOLERANCE_MAX).contains(tolerance))
        .ok_or_else(|| format!("must be a number from 0 to {TOLERANCE_MAX}, got `{text}`"))
}

#[cfg(test)]
mod tests {
    use formation_tests::parameter_section;
    use ros_runtime::arguments::assigned_in;
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn the_shipped_file_lists_every_parameter_with_its_default() {
        let shipped: BTreeMap<String, ParameterValue> = ["The verifier"]
            .into_iter()
            .flat_map(|title| assigned_in(&parameter_section(title)).unwrap())
            .collect();
        let declarations = judging_declarations(&ObserverParameters {
            time_limit: Duration::from_secs(60),
            ..ObserverParameters::default()
        });
        let declared = declarations.into_iter();
        let declared = declared.map(|declaration| (declaration.name.to_owned(), declaration.value));
        assert_eq!(shipped, declared.collect());
    }
}
