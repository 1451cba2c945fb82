//! How a formation is judged.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use formation::fixed::MicroUnits;
use formation::verify::ObserverParameters;

use super::{Seconds, read_scenario};
use crate::outcome::Failure;

/// How a formation is judged.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Judging")]
pub struct JudgingArguments {
    /// Scenario file whose modules are to take part, so that absent ones can be named
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// A formation that is not done after this has failed
    #[arg(long, alias = "timeout-s", value_name = "SECONDS", default_value_t = Seconds(Duration::from_secs(60)))]
    pub time_limit_s: Seconds,
    /// How far a settled module may stand from its spot, in units
    #[arg(long, value_name = "UNITS", default_value_t = 0.05, value_parser = tolerance)]
    pub tolerance: f64,
    /// By how much its heading may differ, in radians
    #[arg(long, value_name = "RADIANS", default_value_t = 0.05, value_parser = tolerance)]
    pub heading_tolerance: f64,
    /// What is reached but not yet right may take so long to become right
    #[arg(long, value_name = "SECONDS", default_value_t = Seconds(Duration::from_secs(3)))]
    pub grace_s: Seconds,
    /// A member that was not heard for so long does not count as living; the suspicion of the agents
    #[arg(long, value_name = "SECONDS", default_value_t = Seconds(Duration::from_secs(5)))]
    pub silence_s: Seconds,
}

impl JudgingArguments {
    /// The observer's parameters.
    ///
    /// # Errors
    /// Names the file or argument that is wrong.
    pub fn parameters(&self) -> Result<ObserverParameters, Failure> {
        let micro = |argument: &str, value| {
            MicroUnits::from_units(value)
                .map_err(|error| Failure::bad_input(format_args!("{argument}: {error}")))
        };
        let expected = match &self.scenario {
            Some(path) => read_scenario(path)?
                .problem()
                .modules()
                .iter()
                .map(|module| module.id)
                .collect(),
            None => Default::default(),
        };
        Ok(ObserverParameters {
            position_tolerance: micro("--tolerance", self.tolerance)?,
            heading_tolerance: micro("--heading-tolerance", self.heading_tolerance)?,
            time_limit: self.time_limit_s.0,
            grace: self.grace_s.0,
            silence: self.silence_s.0,
            expected,
        })
    }
}

fn tolerance(text: &str) -> Result<f64, String> {
    text.trim()
        .parse::<f64>()
        .ok()
        .filter(|tolerance| (0.0..=1.0e3).contains(tolerance))
        .ok_or_else(|| format!("must be a number from 0 to 1000, got `{text}`"))
}
