//! Log lines on the standard error stream, and for `/rosout`.

use std::io::{IsTerminal, stderr};
use std::sync::OnceLock;

use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Registry, reload};

use crate::arguments::{LogArguments, LogLevel};
use crate::rosout::{LogLines, rosout};

/// The libraries below us, by the names under which they log.
const LIBRARIES: [&str; 2] = ["rustdds", "ros2_client"];

/// The filter in use, so that it can be set anew once the node has its name.
static FILTER: OnceLock<reload::Handle<EnvFilter, Registry>> = OnceLock::new();

fn word(level: LogLevel) -> &'static str {
    match level {
        LogLevel::Debug => "debug",
        LogLevel::Info => "info",
        LogLevel::Warn => "warn",
        LogLevel::Error | LogLevel::Fatal => "error",
    }
}

/// What passes when the node's own lines pass from `level` on.
fn filter(level: LogLevel, log: &LogArguments) -> EnvFilter {
    // A set RUST_LOG decides instead.
    if let Ok(filter) = EnvFilter::try_from_default_env() {
        return filter;
    }
    let mut directives = word(level).to_owned();
    // The DDS library logs the ordinary hazards of a network as warnings and errors.
    for library in LIBRARIES {
        let level = match log.loggers.iter().rfind(|(logger, _)| logger == library) {
            Some((_, level)) => word(*level),
            None if level == LogLevel::Debug => "info",
            None => "off",
        };
        directives.push_str(&format!(",{library}={level}"));
    }
    directives.push_str(",mio=warn,polling=warn,async_io=warn");
    EnvFilter::new(directives)
}

/// Logs from here on; returns the lines that are to go to `/rosout`, if any are.
pub fn start(level: LogLevel, log: &LogArguments) -> Option<LogLines> {
    let (filter, handle) = reload::Layer::new(filter(level, log));
    let console = log.console.then(|| {
        tracing_subscriber::fmt::layer()
            .with_writer(stderr)
            .with_ansi(stderr().is_terminal())
            .with_target(false)
    });
    let (layer, lines) = log.rosout.then(rosout).unzip();
    let started = tracing_subscriber::registry()
        .with(filter)
        .with(console)
        .with(layer)
        .try_init();
    // A second start, as in tests that share a process, leaves the first in place.
    if started.is_err() {
        return None;
    }
    let _ = FILTER.set(handle);
    lines
}

/// Lets pass what is to pass for the logger of this name, such as `formation.module_4`.
pub fn follow(logger: &str, log: &LogArguments) {
    let Some(level) = log.level_of(logger).filter(|_| !log.loggers.is_empty()) else {
        return;
    };
    if let Some(handle) = FILTER.get() {
        // The subscriber lives as long as the process.
        let _ = handle.reload(filter(level, log));
    }
}
