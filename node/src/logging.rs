//! Log lines on the standard error stream.

use std::io::{IsTerminal, stderr};

use tracing_subscriber::EnvFilter;

use crate::arguments::LogLevel;

fn filter(level: LogLevel) -> &'static str {
    // The DDS library logs the ordinary hazards of a network as warnings and errors.
    match level {
        LogLevel::Debug => {
            "debug,rustdds=info,ros2_client=info,mio=warn,polling=warn,async_io=warn"
        }
        LogLevel::Info => "info,rustdds=off,ros2_client=off",
        LogLevel::Warn => "warn,rustdds=off,ros2_client=off",
        LogLevel::Error | LogLevel::Fatal => "error,rustdds=off,ros2_client=off",
    }
}

/// Logs from here on; a set `RUST_LOG` decides instead of `level`.
pub fn start(level: LogLevel) {
    let filter =
        EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(filter(level)));
    // A second start, as in tests that share a process, leaves the first in place.
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(stderr)
        .with_ansi(stderr().is_terminal())
        .with_target(false)
        .try_init();
}
