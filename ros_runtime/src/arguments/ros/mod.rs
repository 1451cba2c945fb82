//! The arguments between `--ros-args` and `--`, which all ROS 2 nodes take.
//!
//! After the design articles "ROS Command Line Arguments" and "Remapping Names". Nothing here touches the network; the
//! caller gives the function that reads parameter files.

mod assignments;
mod log_levels;
mod names;
mod remapping;
mod yaml;

use std::ffi::OsString;
use std::io;
use std::path::Path;

use crate::words::suggestion;

pub use assignments::{Origin, ParameterAssignment, ParameterAssignments};
pub use log_levels::{LogArguments, LogLevel};
pub use names::{Namespace, NodeIdentity};
pub use remapping::{RemapRule, RemapRules, Resource};

/// The arguments for ROS 2.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RosArguments {
    /// The remapping rules.
    pub remaps: RemapRules,
    /// The values of parameters.
    pub parameters: ParameterAssignments,
    /// What is logged, and where to.
    pub log: LogArguments,
}

const REMAP: &str = "--remap";
const PARAMETER: &str = "--param";
const PARAMETER_FILE: &str = "--params-file";
const LOG_LEVEL: &str = "--log-level";
const LOG_CONFIGURATION: &str = "--log-config-file";
const LOG_FILE_NAME: &str = "--log-file-name";
const ENCLAVE: &str = "--enclave";
/// The long flags that take a value, with their short forms.
const WITH_VALUE: [(&str, &str); 7] = [
    (REMAP, "-r"),
    (PARAMETER, "-p"),
    (PARAMETER_FILE, ""),
    (LOG_LEVEL, ""),
    (LOG_CONFIGURATION, ""),
    (LOG_FILE_NAME, ""),
    (ENCLAVE, "-e"),
];
const SWITCHES: [&str; 6] = [
    "--enable-rosout-logs",
    "--disable-rosout-logs",
    "--enable-stdout-logs",
    "--disable-stdout-logs",
    "--enable-external-lib-logs",
    "--disable-external-lib-logs",
];

impl RosArguments {
    /// Takes the arguments for ROS 2 out of a command line, and leaves the program's own.
    ///
    /// `read` reads a parameter file.
    ///
    /// # Errors
    /// Names the first argument that cannot be used, and the valid one that is nearest to it.
    pub fn extract(
        arguments: impl IntoIterator<Item = OsString>,
        read: impl Fn(&Path) -> io::Result<String>,
    ) -> Result<(Vec<OsString>, Self), String> {
        let mut own = Vec::new();
        let mut found = Self::default();
        let mut arguments = arguments.into_iter();
        // The program's name comes first.
        own.extend(arguments.next());
        while let Some(argument) = arguments.next() {
            if argument == "--ros-args" {
                while let Some(argument) = arguments.next().filter(|argument| argument != "--") {
                    found.take(&argument, &mut arguments, &read)?;
                }
                continue;
            }
            if let Some(text) = argument.to_str()
                && text.contains(":=")
                && !text.starts_with('-')
            {
                return Err(format!(
                    "`{text}` must stand behind `--ros-args -r` if it is a remapping rule, and behind \
                     `--ros-args -p` if it assigns a parameter"
                ));
            }
            own.push(argument);
        }
        Ok((own, found))
    }

    fn take(
        &mut self,
        argument: &OsString,
        rest: &mut impl Iterator<Item = OsString>,
        read: &impl Fn(&Path) -> io::Result<String>,
    ) -> Result<(), String> {
        let argument = text(argument)?;
        let (flag, attached) = match argument.split_once('=') {
            Some((flag, value)) if flag.starts_with("--") => (flag, Some(value)),
            _ => (argument, None),
        };
        // A set of arguments within a set changes nothing.
        if argument == "--ros-args" {
            return Ok(());
        }
        if let Some((long, _)) = WITH_VALUE
            .into_iter()
            .find(|&(long, short)| flag == long || (!short.is_empty() && flag == short))
        {
            let value = match attached {
                Some(value) => value.to_owned(),
                None => {
                    let value = rest
                        .next()
                        .ok_or_else(|| format!("`{argument}` needs a value"))?;
                    text(&value)?.to_owned()
                }
            };
            return self.take_value(long, &value, read);
        }
        if attached.is_none() && self.log.switch(flag) {
            return Ok(());
        }
        let flags = WITH_VALUE
            .into_iter()
            .flat_map(|(long, short)| [long, short]);
        let flags = flags.chain(SWITCHES).filter(|flag| !flag.is_empty());
        let nearest = suggestion(flag, flags);
        Err(format!(
            "unknown argument `{argument}` after `--ros-args`{nearest}"
        ))
    }

    fn take_value(
        &mut self,
        flag: &str,
        value: &str,
        read: &impl Fn(&Path) -> io::Result<String>,
    ) -> Result<(), String> {
        match flag {
            REMAP => self.remaps.0.push(value.parse()?),
            PARAMETER => self.parameters.add_argument(value)?,
            PARAMETER_FILE => {
                let text = read(Path::new(value))
                    .map_err(|error| format!("parameter file {value}: {error}"))?;
                self.parameters.add_file(Path::new(value), &text)?;
            }
            LOG_LEVEL => self.log.add(value)?,
            LOG_CONFIGURATION | LOG_FILE_NAME => {
                return Err(format!(
                    "`{flag}` has no meaning here: nodes log to the standard error stream and to `/rosout`, and write \
                     no log file"
                ));
            }
            // A user who asks for security must not get a node without it.
            _ => {
                return Err(format!(
                    "`{flag} {value}`: security enclaves are not supported; leave it out to run without security"
                ));
            }
        }
        Ok(())
    }
}

fn text(argument: &OsString) -> Result<&str, String> {
    argument
        .to_str()
        .ok_or_else(|| format!("{argument:?} is not UTF-8"))
}

#[cfg(test)]
mod tests;
