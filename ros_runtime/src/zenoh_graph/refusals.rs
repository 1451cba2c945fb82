//! The log of a router: which sessions it refused, and what.
//!
//! Zenoh has no list of refusals, and logs each message that access control lets through or not as a trace. This reads those
//! lines. It depends on their text, which a test with real processes checks.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;
use std::io::{Write, stderr};
use std::sync::{Mutex, PoisonError};

use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;

use crate::exit::Failure;
use crate::logging::rust_log;

/// Where Zenoh decides about messages.
const ACCESS_CONTROL: &str = "zenoh::net::routing::interceptor::access_control";
/// Where Zenoh accepts links.
const LINKS: &str = "zenoh_link_tls";

/// The greatest number of different refusals that are remembered, so that each is logged once.
const REFUSALS_MAX: usize = 1_000;

/// Logs warnings, and what the router refuses, on the standard error stream. `RUST_LOG` replaces the warnings.
///
/// # Errors
/// `RUST_LOG` cannot be used.
pub fn log() -> Result<(), Failure> {
    let others = rust_log().map_err(Failure::bad_input)?.unwrap_or_else(|| {
        Targets::new()
            .with_default(LevelFilter::WARN)
            .with_target(LINKS, LevelFilter::OFF)
    });
    let console = tracing_subscriber::fmt::layer()
        .with_writer(stderr)
        .with_ansi(false)
        .with_filter(others);
    let refusals = Refusals::default().with_filter(
        Targets::new()
            .with_target(ACCESS_CONTROL, Level::TRACE)
            .with_target(LINKS, Level::WARN),
    );
    // A log that was started before stays.
    let _ = tracing_subscriber::registry()
        .with(console)
        .with(refusals)
        .try_init();
    Ok(())
}

/// What was refused so far.
#[derive(Default)]
struct Refusals(Mutex<Known>);

#[derive(Default)]
struct Known {
    /// The common name and link of a session.
    subjects: BTreeMap<String, String>,
    logged: BTreeSet<String>,
}

thread_local! {
    /// The key for which this thread computes what a session may do with it, before any message has it.
    static COMPUTED: RefCell<Option<String>> = const { RefCell::new(None) };
}

impl<S: Subscriber> Layer<S> for Refusals {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut text = Message::default();
        event.record(&mut text);
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let refused = match event.metadata().target() {
            ACCESS_CONTROL => known.refused(&text.0),
            _ => Some(format!("a link: {}", without_hint(&text.0))),
        };
        let Some(refused) = refused else { return };
        if known.logged.len() >= REFUSALS_MAX {
            known.logged.clear();
        }
        if known.logged.insert(refused.clone()) {
            // If the stream is closed, the line is lost.
            let _ = writeln!(stderr().lock(), "refused {refused}");
        }
    }
}

impl Known {
    /// What was refused to whom, if the line of Zenoh's access control is about a message that was.
    fn refused(&mut self, line: &str) -> Option<String> {
        if let Some(key) = line.split("caching permissions for `").nth(1) {
            let key = key.split('`').next().unwrap_or_default().to_owned();
            COMPUTED.set(Some(key));
            return None;
        }
        let cached = line.strip_prefix("Using cached result: ");
        let (session, rest) = cached.unwrap_or(line).split_once(' ')?;
        let (subject, rest) = match rest.strip_prefix("on ") {
            Some(rest) => rest.split_once(" is ")?,
            None => ("", rest.strip_prefix("is ")?),
        };
        if !subject.is_empty() && self.subjects.len() < REFUSALS_MAX {
            self.subjects.insert(session.to_owned(), subject.to_owned());
        }
        let (verb, rest) = rest.split_once(" to ")?;
        let (message, key) = rest.rsplit_once(" on ")?;
        if cached.is_none() && is_computed(message, key) {
            return None;
        }
        // What a session does not get is no refusal: it never asked for it.
        if verb != "unauthorized" || !message.contains("(ingress)") {
            return None;
        }
        let role = self.subjects.get(session).and_then(|subject| {
            let name = subject.split("CertCommonName(").nth(1)?;
            name.split(')').next()
        });
        let role = role.unwrap_or("unknown");
        let message = message.replace(" (ingress)", "");
        Some(format!(
            "{message} on {key} from session {session} with the certificate of `{role}`"
        ))
    }
}

/// Whether the line belongs to the nine decisions that Zenoh computes for a key in advance, the last of which is about
/// liveliness subscribers.
fn is_computed(message: &str, key: &str) -> bool {
    let computed = COMPUTED.take().filter(|computed| computed == key);
    let is_last = message.starts_with("Declare Liveliness Subscriber");
    let is_computed = computed.is_some();
    COMPUTED.set(computed.filter(|_| !is_last));
    is_computed
}

/// The error of a link without the advice that Zenoh appends to each, which is about open files.
fn without_hint(line: &str) -> &str {
    line.split(". Hint:").next().unwrap_or(line)
}

/// The message of an event.
#[derive(Default)]
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [&str; 2] = ["Put (ingress)", "Declare Liveliness Subscriber (ingress)"];

    #[test]
    fn only_messages_that_arrived_and_were_refused_are_logged() {
        let mut known = Known::default();
        let caching = "ACL (ingress): caching permissions for `0/formation/target/T/H` ...";
        assert_eq!(known.refused(caching), None);
        for message in ALL {
            let line = format!(
                "abc on Interface(lo)+CertCommonName(module)+Transport(Tls)+abc is unauthorized to {message} on 0/formation/target/T/H"
            );
            assert_eq!(known.refused(&line), None, "computed in advance");
        }
        let allowed =
            "Using cached result: abc is authorized to Put (ingress) on 0/formation/claims/T/H";
        assert_eq!(known.refused(allowed), None);
        let egress =
            "Using cached result: abc is unauthorized to Put (egress) on 0/formation/target/T/H";
        assert_eq!(known.refused(egress), None);
        let refused =
            "Using cached result: abc is unauthorized to Put (ingress) on 0/formation/target/T/H";
        assert_eq!(
            known.refused(refused).unwrap(),
            "Put on 0/formation/target/T/H from session abc with the certificate of `module`"
        );
        let direct = "abc on Interface(lo)+CertCommonName(module)+Transport(Tls)+abc is unauthorized to Query (ingress) on 0/formation/query_status/T/H";
        assert_eq!(
            known.refused(direct).unwrap(),
            "Query on 0/formation/query_status/T/H from session abc with the certificate of `module`"
        );
    }
}
