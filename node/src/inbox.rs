//! Waiting for whatever comes first: a sample, a time, or the request to end.

use std::time::{Duration, Instant};

use async_channel::Receiver;
use async_io::Timer;
use futures::stream::{LocalBoxStream, SelectAll, select_all};
use futures::{FutureExt, StreamExt, select_biased};

use crate::inlet::Delivery;

/// Even when something is due already, the processor is left to others for so long: a mistake that makes a thing
/// due for ever costs time, but not the whole machine.
const PAUSE_MIN: Duration = Duration::from_millis(1);

/// Why [`Inbox::wait`] came back.
pub(crate) enum Wake {
    /// A sample came in.
    Delivery(Delivery),
    /// The time has come.
    Due,
    /// The process is to end.
    Stop,
}

/// All that a loop waits for.
pub(crate) struct Inbox<'a> {
    deliveries: SelectAll<LocalBoxStream<'a, Delivery>>,
    stop: Receiver<()>,
}

impl<'a> Inbox<'a> {
    pub(crate) fn new(
        deliveries: impl IntoIterator<Item = LocalBoxStream<'a, Delivery>>,
        stop: Receiver<()>,
    ) -> Self {
        Self {
            deliveries: select_all(deliveries),
            stop,
        }
    }

    /// Waits for the next thing; the request to end comes before all else.
    pub(crate) async fn wait(&mut self, due: Option<Instant>) -> Wake {
        let timer = due.map_or_else(Timer::never, |due| {
            Timer::at(due.max(Instant::now() + PAUSE_MIN))
        });
        let mut timer = FutureExt::fuse(timer);
        let mut stop = std::pin::pin!(self.stop.recv().fuse());
        // A loop without subscriptions has only the other two to wait for.
        let mut deliveries = std::pin::pin!(
            async {
                match self.deliveries.next().await {
                    Some(delivery) => delivery,
                    None => std::future::pending().await,
                }
            }
            .fuse()
        );
        select_biased! {
            // A channel without a sender can never ask, so its owner is gone and the process with it.
            _ = stop => Wake::Stop,
            delivery = deliveries => Wake::Delivery(delivery),
            _ = timer => Wake::Due,
        }
    }

    /// A sample that came in already, without waiting.
    pub(crate) fn ready(&mut self) -> Option<Delivery> {
        self.deliveries.next().now_or_never().flatten()
    }
}
