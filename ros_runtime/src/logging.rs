//! Log lines on the standard error stream, and for `/rosout`.

use std::io::{IsTerminal, stderr};
use std::sync::OnceLock;

use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{Registry, reload};

use crate::arguments::{LogArguments, LogLevel};
use crate::rosout::{LogLines, rosout};

/// The libraries below, by the names under which they log.
const LIBRARIES: [&str; 3] = ["rustdds", "ros2_client", "zenoh"];

/// The filter in use, so that it can be replaced once the node has its name.
static FILTER: OnceLock<reload::Handle<Targets, Registry>> = OnceLock::new();

fn level_filter(level: LogLevel) -> LevelFilter {
    match level {
        LogLevel::Debug => LevelFilter::DEBUG,
        LogLevel::Info => LevelFilter::INFO,
        LogLevel::Warn => LevelFilter::WARN,
        LogLevel::Error | LogLevel::Fatal => LevelFilter::ERROR,
    }
}

/// The lines that are logged: the node's own from `level` on. `RUST_LOG`, a list such as `info,rustdds=debug`, takes
/// precedence.
fn filter(level: LogLevel, log: &LogArguments) -> Targets {
    let variable = std::env::var("RUST_LOG")
        .ok()
        .filter(|text| !text.is_empty());
    if let Some(filter) = variable.and_then(|text| text.parse().ok()) {
        return filter;
    }
    // The libraries log the ordinary hazards of a network as warnings and errors.
    let libraries = LIBRARIES.map(|library| {
        let mut levels = log.loggers.iter().rev();
        let level = match levels.find(|(logger, _)| logger == library) {
            Some((_, level)) => level_filter(*level),
            None if level == LogLevel::Debug => LevelFilter::INFO,
            None => LevelFilter::OFF,
        };
        (library, level)
    });
    Targets::new()
        .with_default(level_filter(level))
        .with_targets(libraries)
        .with_targets(["mio", "polling", "async_io"].map(|library| (library, LevelFilter::WARN)))
}

/// Starts the log; returns the lines for `/rosout`, if any are to be published.
pub(crate) fn start(level: LogLevel, log: &LogArguments) -> Option<LogLines> {
    let (filter, handle) = reload::Layer::new(filter(level, log));
    let console = log.console.then(|| {
        tracing_subscriber::fmt::layer()
            .with_writer(stderr)
            .with_ansi(stderr().is_terminal())
            .with_target(false)
    });
    let (layer, lines) = log.rosout.then(rosout).unzip();
    tracing_subscriber::registry()
        .with(filter)
        .with(console)
        .with(layer)
        .try_init()
        .ok()?;
    let _ = FILTER.set(handle);
    lines
}

/// Filters by the level for the logger of this name, such as `fleet.camera`, if one is given.
pub(crate) fn follow(logger: &str, log: &LogArguments) {
    let level = log.level_of(logger).filter(|_| !log.loggers.is_empty());
    if let (Some(level), Some(handle)) = (level, FILTER.get()) {
        // The subscriber lives as long as the process.
        let _ = handle.reload(filter(level, log));
    }
}
