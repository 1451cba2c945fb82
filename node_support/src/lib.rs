//! What the nodes of the suite share and that knows formations: the table of topics, the conversion of samples into
//! messages of the core, and the start of their programs.

mod find_sessions;
pub mod messages;
mod module_list;
mod pose_source;
pub mod removal_requests;
pub mod scenario;
pub mod stamp;
pub mod topics;
mod value_types;

use std::process::ExitCode;

use async_channel::Receiver;
use clap::Parser;
pub use find_sessions::find_sessions;
pub use module_list::ModuleList;
pub use pose_source::PoseSource;
use ros_runtime::arguments::{self, Namespace};
use ros_runtime::exit::{Failure, conclude, stop_requested};
use ros_runtime::settings::Settings;
pub use value_types::micro_units;

/// The namespace of the nodes, unless an argument or the environment changes it.
pub const NAMESPACE: &str = "/formation";

/// The own command line of a program of the suite, next to the arguments that every node takes.
pub trait Program: Parser {
    /// Does the work of the program, with the settings that its arguments give, until `stop` yields; returns its exit
    /// status.
    ///
    /// # Errors
    /// Says why it could not.
    fn run(self, settings: Settings, stop: &Receiver<()>) -> Result<u8, Failure>;
}

/// The `main` of a program.
#[must_use]
pub fn main<P: Program>() -> ExitCode {
    let run = || {
        let (program, network, ros) = arguments::parse::<P>()?;
        let namespace: Result<Namespace, String> = NAMESPACE.parse();
        let settings = Settings {
            interfaces: formation_msgs::INTERFACES,
            ..network.start(ros, namespace.map_err(Failure::failed)?)?
        };
        program.run(settings, &stop_requested()?)
    };
    conclude(run())
}
