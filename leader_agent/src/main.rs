//! The process of the module that leads a configuration.
//!
//! Any agent can lead, and leaders change when configurations break; this program only makes sure that the module is the
//! initial leader.

use std::path::PathBuf;
use std::process::ExitCode;

use async_channel::Receiver;
use clap::Parser;
use formation_model::ModuleId;
use formation_node_support::Program;
use formation_node_support::scenario::read_own_scenario;
use module_agent::ModuleProcess;
use module_agent::arguments::{AgentTiming, HostedModules, Motion, StoreOptions, require_leader};
use ros_runtime::exit::{Failure, STATUS_DONE};
use ros_runtime::parameters::Tuned;
use ros_runtime::settings::Settings;

/// Runs the module that leads a configuration, until it is asked to stop.
///
/// It publishes the claims of its configuration; the members follow it. SIGINT and SIGTERM end the process, which then
/// leaves the ROS 2 graph at once.
#[derive(Parser)]
#[command(version = formation_version::VERSION)]
struct Arguments {
    /// The leading module, which this process hosts
    #[arg(long, value_name = "ID")]
    module: u32,
    /// Scenario file that says where the modules stand and how they are docked
    #[arg(long, value_name = "FILE")]
    scenario: PathBuf,
    #[command(flatten)]
    motion: Tuned<Motion>,
    #[command(flatten)]
    timing: Tuned<AgentTiming>,
    #[command(flatten)]
    memory: Tuned<StoreOptions>,
}

impl Program for Arguments {
    fn run(self, mut settings: Settings, stop: &Receiver<()>) -> Result<u8, Failure> {
        let scenario = read_own_scenario(&self.scenario, &mut settings)?;
        let module = ModuleId(self.module);
        let wrong = |reason| Failure::bad_input(format!("{}: {reason}", self.scenario.display()));
        require_leader(&scenario, module).map_err(wrong)?;
        let hosted = HostedModules::from_scenario(&[module], &scenario).map_err(wrong)?;
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
