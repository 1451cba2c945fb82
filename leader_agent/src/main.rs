//! The process of the module that leads a configuration.
//!
//! Any agent can lead, and leaders change when configurations break; this executable only makes sure that it is the
//! initial leader whose process it is.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use formation::model::ModuleId;
use formation_node::scenario::read_scenario;
use module_agent::agents::ModuleProcess;
use module_agent::arguments::{HostedModules, MotionArguments, TimingArguments, require_leader};
use ros_runtime::arguments::{self, NetworkArguments};
use ros_runtime::lifetime::stop_requested;
use ros_runtime::outcome::{Failure, STATUS_DONE, conclude};

/// Runs the module that leads a configuration, until it is told to stop.
///
/// It decides for the configuration's block; the members follow it. SIGINT and SIGTERM end the process, which then
/// leaves the ROS 2 graph at once.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// The leading module, which this process hosts
    #[arg(long, value_name = "ID")]
    module: u32,
    /// Scenario file that says where the modules stand and how they are docked
    #[arg(long, value_name = "FILE")]
    scenario: PathBuf,
    #[command(flatten)]
    motion: MotionArguments,
    #[command(flatten)]
    timing: TimingArguments,
    #[command(flatten)]
    network: NetworkArguments,
}

fn main() -> ExitCode {
    conclude(run())
}

fn run() -> Result<u8, Failure> {
    let (arguments, ros) = arguments::parse::<Arguments>()?;
    let settings = arguments.network.start(ros)?;
    let parameters = arguments.timing.parameters()?;
    let scenario = read_scenario(&arguments.scenario)?;
    let module = ModuleId(arguments.module);
    let wrong =
        |reason| Failure::bad_input(format_args!("{}: {reason}", arguments.scenario.display()));
    require_leader(&scenario, module).map_err(wrong)?;
    let hosted = HostedModules::from_scenario(&[module], &scenario).map_err(wrong)?;
    let stop = stop_requested()?;
    ModuleProcess {
        settings,
        modules: hosted.modules,
        parameters,
        motion: arguments.motion.parameters(),
        frame_id: hosted.frame_id,
    }
    .run(&stop)?;
    Ok(STATUS_DONE)
}
