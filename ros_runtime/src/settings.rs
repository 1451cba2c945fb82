//! The place of a process in the ROS 2 graph, as the command line and the environment give it.

use crate::arguments::{Namespace, NodeIdentity, RosArguments};
use crate::environment::Environment;
use crate::middleware::Middleware;
use crate::parameters::{Declaration, NodeParameters, ParameterError, Parameters, Tunables};
use crate::rosout::LogLines;
use crate::security::Security;
use crate::service_mapping::ServiceMapping;
use crate::type_hash::Interface;

/// The place of a process in the ROS 2 graph.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// What carries its messages.
    pub middleware: Middleware,
    /// Whether its messages must be protected.
    pub security: Security,
    /// The interfaces that its topics and services use, in addition to the standard ones; only Zenoh needs them.
    pub interfaces: &'static [Interface],
    /// Its network.
    pub environment: Environment,
    /// The namespace of its node, unless a remapping rule changes it.
    pub namespace: Namespace,
    /// How its services are mapped, unless a parameter decides.
    pub service_mapping: ServiceMapping,
    /// The arguments that all ROS 2 nodes take.
    pub ros: RosArguments,
    /// The lines for `/rosout`, if any are published.
    pub log: Option<LogLines>,
    /// The metres in a unit of length, unless a parameter gives them.
    pub module_size: Option<f64>,
}

impl Settings {
    /// The name and namespace, after remapping, of a node that calls itself `name`.
    #[must_use]
    pub fn identity(&self, name: &str) -> NodeIdentity {
        self.ros.remaps.identity(name, &self.namespace)
    }

    /// Declares the parameters of the node that calls itself `name`: its own, and those that every node has. They take
    /// the values that are assigned to them.
    ///
    /// # Errors
    /// Names the parameter whose value cannot be used.
    pub fn declare(&self, name: &str, own: Vec<Declaration>) -> Result<Parameters, ParameterError> {
        let node = self.identity(name);
        let of_every_node = NodeParameters {
            module_size: self.module_size,
            ..NodeParameters::default()
        };
        let declarations = of_every_node.declarations().into_iter().chain(own);
        let assignments = self.ros.parameters.of_node(&node);
        let (parameters, warnings) = Parameters::declare(declarations, &assignments)?;
        for warning in warnings {
            tracing::warn!("{warning}");
        }
        for file in self.ros.parameters.files_without(&node) {
            tracing::warn!(
                "parameter file {} assigns nothing to {}",
                file.display(),
                node.fully_qualified()
            );
        }
        if NodeParameters::default()
            .read(parameters.values())?
            .use_sim_time
        {
            tracing::warn!(
                "use_sim_time is true, but simulated time is not supported; durations are real"
            );
        }
        Ok(parameters)
    }
}
