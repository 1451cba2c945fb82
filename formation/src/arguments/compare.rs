//! The arguments of `formation compare`.

use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use clap::Args;
use formation_generate::Grouping;
use formation_model::Policy;

use super::generate::equal_configurations;
use super::plan::program_seconds;
use crate::policies;

/// What to compare, and on what.
#[derive(Debug, Args)]
pub struct CompareArguments {
    /// The directory for the results; created if it does not exist.
    #[arg(value_name = "OUT")]
    pub directory: PathBuf,
    /// Scenario files (YAML).
    #[arg(value_name = "SCENARIO", required_unless_present = "sizes")]
    pub scenarios: Vec<PathBuf>,
    /// Compare this policy; may be repeated. The first is the one with which the others are compared.
    #[arg(long, value_name = "NAME", required = true, value_parser = policies::named)]
    pub policy: Vec<Policy>,
    /// Compare the policy of this shell command under this name; may be repeated. See `formation plan --policy-program`.
    #[arg(long, value_name = "NAME=COMMAND")]
    pub policy_program: Vec<NamedProgram>,
    /// The time that a program has for an instance.
    #[arg(long, value_name = "S", default_value = "60", value_parser = program_seconds)]
    pub program_timeout: Duration,
    /// Generate scenarios of these numbers of modules, and as many spots.
    #[arg(long, value_name = "N,N", value_delimiter = ',')]
    pub sizes: Vec<usize>,
    /// How their modules are docked: singletons, mixed, SIZE for as many configurations of SIZE as possible, or KxSIZE for K of them.
    #[arg(long, value_name = "KIND,KIND", value_delimiter = ',', default_value = "mixed", value_parser = kind)]
    pub kinds: Vec<Grouping>,
    /// Their seeds: a number or a range, of each kind and size.
    #[arg(long, value_name = "FIRST-LAST", default_value = "1-10", value_parser = seed_range)]
    pub seeds: (u64, u64),
    /// Plan the motion as well, and compare when the last module arrives.
    #[arg(long)]
    pub motion: bool,
}

/// A program with the name under which it is compared.
#[derive(Clone, Debug)]
pub struct NamedProgram {
    pub name: String,
    pub command: String,
}

impl FromStr for NamedProgram {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, command) = text.split_once('=').ok_or("must be NAME=COMMAND")?;
        let is_allowed =
            |character: char| character.is_ascii_alphanumeric() || "_-".contains(character);
        if name.is_empty() || !name.chars().all(is_allowed) {
            return Err(format!(
                "the name `{name}` may have letters, digits, `_` and `-` only"
            ));
        }
        if Policy::named(name).is_some() {
            return Err(format!("`{name}` is the name of a policy"));
        }
        Ok(Self {
            name: name.to_owned(),
            command: command.to_owned(),
        })
    }
}

/// Reads how modules are docked.
fn kind(text: &str) -> Result<Grouping, String> {
    match text {
        "singletons" => Ok(Grouping::Singletons),
        "mixed" => Ok(Grouping::Mixed),
        text if text.contains('x') => equal_configurations(text),
        text => match text.parse() {
            Ok(size) if size > 0 => Ok(Grouping::Configurations(size)),
            _ => Err("must be singletons, mixed, SIZE or KxSIZE".to_owned()),
        },
    }
}

/// The most seeds.
const SEEDS_MAX: u64 = 100_000;

fn seed_range(text: &str) -> Result<(u64, u64), String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let bounds = first
        .trim()
        .parse::<u64>()
        .ok()
        .zip(last.trim().parse::<u64>().ok());
    bounds
        .filter(|&(first, last)| first <= last && last - first < SEEDS_MAX)
        .ok_or_else(|| format!("must be a number or a range such as 1-50, of at most {SEEDS_MAX}"))
}
