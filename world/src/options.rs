//! How the robots of the world move, measure and dock.

use std::time::Duration;

use formation_node_support::PoseSource;
use ros_runtime::parameters::{
    ParameterValue, Range, Tunable, Tunables, ValueType, choice, milliseconds, number,
};
use ros_runtime::words::Words;

/// How the wheels of a robot let it move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveKind {
    /// In every direction, whatever its heading.
    #[default]
    Holonomic,
    /// Along its heading only, forwards and backwards; it turns in place.
    Differential,
}

impl Words for DriveKind {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("holonomic", Self::Holonomic),
        ("differential", Self::Differential),
    ];
}

/// How the robots of the world move, measure and dock.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldOptions {
    /// The seed of all that is random.
    pub seed: u32,
    /// How their wheels let them move.
    pub drive: DriveKind,
    /// The greatest speed, in units a second.
    pub speed: f64,
    /// The greatest acceleration, in units a second squared.
    pub acceleration: f64,
    /// The greatest share of a commanded velocity that is lost.
    pub slip: f64,
    /// The standard deviation of measured positions along each axis, in units.
    pub noise: f64,
    /// The standard deviation of measured headings, in radians.
    pub heading_noise: f64,
    /// How late poses are published.
    pub delay: Duration,
    /// The probability that a pose is not published.
    pub loss: f64,
    /// The probability that an attempt to dock fails.
    pub docking_failure: f64,
    /// How far a module may be off its place when it docks, in units; the same in radians.
    pub docking_tolerance: f64,
    /// Which message has the pose.
    pub pose_source: PoseSource,
}

impl Default for WorldOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            drive: DriveKind::default(),
            speed: 1.0,
            acceleration: 10.0,
            slip: 0.0,
            noise: 0.0,
            heading_noise: 0.0,
            delay: Duration::ZERO,
            loss: 0.0,
            docking_failure: 0.0,
            docking_tolerance: 0.03,
            pose_source: PoseSource::default(),
        }
    }
}

impl Tunables for WorldOptions {
    const HEADING: &'static str = "World";

    fn table() -> Vec<Tunable<Self>> {
        let mut table = Self::motion();
        table.extend(Self::disturbances());
        let rows = table.into_iter();
        rows.map(|row| row.at_start("the world is set up with it"))
            .collect()
    }
}

impl WorldOptions {
    fn motion() -> Vec<Tunable<Self>> {
        vec![
            Tunable::new(
                "world.seed",
                seed(),
                |own: &mut Self| &mut own.seed,
                "Seed of all that is random: slip, noise, lost poses, docking",
            ),
            Tunable::new(
                "world.drive",
                choice("KIND"),
                |own: &mut Self| &mut own.drive,
                "How robots move: in every direction, or along their heading only, for which they turn in place",
            ),
            Tunable::new(
                "world.speed",
                number("UNITS_PER_S", 0.001, 100.0),
                |own: &mut Self| &mut own.speed,
                "Greatest speed of a robot, in units per second",
            ),
            Tunable::new(
                "world.acceleration",
                number("UNITS_PER_S2", 0.01, 1_000.0),
                |own: &mut Self| &mut own.acceleration,
                "Greatest acceleration of a robot, in units per second squared",
            ),
            Tunable::new(
                "world.pose_source",
                choice("SOURCE"),
                |own: &mut Self| &mut own.pose_source,
                "Which message has the pose of a robot, PoseStamped on `pose` or Odometry on `odom`",
            ),
        ]
    }

    fn disturbances() -> Vec<Tunable<Self>> {
        let probability = |name, field: fn(&mut Self) -> &mut f64, help| {
            Tunable::new(name, number("PROBABILITY", 0.0, 1.0), field, help)
        };
        vec![
            Tunable::new(
                "world.slip",
                number("SHARE", 0.0, 0.95),
                |own: &mut Self| &mut own.slip,
                "Greatest share of a commanded velocity that is lost; the share is drawn ten times a second",
            ),
            Tunable::new(
                "world.noise",
                number("UNITS", 0.0, 1.0),
                |own: &mut Self| &mut own.noise,
                "Standard deviation of measured positions along each axis, in units",
            ),
            Tunable::new(
                "world.heading_noise",
                number("RADIANS", 0.0, 1.0),
                |own: &mut Self| &mut own.heading_noise,
                "Standard deviation of measured headings, in radians",
            ),
            Tunable::new(
                "world.delay_ms",
                milliseconds(5_000.0),
                |own: &mut Self| &mut own.delay,
                "How late poses are published, in milliseconds",
            ),
            probability(
                "world.loss",
                |own| &mut own.loss,
                "Probability that a pose is lost",
            ),
            probability(
                "world.docking_failure",
                |own| &mut own.docking_failure,
                "Probability that an attempt to dock fails; modules then repeat it",
            ),
            Tunable::new(
                "world.docking_tolerance",
                number("UNITS", 0.001, 0.2),
                |own: &mut Self| &mut own.docking_tolerance,
                "How far a module may be off its place when it docks, in units; the same in radians",
            ),
        ]
    }
}

/// A seed.
fn seed() -> ValueType<u32> {
    let range = Range::Integer {
        from: 0,
        to: u32::MAX.into(),
    };
    let write = |seed: &u32| ParameterValue::Integer((*seed).into());
    ValueType::new("NUMBER", range, write, |value| match value {
        ParameterValue::Integer(seed) => u32::try_from(*seed).ok(),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::ffi::OsString;

    use formation_tests::parameter_section;
    use ros_runtime::arguments::RosArguments;
    use ros_runtime::settings::Settings;

    use super::*;

    #[test]
    fn the_shipped_file_lists_every_parameter_with_its_default() {
        let words = ["", "--ros-args", "--params-file", ""].map(OsString::from);
        let sections = parameter_section(&["The world"]);
        let (_, ros) = RosArguments::extract(words, |_| Ok(sections.clone())).unwrap();
        let node = Settings::default().identity("world");
        let shipped = ros.parameters.of_node(&node).into_iter();
        let shipped = shipped.map(|(name, assignment)| (name, assignment.value.clone()));
        let declared = WorldOptions::default().declarations().into_iter();
        let declared = declared.map(|declaration| (declaration.name, declaration.value));
        assert_eq!(shipped.collect::<BTreeMap<_, _>>(), declared.collect());
    }
}
