//! Log lines on the standard error stream.

use std::io::{IsTerminal, stderr};

use clap::ValueEnum;
use tracing_subscriber::EnvFilter;

/// The levels of ROS 2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum LogLevel {
    /// Everything, the DDS library's own words included.
    Debug,
    /// The course of things.
    #[default]
    Info,
    /// What the suite can deal with by itself.
    Warn,
    /// What a person has to mend.
    Error,
    /// The same as `error`: whatever is fatal ends the process and is told last.
    Fatal,
}

impl LogLevel {
    fn filter(self) -> &'static str {
        // The DDS library logs the ordinary hazards of a network as warnings and errors.
        match self {
            Self::Debug => {
                "debug,rustdds=info,ros2_client=info,mio=warn,polling=warn,async_io=warn"
            }
            Self::Info => "info,rustdds=off,ros2_client=off",
            Self::Warn => "warn,rustdds=off,ros2_client=off",
            Self::Error | Self::Fatal => "error,rustdds=off,ros2_client=off",
        }
    }
}

/// Logs from here on; a set `RUST_LOG` decides instead of `level`.
pub fn start(level: LogLevel) {
    let filter =
        EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level.filter()));
    // A second start, as in tests that share a process, leaves the first in place.
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(stderr)
        .with_ansi(stderr().is_terminal())
        .with_target(false)
        .try_init();
}
