//! The parameters that every node has.

use std::time::Duration;

use super::store::ParameterError;
use super::tunable::{Tunable, Tunables, choice, metres, seconds_in, switch, whole_number};
use crate::service_mapping::ServiceMapping;
use crate::words::Words;

/// The parameters that every node has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeParameters {
    /// Whether the node serves its parameters, and offers its other services.
    pub start_parameter_services: bool,
    /// How its services are mapped; `None` for what the middleware's name says.
    pub service_mapping: Option<ServiceMapping>,
    /// Between two reports on `/diagnostics`; 0 for none.
    pub diagnostics_period: Duration,
    /// Whether `/clock` gives the time, which is not supported.
    pub use_sim_time: bool,
    /// The session to which the node's messages belong; `None` for number 0.
    pub session: Option<u32>,
    /// The metres in the node's unit of length, which is the size of a module; `None` if it was not given.
    pub module_size: Option<f64>,
}

impl Default for NodeParameters {
    fn default() -> Self {
        Self {
            start_parameter_services: true,
            service_mapping: None,
            diagnostics_period: Duration::from_secs(1),
            use_sim_time: false,
            session: None,
            module_size: None,
        }
    }
}

impl Words for Option<ServiceMapping> {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("auto", None),
        ("cyclone", Some(ServiceMapping::Cyclone)),
        ("enhanced", Some(ServiceMapping::Enhanced)),
    ];
}

const ENDPOINTS: &str = "it says which endpoints the node has";

/// The least size of a module, in metres.
const MODULE_SIZE_MIN: f64 = 0.001;

impl Tunables for NodeParameters {
    const HEADING: &'static str = "Node";

    fn check(&self) -> Result<(), ParameterError> {
        if self.module_size.is_some_and(|size| size < MODULE_SIZE_MIN) {
            let reason = format!("must be at least {MODULE_SIZE_MIN}, or 0 for none");
            return Err(ParameterError::new("module_size", reason));
        }
        Ok(())
    }

    fn table() -> Vec<Tunable<Self>> {
        vec![
            Tunable::new(
                "start_parameter_services",
                switch(),
                |node: &mut Self| &mut node.start_parameter_services,
                "Whether the node serves its parameters, which takes 12 endpoints, and offers its other services",
            )
            .at_start(ENDPOINTS),
            Tunable::new(
                "service_mapping",
                choice("MAPPING"),
                |node: &mut Self| &mut node.service_mapping,
                "How services are mapped: as RMW_IMPLEMENTATION needs it, as CycloneDDS does, or as Fast DDS and \
                 Connext do",
            )
            .at_start(ENDPOINTS),
            Tunable::new(
                "diagnostics_period_s",
                seconds_in(0.0, 3_600.0),
                |node: &mut Self| &mut node.diagnostics_period,
                "Time between two reports on /diagnostics, 0 for none",
            ),
            Tunable::new(
                "use_sim_time",
                switch(),
                |node: &mut Self| &mut node.use_sim_time,
                "Whether /clock gives the time; durations are measured on each process' own clock, so it must be false",
            )
            .at_start("simulated time is not supported"),
            Tunable::new(
                "session",
                whole_number(u32::MAX),
                |node: &mut Self| &mut node.session,
                "The session, equal for all programs of one formation: messages of another session are refused",
            )
            .at_start("all messages of a node belong to one session"),
            Tunable::new(
                "module_size",
                metres(1_000.0),
                |node: &mut Self| &mut node.module_size,
                "The size of a module in metres, which is the unit of length, equal for all programs of one formation; \
                 0: that of the scenario file, otherwise 1",
            )
            .at_start("all messages of a node are for modules of one size"),
        ]
    }
}
