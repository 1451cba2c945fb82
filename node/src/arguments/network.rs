//! Where a process speaks, how much it tells, and with whom it ends.

use clap::Args;

use crate::environment::{DiscoveryRange, Domain, Environment, Namespace, Overrides};
use crate::lifetime;
use crate::logging::{self, LogLevel};
use crate::outcome::Failure;

/// Where a process speaks, and how much it tells.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Network and log")]
pub struct NetworkArguments {
    /// DDS domain, 0 to 232 [default: ROS_DOMAIN_ID, else 0]
    #[arg(long, value_name = "NUMBER")]
    pub domain: Option<Domain>,
    /// How far to look for others: OFF, LOCALHOST, SUBNET or SYSTEM_DEFAULT [default: ROS_AUTOMATIC_DISCOVERY_RANGE,
    /// else SUBNET]
    #[arg(long, value_name = "RANGE")]
    pub discovery_range: Option<DiscoveryRange>,
    /// Namespace of the node and its topics
    #[arg(long, value_name = "NAME", default_value_t = Namespace::default())]
    pub namespace: Namespace,
    /// The least important messages to log on the standard error stream
    #[arg(long, value_name = "LEVEL", default_value = "info", ignore_case = true)]
    pub log_level: LogLevel,
    /// End when the process that started this one ends, in whatever way
    #[arg(long)]
    pub stop_with_parent: bool,
}

impl NetworkArguments {
    /// Starts the log and the rules by which the process ends, and joins what the arguments and the environment say.
    ///
    /// # Errors
    /// Names the environment variable that cannot be used.
    pub fn start(&self) -> Result<Environment, Failure> {
        logging::start(self.log_level);
        lifetime::end_on_panic();
        if self.stop_with_parent {
            lifetime::end_with_parent()?;
        }
        let overrides = Overrides {
            domain: self.domain,
            range: self.discovery_range,
        };
        Ok(Environment::resolve(overrides, |name| {
            std::env::var_os(name).map(|value| value.to_string_lossy().into_owned())
        })?)
    }
}
