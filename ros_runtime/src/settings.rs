//! What a process was told of its place in the ROS 2 graph.

use crate::arguments::{NodeIdentity, RosArguments};
use crate::environment::{Environment, Namespace};
use crate::parameters::{Declaration, NodeWide, ParameterError, Parameters, node_wide};
use crate::rosout::LogLines;
use crate::service_mapping::ServiceMapping;

/// What a process was told of its place in the ROS 2 graph.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// On which network it speaks.
    pub environment: Environment,
    /// The namespace of its node, unless a remapping rule changes it.
    pub namespace: Namespace,
    /// How its services are mapped, unless a parameter says otherwise.
    pub service_mapping: ServiceMapping,
    /// The arguments that all ROS 2 nodes take.
    pub ros: RosArguments,
    /// The lines that are to go to `/rosout`, if any are.
    pub log: Option<LogLines>,
}

impl Settings {
    /// What a node is called, and where it is, that calls itself `name`.
    #[must_use]
    pub fn identity(&self, name: &str) -> NodeIdentity {
        self.ros.remaps.identity(name, &self.namespace)
    }

    /// Declares the parameters of the node that calls itself `name`: its own, and those that every node has. What is
    /// assigned to them holds.
    ///
    /// # Errors
    /// Names the parameter whose value cannot be used.
    pub fn declare(&self, name: &str, own: Vec<Declaration>) -> Result<Parameters, ParameterError> {
        let node = self.identity(name);
        let declarations = node_wide(NodeWide::default()).into_iter().chain(own);
        let (parameters, warnings) =
            Parameters::declare(declarations, &self.ros.parameters.of_node(&node))?;
        for warning in warnings {
            tracing::warn!("{warning}");
        }
        for file in self.ros.parameters.files_without(&node) {
            tracing::warn!(
                "parameter file {} says nothing for {}",
                file.display(),
                node.fully_qualified()
            );
        }
        if NodeWide::wants_simulated_time(parameters.values()) {
            tracing::warn!(
                "use_sim_time is true, but simulated time is not supported; durations are real"
            );
        }
        Ok(parameters)
    }
}
