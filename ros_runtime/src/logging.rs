//! Log lines on the standard error stream, and for `/rosout`.

use std::io::{IsTerminal, stderr};
use std::sync::OnceLock;

use tracing::Level;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{Registry, reload};

use crate::arguments::{LogArguments, LogLevel};
use crate::rosout::{LogLines, rosout};

/// The libraries below us, by the names under which they log.
const LIBRARIES: [&str; 2] = ["rustdds", "ros2_client"];

/// The filter in use, so that it can be set anew once the node has its name.
static FILTER: OnceLock<reload::Handle<Targets, Registry>> = OnceLock::new();

fn passing(level: LogLevel) -> Level {
    match level {
        LogLevel::Debug => Level::DEBUG,
        LogLevel::Info => Level::INFO,
        LogLevel::Warn => Level::WARN,
        LogLevel::Error | LogLevel::Fatal => Level::ERROR,
    }
}

/// What passes when the node's own lines pass from `level` on.
fn filter(level: LogLevel, log: &LogArguments) -> Targets {
    // A set RUST_LOG decides instead.
    let variable = std::env::var("RUST_LOG").unwrap_or_default();
    if !variable.is_empty()
        && let Ok(filter) = variable.parse()
    {
        return filter;
    }
    // The DDS library logs the ordinary hazards of a network as warnings and errors.
    let libraries = LIBRARIES.map(|library| {
        let level = match log.loggers.iter().rfind(|(logger, _)| logger == library) {
            Some((_, level)) => passing(*level).into(),
            None if level == LogLevel::Debug => LevelFilter::INFO,
            None => LevelFilter::OFF,
        };
        (library, level)
    });
    Targets::new()
        .with_default(passing(level))
        .with_targets(libraries)
        .with_targets(["mio", "polling", "async_io"].map(|library| (library, Level::WARN)))
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
