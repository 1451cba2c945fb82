//! The arguments of `formation replay`.

use std::path::PathBuf;

use clap::Args;
use ros_runtime::arguments::Namespace;

use super::FormationSelector;

/// What to play.
#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// The recording (MCAP), or the folder of a bag.
    pub file: PathBuf,
    /// How many times as fast, 0.01 to 100.
    #[arg(long, value_name = "TIMES", default_value_t = 1.0)]
    pub rate: f64,
    /// The namespace below which it is published.
    #[arg(long, value_name = "NAMESPACE", default_value = "/replay")]
    pub namespace: Namespace,
    #[command(flatten)]
    pub network: FormationSelector,
}
