//! The arguments of `formation check`.

use std::path::PathBuf;

use clap::Args;

use super::{DIFFERENTIAL, HOLONOMIC};
use crate::robot_budget::Robot;

/// What `formation check` checks.
#[derive(Debug, Args)]
pub struct CheckArguments {
    /// The scenario file (YAML); - for the standard input. Not needed with --robot.
    #[arg(required_unless_present = "robot")]
    pub scenario: Option<PathBuf>,
    /// How the robots drive: in every direction, or along their heading only, for which they turn in place.
    #[arg(long, value_name = "KIND", default_value = HOLONOMIC, value_parser = [HOLONOMIC, DIFFERENTIAL])]
    pub drive: String,
    /// A robot, by its width, and optionally by how far off its path it drives, its speed, and how late it hears that it is to halt: width=M[,tracking=M][,speed=M_PER_S][,delay=S]. Prints the sizes and tolerances that it needs, and names what a scenario leaves too small for it.
    #[arg(long, value_name = "SPEC")]
    pub robot: Option<Robot>,
    /// The standard deviation of the robot's localisation, in metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.0, requires = "robot")]
    pub error: f64,
    /// The way on which the robot comes to a halt, in metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.0, requires = "robot")]
    pub stop: f64,
    /// Print one JSON object instead of a line.
    #[arg(long)]
    pub json: bool,
}
