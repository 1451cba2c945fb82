//! `formation`: checks, plans, generates, runs and simulates formations, and evaluates the planner.

mod arguments;
mod check;
mod checked_plan;
mod console;
#[cfg(feature = "experiments")]
mod experiments;
mod explain;
mod generate;
mod joining;
mod manual;
mod motion;
mod plan;
mod progress;
#[cfg(feature = "recordings")]
mod recorded;
mod report;
mod role;
mod router;
mod run;
mod scenario_file;
#[cfg(feature = "zenoh")]
mod security;
mod show;
#[cfg(feature = "simulator")]
mod simulate;
mod table;
mod warnings;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};
use ros_runtime::arguments::completions;
use ros_runtime::exit::{STATUS_DONE, conclude};

#[cfg(feature = "zenoh")]
use crate::arguments::SecurityCommand;
use crate::arguments::{Arguments, Command};
use crate::run::order;

fn main() -> ExitCode {
    let outcome = match Arguments::parse().command {
        Command::Check {
            scenario,
            drive,
            json,
        } => check::check(&scenario, &drive, json),
        Command::Show { scenario, svg } => show::show(&scenario, svg),
        Command::Schema => show::schema(),
        Command::Run(arguments) => run::run(&arguments),
        Command::Watch(arguments) => run::watch(&arguments),
        Command::Stop(network) => order::give(&network, &[order::STOP.to_owned()]),
        Command::Resume(network) => order::give(&network, &[order::RESUME.to_owned()]),
        Command::Remove { modules, network } => order::give(&network, &order::removal(&modules)),
        Command::Router(arguments) => router::run(&arguments),
        #[cfg(feature = "zenoh")]
        Command::Security {
            command: SecurityCommand::Create(arguments),
        } => security::create(&arguments),
        #[cfg(not(feature = "zenoh"))]
        Command::Security { .. } => Err(ros_runtime::exit::Failure::bad_input(
            ros_runtime::middleware::NOT_BUILT,
        )),
        Command::Plan {
            scenario,
            report,
            json,
        } => plan::run(&scenario, report.as_deref(), json),
        Command::Explain {
            scenario,
            module,
            json,
        } => explain::run(&scenario, module, json),
        #[cfg(feature = "recordings")]
        Command::Report(arguments) => recorded::run(&arguments),
        #[cfg(not(feature = "recordings"))]
        Command::Report(_) => Err(not_built("report", "recordings")),
        Command::Completions { shell } => completions(&mut Arguments::command(), &shell)
            .and_then(|script| console::result_line(script.trim_end())),
        Command::Manual(arguments) => manual::run(Arguments::command(), &arguments),
        Command::Generate(arguments) => generate::run(&arguments),
        #[cfg(feature = "simulator")]
        Command::Simulate(arguments) => simulate::run(&arguments),
        #[cfg(not(feature = "simulator"))]
        Command::Simulate(_) => Err(not_built("simulate", "simulator")),
        #[cfg(feature = "experiments")]
        Command::Experiments(arguments) => experiments::run(&arguments),
        #[cfg(not(feature = "experiments"))]
        Command::Experiments(_) => Err(not_built("experiments", "experiments")),
    };
    conclude(outcome.map(|()| STATUS_DONE))
}

/// What a command answers that needs a cargo feature which this build lacks. The features are those of a build with no options
/// about them.
#[cfg(not(all(feature = "experiments", feature = "recordings", feature = "simulator")))]
fn not_built(command: &str, feature: &str) -> ros_runtime::exit::Failure {
    ros_runtime::exit::Failure::bad_input(format_args!(
        "`formation {command}` needs the cargo feature `{feature}`, which this program was built without; \
         `cargo build --release -p formation` includes it"
    ))
}
