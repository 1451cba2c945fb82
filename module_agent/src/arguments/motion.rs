//! How the modules move: simulated, or by drivers outside.

use std::time::Duration;

use clap::{Args, ValueEnum};
use formation::model::MicroUnits;
use formation::motion::ExternalParameters;
use ros2_client::ParameterValue;

use crate::drive::MotionParameters;
use crate::drivers::{ExternalMotion, PoseSource};
use ros_runtime::arguments::{SECONDS, Seconds};
use ros_runtime::parameters::{Change, Declaration, ParameterError, Range, Values};

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
    #[arg(long, value_name = "UNITS_PER_S", default_value_t = SPEED_DEFAULT, value_parser = speed)]
    pub speed: f64,
    /// External motion: which message tells where a module stands
    #[arg(long, value_name = "SOURCE", value_enum, default_value_t)]
    pub pose_source: PoseSource,
    /// External motion: frame of goals and poses, taken to coincide with the target's [default: the target's]
    #[arg(long, value_name = "NAME")]
    pub driver_frame: Option<String>,
    /// External motion: a module whose driver told no pose so long after the start does not take part
    #[arg(long, value_name = "SECONDS", default_value_t = Seconds(ExternalMotion::default().first_pose_limit))]
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

const SPEED_DEFAULT: f64 = 1.0;
const SPEED_MIN: f64 = 0.001;
const SPEED_MAX: f64 = 1.0e6;
const TOLERANCE_MIN: f64 = 0.000_01;
const TOLERANCE_MAX: f64 = 1.0;

const MOTION: &str = "motion";
const SPEED: &str = "speed";
const POSE_SOURCE: &str = "external.pose_source";
const FRAME: &str = "external.frame_id";
const FIRST_POSE_LIMIT: &str = "external.first_pose_limit_s";
const POSE_LIMIT: &str = "external.pose_limit_s";
const DOCKING_LIMIT: &str = "external.docking_limit_s";
const HALT_LIMIT: &str = "external.halt_limit_s";
const STILL: &str = "external.still_s";
const POSITION_TOLERANCE: &str = "external.position_tolerance";
const HEADING_TOLERANCE: &str = "external.heading_tolerance";

/// Declares how modules move, for ROS 2, with these values unless something is assigned.
pub(crate) fn motion_declarations(values: &MotionParameters) -> Vec<Declaration> {
    let (mode, speed, external) = match values {
        MotionParameters::Simulated { speed_units_per_s } => {
            ("simulated", *speed_units_per_s, ExternalMotion::default())
        }
        MotionParameters::External(external) => ("external", SPEED_DEFAULT, external.clone()),
    };
    let at_start = |name, description, value, range| Declaration {
        name,
        description,
        value,
        range,
        change: Change::AtStart("drives are set up with it"),
    };
    let seconds = |name, description, value: Duration| {
        let value = ParameterValue::Double(value.as_secs_f64());
        at_start(name, description, value, SECONDS)
    };
    let tolerance = |name, description, value: MicroUnits| {
        let range = Range::Double {
            from: TOLERANCE_MIN,
            to: TOLERANCE_MAX,
        };
        at_start(
            name,
            description,
            ParameterValue::Double(value.to_units()),
            range,
        )
    };
    let word = |text: &str| ParameterValue::String(text.to_owned());
    let pose_source = match external.pose_source {
        PoseSource::Pose => "pose",
        PoseSource::Odom => "odom",
    };
    vec![
        at_start(
            MOTION,
            "Who moves the modules: this process, or a driver for each",
            word(mode),
            Range::OneOf(&["simulated", "external"]),
        ),
        Declaration {
            name: SPEED,
            description: "Speed of simulated motion in units a second; holds from the next goal on",
            value: ParameterValue::Double(speed),
            range: Range::Double {
                from: SPEED_MIN,
                to: SPEED_MAX,
            },
            change: Change::AtRunTime,
        },
        at_start(
            POSE_SOURCE,
            "Which message of a driver tells where its module stands",
            word(pose_source),
            Range::OneOf(&["pose", "odom"]),
        ),
        at_start(
            FRAME,
            "Frame of goals and poses; the target's if empty",
            word(external.frame_id.as_deref().unwrap_or_default()),
            Range::Any,
        ),
        seconds(
            FIRST_POSE_LIMIT,
            "A module whose driver told no pose so many seconds after the start does not take part",
            external.first_pose_limit,
        ),
        seconds(
            POSE_LIMIT,
            "A module on its way must tell its pose at least this often, in seconds",
            external.drive.pose_limit,
        ),
        seconds(
            DOCKING_LIMIT,
            "A driver must answer a docking request within this, in seconds",
            external.drive.docking_limit,
        ),
        seconds(
            HALT_LIMIT,
            "A module must stand still within so many seconds after its goals ceased",
            external.drive.halt_limit,
        ),
        seconds(
            STILL,
            "A module whose poses stayed within the tolerances for so many seconds stands still",
            external.drive.still,
        ),
        tolerance(
            POSITION_TOLERANCE,
            "So near to its goal a module has arrived, in units",
            external.drive.position_tolerance,
        ),
        tolerance(
            HEADING_TOLERANCE,
            "Turned so little from its goal a module has arrived, in radians",
            external.drive.heading_tolerance,
        ),
    ]
}

/// How modules move, as ROS 2 has it now.
pub(crate) fn motion_parameters(values: &Values) -> Result<MotionParameters, ParameterError> {
    if values.string(MOTION)? == "simulated" {
        return Ok(MotionParameters::Simulated {
            speed_units_per_s: values.double(SPEED)?,
        });
    }
    let micro = |name| {
        MicroUnits::from_units(values.double(name)?)
            .map_err(|error| ParameterError::new(name, error.to_string()))
    };
    Ok(MotionParameters::External(ExternalMotion {
        pose_source: match values.string(POSE_SOURCE)?.as_str() {
            "odom" => PoseSource::Odom,
            _ => PoseSource::Pose,
        },
        frame_id: Some(values.string(FRAME)?).filter(|frame| !frame.is_empty()),
        first_pose_limit: values.seconds(FIRST_POSE_LIMIT)?,
        drive: ExternalParameters {
            pose_limit: values.seconds(POSE_LIMIT)?,
            docking_limit: values.seconds(DOCKING_LIMIT)?,
            halt_limit: values.seconds(HALT_LIMIT)?,
            still: values.seconds(STILL)?,
            position_tolerance: micro(POSITION_TOLERANCE)?,
            heading_tolerance: micro(HEADING_TOLERANCE)?,
        },
    }))
}

fn speed(text: &str) -> Result<f64, String> {
    text.trim()
        .parse::<f64>()
        .ok()
        .filter(|speed| (SPEED_MIN..=SPEED_MAX).contains(speed))
        .ok_or_else(|| format!("must be a speed from {SPEED_MIN} to {SPEED_MAX}, got `{text}`"))
}

fn tolerance(text: &str) -> Result<f64, String> {
    text.trim()
        .parse::<f64>()
        .ok()
        .filter(|tolerance| (TOLERANCE_MIN..=TOLERANCE_MAX).contains(tolerance))
        .ok_or_else(|| format!("must be from {TOLERANCE_MIN} to {TOLERANCE_MAX}, got `{text}`"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use clap::Parser;

    use super::*;
    use ros_runtime::parameters::Parameters;

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
    fn motion_is_the_same_as_parameters_of_ros_2() {
        for given in [
            parsed("--speed 2.5").unwrap(),
            parsed("--motion external --pose-source odom --driver-frame odom --still-s 0.25")
                .unwrap(),
        ] {
            let (parameters, _) =
                Parameters::declare(motion_declarations(&given), &BTreeMap::new()).unwrap();
            assert_eq!(motion_parameters(parameters.values()), Ok(given));
        }
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
