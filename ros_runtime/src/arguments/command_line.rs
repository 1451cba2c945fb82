//! The whole command line: a program's own arguments, and those that all ROS 2 nodes take.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;

use clap::builder::Resettable;
use clap::{Args, Command, FromArgMatches, Parser, ValueEnum};
use clap_complete::Shell;

use super::network::NetworkArguments;
use super::ros::RosArguments;
use crate::exit::{Failure, STATUS_DONE};

/// A parameter file lists a few dozen values.
const PARAMETER_FILE_BYTES_MAX: u64 = 1 << 20;

/// Prints the completions of a shell, where it is the only option; packages install them.
const COMPLETIONS: &str = "--completions";

const ROS_HELP: &str = "ROS 2 arguments:\n  \
    --ros-args ... [--]  what every ROS 2 node takes: -r FROM:=TO (__ns and __node included), -p NAME:=VALUE,\n                       \
    --params-file FILE, --log-level LEVEL, --disable-rosout-logs, --disable-stdout-logs";

/// Parses the command line of this process: its own arguments, those of every node, and those for ROS 2. Asked for help
/// or its version, or given an unknown argument, the process ends here.
///
/// # Errors
/// Names the ROS 2 argument or the parameter file that cannot be used.
pub fn parse<A: Parser>() -> Result<(A, NetworkArguments, RosArguments), Failure> {
    let read = |path: &Path| read_bounded(path, PARAMETER_FILE_BYTES_MAX);
    let (own, ros) =
        RosArguments::extract(std::env::args_os(), read).map_err(Failure::bad_input)?;
    let program = A::command();
    let [about, long_about] =
        [program.get_about(), program.get_long_about()].map(|text| Resettable::from(text.cloned()));
    let command = NetworkArguments::augment_args(program).after_help(ROS_HELP);
    // The arguments of every node would replace what the program says about itself.
    let mut command = command.about(about).long_about(long_about);
    if let [_, option, shell] = own.as_slice()
        && option == COMPLETIONS
    {
        let script = completions(&mut command, &shell.to_string_lossy())?;
        // What reads it may be gone.
        let _ = io::stdout().lock().write_all(script.as_bytes());
        std::process::exit(STATUS_DONE.into());
    }
    let matches = command.get_matches_from(own);
    let arguments = A::from_arg_matches(&matches).map_err(Failure::bad_input)?;
    let network = NetworkArguments::from_arg_matches(&matches).map_err(Failure::bad_input)?;
    Ok((arguments, network, ros))
}

/// The script by which a shell completes the options of a program.
///
/// # Errors
/// The shell is unknown.
pub fn completions(command: &mut Command, shell: &str) -> Result<String, Failure> {
    let known = Shell::value_variants().iter().map(ToString::to_string);
    let found = Shell::from_str(shell, true).map_err(|_| {
        let known: Vec<String> = known.collect();
        Failure::bad_input(format_args!("`{shell}` is none of {}", known.join(", ")))
    })?;
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(found, command, name, &mut script);
    String::from_utf8(script).map_err(Failure::failed)
}

/// Reads a text file of at most `bytes_max` bytes. The length of a pipe is unknown, so the limit applies to what is read.
///
/// # Errors
/// The file cannot be read, is no text, or is larger.
pub fn read_bounded(path: &Path, bytes_max: u64) -> io::Result<String> {
    let file = File::open(path).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => io::Error::other("there is no such file"),
        _ => error,
    })?;
    if file.metadata()?.is_dir() {
        return Err(io::Error::other("is a directory, not a file"));
    }
    text_of(file, bytes_max)
}

/// Reads a text of at most `bytes_max` bytes to its end, for example from the standard input.
///
/// # Errors
/// It cannot be read, is no text, or is larger.
pub fn text_of(source: impl Read, bytes_max: u64) -> io::Result<String> {
    let mut bytes = Vec::new();
    source.take(bytes_max + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > bytes_max {
        let most = bytes_max >> 20;
        return Err(io::Error::other(format!("is larger than {most} MiB")));
    }
    let text = String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        io::Error::other(format!("is no UTF-8 text (byte {})", valid + 1))
    })?;
    // Some editors begin a file with a byte order mark, which is no part of its text.
    Ok(match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_owned(),
        None => text,
    })
}
