//! What a process was told of its place in the ROS 2 graph.

use crate::arguments::RosArguments;
use crate::environment::{Environment, Namespace};
use crate::service_mapping::ServiceMapping;

/// What a process was told of its place in the ROS 2 graph.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// On which network it speaks.
    pub environment: Environment,
    /// The namespace of its node, unless a remapping rule changes it.
    pub namespace: Namespace,
    /// How its services are mapped.
    pub service_mapping: ServiceMapping,
    /// The arguments that all ROS 2 nodes take.
    pub ros: RosArguments,
}
