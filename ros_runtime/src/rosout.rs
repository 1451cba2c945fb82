//! Log lines for `/rosout`, where `ros2` tools and recorders look for them.

use std::fmt::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering};

use async_channel::{Receiver, Sender, TrySendError, bounded};
use ros2_client::builtin_interfaces::Time;
use ros2_client::log::Log;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

use crate::exit::shortened;

/// How many lines wait for the node to publish them; a line that finds no room is counted, and goes to the console only.
const WAITING_MAX: usize = 256;
/// The greatest length of a line in bytes; a longer one is cut.
const MESSAGE_BYTES_MAX: usize = 2_000;

/// The libraries that publish the lines: each line about that would cause more lines. Those that use the `log` crate,
/// as RustDDS does, have its name as their target.
const LIBRARIES: [&str; 7] = [
    "log",
    "rustdds",
    "ros2_client",
    "zenoh",
    "mio",
    "polling",
    "async_io",
];

/// The lines of this process that wait to be published, without the name of the logger.
pub type LogLines = Receiver<Log>;

/// Queues the lines of this process.
pub(crate) struct RosoutLayer {
    lines: Sender<Log>,
    dropped: AtomicU64,
}

/// The two ends of the queue.
pub(crate) fn rosout() -> (RosoutLayer, LogLines) {
    let (sender, lines) = bounded(WAITING_MAX);
    let layer = RosoutLayer {
        lines: sender,
        dropped: AtomicU64::new(0),
    };
    (layer, lines)
}

impl<S: Subscriber> Layer<S> for RosoutLayer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let metadata = event.metadata();
        let mut libraries = LIBRARIES.iter();
        if libraries.any(|library| metadata.target().starts_with(library)) {
            return;
        }
        let mut text = Text::default();
        event.record(&mut text);
        // The next line that finds room reports how many did not.
        let dropped = self.dropped.swap(0, Ordering::Relaxed);
        if dropped > 0 {
            // Writing to a string cannot fail.
            let _ = write!(
                text.fields,
                " ({dropped} lines before this one were dropped)"
            );
        }
        let line = Log {
            stamp: Time::now(),
            level: level(*metadata.level()),
            name: String::new(),
            msg: shortened(text.message + &text.fields, MESSAGE_BYTES_MAX),
            file: metadata.file().unwrap_or_default().to_owned(),
            function: metadata.target().to_owned(),
            line: metadata.line().unwrap_or_default(),
        };
        if let Err(TrySendError::Full(_)) = self.lines.try_send(line) {
            self.dropped.fetch_add(dropped + 1, Ordering::Relaxed);
        }
    }
}

fn level(level: Level) -> u8 {
    match level {
        Level::TRACE | Level::DEBUG => Log::DEBUG,
        Level::INFO => Log::INFO,
        Level::WARN => Log::WARN,
        Level::ERROR => Log::ERROR,
    }
}

/// The message of an event, and its fields behind it.
#[derive(Default)]
struct Text {
    message: String,
    fields: String,
}

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        // Writing to a string cannot fail.
        let _ = if field.name() == "message" {
            write!(self.message, "{value:?}")
        } else {
            write!(self.fields, " {}={value:?}", field.name())
        };
    }
}

#[cfg(test)]
mod tests {
    use tracing_subscriber::layer::SubscriberExt;

    use super::*;

    fn published(log: impl FnOnce()) -> Vec<Log> {
        let (layer, lines) = rosout();
        tracing::subscriber::with_default(tracing_subscriber::registry().with(layer), log);
        std::iter::from_fn(|| lines.try_recv().ok()).collect()
    }

    #[test]
    fn a_line_has_its_level_its_fields_and_its_place() {
        let lines = published(|| {
            tracing::warn!(module = 4, "halted until modules {} answer", "1, 2");
            tracing::error!(target: "rustdds::rtps", "a line of the library");
            tracing::error!(target: "log", "a line of a library that uses the `log` crate");
        });
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].msg, "halted until modules 1, 2 answer module=4");
        assert_eq!(lines[0].level, 30);
        assert!(lines[0].file.ends_with("rosout.rs") && lines[0].line > 0);
    }

    #[test]
    fn a_flood_of_lines_is_bounded() {
        let (layer, lines) = rosout();
        let subscriber = tracing_subscriber::registry().with(layer);
        tracing::subscriber::with_default(subscriber, || {
            for count in 0..WAITING_MAX + 7 {
                tracing::info!(count, "again");
            }
            assert_eq!(lines.len(), WAITING_MAX);
            while lines.try_recv().is_ok() {}
            tracing::info!("{}", "\u{e4}".repeat(MESSAGE_BYTES_MAX));
        });
        let last = lines.try_recv().unwrap();
        assert!(last.msg.len() <= MESSAGE_BYTES_MAX + 4 && last.msg.ends_with(" ..."));
        let lines = published(|| tracing::info!("fine"));
        assert_eq!(lines[0].msg, "fine");
    }

    #[test]
    fn dropped_lines_are_counted_in_the_next() {
        let (layer, lines) = rosout();
        let subscriber = tracing_subscriber::registry().with(layer);
        tracing::subscriber::with_default(subscriber, || {
            for _ in 0..WAITING_MAX + 7 {
                tracing::info!("again");
            }
            while lines.try_recv().is_ok() {}
            tracing::info!("there you are");
        });
        let last = lines.try_recv().unwrap();
        assert_eq!(
            last.msg,
            "there you are (7 lines before this one were dropped)"
        );
    }
}
