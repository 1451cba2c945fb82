//! The process of one module, or of several on one DDS participant.

use std::process::ExitCode;

use async_channel::Receiver;
use clap::Parser;
use formation_node_support::Program;
use module_agent::ModuleProcess;
use module_agent::arguments::{AgentTiming, ModuleArguments, Motion, StoreOptions};
use ros_runtime::exit::{Failure, STATUS_DONE};
use ros_runtime::parameters::Tuned;
use ros_runtime::settings::Settings;

/// Runs one module, or several, until it is asked to stop.
///
/// The modules take part in forming any target that is announced. SIGINT and SIGTERM end the process, which then leaves
/// the ROS 2 graph at once.
#[derive(Parser)]
#[command(version = formation_version::VERSION)]
struct Arguments {
    #[command(flatten)]
    modules: ModuleArguments,
    #[command(flatten)]
    motion: Tuned<Motion>,
    #[command(flatten)]
    timing: Tuned<AgentTiming>,
    #[command(flatten)]
    memory: Tuned<StoreOptions>,
}

impl Program for Arguments {
    fn run(self, mut settings: Settings, stop: &Receiver<()>) -> Result<u8, Failure> {
        let hosted = self.modules.resolve(&mut settings)?;
        ModuleProcess {
            settings,
            hosted,
            timing: self.timing.0,
            motion: self.motion.0,
            memory: self.memory.0,
        }
        .run(stop)?;
        Ok(STATUS_DONE)
    }
}

fn main() -> ExitCode {
    formation_node_support::main::<Arguments>()
}
