//! The network of a node, its log, and with which process it ends.

use clap::Args;

use super::ros::{LogLevel, Namespace, RosArguments};
use crate::environment::{self, DiscoveryRange, Domain, Environment, Overrides};
use crate::exit::{self, Failure};
use crate::logging;
use crate::middleware::Middleware;
use crate::security::Security;
use crate::service_mapping::{RMW_IMPLEMENTATION, ServiceMapping};
use crate::settings::Settings;

/// The network of a node, and its log.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Network and log")]
pub struct NetworkArguments {
    /// What carries the messages: dds or zenoh [default: zenoh if RMW_IMPLEMENTATION is rmw_zenoh_cpp, else dds]
    #[arg(long, value_name = "MIDDLEWARE")]
    pub middleware: Option<Middleware>,
    /// ROS domain, 0 to 232 [default: ROS_DOMAIN_ID, else 0]
    #[arg(long, value_name = "NUMBER")]
    pub domain: Option<Domain>,
    /// How far to look for others: OFF, LOCALHOST, SUBNET or SYSTEM_DEFAULT [default: ROS_AUTOMATIC_DISCOVERY_RANGE,
    /// else SUBNET]
    #[arg(long, value_name = "RANGE")]
    pub discovery_range: Option<DiscoveryRange>,
    /// Namespace of the node and its topics; `--ros-args -r __ns:=NAME` takes precedence [default: ROS_NAMESPACE, else
    /// that of the suite]
    #[arg(long, value_name = "NAME")]
    pub namespace: Option<Namespace>,
    /// How services are mapped: cyclone or enhanced [default: as RMW_IMPLEMENTATION needs it, else enhanced]
    #[arg(long, value_name = "MAPPING")]
    pub service_mapping: Option<ServiceMapping>,
    /// The least level that is logged; `--ros-args --log-level LEVEL` takes precedence
    #[arg(long, value_name = "LEVEL", default_value = "info", ignore_case = true)]
    pub log_level: LogLevel,
    /// End when the process that started this one ends, for whatever reason
    #[arg(long)]
    pub stop_with_parent: bool,
}

impl NetworkArguments {
    /// Starts the log and the rules by which the process ends, and resolves the settings: the arguments take precedence
    /// over the environment, and the environment over `default_namespace`.
    ///
    /// # Errors
    /// Names the environment variable that cannot be used.
    pub fn start(
        &self,
        ros: RosArguments,
        default_namespace: Namespace,
    ) -> Result<Settings, Failure> {
        let log = logging::start(ros.log.level.unwrap_or(self.log_level), &ros.log)
            .map_err(Failure::bad_input)?;
        exit::end_on_panic();
        if self.stop_with_parent {
            exit::end_with_parent()?;
        }
        let variable =
            |name: &str| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned());
        let overrides = Overrides {
            domain: self.domain,
            range: self.discovery_range,
        };
        let environment = Environment::resolve(overrides, variable).map_err(Failure::bad_input)?;
        let namespace = match &self.namespace {
            Some(namespace) => namespace.clone(),
            None => environment::namespace(variable)
                .map_err(Failure::bad_input)?
                .unwrap_or(default_namespace),
        };
        let implementation = variable(RMW_IMPLEMENTATION);
        let middleware = Middleware::choose(self.middleware, implementation.as_deref())
            .check()
            .map_err(Failure::bad_input)?;
        let security = Security::resolve(variable).map_err(Failure::bad_input)?;
        let service_mapping = match self.service_mapping {
            Some(mapping) => mapping,
            // Zenoh has one mapping of services.
            None if middleware == Middleware::Zenoh => ServiceMapping::default(),
            None => ServiceMapping::of_middleware(implementation.as_deref())
                .map_err(|reason| environment::wrong(RMW_IMPLEMENTATION, &reason))
                .map_err(Failure::bad_input)?,
        };
        Ok(Settings {
            middleware,
            security,
            interfaces: &[],
            environment,
            namespace,
            service_mapping,
            ros,
            log,
            module_size: None,
        })
    }
}
