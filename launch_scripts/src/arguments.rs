//! The command line.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use formation_node::environment::Domain;

use crate::run::MODULES_PER_PROCESS_MAX;

/// Forms a target configuration out of robot modules over DDS.
#[derive(Debug, Parser)]
#[command(name = "formation", version, after_help = EXIT_STATUS)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

const EXIT_STATUS: &str = "\
Exit status:
  0  done
  1  the formation failed or was found wrong
  2  bad input or usage";

/// What the launcher can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Validate a scenario file, and name what is wrong and where.
    Check {
        /// The scenario file (YAML).
        scenario: PathBuf,
    },
    /// Form the target with real processes over DDS, watch them and have the outcome verified.
    Run(RunArguments),
    /// Decide who takes which spot, offline, by the same core as in every module.
    Plan {
        /// The scenario file (YAML).
        scenario: PathBuf,
        /// Print one JSON object instead of a table.
        #[arg(long)]
        json: bool,
    },
    /// Make a random scenario from a seed and print it as YAML.
    ///
    /// Targets and configurations are trees on the unit lattice; leaders and singletons stand uniformly in a box of
    /// 16 x 16 units. The same options give the same scenario.
    Generate(GenerateArguments),
}

/// What to run, and how.
#[derive(Debug, Args)]
pub struct RunArguments {
    /// The scenario file (YAML).
    pub scenario: PathBuf,
    /// Host K modules in each process, on one DDS participant.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = modules_per_process)]
    pub modules_per_process: usize,
    /// DDS domain, 0 to 232 [default: ROS_DOMAIN_ID, else 0]
    #[arg(long, value_name = "D")]
    pub domain: Option<Domain>,
    /// Give up after so many seconds.
    #[arg(long, value_name = "S", default_value = "120", value_parser = seconds)]
    pub timeout: Duration,
    /// Stop once all modules have agreed on the plan; nothing moves.
    #[arg(long)]
    pub plan_only: bool,
    /// The speed of simulated modules, in units a second.
    #[arg(long, value_name = "UNITS", default_value_t = 5.0)]
    pub speed: f64,
    /// Write `report.json`, the object that --json prints, into this directory.
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Print one JSON object instead of a table; progress stays on the standard error output.
    #[arg(long)]
    pub json: bool,
    /// Set by the launcher itself when it runs in a network namespace of its own.
    #[arg(long, hide = true)]
    pub private_network: bool,
}

fn modules_per_process(text: &str) -> Result<usize, String> {
    text.parse()
        .ok()
        .filter(|count| (1..=MODULES_PER_PROCESS_MAX).contains(count))
        .ok_or_else(|| format!("must be a whole number from 1 to {MODULES_PER_PROCESS_MAX}"))
}

/// A day is as good as for ever.
const TIMEOUT_SECONDS_MAX: f64 = 86_400.0;

fn seconds(text: &str) -> Result<Duration, String> {
    text.parse::<f64>()
        .ok()
        .filter(|seconds| (1.0..=TIMEOUT_SECONDS_MAX).contains(seconds))
        .map(Duration::from_secs_f64)
        .ok_or_else(|| format!("must be seconds from 1 to {TIMEOUT_SECONDS_MAX}"))
}

/// What to generate.
#[derive(Debug, Args)]
pub struct GenerateArguments {
    /// How many modules.
    #[arg(long, value_name = "N")]
    pub modules: usize,
    /// How many spots.
    #[arg(long, value_name = "N")]
    pub spots: usize,
    /// Dock the modules into configurations of K; those left over stand alone.
    #[arg(long, value_name = "K", conflicts_with = "mixed")]
    pub configuration_size: Option<usize>,
    /// Mix singletons with configurations of 2 to 10 modules.
    #[arg(long)]
    pub mixed: bool,
    /// The most links that one spot or module has: 3 or 4.
    #[arg(long, value_name = "D", default_value_t = 3)]
    pub degree: usize,
    /// The seed of all that is random.
    #[arg(long, value_name = "X")]
    pub seed: u64,
}
