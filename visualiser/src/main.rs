//! Draws a formation for RViz, Foxglove and similar tools.

mod markers;
mod scene;
mod transforms;
mod visualisation;

use std::process::ExitCode;

use async_channel::Receiver;
use clap::Parser;
use formation_node_support::Program;
use ros_runtime::exit::{Failure, STATUS_DONE};
use ros_runtime::parameters::Tuned;
use ros_runtime::settings::Settings;

use crate::visualisation::{Drawing, draw};

/// Publishes what is on the formation's topics as markers and transforms, until it is asked to stop.
///
/// `markers` carries modules, links, target spots, obstacles, claims and trails; `/tf` the frames `module_N` and
/// `/tf_static` the frames `spot_N`. It takes no part in the formation.
#[derive(Parser)]
#[command(version = formation_version::VERSION)]
struct Arguments {
    #[command(flatten)]
    drawing: Tuned<Drawing>,
}

impl Program for Arguments {
    fn run(self, settings: Settings, stop: &Receiver<()>) -> Result<u8, Failure> {
        draw(&settings, self.drawing.0, stop)?;
        Ok(STATUS_DONE)
    }
}

fn main() -> ExitCode {
    formation_node_support::main::<Arguments>()
}
