//! `formation manual`: the manual pages of all commands, and the same as one page of Markdown.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::Context;
use clap::{Arg, Command};
use ros_runtime::exit::Failure;

use crate::arguments::ManualArguments;
use crate::console;

/// Writes one manual page for each command into a directory, or prints all as Markdown.
///
/// # Errors
/// The directory cannot be made or written to.
pub fn run(command: Command, arguments: &ManualArguments) -> Result<(), Failure> {
    match &arguments.directory {
        Some(directory) => write_pages(command, directory),
        None => console::result_line(markdown(command).trim_end()),
    }
}

fn write_pages(command: Command, directory: &Path) -> Result<(), Failure> {
    let name = || directory.display().to_string();
    fs::create_dir_all(directory)
        .and_then(|()| clap_mangen::generate_to(command, directory))
        .with_context(|| format!("{}: manual pages cannot be written", name()))
        .map_err(Failure::Failed)?;
    console::result_line(&format!("{}: manual pages written", name()))
}

const HEAD: &str = "\
# Command line

<!-- Written by `formation manual --markdown`; a test compares it with the program. -->

Options of the launcher. Every other program lists its own with `--help`; those that are ROS parameters as well are in
[Parameters](parameters.md).
";

fn markdown(mut command: Command) -> String {
    command.build();
    let mut text = HEAD.to_owned();
    for command in command.get_subcommands_mut() {
        describe(command, &mut text);
    }
    text
}

/// A section on a command, and one on each command below it.
fn describe(command: &mut Command, text: &mut String) {
    if command.is_hide_set() || command.get_name() == "help" {
        return;
    }
    let name = command.get_bin_name().unwrap_or(command.get_name());
    // Writing to a string cannot fail.
    let _ = write!(text, "\n## {name}\n\n");
    let about = command.get_long_about().or(command.get_about());
    let about = about.map(ToString::to_string).unwrap_or_default();
    let _ = write!(text, "{}\n\n", prose(&about));
    let usage = command.render_usage().to_string();
    let usage = usage.trim_start_matches("Usage:").trim();
    let _ = write!(text, "```text\n{usage}\n```\n");
    let rows: Vec<String> = command
        .get_arguments()
        .filter(|argument| !argument.is_hide_set() && argument.get_id() != "help")
        .map(row)
        .collect();
    if !rows.is_empty() {
        let _ = write!(
            text,
            "\n| argument | default | |\n|---|---|---|\n{}",
            rows.concat()
        );
    }
    for command in command.get_subcommands_mut() {
        describe(command, text);
    }
}

fn row(argument: &Arg) -> String {
    let values = argument.get_value_names().unwrap_or_default();
    let takes_values = argument.get_action().takes_values();
    let values: Vec<&str> = values.iter().map(|value| value.as_str()).collect();
    let values = values.join(" ");
    let name = match argument.get_long() {
        Some(long) if takes_values => format!("--{long} {values}"),
        Some(long) => format!("--{long}"),
        None => values,
    };
    let default: Vec<String> = argument
        .get_default_values()
        .iter()
        .filter(|_| takes_values)
        .map(|value| format!("`{}`", value.to_string_lossy()))
        .collect();
    let help = argument.get_long_help().or(argument.get_help());
    let mut help = prose(&help.map(ToString::to_string).unwrap_or_default());
    let possible: Vec<String> = argument
        .get_possible_values()
        .iter()
        .filter(|_| takes_values)
        .map(|value| format!("`{}`", value.get_name()))
        .collect();
    if !possible.is_empty() {
        let _ = write!(help, " One of {}.", possible.join(", "));
    }
    format!(
        "| `{}` | {} | {} |\n",
        name.replace('|', "\\|"),
        default.join(" "),
        help.replace('\n', " ").replace('|', "\\|")
    )
}

/// A help text as sentences: clap leaves out the last stop.
fn prose(help: &str) -> String {
    let help = help.trim();
    match help.chars().last() {
        None | Some('.' | ']' | ':') => help.to_owned(),
        Some(_) => format!("{help}."),
    }
}
