//! The process of one module, or of several on one DDS participant.

use std::process::ExitCode;

use clap::Parser;
use module_agent::agents::ModuleProcess;
use module_agent::arguments::{ModuleArguments, MotionArguments, TimingArguments};
use ros_runtime::arguments::{self, NetworkArguments};
use ros_runtime::lifetime::stop_requested;
use ros_runtime::outcome::{Failure, STATUS_DONE, conclude};

/// Runs one module, or several, until it is told to stop.
///
/// The modules take part in forming whatever target is announced. SIGINT and SIGTERM end the process, which then leaves
/// the ROS 2 graph at once.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(flatten)]
    modules: ModuleArguments,
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
    let hosted = arguments.modules.resolve()?;
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
