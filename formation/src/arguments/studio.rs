//! Arguments of `formation studio`.

use std::path::PathBuf;

use clap::Args;
use ros_runtime::environment::Domain;

/// What the studio begins with, and where.
#[derive(Debug, Args)]
pub struct StudioArguments {
    /// A scenario file (YAML) with which the page begins.
    #[arg(conflicts_with = "attach")]
    pub scenario: Option<PathBuf>,
    /// The port on 127.0.0.1; 0 takes a free one.
    #[arg(long, value_name = "PORT", default_value_t = 0)]
    pub port: u16,
    /// Open the page in the browser of the desktop, by `xdg-open`.
    #[arg(long)]
    pub open: bool,
    /// Watch a formation that runs elsewhere, and change nothing.
    #[arg(long)]
    pub attach: bool,
    /// ROS domain of the run or of the formation that is watched, 0 to 232
    /// [default: ROS_DOMAIN_ID, else as `formation run` and `formation watch` choose it]
    #[arg(long, value_name = "D")]
    pub domain: Option<Domain>,
    /// The session of the formation that is watched, where there are several.
    #[arg(long, value_name = "NUMBER", requires = "attach")]
    pub session: Option<u32>,
    /// The speed of simulated modules in runs, in units a second [default: that of `formation run`]
    #[arg(long, value_name = "UNITS", value_parser = super::speed, conflicts_with = "attach")]
    pub speed: Option<f64>,
}
