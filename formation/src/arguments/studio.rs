//! The arguments of `formation studio`.

use std::path::PathBuf;

use clap::Args;
use ros_runtime::environment::Domain;

/// What the page of the studio begins with, and what it may do.
#[derive(Debug, Args)]
pub struct StudioArguments {
    /// A scenario file (YAML) to begin with.
    #[arg(conflicts_with = "attach")]
    pub scenario: Option<PathBuf>,
    /// The port of the page on loopback [default: any free one].
    #[arg(
        long,
        value_name = "PORT",
        default_value_t = 0,
        hide_default_value = true
    )]
    pub port: u16,
    /// Only watch a formation that runs elsewhere, and change nothing.
    #[arg(long)]
    pub attach: bool,
    /// ROS domain of runs, or of the formation that is watched, 0 to 232 [default: ROS_DOMAIN_ID, else the first free one for runs, 0
    /// to watch]
    #[arg(long, value_name = "D")]
    pub domain: Option<Domain>,
    /// Pass this option to `formation run`, such as --run-option=--speed=2; may be repeated.
    #[arg(
        long,
        value_name = "OPTION",
        allow_hyphen_values = true,
        conflicts_with = "attach"
    )]
    pub run_option: Vec<String>,
}
