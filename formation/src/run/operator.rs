//! `formation stop`, `resume` and `remove`: commands to the modules of a running formation.

use anyhow::{Context, anyhow};
use formation_model::text::joined;
use ros_runtime::environment::Environment;
use ros_runtime::exit::Failure;

use super::{Programs, environment_of_runs};
use crate::arguments::FormationSelector;

/// The option of the target publisher that stops all modules.
pub const STOP: &str = "--stop";
/// The option that lets them resume.
pub const RESUME: &str = "--resume";

/// The option that reports bodies as removed.
pub fn removal(modules: &[u32]) -> Vec<String> {
    vec!["--remove-module".to_owned(), joined(modules, ",")]
}

/// Has a target publisher give a command, which ends once the modules show it.
///
/// # Errors
/// Says why the command was not given, or not taken.
pub fn give(network: &FormationSelector, order: &[String]) -> Result<(), Failure> {
    let mut command = Programs::next_to_launcher()?.command("target_publisher");
    let Environment { domain, range, .. } = environment_of_runs(network.domain)?;
    let status = command
        .args(["--domain", &domain.to_string()])
        .args(["--discovery-range", &range.to_string()])
        .args(order)
        .status()
        .context("cannot start target_publisher")
        .map_err(Failure::Failed)?;
    if status.success() {
        return Ok(());
    }
    Err(Failure::Failed(anyhow!(
        "target_publisher, which gives the command, ended with {status}; its last lines are above"
    )))
}
