//! `formation stop`, `resume`, `remove` and `retire`, which command the modules of a running formation, and `formation replay`: each is
//! the work of another program.

use anyhow::{Context, anyhow};
use formation_model::text::joined;
use ros_runtime::environment::Environment;
use ros_runtime::exit::Failure;

use super::{Programs, environment_of_runs};
use crate::arguments::{FormationSelector, ReplayArguments};

/// The option of the target publisher that stops all modules.
pub const STOP: &str = "--stop";
/// The option that lets them resume.
pub const RESUME: &str = "--resume";

/// The options that report bodies as removed, with the votes of their modules or without.
pub fn removal(modules: &[u32], takes_votes: bool) -> Vec<String> {
    let mut options = vec!["--remove-module".to_owned(), joined(modules, ",")];
    if takes_votes {
        options.push("--vote-too".to_owned());
    }
    options
}

/// The option that takes a module out of service, or back.
pub fn retirement(module: u32, rejoins: bool) -> Vec<String> {
    let option = match rejoins {
        true => "--rejoin-module",
        false => "--retire-module",
    };
    vec![option.to_owned(), module.to_string()]
}

/// The option that pushes a simulated module so many metres along the axes.
pub fn push(module: u32, (x, y): (f64, f64)) -> Vec<String> {
    vec![format!("--push-module={module},{x},{y}")]
}

/// Has a target publisher give a command, which ends once the modules show it.
///
/// # Errors
/// Says why the command was not given, or not taken.
pub fn give(network: &FormationSelector, order: &[String]) -> Result<(), Failure> {
    have_done("target_publisher", "gives the command", network, order)
}

/// Has a recorder play a recording.
///
/// # Errors
/// Says why it was not played, or not to its end.
pub fn replay(arguments: &ReplayArguments) -> Result<(), Failure> {
    let options = [
        arguments.file.display().to_string(),
        "--replay".to_owned(),
        format!("--rate={}", arguments.rate),
        format!("--namespace={}", arguments.namespace),
    ];
    have_done("recorder", "plays the file", &arguments.network, &options)
}

fn have_done(
    program: &str,
    deed: &str,
    network: &FormationSelector,
    arguments: &[String],
) -> Result<(), Failure> {
    let mut command = Programs::next_to_launcher()?.command(program);
    let Environment { domain, range, .. } = environment_of_runs(network.domain)?;
    let status = command
        .args(["--domain", &domain.to_string()])
        .args(["--discovery-range", &range.to_string()])
        .args(arguments)
        .status()
        .with_context(|| format!("cannot start {program}"))
        .map_err(Failure::Failed)?;
    if status.success() {
        return Ok(());
    }
    let ended = anyhow!("{program}, which {deed}, ended with {status}; its last lines are above");
    Err(match status.code() {
        Some(2) => Failure::BadInput(ended),
        _ => Failure::Failed(ended),
    })
}
