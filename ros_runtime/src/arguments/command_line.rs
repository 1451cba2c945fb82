//! The whole command line: a program's own arguments, and those that all ROS 2 nodes take.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use clap::Parser;

use super::ros::RosArguments;
use crate::exit::Failure;

/// A parameter file lists a few dozen values.
const PARAMETER_FILE_BYTES_MAX: u64 = 1 << 20;

const ROS_HELP: &str = "ROS 2 arguments:\n  \
    --ros-args ... [--]  what every ROS 2 node takes: -r FROM:=TO (__ns and __node included), -p NAME:=VALUE,\n                       \
    --params-file FILE, --log-level LEVEL, --disable-rosout-logs, --disable-stdout-logs";

/// Parses the command line of this process. Asked for help or its version, or given an unknown argument, the process
/// ends here.
///
/// # Errors
/// Names the ROS 2 argument or the parameter file that cannot be used.
pub fn parse<A: Parser>() -> Result<(A, RosArguments), Failure> {
    let read = |path: &Path| read_bounded(path, PARAMETER_FILE_BYTES_MAX);
    let (own, ros) =
        RosArguments::extract(std::env::args_os(), read).map_err(Failure::bad_input)?;
    let matches = A::command().after_help(ROS_HELP).get_matches_from(own);
    let arguments = A::from_arg_matches(&matches).map_err(Failure::bad_input)?;
    Ok((arguments, ros))
}

/// Reads a text file of at most `bytes_max` bytes.
///
/// # Errors
/// The file cannot be read, is no text, or is larger.
pub fn read_bounded(path: &Path, bytes_max: u64) -> io::Result<String> {
    let mut text = String::new();
    let file = File::open(path)?;
    file.take(bytes_max + 1).read_to_string(&mut text)?;
    if text.len() as u64 > bytes_max {
        return Err(io::Error::other(format!(
            "is larger than {bytes_max} bytes"
        )));
    }
    Ok(text)
}
