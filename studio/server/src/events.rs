//! Events for all pages that are open.

use std::convert::Infallible;
use std::sync::Arc;

use axum::response::sse::Event;
use futures::stream::{self, Stream};
use tokio::sync::broadcast::{self, Receiver, Sender};

/// A page that has more events to take than these is disconnected. It then connects again, and begins with the present state.
const EVENTS_WAITING_MAX: usize = 4_096;

/// Passes events to every page that is connected.
#[derive(Clone, Debug)]
pub struct EventHub {
    sender: Sender<Arc<str>>,
}

impl Default for EventHub {
    fn default() -> Self {
        Self {
            sender: broadcast::channel(EVENTS_WAITING_MAX).0,
        }
    }
}

impl EventHub {
    /// Sends one JSON object to every page that is connected.
    pub fn send(&self, event: &str) {
        // Without a page, nobody misses it.
        let _ = self.sender.send(event.into());
    }

    /// How many pages are connected.
    pub(crate) fn pages(&self) -> usize {
        self.sender.receiver_count()
    }

    pub(crate) fn subscribe(&self) -> Receiver<Arc<str>> {
        self.sender.subscribe()
    }
}

/// The events from now on, after the state.
pub(crate) fn stream(
    state: String,
    receiver: Receiver<Arc<str>>,
) -> impl Stream<Item = Result<Event, Infallible>> + Send {
    let first = Some(state);
    stream::unfold((first, receiver), |(first, mut receiver)| async move {
        let text: Arc<str> = match first {
            Some(state) => state.into(),
            // It lags behind, or the server ends.
            None => receiver.recv().await.ok()?,
        };
        Some((Ok(Event::default().data(&*text)), (None, receiver)))
    })
}
