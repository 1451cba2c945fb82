//! What is logged, and where to.

use crate::words::{Words, by_words};

/// The levels of ROS 2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum LogLevel {
    /// Everything.
    Debug,
    /// The course of events.
    #[default]
    Info,
    /// Faults that the suite tolerates.
    Warn,
    /// Faults on which a person has to act.
    Error,
    /// Treated as `Error`: a fatal fault ends the process and is its last line.
    Fatal,
}

impl Words for LogLevel {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("DEBUG", Self::Debug),
        ("INFO", Self::Info),
        ("WARN", Self::Warn),
        ("ERROR", Self::Error),
        ("FATAL", Self::Fatal),
    ];
}

by_words!(LogLevel);

/// What the arguments for ROS 2 say of logging.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogArguments {
    /// The least level for all loggers, where given.
    pub level: Option<LogLevel>,
    /// The least level for a logger and those below it, in the order given.
    pub loggers: Vec<(String, LogLevel)>,
    /// Whether log lines go to `/rosout`.
    pub rosout: bool,
    /// Whether log lines go to the console.
    pub console: bool,
}

impl Default for LogArguments {
    fn default() -> Self {
        Self {
            level: None,
            loggers: Vec::new(),
            rosout: true,
            console: true,
        }
    }
}

impl LogArguments {
    /// Adds `LEVEL` or `logger:=LEVEL`.
    pub(super) fn add(&mut self, value: &str) -> Result<(), String> {
        let (logger, level) = match value.split_once(":=") {
            Some(("", _)) => return Err(format!("`{value}` must name a logger before `:=`")),
            Some((logger, level)) => (Some(logger), level),
            None => (None, value),
        };
        let level = level
            .parse()
            .map_err(|reason| format!("log level: {reason}"))?;
        match logger {
            Some(logger) => self.loggers.push((logger.to_owned(), level)),
            None => self.level = Some(level),
        }
        Ok(())
    }

    /// Takes a switch, if it is one of logging.
    pub(super) fn switch(&mut self, flag: &str) -> bool {
        match flag {
            "--enable-rosout-logs" => self.rosout = true,
            "--disable-rosout-logs" => self.rosout = false,
            "--enable-stdout-logs" => self.console = true,
            "--disable-stdout-logs" => self.console = false,
            // No other library logs, so there is nothing to turn on or off.
            "--enable-external-lib-logs" | "--disable-external-lib-logs" => {}
            _ => return false,
        }
        true
    }

    /// The least level for a logger, where given: that of the longest name that is the logger's or above it.
    #[must_use]
    pub fn level_of(&self, logger: &str) -> Option<LogLevel> {
        let matching = self.loggers.iter().filter(|(name, _)| {
            let below = logger.strip_prefix(name.as_str());
            below.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        });
        // Of two that are equally long the later one holds.
        let longest = matching.max_by_key(|(name, _)| name.len());
        longest.map(|(_, level)| *level).or(self.level)
    }
}
