//! The parameters that every node of the suite has.

use std::time::Duration;

use ros2_client::ParameterValue;

use super::declaration::{Change, Declaration, Range};
use super::store::{ParameterError, Values};
use crate::service_mapping::ServiceMapping;

const SERVICES: &str = "start_parameter_services";
const MAPPING: &str = "service_mapping";
const DIAGNOSTICS: &str = "diagnostics_period_s";
const SIMULATED_TIME: &str = "use_sim_time";
const AUTOMATIC: &str = "auto";

const ENDPOINTS_REASON: &str = "it says which endpoints the node has";

/// What every node of the suite can be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeWide {
    /// Whether the node serves its parameters.
    pub parameter_services: bool,
    /// How its services are mapped, unless the middleware's name decides.
    pub service_mapping: Option<ServiceMapping>,
    /// Between two reports on `/diagnostics`; none if there are to be none.
    pub diagnostics_period: Option<Duration>,
}

impl Default for NodeWide {
    fn default() -> Self {
        Self {
            parameter_services: true,
            service_mapping: None,
            diagnostics_period: Some(Duration::from_secs(1)),
        }
    }
}

/// Declares them, with these values unless something is assigned.
pub fn node_wide(values: NodeWide) -> Vec<Declaration> {
    let mapping = values
        .service_mapping
        .map_or_else(|| AUTOMATIC.to_owned(), |mapping| mapping.to_string());
    vec![
        Declaration {
            name: SERVICES,
            description: "Whether the node serves its parameters, which takes 12 endpoints, and whatever else it serves",
            value: ParameterValue::Boolean(values.parameter_services),
            range: Range::Any,
            change: Change::AtStart(ENDPOINTS_REASON),
        },
        Declaration {
            name: MAPPING,
            description: "How services are mapped: as RMW_IMPLEMENTATION needs it, as CycloneDDS does, or as Fast \
                          DDS and Connext do",
            value: ParameterValue::String(mapping),
            range: Range::OneOf(&[AUTOMATIC, "cyclone", "enhanced"]),
            change: Change::AtStart(ENDPOINTS_REASON),
        },
        Declaration {
            name: DIAGNOSTICS,
            description: "Seconds between two reports on /diagnostics; 0 for none",
            value: ParameterValue::Double(
                values
                    .diagnostics_period
                    .map_or(0.0, |period| period.as_secs_f64()),
            ),
            range: Range::Double {
                from: 0.0,
                to: 3_600.0,
            },
            change: Change::AtRunTime,
        },
        Declaration {
            name: SIMULATED_TIME,
            description: "Whether /clock gives the time; this suite compares durations on each process' own clock, so \
                          it must be false",
            value: ParameterValue::Boolean(false),
            range: Range::Any,
            change: Change::AtStart("simulated time is not supported"),
        },
    ]
}

impl NodeWide {
    /// What the parameters say now.
    pub fn of(values: &Values) -> Result<Self, ParameterError> {
        let period = values.seconds(DIAGNOSTICS)?;
        Ok(Self {
            parameter_services: values.boolean(SERVICES)?,
            service_mapping: values.string(MAPPING)?.parse().ok(),
            diagnostics_period: (!period.is_zero()).then_some(period),
        })
    }

    /// Whether simulated time was asked for, which these nodes do not have.
    pub fn wants_simulated_time(values: &Values) -> bool {
        values.boolean(SIMULATED_TIME) == Ok(true)
    }
}
