//! Where the node's programs are, and how they are started.

use std::env;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, anyhow};
use ros_runtime::exit::Failure;

/// The program that records a run.
pub const RECORDER: &str = "recorder";

/// The programs that every run starts.
pub const PROGRAMS: [&str; 4] = [
    "module_agent",
    "leader_agent",
    "target_publisher",
    "verifier",
];

/// The programs in the launcher's directory.
pub struct Programs {
    directory: PathBuf,
}

impl Programs {
    /// Finds the programs in the launcher's own directory.
    ///
    /// # Errors
    /// Names the program that is missing, and how to build it.
    pub fn next_to_launcher() -> Result<Self, Failure> {
        let launcher = env::current_exe()
            .context("cannot find the launcher's own program")
            .map_err(Failure::BadInput)?;
        let directory = launcher.parent().unwrap_or(Path::new(".")).to_owned();
        Self::in_directory(directory)
    }

    fn in_directory(directory: PathBuf) -> Result<Self, Failure> {
        let programs = Self { directory };
        for program in PROGRAMS {
            programs.require(program)?;
        }
        Ok(programs)
    }

    /// Checks that a program is there.
    ///
    /// # Errors
    /// Names the program, and how to build it.
    pub fn require(&self, program: &str) -> Result<(), Failure> {
        let path = self.directory.join(program);
        if path.is_file() {
            return Ok(());
        }
        Err(Failure::BadInput(anyhow!(
            "{} is missing; build it next to the launcher with `cargo build --release`",
            path.display()
        )))
    }

    /// A command that runs one of the programs.
    ///
    /// It has a process group of its own, so that Ctrl-C in the terminal reaches the launcher alone, which then stops
    /// everything in order. Should the launcher itself be killed, the kernel asks the program to end.
    pub fn command(&self, program: &str) -> Command {
        let mut command = Command::new(self.directory.join(program));
        command.process_group(0).arg("--stop-with-parent");
        command
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_missing_program_is_named() {
        let directory = tempfile::tempdir().unwrap();
        for program in &PROGRAMS[..3] {
            fs::write(directory.path().join(program), "").unwrap();
        }
        let Err(failure) = Programs::in_directory(directory.path().to_owned()) else {
            panic!("the verifier is not there");
        };
        let message = failure.to_string();
        assert!(message.contains("verifier is missing"), "{message}");
        assert!(message.contains("cargo build"), "{message}");
    }
}
