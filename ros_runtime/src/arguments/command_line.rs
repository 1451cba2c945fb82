//! The whole command line: a program's own arguments, and those that all ROS 2 nodes take.

use std::ffi::OsString;

use clap::Parser;

use super::ros::RosArguments;
use super::text_file;
use crate::outcome::Failure;

/// A parameter file lists a few dozen values.
const PARAMETER_FILE_BYTES_MAX: u64 = 1 << 20;

const ROS_HELP: &str = "ROS 2 arguments:\n  \
    --ros-args ... [--]  what every ROS 2 node takes: -r FROM:=TO (__ns and __node included), -p NAME:=VALUE,\n                       \
    --params-file FILE, --log-level LEVEL, --disable-rosout-logs, --disable-stdout-logs";

/// Parses the command line of this process; asked for help or its version, or told what it does not know, it ends here.
///
/// # Errors
/// Names the ROS 2 argument or the parameter file that cannot be used.
pub fn parse<A: Parser>() -> Result<(A, RosArguments), Failure> {
    parse_from(std::env::args_os())
}

fn parse_from<A: Parser>(
    words: impl IntoIterator<Item = OsString>,
) -> Result<(A, RosArguments), Failure> {
    let (own, ros) = RosArguments::extract(words, |path| {
        text_file::read(path, PARAMETER_FILE_BYTES_MAX)
    })
    .map_err(Failure::bad_input)?;
    let matches = A::command().after_help(ROS_HELP).get_matches_from(own);
    let arguments = A::from_arg_matches(&matches).map_err(Failure::bad_input)?;
    Ok((arguments, ros))
}
