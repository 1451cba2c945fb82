//! Log lines on the standard error stream, and for `/rosout`.

use std::io::{IsTerminal, stderr};
use std::sync::OnceLock;

use tracing_subscriber::filter::{LevelFilter, ParseError, Targets};
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

/// The lines that `RUST_LOG` asks for, a list such as `info,rustdds=debug`, if it is set.
pub(crate) fn rust_log() -> Result<Option<Targets>, String> {
    let variable = std::env::var_os("RUST_LOG").filter(|text| !text.is_empty());
    let parsed = variable.map(|text| {
        let text = text.to_string_lossy();
        text.parse()
            .map_err(|error: ParseError| format!("RUST_LOG is `{text}`: {error}"))
    });
    parsed.transpose()
}

/// The lines that are logged without `RUST_LOG`: the node's own from `level` on.
fn filter(level: LogLevel, log: &LogArguments) -> Targets {
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

/// Starts the log; returns the lines for `/rosout`, if any are to be published. `RUST_LOG` takes precedence over the levels.
pub(crate) fn start(level: LogLevel, log: &LogArguments) -> Result<Option<LogLines>, String> {
    let filter = rust_log()?.unwrap_or_else(|| filter(level, log));
    let (filter, handle) = reload::Layer::new(filter);
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
    // A log that was started before stays.
    if started.is_err() {
        return Ok(None);
    }
    let _ = FILTER.set(handle);
    Ok(lines)
}

/// Filters by the level for the logger of this name, such as `fleet.camera`, if one is given.
pub(crate) fn follow(logger: &str, log: &LogArguments) {
    let level = log.level_of(logger).filter(|_| !log.loggers.is_empty());
    if let (Some(level), Some(handle), Ok(None)) = (level, FILTER.get(), rust_log()) {
        // The subscriber lives as long as the process.
        let _ = handle.reload(filter(level, log));
    }
}
