//! What happens, for all pages that are open and for those that come later.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::response::sse::Event;
use futures::stream::{self, Stream, StreamExt};
use tokio::sync::watch;

/// The most events that are kept; the oldest go first.
const EVENTS_MAX: usize = 200_000;
/// How many are sent before another page has its turn.
const BATCH: usize = 256;

/// Events in their order, each one JSON object on a line.
#[derive(Clone, Debug)]
pub struct EventLog {
    kept: Arc<Mutex<Kept>>,
    /// How many events there were.
    count: watch::Sender<usize>,
}

#[derive(Debug, Default)]
struct Kept {
    events: VecDeque<Arc<str>>,
    /// The number of the first that is kept.
    first: usize,
}

impl Default for EventLog {
    fn default() -> Self {
        Self {
            kept: Arc::default(),
            count: watch::Sender::new(0),
        }
    }
}

impl EventLog {
    /// Adds an event, which every page gets.
    pub fn push(&self, event: &str) {
        let mut kept = self.kept();
        kept.events.push_back(event.into());
        if kept.events.len() > EVENTS_MAX {
            kept.events.pop_front();
            kept.first += 1;
        }
        let count = kept.first + kept.events.len();
        drop(kept);
        self.count.send_replace(count);
    }

    /// How many pages are connected.
    pub(crate) fn pages(&self) -> usize {
        self.count.receiver_count()
    }

    /// The events from a number on, and those that come, each with its number.
    pub(crate) fn stream(
        &self,
        next: usize,
    ) -> impl Stream<Item = Result<Event, Infallible>> + Send + use<> {
        let log = self.clone();
        let batches = stream::unfold((next, self.count.subscribe()), move |(next, mut count)| {
            let log = log.clone();
            async move {
                // It fails when the server ends.
                count.wait_for(|count| *count > next).await.ok()?;
                let batch = log.from(next);
                let after = batch.last().map_or(next, |(number, _)| number + 1);
                Some((stream::iter(batch), (after, count)))
            }
        });
        batches
            .flatten()
            .map(|(number, event)| Ok(Event::default().id(number.to_string()).data(&*event)))
    }

    /// Some events from a number on.
    fn from(&self, next: usize) -> Vec<(usize, Arc<str>)> {
        let kept = self.kept();
        let first = next.max(kept.first);
        let events = kept.events.iter().skip(first - kept.first).take(BATCH);
        (first..).zip(events.cloned()).collect()
    }

    /// A thread that panicked left the events whole.
    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
