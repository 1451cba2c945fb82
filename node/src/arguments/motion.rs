//! How the modules move: simulated, or by drivers outside.

use clap::{Args, ValueEnum};
use formation::fixed::MicroUnits;
use formation::motion::ExternalParameters;

use super::timing::Seconds;
use crate::drive::MotionParameters;
use crate::drivers::{ExternalMotion, PoseSource};

/// Who moves the modules.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum MotionMode {
    /// This process, as if each module went straight to its goal
    #[default]
    Simulated,
    /// A driver for each module, such as that of a robot, told over topics
    External,
}

/// How the modules move.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Motion")]
pub struct MotionArguments {
    /// Who moves the modules
    #[arg(long, value_name = "MODE", value_enum, default_value_t)]
    pub motion: MotionMode,
    /// Speed of simulated motion in units a second
    #[arg(long, value_name = "UNITS_PER_S", default_value_t = 1.0, value_parser = speed)]
    pub speed: f64,
    /// External motion: which message tells where a module stands
    #[arg(long, value_name = "SOURCE", value_enum, default_value_t)]
    pub pose_source: PoseSource,
    /// External motion: frame of goals and poses, taken to coincide with the target's [default: the target's]
    #[arg(long, value_name = "NAME")]
    pub driver_frame: Option<String>,
    /// External motion: a module whose driver told no pose so long after the start does not take part
    #[arg(long, value_name = "SECONDS", default_value = "30")]
    pub first_pose_limit_s: Seconds,
    /// External motion: a module on its way must tell its pose at least this often
    #[arg(long, value_name = "SECONDS", default_value_t = Seconds(ExternalParameters::default().pose_limit))]
    pub pose_limit_s: Seconds,
    /// External motion: a driver must answer a docking request within this
    #[arg(long, value_name = "SECONDS", default_value_t = Seconds(ExternalParameters::default().docking_limit))]
    pub docking_limit_s: Seconds,
    /// External motion: a module must stand still within this after its goals ceased
    #[arg(long, value_name = "SECONDS", default_value_t = Seconds(ExternalParameters::default().halt_limit))]
    pub halt_limit_s: Seconds,
    /// External motion: a module whose poses stayed within the tolerances for so long stands still
    #[arg(long, value_name = "SECONDS", default_value_t = Seconds(ExternalParameters::default().still))]
    pub still_s: Seconds,
    /// External motion: so near to its goal a module has arrived, in units
    #[arg(long, value_name = "UNITS", default_value_t = ExternalParameters::default().position_tolerance.to_units(), value_parser = tolerance)]
    pub position_tolerance: f64,
    /// External motion: turned so little from its goal a module has arrived, in radians
    #[arg(long, value_name = "RADIANS", default_value_t = ExternalParameters::default().heading_tolerance.to_units(), value_parser = tolerance)]
    pub heading_tolerance: f64,
}

impl MotionArguments {
    /// The motion parameters.
    #[must_use]
    pub fn parameters(&self) -> MotionParameters {
        // The arguments' bounds leave nothing that could not be quantised.
        let micro = |units| MicroUnits::from_units(units).unwrap_or_default();
        match self.motion {
            MotionMode::Simulated => MotionParameters::Simulated {
                speed_units_per_s: self.speed,
            },
            MotionMode::External => MotionParameters::External(ExternalMotion {
                pose_source: self.pose_source,
                frame_id: self.driver_frame.clone(),
                first_pose_limit: self.first_pose_limit_s.0,
                drive: ExternalParameters {
                    pose_limit: self.pose_limit_s.0,
                    docking_limit: self.docking_limit_s.0,
                    halt_limit: self.halt_limit_s.0,
                    still: self.still_s.0,
                    position_tolerance: micro(self.position_tolerance),
                    heading_tolerance: micro(self.heading_tolerance),
                },
            }),
        }
    }
}

fn speed(text: &str) -> Result<f64, String> {
    text.trim()
        .parse::<f64>()
        .ok()
        .filter(|speed| (0.001..=1.0e6).contains(speed))
        .ok_or_else(|| format!("must be a speed from 0.001 to 1000000, got `{text}`"))
}

fn tolerance(text: &str) -> Result<f64, String> {
    text.trim()
        .parse::<f64>()
        .ok()
        .filter(|tolerance| (0.000_01..=1.0).contains(tolerance))
        .ok_or_else(|| format!("must be from 0.00001 to 1, got `{text}`"))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        motion: MotionArguments,
    }

    fn parsed(words: &str) -> Result<MotionParameters, String> {
        let words = std::iter::once("test").chain(words.split_whitespace());
        Command::try_parse_from(words)
            .map(|command| command.motion.parameters())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn motion_is_simulated_unless_a_driver_is_asked_for() {
        assert_eq!(
            parsed("--speed 2.5"),
            Ok(MotionParameters::Simulated {
                speed_units_per_s: 2.5
            })
        );
        let Ok(MotionParameters::External(motion)) =
            parsed("--motion external --pose-source odom --position-tolerance 0.01")
        else {
            panic!("a driver was asked for");
        };
        assert_eq!(motion.pose_source, PoseSource::Odom);
        assert_eq!(
            motion.drive,
            ExternalParameters {
                position_tolerance: MicroUnits(10_000),
                ..ExternalParameters::default()
            }
        );
    }

    #[test]
    fn speeds_and_tolerances_are_finite_and_positive() {
        for bad in [
            "--speed 0",
            "--speed inf",
            "--position-tolerance 0",
            "--heading-tolerance NaN",
            "--motion magic",
        ] {
            assert!(parsed(bad).is_err(), "{bad}");
        }
    }
}
