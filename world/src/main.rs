//! A physical world that plays the robots of a formation.

use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use async_channel::Receiver;
use clap::Parser;
use formation_motion::WorldReport;
use formation_node_support::Program;
use formation_node_support::scenario::read_own_scenario;
use ros_runtime::exit::{Failure, STATUS_DONE};
use ros_runtime::parameters::Tuned;
use ros_runtime::settings::Settings;
use world::options::WorldOptions;
use world::process::WorldProcess;

/// Plays the robots of a scenario behind the topics of external drivers, as rigid bodies with forces, until it is asked to stop.
///
/// The modules are started with --motion external. It prints what it counts as one JSON object a line, whenever that changes:
/// contacts between modules that are not docked, and attempts to dock.
#[derive(Parser)]
#[command(version = formation_version::VERSION)]
struct Arguments {
    /// Scenario file that says where the modules stand, how they are docked, and where obstacles and walls are
    #[arg(long, value_name = "FILE")]
    scenario: PathBuf,
    #[command(flatten)]
    options: Tuned<WorldOptions>,
}

impl Program for Arguments {
    fn run(self, mut settings: Settings, stop: &Receiver<()>) -> Result<u8, Failure> {
        let scenario = read_own_scenario(&self.scenario, &mut settings)?;
        let process = WorldProcess {
            settings,
            scenario,
            options: self.options.0,
        };
        process.run(stop, print)?;
        Ok(STATUS_DONE)
    }
}

/// Prints a line; the world goes on when the reader of its output is gone.
fn print(report: &WorldReport) {
    match serde_json::to_string(report) {
        Ok(line) => {
            let mut out = io::stdout().lock();
            let _ = writeln!(out, "{line}").and_then(|()| out.flush());
        }
        Err(error) => tracing::error!("cannot write the counts: {error}"),
    }
}

fn main() -> ExitCode {
    formation_node_support::main::<Arguments>()
}
