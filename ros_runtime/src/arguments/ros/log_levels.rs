//! What is logged, and where to.

use std::str::FromStr;

use clap::ValueEnum;

use super::nearest::suggestion;

/// The levels of ROS 2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum LogLevel {
    /// Everything.
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

const LEVELS: [(&str, LogLevel); 5] = [
    ("DEBUG", LogLevel::Debug),
    ("INFO", LogLevel::Info),
    ("WARN", LogLevel::Warn),
    ("ERROR", LogLevel::Error),
    ("FATAL", LogLevel::Fatal),
];

impl FromStr for LogLevel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        LEVELS
            .into_iter()
            .find(|(name, _)| name.eq_ignore_ascii_case(text))
            .map(|(_, level)| level)
            .ok_or_else(|| {
                let names = LEVELS.map(|(name, _)| name);
                format!(
                    "log level `{text}` must be one of {}{}",
                    names.join(", "),
                    suggestion(text, names)
                )
            })
    }
}

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
        match value.split_once(":=") {
            Some(("", _)) => return Err(format!("`{value}` must name a logger before `:=`")),
            Some((logger, level)) => self.loggers.push((logger.to_owned(), level.parse()?)),
            None => self.level = Some(value.parse()?),
        }
        Ok(())
    }

    /// Takes a switch, if it is one of its own.
    pub(super) fn switch(&mut self, flag: &str) -> bool {
        match flag {
            "--enable-rosout-logs" => self.rosout = true,
            "--disable-rosout-logs" => self.rosout = false,
            "--enable-stdout-logs" => self.console = true,
            "--disable-stdout-logs" => self.console = false,
            // There is no other library that logs, so there is nothing to turn on or off.
            "--enable-external-lib-logs" | "--disable-external-lib-logs" => {}
            _ => return false,
        }
        true
    }

    /// The least level for a logger, where given: that of the longest name that is the logger's or above it.
    #[must_use]
    pub fn level_of(&self, logger: &str) -> Option<LogLevel> {
        self.loggers
            .iter()
            .filter(|(name, _)| {
                logger
                    .strip_prefix(name.as_str())
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
            })
            // Of two that are equally long the later one holds.
            .max_by_key(|(name, _)| name.len())
            .map(|(_, level)| *level)
            .or(self.level)
    }
}
