//! `formation`: checks, plans, generates, runs and simulates formations, and evaluates the planner.

mod arguments;
mod check;
#[cfg(feature = "experiments")]
mod compare;
mod console;
#[cfg(feature = "experiments")]
mod experiments;
mod explain;
mod generate;
#[cfg(feature = "maps")]
mod import;
mod joining;
mod manual;
mod plan;
mod plan_output;
mod policies;
mod policy_program;
mod progress;
#[cfg(feature = "recordings")]
mod recorded;
mod report;
mod robot_budget;
mod role;
mod router;
mod run;
mod scenario_file;
#[cfg(feature = "zenoh")]
mod security;
mod show;
#[cfg(feature = "simulator")]
mod simulate;
#[cfg(feature = "studio")]
mod studio;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};
use ros_runtime::arguments::completions;
use ros_runtime::exit::{STATUS_DONE, conclude};

#[cfg(feature = "zenoh")]
use crate::arguments::SecurityCommand;
use crate::arguments::{Arguments, FormationCommand};
use crate::run::operator;

fn main() -> ExitCode {
    let outcome = match Arguments::parse().command {
        FormationCommand::Check(arguments) => check::check(&arguments),
        FormationCommand::Show { scenario, svg } => show::show(&scenario, svg),
        FormationCommand::Schema => show::schema(),
        FormationCommand::Run(arguments) => run::run(&arguments),
        FormationCommand::Watch(arguments) => run::watch(&arguments),
        #[cfg(feature = "studio")]
        FormationCommand::Studio(arguments) => studio::serve(&arguments),
        #[cfg(not(feature = "studio"))]
        FormationCommand::Studio(_) => Err(not_built("studio", "studio")),
        FormationCommand::Stop(network) => operator::give(&network, &[operator::STOP.to_owned()]),
        FormationCommand::Resume(network) => {
            operator::give(&network, &[operator::RESUME.to_owned()])
        }
        FormationCommand::Remove {
            modules,
            vote_too,
            network,
        } => operator::give(&network, &operator::removal(&modules, vote_too)),
        FormationCommand::Retire {
            module,
            rejoin,
            network,
        } => operator::give(&network, &operator::retirement(module, rejoin)),
        FormationCommand::Replay(arguments) => operator::replay(&arguments),
        FormationCommand::Router(arguments) => router::run(&arguments),
        #[cfg(feature = "zenoh")]
        FormationCommand::Security {
            command: SecurityCommand::Create(arguments),
        } => security::create(&arguments),
        #[cfg(not(feature = "zenoh"))]
        FormationCommand::Security { .. } => Err(ros_runtime::exit::Failure::bad_input(
            ros_runtime::middleware::NOT_BUILT,
        )),
        FormationCommand::Plan(arguments) => plan::run(&arguments),
        FormationCommand::Policies { json } => policies::list(json),
        FormationCommand::Explain {
            scenario,
            module,
            json,
        } => explain::run(&scenario, module, json),
        #[cfg(feature = "recordings")]
        FormationCommand::Report(arguments) => recorded::run(&arguments),
        #[cfg(not(feature = "recordings"))]
        FormationCommand::Report(_) => Err(not_built("report", "recordings")),
        FormationCommand::Completions { shell } => completions(&mut Arguments::command(), &shell)
            .and_then(|script| console::result_line(script.trim_end())),
        FormationCommand::Manual(arguments) => manual::run(Arguments::command(), &arguments),
        FormationCommand::Generate(arguments) => generate::run(&arguments),
        #[cfg(feature = "maps")]
        FormationCommand::Import(arguments) => import::run(&arguments),
        #[cfg(not(feature = "maps"))]
        FormationCommand::Import(_) => Err(not_built("import", "maps")),
        #[cfg(feature = "simulator")]
        FormationCommand::Simulate(arguments) => simulate::run(&arguments),
        #[cfg(not(feature = "simulator"))]
        FormationCommand::Simulate(_) => Err(not_built("simulate", "simulator")),
        #[cfg(feature = "experiments")]
        FormationCommand::Compare(arguments) => compare::run(&arguments),
        #[cfg(not(feature = "experiments"))]
        FormationCommand::Compare(_) => Err(not_built("compare", "experiments")),
        #[cfg(feature = "experiments")]
        FormationCommand::Experiments(arguments) => experiments::run(&arguments),
        #[cfg(not(feature = "experiments"))]
        FormationCommand::Experiments(_) => Err(not_built("experiments", "experiments")),
    };
    conclude(outcome.map(|()| STATUS_DONE))
}

/// What a command answers that needs a cargo feature which this build lacks. The features are those of a build with no options
/// about them.
#[cfg(not(all(
    feature = "experiments",
    feature = "maps",
    feature = "recordings",
    feature = "simulator",
    feature = "studio"
)))]
fn not_built(command: &str, feature: &str) -> ros_runtime::exit::Failure {
    ros_runtime::exit::Failure::bad_input(format_args!(
        "`formation {command}` needs the cargo feature `{feature}`, which this program was built without; \
         `cargo build --release -p formation` includes it"
    ))
}
