//! The arguments of `formation plan` and `formation policies`.

use std::path::PathBuf;
use std::time::Duration;

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
    /// Plan with the allocation that this shell command answers: it reads the instance as JSON from its standard input, and writes the
    /// allocation as JSON; docs/own_policy.md describes both.
    #[arg(long, value_name = "COMMAND", conflicts_with = "policy")]
    pub policy_program: Option<String>,
    /// The time that the program has.
    #[arg(long, value_name = "S", default_value = "60", requires = "policy_program", value_parser = program_seconds)]
    pub program_timeout: Duration,
    /// Write pictures, a page that plays the plan, and the JSON of --json into this directory.
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    pub json: bool,
    /// Print the paths as a solution of CG:SHOP 2021 instead, in JSON: steps from cell to cell, where module r is robot r.
    #[arg(long, conflicts_with = "json")]
    pub cgshop: bool,
}

/// The longest time of a program.
const PROGRAM_SECONDS_MAX: f64 = 86_400.0;

/// Reads the time that a program has.
pub fn program_seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().ok();
    seconds
        .filter(|seconds| (0.01..=PROGRAM_SECONDS_MAX).contains(seconds))
        .map(Duration::from_secs_f64)
        .ok_or_else(|| format!("must be seconds from 0.01 to {PROGRAM_SECONDS_MAX}"))
}
