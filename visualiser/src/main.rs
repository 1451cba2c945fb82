//! Draws a formation for RViz, Foxglove and their like.

mod visualisation;

use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use ros_runtime::arguments::{self, NetworkArguments, Seconds};
use ros_runtime::lifetime::stop_requested;
use ros_runtime::outcome::{Failure, STATUS_DONE, conclude};
use visualisation::{RATE_MAX, RATE_MIN, VisualisationParameters, VisualiserProcess};

/// Publishes what is on the formation's topics as markers and transforms, until it is told to stop.
///
/// `markers` carries modules, links, target spots, claims and trails; `/tf` the frames `module_N` and `/tf_static` the
/// frames `spot_N`. It takes no part in the formation.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// At most so many pictures a second, and only when something changed
    #[arg(long, value_name = "NUMBER", default_value_t = 5.0, value_parser = rate)]
    rate: f64,
    /// A module that was not heard for so long is drawn grey
    #[arg(long, value_name = "SECONDS", default_value = "5")]
    suspicion_s: Seconds,
    /// Leave out the numbers of modules and spots
    #[arg(long)]
    no_labels: bool,
    #[command(flatten)]
    network: NetworkArguments,
}

fn main() -> ExitCode {
    conclude(run())
}

fn run() -> Result<u8, Failure> {
    let (arguments, ros) = arguments::parse::<Arguments>()?;
    let settings = arguments.network.start(ros)?;
    let stop = stop_requested()?;
    VisualiserProcess {
        settings,
        parameters: VisualisationParameters {
            interval: Duration::from_secs_f64(1.0 / arguments.rate),
            suspicion: arguments.suspicion_s.0,
            labels: !arguments.no_labels,
        },
    }
    .run(stop)?;
    Ok(STATUS_DONE)
}

fn rate(text: &str) -> Result<f64, String> {
    text.trim()
        .parse::<f64>()
        .ok()
        .filter(|rate| (RATE_MIN..=RATE_MAX).contains(rate))
        .ok_or_else(|| format!("must be a number from {RATE_MIN} to {RATE_MAX}, got `{text}`"))
}
