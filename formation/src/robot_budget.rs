//! What room a robot needs beside its path: the budget that `formation check --robot` computes.
//!
//! Half of the clearance between two bodies on adjacent cells must hold what a robot may be off its place: four standard deviations
//! of its localisation, how far off its path it drives, how far it drives on before it hears that it is to halt, and its stopping
//! distance.

use std::str::FromStr;

use formation_model::Scenario;
use serde::Serialize;

/// The tolerances that agents and verifiers have by default, in units.
const ARRIVAL_TOLERANCE: f64 = 0.02;
const VERIFIER_TOLERANCE: f64 = 0.05;

/// Scatter beyond this many standard deviations is left to chance.
const DEVIATIONS: f64 = 4.0;

/// Lengths that differ by less than this, in metres, are equal.
const ROUNDING_M: f64 = 1.0e-9;

/// A robot, in metres and seconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Robot {
    /// Its width.
    pub width: f64,
    /// How far off its path it drives.
    pub tracking: f64,
    /// Its speed.
    pub speed: f64,
    /// The time until it hears that it is to halt.
    pub delay: f64,
}

impl FromStr for Robot {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut robot = Self {
            width: 0.0,
            tracking: 0.0,
            speed: 0.0,
            delay: 0.0,
        };
        for entry in text.split(',') {
            let (key, value) = entry
                .split_once('=')
                .ok_or_else(|| format!("`{entry}` is no KEY=VALUE, such as width=0.30"))?;
            let number: f64 = value
                .parse()
                .ok()
                .filter(|number: &f64| number.is_finite() && *number >= 0.0)
                .ok_or_else(|| format!("`{value}` is no number from 0 on"))?;
            *match key.trim() {
                "width" => &mut robot.width,
                "tracking" => &mut robot.tracking,
                "speed" => &mut robot.speed,
                "delay" => &mut robot.delay,
                _ => return Err(format!("`{key}` is none of width, tracking, speed, delay")),
            } = number;
        }
        match robot.width > 0.0 {
            true => Ok(robot),
            false => Err("the width must be given, and greater than 0".to_owned()),
        }
    }
}

/// What a robot needs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Budget {
    /// The pitch of the lattice, in metres.
    pub module_size: f64,
    /// The width of a body, in units.
    pub body_width: f64,
    /// Agents' `--position-tolerance`, in units.
    pub position_tolerance: f64,
    /// The verifier's `--position-tolerance`, in units.
    pub verifier_position_tolerance: f64,
    /// What half of the clearance must hold, in metres, with the part of each cause.
    pub needed: f64,
    pub parts: [(&'static str, f64); 4],
}

impl Budget {
    /// What a robot needs whose localisation has this standard deviation, and which comes to a halt on this way, in metres.
    pub fn of(robot: Robot, error: f64, stop: f64) -> Self {
        Self::at(robot, error, stop, None)
    }

    /// The same on a lattice of this pitch, in metres.
    fn at(robot: Robot, error: f64, stop: f64, pitch: Option<f64>) -> Self {
        let parts = [
            ("localisation", DEVIATIONS * error),
            ("tracking", robot.tracking),
            ("speed x delay", robot.speed * robot.delay),
            ("stopping distance", stop),
        ];
        let needed: f64 = parts.iter().map(|(_, part)| part).sum();
        let pitch = pitch.unwrap_or(robot.width + 2.0 * needed);
        let scatter = DEVIATIONS * error / pitch;
        Self {
            module_size: pitch,
            body_width: robot.width / pitch,
            position_tolerance: scatter.max(ARRIVAL_TOLERANCE),
            verifier_position_tolerance: (2.0 * scatter).max(VERIFIER_TOLERANCE),
            needed,
            parts,
        }
    }

    /// What is too small in a scenario for a robot of this width; nothing if all is large enough.
    pub fn lacks(&self, robot: Robot, scenario: &Scenario) -> Vec<String> {
        let Some(size) = scenario.module_size() else {
            return vec![format!(
                "module_size is missing: the robot needs {:.3} m",
                self.module_size
            )];
        };
        let surroundings = scenario.problem().target().surroundings();
        let (pitch, width) = (size.metres(), surroundings.body_width().to_units());
        let mut lacks = Vec::new();
        if pitch * width + ROUNDING_M < robot.width {
            lacks.push(format!(
                "body_width {width} is {:.3} m at module_size {pitch}: the robot is {:.3} m wide",
                pitch * width,
                robot.width
            ));
        }
        let left = (pitch - robot.width) / 2.0;
        if left + ROUNDING_M < self.needed {
            let parts: Vec<String> = (self.parts.iter())
                .filter(|(_, part)| *part > 0.0)
                .map(|(name, part)| format!("{name} {part:.3} m"))
                .collect();
            lacks.push(format!(
                "module_size {pitch} leaves {:.3} m on each side, and the robot needs {:.3} m ({}): at least {:.3}",
                left.max(0.0),
                self.needed,
                parts.join(" + "),
                self.module_size
            ));
        }
        lacks
    }

    /// A few lines for people; the first two are those of a scenario file.
    pub fn text(&self) -> String {
        let parts: Vec<String> = (self.parts.iter())
            .map(|(name, part)| format!("{name} {part:.3} m"))
            .collect();
        format!(
            "module_size: {:.4}\nbody_width: {:.4}\nagents: --position-tolerance {:.4}\nverifier: --position-tolerance {:.4}\nhalf of the clearance: {:.3} m = {}",
            self.module_size,
            self.body_width,
            self.position_tolerance,
            self.verifier_position_tolerance,
            self.needed,
            parts.join(" + ")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_clearance_holds_what_a_robot_may_be_off() {
        let robot: Robot = "width=0.30,tracking=0.005,speed=0.2,delay=0.1"
            .parse()
            .unwrap();
        let budget = Budget::of(robot, 0.01, 0.05);
        assert!((budget.needed - 0.115).abs() < 1e-12);
        assert!((budget.module_size - 0.53).abs() < 1e-12);
        assert!((budget.body_width - 0.30 / 0.53).abs() < 1e-12);
        assert!((budget.position_tolerance - 0.04 / 0.53).abs() < 1e-12);
        assert!((budget.verifier_position_tolerance - 0.08 / 0.53).abs() < 1e-12);
    }

    #[test]
    fn a_robot_is_refused_by_what_is_wrong_with_it() {
        let refused = |text: &str| text.parse::<Robot>().unwrap_err();
        assert!(refused("tracking=0.1").contains("width"));
        assert!(refused("width=-1").contains("`-1`"));
        assert!(refused("width=0.3,mass=2").contains("`mass`"));
        assert!(refused("0.3").contains("KEY=VALUE"));
    }

    #[test]
    fn what_a_scenario_leaves_too_small_is_named() {
        let scenario = |size: f64, width: f64| {
            let text = format!(
                "module_size: {size}\ntarget: {{map: 'o-o'}}\nbody_width: {width}\nsingletons: [{{id: 1, x: 0, y: 3}}, {{id: 2, x: 3, y: 3}}]"
            );
            Scenario::from_yaml(&text).unwrap()
        };
        let robot: Robot = "width=0.30".parse().unwrap();
        let budget = Budget::of(robot, 0.01, 0.05);
        assert_eq!(budget.lacks(robot, &scenario(0.48, 0.625)), [""; 0]);
        let lacks = budget.lacks(robot, &scenario(0.4, 0.5));
        assert_eq!(lacks.len(), 2);
        assert!(
            lacks[0].contains("body_width 0.5 is 0.200 m"),
            "{}",
            lacks[0]
        );
        assert!(lacks[1].contains("leaves 0.050 m"), "{}", lacks[1]);
    }
}
