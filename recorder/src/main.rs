//! Records the topics of a formation, or plays a recording.

use std::path::PathBuf;
use std::process::ExitCode;

use async_channel::Receiver;
use clap::Parser;
use formation_node_support::{ModuleList, NAMESPACE, Program};
use recorder::play::PlayerProcess;
use recorder::process::{MODULES_MAX, RecorderProcess};
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
    /// Record the topics of these modules as well, such as `1-25` or `1,4,7-9`: goals, paths, docking, and what their
    /// drivers answer; at most 100
    #[arg(long, value_name = "LIST")]
    modules: Option<ModuleList>,
    /// Publish what the file has, at the times at which it was recorded, instead of recording; in another namespace than modules have
    #[arg(long, conflicts_with = "modules")]
    replay: bool,
    /// How many times as fast, 0.01 to 100
    #[arg(long, value_name = "TIMES", default_value_t = 1.0, requires = "replay", value_parser = rate)]
    rate: f64,
}

fn rate(text: &str) -> Result<f64, String> {
    let rate: Result<f64, _> = text.parse();
    let rate = rate.ok().filter(|rate| (0.01..=100.0).contains(rate));
    rate.ok_or_else(|| format!("`{text}` is no number from 0.01 to 100"))
}

impl Program for Arguments {
    fn run(self, settings: Settings, stop: &Receiver<()>) -> Result<u8, Failure> {
        if self.replay {
            return self.play(settings, stop);
        }
        let modules = self.modules.as_ref();
        let modules = modules.map_or(&[][..], ModuleList::modules).to_vec();
        if modules.len() > MODULES_MAX {
            return Err(Failure::bad_input(format_args!(
                "--modules: at most {MODULES_MAX} modules, got {}; start a recorder for each part of them",
                modules.len()
            )));
        }
        let process = RecorderProcess {
            settings,
            file: self.file,
            modules,
        };
        let written = process.run(stop)?;
        match written.lost {
            0 => tracing::info!("{written}"),
            _ => tracing::error!("{written}"),
        }
        Ok(STATUS_DONE)
    }
}

impl Arguments {
    fn play(self, settings: Settings, stop: &Receiver<()>) -> Result<u8, Failure> {
        if settings.namespace.to_string() == NAMESPACE {
            return Err(Failure::bad_input(format_args!(
                "{NAMESPACE} is where modules and drivers listen: name another namespace, such as --namespace /replay"
            )));
        }
        let process = PlayerProcess {
            settings,
            file: self.file,
            rate: self.rate,
        };
        let played = process.run(stop)?;
        tracing::info!("{played}");
        match played.damage {
            None => Ok(STATUS_DONE),
            Some(damage) => Err(Failure::failed(format_args!(
                "{}: {damage}",
                process.file.display()
            ))),
        }
    }
}

fn main() -> ExitCode {
    formation_node_support::main::<Arguments>()
}
