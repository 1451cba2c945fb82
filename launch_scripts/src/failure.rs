//! How a command can fail, and the exit status by which a script distinguishes failures.

use std::fmt;
use std::process::ExitCode;

/// Why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// The input or the environment is wrong; nothing was started.
    BadInput(anyhow::Error),
    /// The command began, and then failed or found something wrong.
    Failed(anyhow::Error),
    /// The reader of the standard output closed it, as `head` does; nothing is reported then.
    OutputClosed,
}

impl Failure {
    /// The exit status.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::BadInput(_) => ExitCode::from(2),
            Self::Failed(_) | Self::OutputClosed => ExitCode::from(1),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // Parsers may quote the input, so a message can hold line ends of its own.
            Self::BadInput(error) | Self::Failed(error) => {
                formatter.write_str(&one_line(&format!("{error:#}")))
            }
            Self::OutputClosed => formatter.write_str("the standard output was closed"),
        }
    }
}

/// The text with every run of line ends and other control characters replaced by one space.
pub fn one_line(text: &str) -> String {
    text.split(char::is_control)
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_one_line_with_all_its_causes() {
        let failure = Failure::BadInput(anyhow::anyhow!("line\r\nend\tof it").context("file"));
        assert_eq!(failure.to_string(), "file: line end of it");
    }
}
