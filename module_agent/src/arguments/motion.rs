//! How the modules move: simulated, or by drivers outside.

use std::time::Duration;

use formation_model::MicroUnits;
use formation_motion::{DEVIATION_LIMIT, ExternalParameters};
use formation_node_support::{PoseSource, micro_units};
use ros_runtime::parameters::{Tunable, Tunables, choice, number, seconds, switch, text};
use ros_runtime::words::Words;

/// What moves the modules.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveMode {
    /// This process, as if each module drove as it should.
    #[default]
    Simulated,
    /// A driver for each module, such as that of a robot, over topics.
    External,
}

impl Words for DriveMode {
    const WORDS: &'static [(&'static str, Self)] =
        &[("simulated", Self::Simulated), ("external", Self::External)];
}

/// How the modules move.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// What moves them.
    pub mode: DriveMode,
    /// The speed of simulated modules, in units per second.
    pub speed: f64,
    /// Whether `~/push_module` moves bodies of simulated modules.
    pub pushable: bool,
    /// Which message of a driver has the pose.
    pub pose_source: PoseSource,
    /// The frame of goals and poses; `None` for the target's.
    pub frame_id: Option<String>,
    /// A module whose driver sends no pose within this after the start does not take part.
    pub first_pose_limit: Duration,
    /// The limits of external motion, and the tolerances of arrival.
    pub external: ExternalParameters,
    /// The standard deviation stated by a driver beyond which localisation is lost.
    pub deviation_limit: MicroUnits,
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            mode: DriveMode::default(),
            speed: 1.0,
            pushable: false,
            pose_source: PoseSource::default(),
            frame_id: None,
            first_pose_limit: Duration::from_secs(30),
            external: ExternalParameters::default(),
            deviation_limit: DEVIATION_LIMIT,
        }
    }
}

const SET_UP: &str = "drives are set up with it";

impl Tunables for Motion {
    const HEADING: &'static str = "Motion";

    fn table() -> Vec<Tunable<Self>> {
        let mut table = vec![
            Tunable::new(
                "motion",
                choice("MODE"),
                |own: &mut Self| &mut own.mode,
                "What moves the modules: this process, as if each drove as it should, or a driver for each",
            )
            .at_start(SET_UP),
            Tunable::new(
                "speed",
                number("UNITS_PER_S", 0.001, 1.0e6),
                |own: &mut Self| &mut own.speed,
                "Speed of simulated modules in units per second; applies from the next goal on",
            ),
            Tunable::new(
                "pushable",
                switch(),
                |own: &mut Self| &mut own.pushable,
                "Serve ~/push_module, which moves the body of a simulated module as a hand would",
            )
            .at_start("services are offered from the start"),
            Tunable::new(
                "external.pose_source",
                choice("SOURCE"),
                |own: &mut Self| &mut own.pose_source,
                "External motion: which message has a module's pose, PoseStamped on `pose` or Odometry on `odom`",
            )
            .at_start(SET_UP),
            Tunable::new(
                "external.frame_id",
                text("NAME"),
                |own: &mut Self| &mut own.frame_id,
                "External motion: frame of goals and poses, which coincides with the target's; the target's if empty",
            )
            .at_start(SET_UP)
            .option("driver-frame"),
        ];
        table.extend(Self::limits());
        table
    }
}

impl Motion {
    /// The limits and tolerances of external motion.
    fn limits() -> [Tunable<Self>; 9] {
        let limit = |name, field: fn(&mut Self) -> &mut Duration, help| {
            Tunable::new(name, seconds(), field, help).at_start(SET_UP)
        };
        let tolerance = |name, unit, field: fn(&mut Self) -> &mut MicroUnits, help| {
            Tunable::new(name, micro_units(unit, 0.000_01, 1.0), field, help).at_start(SET_UP)
        };
        [
            limit(
                "external.first_pose_limit_s",
                |own| &mut own.first_pose_limit,
                "External motion: a module whose driver sends no pose within this after the start does not take part",
            ),
            limit(
                "external.pose_limit_s",
                |own| &mut own.external.pose_limit,
                "External motion: the driver of a moving module must send poses at least this often",
            ),
            limit(
                "external.docking_limit_s",
                |own| &mut own.external.docking_limit,
                "External motion: a driver must answer a docking request within this",
            ),
            limit(
                "external.docking_repeat_s",
                |own| &mut own.external.docking_repeat,
                "External motion: a docking request that is not answered is repeated after this",
            ),
            limit(
                "external.halt_limit_s",
                |own| &mut own.external.halt_limit,
                "External motion: a module must stand still within this after its goals stop repeating",
            ),
            limit(
                "external.still_s",
                |own| &mut own.external.still,
                "External motion: a module that stays within the tolerances for this time stands still",
            ),
            tolerance(
                "external.position_tolerance",
                "UNITS",
                |own| &mut own.external.position_tolerance,
                "External motion: distance from the goal at which a module has arrived, in units",
            ),
            tolerance(
                "external.heading_tolerance",
                "RADIANS",
                |own| &mut own.external.heading_tolerance,
                "External motion: deviation from the goal's heading at which a module has arrived, in radians",
            ),
            tolerance(
                "external.error",
                "UNITS",
                |own| &mut own.deviation_limit,
                "External motion: standard deviation in the covariance of an Odometry beyond which localisation is lost, in units",
            ),
        ]
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use ros_runtime::parameters::Tuned;
    use ros_runtime::settings::Settings;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        motion: Tuned<Motion>,
    }

    fn parsed(words: &str) -> Result<Motion, String> {
        let words = std::iter::once("test").chain(words.split_whitespace());
        let command = Command::try_parse_from(words);
        command
            .map(|command| command.motion.0)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn motion_is_simulated_unless_the_command_line_chooses_drivers() {
        let fast = Motion {
            speed: 2.5,
            ..Motion::default()
        };
        assert_eq!(parsed("--speed 2.5"), Ok(fast));
        let driven = Motion {
            mode: DriveMode::External,
            pose_source: PoseSource::Odometry,
            external: ExternalParameters {
                position_tolerance: MicroUnits(10_000),
                ..ExternalParameters::default()
            },
            ..Motion::default()
        };
        let words = "--motion external --pose-source odom --position-tolerance 0.01";
        assert_eq!(parsed(words), Ok(driven));
    }

    #[test]
    fn motion_is_the_same_as_parameters_of_ros_2() {
        for words in [
            "--speed 2.5",
            "--motion external --pose-source odom --driver-frame odom --still-s 0.25",
        ] {
            let given = parsed(words).unwrap();
            let parameters = Settings::default()
                .declare("module_4", given.declarations())
                .unwrap();
            assert_eq!(Motion::default().read(parameters.values()), Ok(given));
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
