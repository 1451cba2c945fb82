//! The arguments of `formation plan` and `formation policies`.

use std::path::PathBuf;

use clap::Args;
use formation_model::Policy;

use crate::policies;

/// What to plan, and how to print it.
#[derive(Debug, Args)]
pub struct PlanArguments {
    /// The scenario file (YAML); - for the standard input.
    pub scenario: PathBuf,
    /// Plan with this policy instead of the scenario's; `formation policies` lists them.
    #[arg(long, value_name = "NAME", value_parser = policies::named)]
    pub policy: Option<Policy>,
    /// Write pictures, a page that plays the plan, and the JSON of --json into this directory.
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    pub json: bool,
}
