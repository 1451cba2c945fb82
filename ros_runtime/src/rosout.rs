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

/// So many lines wait for the node to publish them; a line that finds no room is counted and only on the console.
const WAITING_MAX: usize = 256;
/// A line takes no more than this; what is longer is cut.
const MESSAGE_BYTES_MAX: usize = 2_000;

/// The libraries below us publish what they are told to, so their own lines would call for ever more of them.
const LIBRARIES: [&str; 5] = ["rustdds", "ros2_client", "mio", "polling", "async_io"];

/// The lines of this process that wait to be published, without the name of the logger.
#[derive(Clone, Debug)]
pub struct LogLines {
    lines: Receiver<Log>,
}

impl LogLines {
    /// The log lines, as they come.
    pub fn lines(&self) -> Receiver<Log> {
        self.lines.clone()
    }
}

/// The end at which lines come in.
pub struct RosoutLayer {
    lines: Sender<Log>,
    dropped: AtomicU64,
}

/// Both ends.
pub fn rosout() -> (RosoutLayer, LogLines) {
    let (sender, lines) = bounded(WAITING_MAX);
    let layer = RosoutLayer {
        lines: sender,
        dropped: AtomicU64::new(0),
    };
    (layer, LogLines { lines })
}

impl<S: Subscriber> Layer<S> for RosoutLayer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let metadata = event.metadata();
        let of_library = LIBRARIES
            .iter()
            .any(|library| metadata.target().starts_with(library));
        if of_library {
            return;
        }
        let mut text = Text::default();
        event.record(&mut text);
        // Lines that found no room are owned up to by the next that does.
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
            msg: text.joined(),
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
        Level::TRACE | Level::DEBUG => 10,
        Level::INFO => 20,
        Level::WARN => 30,
        Level::ERROR => 40,
    }
}

/// The message of an event, and its fields behind it.
#[derive(Default)]
struct Text {
    message: String,
    fields: String,
}

impl Text {
    fn joined(mut self) -> String {
        self.message.push_str(&self.fields);
        if self.message.len() > MESSAGE_BYTES_MAX {
            let end = (0..=MESSAGE_BYTES_MAX)
                .rev()
                .find(|&end| self.message.is_char_boundary(end))
                .unwrap_or_default();
            self.message.truncate(end);
            self.message.push_str(" ...");
        }
        self.message
    }
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

    fn told(speak: impl FnOnce()) -> Vec<Log> {
        let (layer, lines) = rosout();
        tracing::subscriber::with_default(tracing_subscriber::registry().with(layer), speak);
        std::iter::from_fn(|| lines.lines.try_recv().ok()).collect()
    }

    #[test]
    fn a_line_has_its_level_its_fields_and_its_place() {
        let lines = told(|| {
            tracing::warn!(module = 4, "halted until modules {} are heard", "1, 2");
            tracing::error!(target: "rustdds::rtps", "the library's own troubles");
        });
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].msg, "halted until modules 1, 2 are heard module=4");
        assert_eq!(lines[0].level, 30);
        assert!(lines[0].file.ends_with("rosout.rs") && lines[0].line > 0);
    }

    #[test]
    fn a_flood_of_lines_is_bounded_and_owned_up_to() {
        let (layer, lines) = rosout();
        let subscriber = tracing_subscriber::registry().with(layer);
        tracing::subscriber::with_default(subscriber, || {
            for count in 0..WAITING_MAX + 7 {
                tracing::info!(count, "again");
            }
            assert_eq!(lines.lines.len(), WAITING_MAX);
            while lines.lines.try_recv().is_ok() {}
            tracing::info!("{}", "\u{e4}".repeat(MESSAGE_BYTES_MAX));
        });
        let last = lines.lines.try_recv().unwrap();
        assert!(last.msg.len() <= MESSAGE_BYTES_MAX + 4 && last.msg.ends_with(" ..."));
        let lines = told(|| tracing::info!("fine"));
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
            while lines.lines.try_recv().is_ok() {}
            tracing::info!("there you are");
        });
        let last = lines.lines.try_recv().unwrap();
        assert_eq!(
            last.msg,
            "there you are (7 lines before this one were dropped)"
        );
    }
}
