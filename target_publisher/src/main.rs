//! Announces the target configuration.

mod announcer;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use announcer::TargetProcess;
use clap::Parser;
use formation::model::TargetAnnouncement;
use formation_node::scenario::read_scenario;
use formation_node::stamp;
use ros_runtime::arguments::{self, NetworkArguments};
use ros_runtime::lifetime::stop_requested;
use ros_runtime::outcome::{Failure, STATUS_DONE, conclude};

/// Announces the target of a scenario, and keeps it for whoever comes late, until it is told to stop.
///
/// It serves the action `form_configuration`, by which others have targets formed, and services that tell how the formation
/// fares and withdraw its target. Without a scenario it announces nothing until it is asked to.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scenario file whose target and planner parameters are announced; without it, nothing is until a goal comes
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Folder of the scenarios that goals can name [default: that of the scenario file]
    #[arg(long, value_name = "FOLDER")]
    scenario_folder: Option<PathBuf>,
    /// How many modules take part; without it, gathering ends when nothing new comes
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    expected_modules: Option<u32>,
    /// The highest revision holds [default: the wall clock in milliseconds]
    #[arg(long, value_name = "NUMBER", requires = "scenario")]
    revision: Option<u64>,
    /// Withdraw the target instead: modules then stay where they are
    #[arg(long, requires = "scenario")]
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
    let announcement = match &arguments.scenario {
        Some(path) => {
            let scenario = read_scenario(path)?;
            let problem = scenario.problem();
            Some(TargetAnnouncement {
                revision: arguments.revision.unwrap_or_else(stamp::revision),
                name: scenario.name().to_owned(),
                target: (!arguments.withdraw).then(|| Arc::clone(problem.target())),
                parameters: *problem.parameters(),
                expected_modules: arguments.expected_modules,
            })
        }
        None => None,
    };
    let stop = stop_requested()?;
    TargetProcess {
        settings,
        announcement,
        expected_modules: arguments.expected_modules,
        scenario_folder: arguments.scenario_folder.or_else(|| {
            let folder = arguments.scenario.as_deref()?.parent()?;
            Some(Path::new(".").join(folder))
        }),
    }
    .run(&stop)?;
    Ok(STATUS_DONE)
}
