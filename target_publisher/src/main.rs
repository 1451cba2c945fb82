//! Announces the target configuration.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use clap::Parser;
use formation::message::TargetAnnouncement;
use formation_node::announcer::TargetProcess;
use formation_node::arguments::{self, NetworkArguments, read_scenario};
use formation_node::lifetime::stop_requested;
use formation_node::outcome::{Failure, STATUS_DONE, conclude};
use formation_node::stamp;

/// Announces the target of a scenario, and keeps it for whoever comes late, until it is told to stop.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scenario file whose target and planner parameters are announced
    #[arg(long, value_name = "FILE")]
    scenario: PathBuf,
    /// How many modules take part; without it, gathering ends when nothing new comes
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    expected_modules: Option<u32>,
    /// The highest revision holds [default: the wall clock in milliseconds]
    #[arg(long, value_name = "NUMBER")]
    revision: Option<u64>,
    /// Withdraw the target instead: modules then stay where they are
    #[arg(long)]
    withdraw: bool,
    #[command(flatten)]
    network: NetworkArguments,
}

fn main() -> ExitCode {
    conclude(run())
}

fn run() -> Result<u8, Failure> {
    let (arguments, ros) = arguments::parse::<Arguments>()?;
    let settings = arguments.network.start(ros)?;
    let scenario = read_scenario(&arguments.scenario)?;
    let problem = scenario.problem();
    let announcement = TargetAnnouncement {
        revision: arguments.revision.unwrap_or_else(stamp::revision),
        name: scenario.name().to_owned(),
        target: (!arguments.withdraw).then(|| Arc::clone(problem.target())),
        parameters: *problem.parameters(),
        expected_modules: arguments.expected_modules,
    };
    let stop = stop_requested()?;
    TargetProcess {
        settings,
        announcement,
    }
    .run(&stop)?;
    Ok(STATUS_DONE)
}
