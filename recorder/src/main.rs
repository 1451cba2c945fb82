//! Records the topics of a formation.

use std::path::PathBuf;
use std::process::ExitCode;

use async_channel::Receiver;
use clap::Parser;
use formation_node::Program;
use recorder::process::RecorderProcess;
use ros_runtime::exit::{Failure, STATUS_DONE};
use ros_runtime::settings::Settings;

/// Records every sample on the topics of the formation into an MCAP file, until it is asked to stop.
///
/// The file has the samples as they are on the wire, and opens with `ros2 bag`, `rosbags` and Foxglove. It takes no part in
/// the formation, and records every session of the domain.
#[derive(Parser)]
#[command(version = formation_version::VERSION)]
struct Arguments {
    /// The file, which is replaced if it exists
    file: PathBuf,
}

impl Program for Arguments {
    fn run(self, settings: Settings, stop: &Receiver<()>) -> Result<u8, Failure> {
        let file = self.file;
        let written = RecorderProcess { settings, file }.run(stop)?;
        match written.lost {
            0 => tracing::info!("{written}"),
            _ => tracing::error!("{written}"),
        }
        Ok(STATUS_DONE)
    }
}

fn main() -> ExitCode {
    formation_node::main::<Arguments>()
}
