//! The command line.

mod check;
#[cfg(feature = "experiments")]
mod compare;
mod generate;
#[cfg(feature = "maps")]
mod import;
mod manual;
#[cfg(not(all(
    feature = "experiments",
    feature = "maps",
    feature = "recordings",
    feature = "simulator",
    feature = "studio"
)))]
mod not_built;
mod plan;
mod replay;
mod studio;

use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::time::Duration;

#[cfg(feature = "simulator")]
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand};
#[cfg(feature = "simulator")]
use formation_offline::SIMULATED_MODULES_MAX;
use formation_offline::SPEED_UNITS_PER_S;
#[cfg(feature = "simulator")]
use formation_sim::FaultKind;
use ros_runtime::arguments::Namespace;
use ros_runtime::environment::Domain;
use ros_runtime::middleware::Middleware;

pub use check::CheckArguments;
#[cfg(feature = "experiments")]
pub use compare::CompareArguments;
pub use generate::GenerateArguments;
pub use manual::ManualArguments;
pub use plan::PlanArguments;
pub use replay::ReplayArguments;
pub use studio::StudioArguments;

/// The most modules in one process: a sample may carry the states of all of them.
pub const MODULES_PER_PROCESS_MAX: usize = 100;

/// Forms a target configuration out of robot modules over DDS or Zenoh.
#[derive(Debug, Parser)]
#[command(name = "formation", version = formation_version::VERSION, after_help = EXIT_STATUS)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: FormationCommand,
}

const EXIT_STATUS: &str = "\
Exit status:
  0  done
  1  the formation failed, or its result is wrong
  2  bad input or usage
  3  not judged: formed, but the poses are not exact enough to tell whether bodies touched
  129, 130, 143  interrupted by SIGHUP, Ctrl-C (SIGINT) or SIGTERM";

/// What the launcher can do.
#[derive(Debug, Subcommand)]
pub enum FormationCommand {
    /// Check that a scenario is valid and that its spots can be reached; say what is wrong, where and why.
    Check(CheckArguments),
    /// Draw a scenario as text, in the form that a scenario file may have; modules and spots must stand on a lattice.
    Show {
        /// The scenario file (YAML); - for the standard input.
        scenario: PathBuf,
        /// Print an SVG picture instead; needs no lattice.
        #[arg(long)]
        svg: bool,
    },
    /// Print the JSON schema of scenario files, for editors that complete and check them.
    Schema,
    /// Print the shell completions of this program; the other programs have `--completions SHELL`.
    Completions {
        /// The shell: bash, elvish, fish, powershell or zsh.
        shell: String,
    },
    /// Write the manual pages of all commands into a directory, or print them as Markdown.
    Manual(ManualArguments),
    /// Form the target with real processes, one per module, and verify the outcome.
    Run(Box<RunArguments>),
    /// Show a formation that runs elsewhere, until its verdict; changes nothing.
    Watch(WatchArguments),
    /// Draw scenarios, run them and watch them in a browser on this machine: serves a page, and prints its address. It runs one at a time.
    Studio(StudioArguments),
    /// Halt all modules of a running formation until `formation resume`; restarts do not end the stop.
    Stop(FormationSelector),
    /// Let a stopped formation go on.
    Resume(FormationSelector),
    /// Report that the robots of dead modules were taken away, so that they no longer block spots.
    Remove {
        /// The modules.
        #[arg(required = true, value_name = "ID")]
        modules: Vec<u32>,
        /// Take their votes for good: if one of them runs on behind a cut, two formations may move.
        #[arg(long)]
        vote_too: bool,
        #[command(flatten)]
        network: FormationSelector,
    },
    /// Have a module leave a running formation: it gets no spot, and a spare takes its own.
    Retire {
        /// The module.
        #[arg(value_name = "ID")]
        module: u32,
        /// Have it take part again instead.
        #[arg(long)]
        rejoin: bool,
        #[command(flatten)]
        network: FormationSelector,
    },
    /// Route messages between processes over Zenoh, until interrupted.
    Router(RouterArguments),
    /// Restrict a formation over Zenoh to programs with a certificate, each in its role.
    Security {
        /// What to do.
        #[command(subcommand)]
        command: SecurityCommand,
    },
    /// Plan offline which module takes which spot, with the planner that every module runs.
    Plan(PlanArguments),
    /// List the policies: the name of each, what it does, and where it is from.
    Policies {
        /// Print a JSON list of objects instead of lines.
        #[arg(long)]
        json: bool,
    },
    /// Explain why a module gets its spot in the offline plan, or none: its turns, evictions, and what other spots cost.
    Explain {
        /// The scenario file (YAML); - for the standard input.
        scenario: PathBuf,
        /// The identifier of the module.
        #[arg(long, value_name = "ID")]
        module: u32,
        /// Print one JSON object instead of text.
        #[arg(long)]
        json: bool,
    },
    /// Draw a recorded run: pictures, a page that plays it, or an animated picture.
    ///
    /// A damaged recording is read up to the damage; the exit status is then 1.
    Report(ReportArguments),
    /// Publish what a recording has once more, at the times at which it was recorded, below /replay, where no module listens.
    ///
    /// `visualiser --namespace /replay --ros-args -p session:=N` draws it; N is the session that the run printed.
    Replay(ReplayArguments),
    /// Generate a random scenario from a seed and print it as YAML.
    ///
    /// Targets and configurations are trees on the unit lattice. The modules start at random poses in a square field about the
    /// target. The same options give the same scenario.
    Generate(GenerateArguments),
    /// Import the walls of a map: a YAML file of ROS 2 with its image, or a grid map of the MovingAI benchmarks (.map).
    ///
    /// Prints obstacles and arena for a scenario file, in cells of the size of a module, with middles at whole units. A cell is
    /// closed if anything occupied or unknown reaches into it.
    Import(ImportArguments),
    /// Simulate many agents in one process, in virtual time, on a seeded network and with faults.
    ///
    /// Each seed is one run, the same each time. Every run is checked for what must always hold: at most one module per
    /// spot, no motion without agreement, one plan in motion, no hole, an end. A seed that fails is printed with the command
    /// that replays it; a single seed is printed in full.
    Simulate(SimulateArguments),
    /// Compare policies on scenarios, or on generated ones by kinds, sizes and seeds.
    ///
    /// Writes a row for each policy and instance, failures included: `rows.jsonl` and `rows.csv` (what is the same on every
    /// machine), `times.jsonl` and `times.csv` (what the clock decides), and from them `summary.md` and `times.md`, with paired
    /// differences from the first policy. After an interruption the same command continues where it stopped.
    Compare(CompareArguments),
    /// Repeat the paper's evaluation: its stated numbers, its algorithms and ours.
    ///
    /// Writes `cells.jsonl` (what is the same on every machine), `times.jsonl` (what the clock decides), and from them a CSV
    /// file per figure and `summary.md`; `experiments/plot.py OUT` draws the plots. After an interruption the same command
    /// continues where it stopped.
    Experiments(ExperimentsArguments),
}

#[cfg(not(all(
    feature = "experiments",
    feature = "maps",
    feature = "recordings",
    feature = "simulator",
    feature = "studio"
)))]
use not_built::AnyArguments;

#[cfg(not(feature = "experiments"))]
type CompareArguments = AnyArguments;
#[cfg(not(feature = "experiments"))]
type ExperimentsArguments = AnyArguments;
#[cfg(feature = "maps")]
pub use import::ImportArguments;
#[cfg(not(feature = "maps"))]
type ImportArguments = AnyArguments;
#[cfg(not(feature = "recordings"))]
type ReportArguments = AnyArguments;
#[cfg(not(feature = "simulator"))]
type SimulateArguments = AnyArguments;

/// What to draw of a recording.
#[cfg(feature = "recordings")]
#[derive(Debug, Args)]
pub struct ReportArguments {
    /// The recording (MCAP), as `formation run --record` and the program `recorder` write it, or the folder of a bag.
    pub recording: PathBuf,
    /// Write pictures and page into this directory [default: the name of the recording without its end, unless --film or --figure
    /// is given]
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Write an animated picture (SVG) to this file; it plays wherever a picture may stand, such as in a README.
    #[arg(long, value_name = "FILE")]
    pub film: Option<PathBuf>,
    /// Draw the film for a dark page.
    #[arg(long, requires = "film")]
    pub dark: bool,
    /// Write a row of pictures (SVG) to this file, at the shares of the time from the first motion to the end that --at names.
    #[arg(long, value_name = "FILE")]
    pub figure: Option<PathBuf>,
    /// The shares of the figure in per cent, at most 12.
    #[arg(long, value_name = "PERCENTS", value_delimiter = ',', default_value = "0,25,50,100", value_parser = percent)]
    pub at: Vec<u32>,
}

/// A share such as 25 or 25%.
#[cfg(feature = "recordings")]
fn percent(text: &str) -> Result<u32, String> {
    let number = text.trim().trim_end_matches('%').parse();
    let percent = number.ok().filter(|percent| *percent <= 100);
    percent.ok_or_else(|| format!("`{text}` is no share from 0 to 100 per cent"))
}

/// What can be done for the security of a formation.
#[derive(Debug, Subcommand)]
pub enum SecurityCommand {
    /// Create a certificate authority, and for each role a Zenoh configuration file with its certificate.
    ///
    /// The roles are module, publisher, verifier, operator and observer. Name a role's file to a program in
    /// ZENOH_SESSION_CONFIG_URI, and router.json5 to `formation router` in ZENOH_ROUTER_CONFIG_URI.
    Create(SecurityArguments),
}

/// For which formation to create certificates.
#[derive(Debug, Args)]
pub struct SecurityArguments {
    /// A new or empty directory for the files. They hold private keys.
    #[arg(value_name = "DIR")]
    pub directory: PathBuf,
    /// Host name or address of a router, as sessions reach it; may be repeated [default: localhost]
    #[arg(long, value_name = "HOST")]
    pub router: Vec<String>,
    /// The port of all routers.
    #[arg(long, value_name = "PORT", default_value_t = 7447)]
    pub port: u16,
    /// The namespace of the formation.
    #[arg(long, value_name = "NAME", default_value = "/formation")]
    pub namespace: Namespace,
    /// Days for which the certificates are valid.
    #[arg(long, value_name = "DAYS", default_value_t = 365, value_parser = clap::value_parser!(u32).range(1..=36_500))]
    pub days: u32,
}

/// Where a router listens.
#[derive(Debug, Args)]
pub struct RouterArguments {
    /// Listen at this endpoint, for example tcp/0.0.0.0:7447; may be repeated
    /// [default: as ZENOH_ROUTER_CONFIG_URI says, else tcp/[::]:7447]
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,
    /// Connect to the router at this endpoint, for example tcp/10.0.0.2:7447; may be repeated.
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,
    /// End with the process that started this one.
    #[arg(long, hide = true)]
    pub stop_with_parent: bool,
}

/// Where a running formation is.
#[derive(Debug, Args)]
pub struct FormationSelector {
    /// DDS domain, 0 to 232 [default: ROS_DOMAIN_ID, else 0]
    #[arg(long, value_name = "D")]
    pub domain: Option<Domain>,
}

/// Which formation to watch.
#[derive(Debug, Args)]
pub struct WatchArguments {
    /// ROS domain, 0 to 232 [default: ROS_DOMAIN_ID, else 0]
    #[arg(long, value_name = "D")]
    pub domain: Option<Domain>,
    /// What carries the messages: dds or zenoh [default: zenoh if RMW_IMPLEMENTATION is rmw_zenoh_cpp, else dds]
    #[arg(long, value_name = "MIDDLEWARE")]
    pub middleware: Option<Middleware>,
    /// The session of the formation, where there are several.
    #[arg(long, value_name = "NUMBER")]
    pub session: Option<u32>,
    /// Print what happens for programs, one JSON object a line, also after a verdict, until no message comes.
    #[arg(long)]
    pub events: bool,
}

/// What to run, and how.
#[derive(Debug, Args)]
pub struct RunArguments {
    /// The scenario file (YAML).
    pub scenario: PathBuf,
    /// Host K modules in each process, on one participant.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = modules_per_process)]
    pub modules_per_process: usize,
    /// ROS domain, 0 to 232; refused if another formation has it [default: ROS_DOMAIN_ID, else the first free one]
    #[arg(long, value_name = "D")]
    pub domain: Option<Domain>,
    /// What carries the messages: dds or zenoh, for which a router is started unless ZENOH_SESSION_CONFIG_URI or
    /// ZENOH_CONFIG_OVERRIDE name one [default: as RMW_IMPLEMENTATION says, else dds for up to 50 processes of modules]
    #[arg(long, value_name = "MIDDLEWARE")]
    pub middleware: Option<Middleware>,
    /// Give each process the certificate of its role, from the files that `formation security create` made in this directory;
    /// implies Zenoh
    #[arg(long, value_name = "DIR")]
    pub security: Option<PathBuf>,
    /// Fail after this many seconds without a verdict.
    #[arg(long, value_name = "S", default_value = "120", value_parser = seconds)]
    pub timeout: Duration,
    /// Stop once all modules agree on the plan, before anything moves.
    #[arg(long)]
    pub plan_only: bool,
    #[command(flatten)]
    pub motion: MotionArguments,
    /// Serve the nodes' parameters, for `ros2 param` [default: on for up to 25 processes of modules]
    ///
    /// That takes 12 endpoints per node, and doubles the time in which 40 or more processes discover each other.
    #[arg(long, value_name = "on|off", value_parser = [ON, "off"])]
    pub parameter_services: Option<String>,
    /// Session number; programs refuse messages of another session, such as late ones of an earlier run
    /// [default: drawn at random, and printed]
    #[arg(long, value_name = "NUMBER")]
    pub session: Option<u32>,
    /// Keep what modules agreed on in this directory; a later run with the same session and --modules-per-process continues
    /// from it [default: a directory that is deleted with the run]
    #[arg(long, value_name = "DIR")]
    pub state_dir: Option<PathBuf>,
    /// Write pictures, a page that plays the run, and the JSON of --json into this directory.
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Write every state that a module publishes to this file, one JSON object a line: t (by the sender's clock, in s since
    /// 1970), module, x, y (units), theta (radians), links, folding.
    #[arg(long, value_name = "FILE")]
    pub trace: Option<PathBuf>,
    /// Record every sample on the topics of the formation into this MCAP file, for Foxglove, `ros2 bag` and
    /// `formation report`.
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Print one JSON object instead of a table; progress stays on standard error.
    #[arg(long)]
    pub json: bool,
    /// Take orders from the standard input, and print what happens, one JSON object a line each; the run goes on after a verdict,
    /// until the input ends.
    #[arg(long, conflicts_with_all = ["json", "plan_only", "report"])]
    pub attended: bool,
    /// Set by the launcher when it restarts itself in a network namespace of its own.
    #[arg(long, hide = true)]
    pub private_network: bool,
}

/// How modules move.
#[derive(Debug, Args)]
pub struct MotionArguments {
    /// The speed of simulated modules, in units a second.
    #[arg(long, value_name = "UNITS", default_value_t = SPEED_UNITS_PER_S, value_parser = speed)]
    pub speed: f64,
    /// What moves the modules: a simulation in their processes, or an external driver for each, over topics
    /// [default: simulated; external with --driver]
    #[arg(long, value_name = "MODE", value_parser = [SIMULATED, EXTERNAL])]
    motion: Option<String>,
    /// Shell command that drives all modules; the run starts and stops it.
    #[arg(long, value_name = "COMMAND")]
    pub driver: Option<String>,
    #[command(flatten)]
    pub world: WorldArguments,
    /// Keep the robots of dead processes where they are, so that they block spots; otherwise the run reports simulated ones as
    /// removed [default with --motion external]
    #[arg(long)]
    pub bodies_stay: bool,
    /// Pass this option to every module's process, such as --module-option=--motion-limit-s=30; may be repeated.
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    pub module_option: Vec<String>,
}

impl MotionArguments {
    /// What moves the modules.
    pub fn mode(&self) -> &str {
        let default = match &self.driver {
            None if !self.world.world => SIMULATED,
            _ => EXTERNAL,
        };
        self.motion.as_deref().unwrap_or(default)
    }

    /// Whether drivers outside the processes move the modules.
    pub fn is_external(&self) -> bool {
        self.mode() == EXTERNAL
    }

    /// Whether robots outlive their processes.
    pub fn bodies_stay(&self) -> bool {
        self.bodies_stay || self.is_external()
    }
}

/// A number within a range.
fn number_within(text: &str, range: RangeInclusive<f64>) -> Result<f64, String> {
    let number = text.parse().map_err(|_| "not a number".to_owned())?;
    match range.contains(&number) {
        true => Ok(number),
        false => Err(format!("must be from {} to {}", range.start(), range.end())),
    }
}

/// What agents and the world accept as a speed.
fn speed(text: &str) -> Result<f64, String> {
    number_within(text, 0.001..=1.0e6)
}

/// What the world accepts as the share of a velocity that is lost.
fn share(text: &str) -> Result<f64, String> {
    number_within(text, 0.0..=1.0)
}

/// A physical world that plays the robots.
#[derive(Debug, Args)]
pub struct WorldArguments {
    /// Play all robots in a physical world: rigid bodies with forces, which slip, touch and dock, at --speed.
    #[arg(long, conflicts_with_all = ["driver", "motion"])]
    pub world: bool,
    /// World: robots lose up to this share of a commanded velocity.
    #[arg(long, value_name = "SHARE", requires = "world", value_parser = share)]
    slip: Option<f64>,
    /// World: standard deviation of measured poses, in units and radians. Raises the tolerances of modules to 4 times this,
    /// and of the verifier to 8 times.
    #[arg(long, value_name = "NOISE", requires = "world")]
    noise: Option<f64>,
    /// Pass this option to the world, such as --world-option=--docking-failure=0.2; may be repeated.
    #[arg(
        long,
        value_name = "OPTION",
        allow_hyphen_values = true,
        requires = "world"
    )]
    world_option: Vec<String>,
}

impl WorldArguments {
    /// The options of the program `world`.
    pub fn options(&self) -> Vec<String> {
        let given = [
            ("slip", self.slip),
            ("noise", self.noise),
            ("heading-noise", self.noise),
        ];
        let given = given.into_iter();
        given
            .filter_map(|(name, value)| Some(format!("--{name}={}", value?)))
            .chain(self.world_option.iter().cloned())
            .collect()
    }

    /// Whether its robots have differential drives.
    pub fn is_differential(&self) -> bool {
        let words: Vec<&str> = self.world_option.iter().map(String::as_str).collect();
        let joined = format!("--drive={DIFFERENTIAL}");
        words.contains(&joined.as_str())
            || words
                .windows(2)
                .any(|pair| pair == ["--drive", DIFFERENTIAL])
    }

    /// The tolerances of modules, where the noise needs more than they have by themselves: a module that stands still is to be
    /// within them nearly always.
    pub fn module_options(&self) -> Vec<String> {
        self.tolerances(
            4.0,
            ["--position-tolerance", "--heading-tolerance"],
            [0.02, 0.03],
        )
    }

    /// Tolerances for the verifier, which compares poses of two moments.
    pub fn verifier_options(&self) -> Vec<String> {
        self.tolerances(8.0, ["--tolerance", "--heading-tolerance"], [0.05, 0.05])
    }

    fn tolerances(&self, factor: f64, names: [&str; 2], defaults: [f64; 2]) -> Vec<String> {
        let needed = factor * self.noise.unwrap_or_default();
        let options = names.into_iter().zip(defaults);
        options
            .filter(|&(_, default)| needed > default)
            .map(|(name, _)| format!("{name}={needed}"))
            .collect()
    }
}

const HOLONOMIC: &str = "holonomic";
/// The drive of robots that turn in place.
pub const DIFFERENTIAL: &str = "differential";

const SIMULATED: &str = "simulated";
const EXTERNAL: &str = "external";

/// The value of a switch.
pub const ON: &str = "on";

fn modules_per_process(text: &str) -> Result<usize, String> {
    text.parse()
        .ok()
        .filter(|count| (1..=MODULES_PER_PROCESS_MAX).contains(count))
        .ok_or_else(|| format!("must be a whole number from 1 to {MODULES_PER_PROCESS_MAX}"))
}

/// One day.
const TIMEOUT_SECONDS_MAX: f64 = 86_400.0;

fn seconds(text: &str) -> Result<Duration, String> {
    text.parse::<f64>()
        .ok()
        .filter(|seconds| (1.0..=TIMEOUT_SECONDS_MAX).contains(seconds))
        .map(Duration::from_secs_f64)
        .ok_or_else(|| format!("must be seconds from 1 to {TIMEOUT_SECONDS_MAX}"))
}

/// Reads the name of a kind of faults, and lists all names in the help.
#[cfg(feature = "simulator")]
fn fault_kind() -> impl TypedValueParser<Value = FaultKind> {
    let names = FaultKind::NAMED.map(|(name, _)| name);
    PossibleValuesParser::new(names).try_map(|name| name.parse::<FaultKind>())
}

/// What to simulate.
#[cfg(feature = "simulator")]
#[derive(Debug, Args)]
pub struct SimulateArguments {
    /// A scenario file (YAML), or - for the standard input: its modules and target in every run [default: drawn from each
    /// seed]
    pub scenario: Option<PathBuf>,
    /// Number of seeds to run; a single one is printed in full.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..))]
    pub seeds: u64,
    /// The first seed; the others follow it.
    #[arg(long, value_name = "X", default_value_t = 0)]
    pub first_seed: u64,
    /// Modules of a drawn scenario: a number or a range.
    #[arg(long, value_name = "MIN-MAX", default_value = "5-40", conflicts_with = "scenario", value_parser = module_range)]
    pub modules: (usize, usize),
    /// Which faults occur; docs/running.md describes them.
    #[arg(long, value_name = "KIND", default_value_t = FaultKind::Mixed, value_parser = fault_kind())]
    pub faults: FaultKind,
    /// Print one JSON object instead of text.
    #[arg(long)]
    pub json: bool,
}

#[cfg(feature = "simulator")]
fn module_range(text: &str) -> Result<(usize, usize), String> {
    let (min, max) = text.split_once('-').unwrap_or((text, text));
    let bound = |text: &str| text.trim().parse::<usize>().ok();
    bound(min)
        .zip(bound(max))
        .filter(|&(min, max)| 1 <= min && min <= max && max <= SIMULATED_MODULES_MAX)
        .ok_or_else(|| {
            format!("must be a number or a range such as 5-40, from 1 to {SIMULATED_MODULES_MAX}")
        })
}

/// Which experiments to run, and how.
#[cfg(feature = "experiments")]
#[derive(Debug, Args)]
pub struct ExperimentsArguments {
    /// The directory for the results; created if it does not exist.
    #[arg(value_name = "OUT")]
    pub directory: PathBuf,
    /// Average over N instances [default: 50, as in the paper; 5 with --quick]
    #[arg(long, value_name = "N")]
    pub runs: Option<u64>,
    /// Run only this experiment; may be repeated.
    #[arg(long, value_name = "NAME")]
    pub only: Vec<String>,
    /// Fewer sizes and runs, and real processes only once: some minutes.
    #[arg(long)]
    pub quick: bool,
    /// The seed of the first instance; each further instance has the next seed.
    #[arg(long, value_name = "X", default_value_t = 1)]
    pub seed: u64,
}
